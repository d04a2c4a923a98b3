//! Behaviour through the public face, in one program: every program of tests costs a link.

mod background;
mod bvh;
mod damaged;
mod long_c3d;
mod readers;
mod standing;

/// Cases of a property: few in every test run, as many as asked for when fuzzing.
fn cases(usual: u32) -> u32 {
    std::env::var("PROPTEST_CASES").ok().and_then(|text| text.parse().ok()).unwrap_or(usual)
}

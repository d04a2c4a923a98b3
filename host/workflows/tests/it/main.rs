//! farnear-workflows through its public face, one program for all of it.
#![allow(clippy::unwrap_used)] // a test that panics has failed, which is what it is for

mod damaged;
mod people;
// A pseudo-terminal holds the scripted board: Linux has them.
#[cfg(target_os = "linux")]
mod rig;
mod stages;

/// Cases of a property: few in every test run, as many as asked for when fuzzing.
fn cases(usual: u32) -> u32 {
    std::env::var("PROPTEST_CASES").ok().and_then(|text| text.parse().ok()).unwrap_or(usual)
}

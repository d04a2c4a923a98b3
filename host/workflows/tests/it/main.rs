//! Public interface tests of farnear-workflows, in one binary.
#![allow(clippy::unwrap_used)] // a test that panics has failed, which is what it is for

mod batch;
mod damaged;
mod people;
// The scripted board needs a Linux pseudo-terminal.
#[cfg(target_os = "linux")]
mod rig;
mod stages;

/// Cases of a property: few by default, more when fuzzing.
fn cases(usual: u32) -> u32 {
    std::env::var("PROPTEST_CASES").ok().and_then(|text| text.parse().ok()).unwrap_or(usual)
}

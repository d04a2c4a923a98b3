mod damaged;
mod detectors;
mod highway;
mod removal;
mod sun;

/// Few by default, more for fuzzing.
fn cases(usual: u32) -> u32 {
    std::env::var("PROPTEST_CASES").ok().and_then(|text| text.parse().ok()).unwrap_or(usual)
}

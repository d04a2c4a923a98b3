mod damaged;
mod detectors;
mod highway;
mod removal;
mod sun;

fn cases(usual: u32) -> u32 {
    std::env::var("PROPTEST_CASES").ok().and_then(|text| text.parse().ok()).unwrap_or(usual)
}

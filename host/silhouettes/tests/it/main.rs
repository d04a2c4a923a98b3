mod background;
mod bvh;
mod damaged;
mod long_c3d;
mod readers;
mod standing;

fn cases(usual: u32) -> u32 {
    std::env::var("PROPTEST_CASES").ok().and_then(|text| text.parse().ok()).unwrap_or(usual)
}

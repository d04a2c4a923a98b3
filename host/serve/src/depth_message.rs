//! Depth for the page before it is in a file: live, played, and of a new pair.

use std::time::{Instant, SystemTime, UNIX_EPOCH};

use axum::body::Bytes;
use farnear_capture::camera::Image;
use farnear_depth::{measure::Measurement, optics::Optics};
use farnear_workflows::{
    Result, optics,
    rig::live_depth::{self, LiveDepth},
};
use ndarray::s;
use serde_json::{Value, json};

use crate::{
    app::App,
    picture_message::{depth_codes, message},
};

/// Milliseconds since 1970 by this computer's clock.
pub fn unix_ms() -> f64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH);
    since.map_or(0.0, |since| since.as_secs_f64() * 1e3)
}

/// Ends of the colour scale, mm: 25 % beyond the working range, so that depths just outside remain distinguishable.
pub fn ends(optics: &Optics) -> [f32; 2] {
    let range = optics.working_range();
    let margin = 0.25 * (range.far_mm - range.near_mm);
    [(range.near_mm - margin) as f32, (range.far_mm + margin) as f32]
}

pub fn live(depth: &LiveDepth<'_>, ends: [f32; 2], rate_hz: f64) -> Bytes {
    let header = json!({
        "type": "depth",
        "rate_hz": rate_hz,
        "pair_ms": depth.pair_ms,
        "latency_ms": depth.latency_ms,
        "arrived_ms": unix_ms() - depth.latency_ms,
    });
    picture(header, depth.found, depth.far, ends, &[])
}

/// Shows a new pair's depth, with its standard deviation (32-bit floats, mm) and reasons, before its files are written,
/// because writing takes longer than computing. The depth to keep is computed from the files; errors are reported there.
pub fn show_fresh(app: &App, capture: &str, far: &Image, near: &Image) {
    let (arrived, arrived_ms) = (Instant::now(), unix_ms());
    let shown = || -> Result<Bytes> {
        let optics = optics::read(&app.optics_file())?;
        let found = live_depth::stream(&optics)?.measure([far, near].map(Image::grey))?;
        let latency_ms = arrived.elapsed().as_secs_f64() * 1e3;
        let header = json!({
            "type": "fresh", "capture": capture, "latency_ms": latency_ms, "arrived_ms": arrived_ms,
        });
        let validity = &found.validity;
        let deviation: Vec<u8> = validity.deviation_mm.iter().flat_map(|value| value.to_le_bytes()).collect();
        let reasons: Vec<u8> = validity.reasons.iter().copied().collect();
        Ok(picture(header, &found, far, ends(&optics), &[&deviation, &reasons]))
    };
    if let Ok(picture) = shown() {
        app.pictures.send_replace(picture);
    }
}

/// Depth, confidence, the far image, and what `more` is shown of them.
fn picture(mut header: Value, found: &Measurement, far: &Image, ends: [f32; 2], more: &[&[u8]]) -> Bytes {
    let map = &found.map;
    let (height, width) = map.depth_mm.dim();
    header["width"] = width.into();
    header["height"] = height.into();
    header["low_mm"] = ends[0].into();
    header["high_mm"] = ends[1].into();
    header["low_texture_fraction"] = map.low_texture_fraction.into();
    let codes = depth_codes(&map.depth_mm, ends);
    let confidence: Vec<u8> = map.confidence.iter().map(|value| (value * 255.0) as u8).collect();
    // A learned lens may have its pixels averaged.
    let step = (far.pixels.nrows() / height.max(1)).max(1);
    let pixels = far.pixels.slice(s![..height * step; step, ..width * step; step]).to_owned();
    let far = Image::new(pixels, far.bits);
    message(&header, &[&[&codes[..], &confidence, &far.eight_bits()], more].concat())
}

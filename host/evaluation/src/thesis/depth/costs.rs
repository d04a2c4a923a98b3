//! Section 6.6.4: cost of the corrections, compared with depth.

use std::time::Instant;

use anyhow::Result;
use farnear_depth::{
    corrections::{CdcSettings, Method as Kind, Pattern, fit},
    depth_map::DepthMap,
    fill::fill_low_texture,
};
use ndarray::{Array2, s};

use super::{
    bench::{Bench, Method},
    planes::Planes,
};
use crate::{page::Page, rig};

/// (height, width) of the thesis' maps: one depth for 7x7 pixels.
const SMALL: (usize, usize) = (63, 86);
/// The minimum counts, because other load only adds.
const TIMES: usize = 15;

fn least_ms<T>(mut work: impl FnMut() -> T) -> f64 {
    let once = || {
        let start = Instant::now();
        std::hint::black_box(work());
        start.elapsed().as_secs_f64() * 1e3
    };
    std::iter::repeat_with(once).take(TIMES).fold(f64::INFINITY, f64::min)
}

fn patches(map: &Array2<f32>) -> Array2<f32> {
    map.slice(s![14..14 + 7 * SMALL.0 as isize; 7, 14..14 + 7 * SMALL.1 as isize; 7]).to_owned()
}

pub fn measure(page: &mut Page, bench: &Bench, planes: &Planes) -> Result<()> {
    page.subheading("Computational cost (section 6.6.4)");
    let large: Vec<(f64, Array2<f32>)> =
        planes.patterns(Method::Ggro).map(|(depth, map)| (depth, map.clone())).collect();
    let small: Vec<(f64, Array2<f32>)> = large.iter().map(|(depth, map)| (*depth, patches(map))).collect();
    let of = |kind: Kind, maps: &[(f64, Array2<f32>)]| -> Result<f64> {
        let patterns: Vec<Pattern<'_>> =
            maps.iter().map(|(true_mm, map)| Pattern { depth_mm: map.view(), true_mm: *true_mm }).collect();
        let correction = fit(kind, &patterns, &CdcSettings { window: 1, smoothing_px: 0.0 })?;
        let map = &maps[maps.len() / 2].1;
        Ok(least_ms(|| correction.apply(map.view())))
    };
    let mut rows = Vec::new();
    for (name, kind, li) in [
        ("CDC, 24 patterns, window 3x3", Kind::Cdc, 994.0),
        ("CLSF, 3x3 regions", Kind::Clsf, 5.87),
        ("two steps (section 5.3)", Kind::TwoStep, 10.3),
    ] {
        let (few, many) = (of(kind, &small)?, of(kind, &large)?);
        rows.push(vec![
            name.to_owned(),
            format!("{few:.3}"),
            format!("{li}"),
            format!("{:.0}", li / few),
            format!("{many:.2}"),
        ]);
    }
    let (few, many) = (filling(&small[12].1), filling(&large[12].1));
    rows.push(vec![
        "low texture filled (section 6.5)".into(),
        format!("{few:.3}"),
        "443".into(),
        format!("{:.0}", 443.0 / few),
        format!("{many:.2}"),
    ]);
    let pair = bench.render(&rig::plane(910.0)?, 77)?;
    let depth = least_ms(|| bench.depth(Method::Ggro, &pair, 3));
    rows.push(vec!["depth by GGRO".into(), "-".into(), "-".into(), "-".into(), format!("{depth:.2}")]);
    page.table(1, &["ms, one thread", "63 x 86", "Li 2014, 63 x 86", "times faster", "640 x 480"], &rows);
    page.paragraph(&format!(
        "The least of {TIMES} runs on the machine of the evaluation (the thesis: the mean of five in MATLAB on a Core i7 at 3.40 GHz), by the profile that `cargo xtask demo` builds or a faster one. \
         Section 5.5 gives 0.35 s for depth and correction of 640 x 480 on a Pentium Dual-Core at 2.16 GHz. The order is the thesis': CLSF and the two steps cost little compared with depth itself; CDC costs most. The correction of section 5.3 was 4 to 8 % of depth there. [speed.md](speed.md) has the run time in detail."
    ));
    Ok(())
}

/// Time to fill a textureless disc of an eighth of the height.
fn filling(map: &Array2<f32>) -> f64 {
    let (height, width) = map.dim();
    let radius = height as f64 / 8.0;
    let texture = Array2::from_shape_fn((height, width), |(y, x)| {
        let away = (y as f64 - 0.5 * height as f64).hypot(x as f64 - 0.5 * width as f64);
        if away < radius { 0.0_f32 } else { 1.0 }
    });
    least_ms(|| {
        let mut map = DepthMap {
            depth_mm: map.clone(),
            confidence: Array2::from_elem(map.dim(), 0.9),
            filled: None,
            low_texture_fraction: 0.0,
            warnings: Vec::new(),
        };
        fill_low_texture(&mut map, texture.view(), 9)
    })
}

//! Tables 5.1 and 5.2: flat surfaces of four scenes; figs. 6.7 and 6.8: two before and after correction.

use anyhow::Result;
use ndarray::Array2;
use rayon::prelude::*;

use super::{
    bench::{Bench, Method},
    beside,
    planes::{Flat, Planes, Taught},
    shapes::{self, TestScene},
};
use crate::{
    page::{Page, mm},
    panels::{self, Scale},
    rig::Pair,
};

const SEED: u64 = 5_500;

/// With the thesis' figures for SC, TP, HD and CD.
struct Line {
    name: &'static str,
    method: Method,
    taught: Option<Taught>,
    rmse: Option<[f64; 4]>,
    sd: Option<[f64; 4]>,
}

#[expect(clippy::approx_constant, reason = "millimetres, some of which look like pi")]
const LINES: [Line; 8] = [
    Line {
        name: "Raj",
        method: Method::Raj,
        taught: None,
        rmse: Some([6.46, 7.23, 6.59, 8.59]),
        sd: Some([3.14, 3.21, 11.78, 3.20]),
    },
    Line {
        name: "GRO before",
        method: Method::Gro,
        taught: None,
        rmse: Some([4.59, 5.43, 6.03, 8.02]),
        sd: Some([2.49, 2.75, 6.88, 2.45]),
    },
    Line {
        name: "GGRO before",
        method: Method::Ggro,
        taught: None,
        rmse: Some([4.17, 5.14, 6.19, 7.88]),
        sd: Some([2.21, 2.36, 6.32, 2.29]),
    },
    Line { name: "Raj after", method: Method::Raj, taught: Some(Taught::TwoStep), rmse: None, sd: None },
    Line {
        name: "GRO after",
        method: Method::Gro,
        taught: Some(Taught::TwoStep),
        rmse: Some([3.90, 2.91, 4.35, 4.20]),
        sd: Some([3.00, 3.12, 7.68, 3.14]),
    },
    Line {
        name: "GGRO after",
        method: Method::Ggro,
        taught: Some(Taught::TwoStep),
        rmse: Some([3.63, 2.89, 4.11, 4.19]),
        sd: Some([2.79, 2.96, 7.23, 2.95]),
    },
    Line { name: "GGRO linear, before", method: Method::GgroLinear, taught: None, rmse: None, sd: None },
    Line {
        name: "GGRO linear, clsf-full",
        method: Method::GgroLinear,
        taught: Some(Taught::ClsfFull),
        rmse: None,
        sd: None,
    },
];

pub struct Seen {
    name: &'static str,
    pair: Pair,
    /// Of figs. 6.7 and 6.8, with their titles.
    maps: Vec<(String, Array2<f32>)>,
}

pub fn measure(page: &mut Page, bench: &Bench, planes: &Planes) -> Result<Vec<Seen>> {
    page.subheading("Flat surfaces of four scenes (tables 5.1 and 5.2)");
    let scenes = shapes::all()?;
    let about: Vec<String> =
        scenes.iter().map(|scene| format!("{} is {}", scene.name, scene.about)).collect();
    page.paragraph(&format!(
        "{}; modelled after the photographs of fig. 5.5, with depths of our own. For each flat surface across the axis, 9 px of its edge left out, the error against its true depth is \
         taken; the mean over a scene's surfaces stands here, in mm, the thesis' own in brackets.",
        about.join("; ")
    ));
    let judged = scenes
        .par_iter()
        .enumerate()
        .map(|(index, scene)| -> Result<(Vec<Flat>, Seen)> {
            let pair = bench.render(&scene.scene, SEED + index as u64)?;
            let flats =
                LINES.iter().map(|line| of_line(line, scene, &pair, bench, planes)).collect::<Result<_>>()?;
            let maps = chapter_6(scene, &pair, bench, planes)?;
            Ok((flats, Seen { name: scene.name, pair, maps }))
        })
        .collect::<Result<Vec<_>>>()?;
    let table = |of: fn(&Flat) -> f64, li: fn(&Line) -> Option<[f64; 4]>| -> Vec<Vec<String>> {
        let row = |(index, line): (usize, &Line)| {
            let mut cells = vec![line.name.to_owned()];
            let found = judged.iter().enumerate();
            cells.extend(
                found.map(|(scene, (flats, _))| beside(of(&flats[index]), li(line).map(|li| li[scene]))),
            );
            cells
        };
        LINES.iter().enumerate().map(row).collect()
    };
    let head = |what: &str| -> Vec<String> {
        [what].into_iter().chain(scenes.iter().map(|scene| scene.name)).map(str::to_owned).collect()
    };
    page.table(1, &head("RMSE (table 5.1)"), &table(|flat| flat.rmse_mm, |line| line.rmse));
    page.table(1, &head("SD (table 5.2)"), &table(|flat| flat.sd_mm, |line| line.sd));
    Ok(judged.into_iter().map(|(_, seen)| seen).collect())
}

fn of_line(line: &Line, scene: &TestScene, pair: &Pair, bench: &Bench, planes: &Planes) -> Result<Flat> {
    let map = bench.depth(line.method, pair, scene.median_px)?;
    let map = planes.corrected(line.method, line.taught, &map)?;
    let flats: Vec<Flat> =
        scene.flats.iter().map(|(depth_mm, counts)| Flat::of(&map, *depth_mm, |at| counts[at])).collect();
    let mean = |of: fn(&Flat) -> f64| flats.iter().map(of).sum::<f64>() / flats.len() as f64;
    Ok(Flat { mean_mm: mean(|f| f.mean_mm), rmse_mm: mean(|f| f.rmse_mm), sd_mm: mean(|f| f.sd_mm) })
}

/// Maps of figs. 6.7 and 6.8.
fn chapter_6(
    scene: &TestScene,
    pair: &Pair,
    bench: &Bench,
    planes: &Planes,
) -> Result<Vec<(String, Array2<f32>)>> {
    let mut maps = Vec::new();
    if !["SC", "CD"].contains(&scene.name) {
        return Ok(maps);
    }
    let methods = [Method::Subbarao, Method::Favaro, Method::Raj, Method::Ggro];
    let raw = methods.map(|method| bench.depth(method, pair, scene.median_px).map(|map| (method, map)));
    let raw = raw.into_iter().collect::<Result<Vec<_>>>()?;
    for (way, taught) in [("", None), (", CDC", Some(Taught::Cdc)), (", CLSF", Some(Taught::Clsf))] {
        for (method, map) in &raw {
            maps.push((format!("{}{way}", method.name()), planes.corrected(*method, taught, map)?));
        }
    }
    Ok(maps)
}

pub fn pictures(page: &mut Page, scenes: &[Seen]) -> Result<()> {
    page.subheading("Two scenes before and after correction (figs. 6.7 and 6.8)");
    for seen in scenes.iter().filter(|seen| !seen.maps.is_empty()) {
        let (file, figure) =
            if seen.name == "SC" { ("thesis-stair.png", "6.7") } else { ("thesis-circular.png", "6.8") };
        page.picture(
            file,
            &panels::titled(4, &seen.maps, Scale::Depth([880.0, 940.0]))?,
            &format!(
                "{}, fig. {figure}: Subbarao, Favaro, Raj and GGRO; as measured, after CDC (smoothed patterns), after CLSF; 880 mm (red) to 940 mm (blue)",
                seen.name
            ),
        )?;
        let rmse = |map: &Array2<f32>| -> Result<String> {
            Ok(mm(crate::rig::error(map, &seen.pair.truth, true)?.rmse_mm))
        };
        let mut rows = Vec::new();
        for (row, way) in ["uncorrected", "CDC, smoothed patterns", "CLSF"].into_iter().enumerate() {
            let mut cells = vec![way.to_owned()];
            for (_, map) in &seen.maps[4 * row..4 * row + 4] {
                cells.push(rmse(map)?);
            }
            rows.push(cells);
        }
        page.table(
            1,
            &["RMSE over the scene, off edges, mm", "Subbarao", "Favaro", "Raj", "Li (GGRO)"],
            &rows,
        );
    }
    Ok(())
}

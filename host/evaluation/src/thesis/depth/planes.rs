//! Flat surfaces through the working range: figs. 5.4, 6.1 and 6.4.

use anyhow::{Context, Result};
use farnear_depth::corrections::{CdcSettings, Correction, Method as Kind, Pattern, fit};
use ndarray::Array2;
use rayon::prelude::*;

use super::bench::{Bench, Method};
use crate::{
    chart::{self, Curve, Plot},
    page::{Page, mm},
    panels::{self, Panel, Scale},
    rig,
};

/// Surfaces to learn from, as many as in the thesis; [`JUDGED`] others are measured.
const PATTERNS: usize = 24;
const JUDGED: usize = 12;
const SEED: u64 = 5_400;
/// Methods of fig. 6.4; "Li" is GGRO.
const OF_CHAPTER_6: [Method; 4] = [Method::Subbarao, Method::Favaro, Method::Raj, Method::Ggro];

type Figure = (&'static str, fn(&Flat) -> f64);

/// A flat surface by every method, in the order of [`Method::ALL`].
struct Plane {
    true_mm: f64,
    maps: Vec<Array2<f32>>,
}

pub struct Planes {
    learn: Vec<Plane>,
    judge: Vec<Plane>,
    corrections: Vec<(Method, Taught, Correction)>,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Taught {
    TwoStep,
    /// Cancellation by measured patterns, eqs. 6.2 to 6.10.
    CdcRaw,
    /// By smoothed patterns.
    Cdc,
    Clsf,
    /// One seamless polynomial with mixed terms.
    ClsfFull,
}

impl Taught {
    const ALL: [Self; 5] = [Self::TwoStep, Self::CdcRaw, Self::Cdc, Self::Clsf, Self::ClsfFull];

    fn kind(self) -> (Kind, CdcSettings) {
        let smoothed = CdcSettings::default();
        match self {
            Self::TwoStep => (Kind::TwoStep, smoothed),
            Self::CdcRaw => (Kind::Cdc, CdcSettings { smoothing_px: 0.0, ..smoothed }),
            Self::Cdc => (Kind::Cdc, smoothed),
            Self::Clsf => (Kind::Clsf, smoothed),
            Self::ClsfFull => (Kind::ClsfFull, smoothed),
        }
    }
}

#[derive(Clone, Copy)]
pub struct Flat {
    pub mean_mm: f64,
    pub rmse_mm: f64,
    pub sd_mm: f64,
}

impl Flat {
    /// Of the pixels with a depth that `counts` accepts.
    pub fn of(map: &Array2<f32>, true_mm: f64, counts: impl Fn((usize, usize)) -> bool) -> Self {
        let (mut n, mut sum, mut squares) = (0.0, 0.0, 0.0);
        for (at, depth) in map.indexed_iter() {
            if depth.is_finite() && counts(at) {
                let error = f64::from(*depth) - true_mm;
                n += 1.0;
                sum += error;
                squares += error * error;
            }
        }
        let (mean, square): (f64, f64) = (sum / n, squares / n);
        Self {
            mean_mm: true_mm + mean,
            rmse_mm: square.sqrt(),
            sd_mm: (square - mean * mean).max(0.0).sqrt(),
        }
    }
}

const RIM_PX: usize = 16;

impl Planes {
    pub fn measure(bench: &Bench) -> Result<Self> {
        let learn = measured(bench, &rig::depths(PATTERNS, 0.0)?, SEED)?;
        let judge = measured(bench, &rig::depths(JUDGED, 0.25)?, SEED + PATTERNS as u64)?;
        let wanted: Vec<(usize, Method, Taught)> = Method::ALL
            .into_iter()
            .enumerate()
            .flat_map(|(index, method)| Taught::ALL.map(|taught| (index, method, taught)))
            .collect();
        let teach = |(index, method, taught): (usize, Method, Taught)| {
            let patterns: Vec<Pattern<'_>> = learn
                .iter()
                .map(|plane| Pattern { depth_mm: plane.maps[index].view(), true_mm: plane.true_mm })
                .collect();
            let (kind, cdc) = taught.kind();
            Ok((
                method,
                taught,
                fit(kind, &patterns, &cdc).with_context(|| format!("{taught:?} of {method:?}"))?,
            ))
        };
        let corrections = wanted.into_par_iter().map(teach).collect::<Result<Vec<_>>>()?;
        Ok(Self { learn, judge, corrections })
    }

    pub fn corrected(
        &self,
        method: Method,
        taught: Option<Taught>,
        map: &Array2<f32>,
    ) -> Result<Array2<f32>> {
        let Some(taught) = taught else { return Ok(map.clone()) };
        let found = self.corrections.iter().find(|(of, by, _)| (*of, *by) == (method, taught));
        let (.., correction) = found.with_context(|| format!("{taught:?} of {method:?} was not learned"))?;
        Ok(correction.apply(map.view())?)
    }

    pub fn patterns(&self, method: Method) -> impl Iterator<Item = (f64, &Array2<f32>)> {
        let index = place(method);
        self.learn.iter().map(move |plane| (plane.true_mm, &plane.maps[index]))
    }

    fn judged(&self, method: Method, taught: Option<Taught>) -> Result<Vec<(f64, Flat)>> {
        let of = |plane: &Plane| {
            let map = self.corrected(method, taught, &plane.maps[place(method)])?;
            let (height, width) = map.dim();
            let inside = |(y, x)| y >= RIM_PX && x >= RIM_PX && y + RIM_PX < height && x + RIM_PX < width;
            Ok((plane.true_mm, Flat::of(&map, plane.true_mm, inside)))
        };
        self.judge.par_iter().map(of).collect()
    }
}

fn place(method: Method) -> usize {
    Method::ALL.iter().position(|known| *known == method).unwrap_or(0)
}

fn measured(bench: &Bench, depths: &[f64], seed: u64) -> Result<Vec<Plane>> {
    let one = |(index, true_mm): (usize, &f64)| -> Result<Plane> {
        let pair = bench.render(&rig::plane(*true_mm)?, seed + index as u64)?;
        let maps =
            Method::ALL.into_iter().map(|method| bench.depth(method, &pair, 3)).collect::<Result<_>>()?;
        Ok(Plane { true_mm: *true_mm, maps })
    };
    depths.par_iter().enumerate().map(one).collect()
}

fn mean(of: impl ExactSizeIterator<Item = f64>) -> f64 {
    let n = of.len() as f64;
    of.sum::<f64>() / n
}

fn curve(name: &str, judged: &[(f64, Flat)], of: fn(&Flat) -> f64) -> Curve {
    Curve { name: name.into(), points: judged.iter().map(|(depth, flat)| (*depth, of(flat))).collect() }
}

pub fn operators(page: &mut Page, planes: &Planes) -> Result<()> {
    page.subheading("Raj's operators, GRO and GGRO (fig. 5.4)");
    page.paragraph(&format!(
        "RMSE over each of {JUDGED} flat surfaces, which taught nothing: the corrections are learned from {PATTERNS} others with textures and noise of their own (the thesis \
         judged on the surfaces that taught). *Corrected* is the method of section 5.3, eqs. 5.21 and 5.22, with step 2 put right. *SD* is the spread within a \
         surface, its mean taken off."
    ));
    let wanted = [
        ("Raj", Method::Raj, None),
        ("GRO", Method::Gro, None),
        ("GGRO", Method::Ggro, None),
        ("Raj corrected", Method::Raj, Some(Taught::TwoStep)),
        ("GRO corrected", Method::Gro, Some(Taught::TwoStep)),
        ("GGRO corrected", Method::Ggro, Some(Taught::TwoStep)),
        ("GGRO, linear design", Method::GgroLinear, None),
        ("GGRO, linear, clsf-full", Method::GgroLinear, Some(Taught::ClsfFull)),
    ];
    let (mut rows, mut curves, mut all) = (Vec::new(), Vec::new(), Vec::new());
    for (name, method, taught) in wanted {
        let judged = planes.judged(method, taught)?;
        let ends = [&judged[0], &judged[JUDGED - 1]].map(|(_, flat)| mm(flat.rmse_mm));
        let [far, near] = ends;
        rows.push(vec![
            name.to_owned(),
            mm(mean(judged.iter().map(|(_, flat)| flat.rmse_mm))),
            mm(mean(judged.iter().map(|(_, flat)| flat.sd_mm))),
            far,
            near,
        ]);
        curves.push(curve(name, &judged, |flat| flat.rmse_mm));
        all.push(judged);
    }
    page.table(1, &["", "mean RMSE", "mean SD", "RMSE, farthest", "RMSE, nearest"], &rows);
    let png = chart::lines(
        "Flat surfaces through the imperfect lens (fig. 5.4)",
        "depth in mm",
        "RMSE in mm",
        &curves,
    )?;
    page.picture(
        "thesis-operators.png",
        &png,
        "RMSE over depth: Raj, GRO and GGRO before and after correction",
    )?;
    claims_of_5_4(page, &all);
    Ok(())
}

fn row(claim: &str, holds: bool, here: String) -> Vec<String> {
    vec![claim.to_owned(), if holds { "yes" } else { "no" }.to_owned(), here]
}

fn claims_of_5_4(page: &mut Page, all: &[Vec<(f64, Flat)>]) {
    let rmse = |of: usize| mean(all[of].iter().map(|(_, flat)| flat.rmse_mm));
    let [raj, gro, ggro, raj_after, gro_after, ggro_after] = [0, 1, 2, 3, 4, 5].map(rmse);
    let better = |a: usize, b: usize| {
        let pairs = all[a].iter().zip(&all[b]);
        pairs.filter(|((depth, a), (_, b))| *depth > 890.8 && a.rmse_mm < b.rmse_mm).count()
    };
    let deep = all[0].iter().filter(|(depth, _)| *depth > 890.8).count();
    let everywhere =
        |a: usize| all[a].iter().zip(&all[0]).filter(|((_, a), (_, raj))| a.rmse_mm < raj.rmse_mm).count();
    let halves = |of: usize| {
        let half = JUDGED / 2;
        let part = |part: &[(f64, Flat)]| mean(part.iter().map(|(_, flat)| flat.rmse_mm));
        [part(&all[of][..half]), part(&all[of][half..])]
    };
    let ([far_before, near_before], [far_after, near_after]) = (halves(2), halves(5));
    let rows = [
        row(
            "before correction GRO and GGRO beat Raj beyond 890.8 mm",
            better(1, 0) == deep && better(2, 0) == deep,
            format!("on {} and {} of {deep} surfaces", better(1, 0), better(2, 0)),
        ),
        row(
            "GGRO has the least error, before and after",
            ggro <= gro.min(raj) && ggro_after <= gro_after.min(raj_after),
            format!(
                "before: Raj {raj:.2}, GRO {gro:.2}, GGRO {ggro:.2}; after: {raj_after:.2}, {gro_after:.2}, {ggro_after:.2} mm"
            ),
        ),
        row(
            "corrected, both beat the uncorrected Raj everywhere",
            everywhere(4) == JUDGED && everywhere(5) == JUDGED,
            format!("on {} and {} of {JUDGED}", everywhere(4), everywhere(5)),
        ),
        row(
            "before correction the near half is worse (GGRO)",
            near_before > far_before,
            format!("far half {far_before:.2}, near half {near_before:.2} mm"),
        ),
        row(
            "after correction the far half is worse (GGRO)",
            far_after > near_after,
            format!("far half {far_after:.2}, near half {near_after:.2} mm"),
        ),
    ];
    page.table(3, &["what the thesis says of fig. 5.4", "here", "figures"], &rows);
    page.paragraph(
        "The thesis compares corrected GRO and GGRO with Raj's operators *un*corrected. The line *Raj corrected* above fills this gap: a correction that is learned from \
         the method's own maps also takes away most of what a wrong point spread function does to a flat surface.",
    );
}

pub fn depth_dependence(page: &mut Page, planes: &Planes) -> Result<()> {
    page.subheading("The distortion depends on depth (fig. 6.1)");
    let index = place(Method::Subbarao);
    let [far, near] = [planes.learn.first(), planes.learn.last()].map(|plane| plane.context("no planes"));
    let (far, near) = (far?, near?);
    let cancelled = |of: &Array2<f32>, by: &Plane| of - &by.maps[index] + by.true_mm as f32;
    // Measured planes at the ends, so that no pattern is subtracted from itself.
    let [seen_far, seen_near] =
        [planes.judge.first(), planes.judge.last()].map(|plane| plane.context("no planes"));
    let mut maps = Vec::new();
    for (seen, own, other, scale) in
        [(seen_far?, far, near, [925.0, 940.0]), (seen_near?, near, far, [880.0, 900.0])]
    {
        let map = &seen.maps[index];
        let title = |what: &str| format!("{what}: {} to {} mm", scale[0], scale[1]);
        maps.push((title(&format!("{:.0} mm", seen.true_mm)), map.clone(), scale, seen.true_mm));
        maps.push((title("its own pattern"), cancelled(map, own), scale, seen.true_mm));
        maps.push((title("the other's"), cancelled(map, other), scale, seen.true_mm));
    }
    let panels: Vec<Panel<'_>> = maps
        .iter()
        .map(|(title, map, scale, _)| Panel {
            title: title.clone(),
            map: map.view(),
            scale: Scale::Depth(*scale),
        })
        .collect();
    page.picture(
        "thesis-patterns.png",
        &panels::grid(3, &panels)?,
        "Subbarao's method, fig. 6.1: a far and a near surface as measured, with its own pattern subtracted, and with the other's",
    )?;
    // Means over 40 x 40 px: single pixels are much noisier than the bowl.
    let bowl = |map: &Array2<f32>, true_mm: f64| {
        let blocks = map.exact_chunks((40, 40)).into_iter().map(|block| {
            let values = block.iter().filter(|v| v.is_finite());
            let (sum, n) = values.fold((0.0, 0.0), |(sum, n), v| (sum + f64::from(*v), n + 1.0));
            (sum / n - true_mm).powi(2)
        });
        let all: Vec<f64> = blocks.collect();
        (all.iter().sum::<f64>() / all.len() as f64).sqrt()
    };
    let end = |of: usize, name: &str| {
        let mut cells = vec![name.to_owned()];
        cells.extend(maps[of..of + 3].iter().map(|(_, map, _, true_mm)| mm(bowl(map, *true_mm))));
        cells
    };
    page.table(
        1,
        &[
            "RMS of means over 40 x 40 px, mm",
            "as measured",
            "its own end's pattern",
            "the other end's pattern",
        ],
        &[end(0, "far surface"), end(3, "near surface")],
    );
    page.paragraph(
        "As in the thesis a pattern from the right depth flattens the surface and one from the other end of the range does not. (The surfaces lie a quarter of a step of \
         the judged series inside the ends, so that no pattern is subtracted from itself as in fig. 6.1.)",
    );
    Ok(())
}

pub fn corrections(page: &mut Page, planes: &Planes) -> Result<()> {
    page.subheading("CDC and CLSF on four methods (fig. 6.4)");
    let ways: [(&str, Option<Taught>); 3] =
        [("uncorrected", None), ("CDC", Some(Taught::CdcRaw)), ("CLSF", Some(Taught::Clsf))];
    let (mut plots, mut rows, mut figures) = ([const { Vec::new() }; 3], Vec::new(), Vec::new());
    for method in OF_CHAPTER_6 {
        let name = if method == Method::Ggro { "Li (GGRO)" } else { method.name() };
        let mut judged = Vec::new();
        for (way, taught) in ways {
            judged.push((way, planes.judged(method, taught)?));
        }
        let smoothed = planes.judged(method, Some(Taught::Cdc))?;
        let full = planes.judged(method, Some(Taught::ClsfFull))?;
        let parts: [Figure; 3] = [
            ("estimated depth, mm", |flat| flat.mean_mm),
            ("RMSE, mm", |flat| flat.rmse_mm),
            ("variance, mm2", |flat| flat.sd_mm.powi(2)),
        ];
        for ((label, of), plots) in parts.into_iter().zip(&mut plots) {
            let mut curves: Vec<Curve> = judged.iter().map(|(way, flats)| curve(way, flats, of)).collect();
            let vertical = label.starts_with("estimated").then_some([875.0, 945.0]);
            if vertical.is_some() {
                curves.push(Curve {
                    name: "expected".into(),
                    points: judged[0].1.iter().map(|(depth, _)| (*depth, *depth)).collect(),
                });
            }
            plots.push(Plot { title: name.into(), labels: ["depth, mm", label], curves, vertical });
        }
        let of = |flats: &[(f64, Flat)]| {
            [mean(flats.iter().map(|f| f.1.rmse_mm)), mean(flats.iter().map(|f| f.1.sd_mm.powi(2)))]
        };
        let all: Vec<[f64; 2]> =
            judged.iter().map(|(_, flats)| of(flats)).chain([of(&smoothed), of(&full)]).collect();
        let mut cells = vec![name.to_owned()];
        cells.extend(all.iter().map(|[rmse, variance]| format!("{rmse:.2} / {variance:.2}")));
        rows.push(cells);
        figures.push(all);
    }
    page.picture(
        "thesis-corrections.png",
        &chart::grid(4, &plots.into_iter().flatten().collect::<Vec<_>>())?,
        "Estimated depth, RMSE and variance over depth, before and after CDC and CLSF, for four methods, fig. 6.4",
    )?;
    page.table(
        1,
        &[
            "RMSE in mm / variance in mm2, means over the surfaces",
            "uncorrected",
            "CDC",
            "CLSF",
            "CDC, smoothed patterns",
            "clsf-full",
        ],
        &rows,
    );
    claims_of_6_4(page, &figures);
    Ok(())
}

fn claims_of_6_4(page: &mut Page, figures: &[Vec<[f64; 2]>]) {
    let reduced = figures.iter().filter(|f| f[1][0] < f[0][0] && f[2][0] < f[0][0]).count();
    let quieter = figures.iter().filter(|f| f[1][1] < f[0][1] && f[2][1] < f[0][1]).count();
    let cdc_first = figures[..3].iter().filter(|f| f[1][0] < f[2][0] && f[1][1] < f[2][1]).count();
    let smoothed_first = figures[..3].iter().filter(|f| f[3][0] < f[2][0] && f[3][1] < f[2][1]).count();
    let [li_cdc, li_clsf] = [figures[3][1][0], figures[3][2][0]];
    let before: Vec<String> = figures.iter().map(|f| format!("{:.2}", f[0][0])).collect();
    let rows = [
        row("both corrections reduce the RMSE of all four methods", reduced == 4, format!("{reduced} of 4")),
        row("both reduce the variance of all four", quieter == 4, format!("{quieter} of 4")),
        row(
            "CDC is better than CLSF for Subbarao, Favaro and Raj",
            cdc_first == 3,
            format!("for {cdc_first} of 3 as printed, for {smoothed_first} of 3 by smoothed patterns"),
        ),
        row(
            "CLSF is slightly better than CDC for Li",
            li_clsf < li_cdc,
            format!("{li_clsf:.3} against {li_cdc:.3} mm; CDC by smoothed patterns {:.3}", figures[3][3][0]),
        ),
        row(
            "calibrated methods (Subbarao, Li) are nearer to the truth before correction",
            figures[0][0][0].max(figures[3][0][0]) < figures[1][0][0].min(figures[2][0][0]),
            format!("Subbarao, Favaro, Raj, Li: {} mm", before.join(", ")),
        ),
    ];
    page.table(3, &["what the thesis says of fig. 6.4", "here", "figures"], &rows);
    page.paragraph(
        "*CDC* is as printed, by patterns as they were measured, with a window of 3x3; each pattern then adds its own noise to every map it corrects. Smoothing the patterns \
         (what `cdc` does by default) takes that away. The thesis took one depth per 7x7 patch, which smooths too. In the thesis Favaro's projectors were learned from photographs and \
         no calibration told Favaro's method of the lens; here they are learned from pictures rendered with the calibrated point spread function, so that it is a calibrated one.",
    );
}

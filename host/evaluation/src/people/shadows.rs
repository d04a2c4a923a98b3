//! Shadow removal: cutters on seeded scenes, detectors on coloured ones and the highway (Li 2014, tables 8.1 and 8.2).

use anyhow::{Context, Result, ensure};
use farnear_shadow::Method as Cutter;
use farnear_shadow::detectors::{Detector, Images, Method};
use farnear_shadow::remove;
use farnear_shadow::score::{ShadowScore, Truth};
use farnear_shadow::synthetic::{
    pictures::colour_in,
    scene::{Kind, scene},
};
use farnear_silhouettes::background::{BackgroundModel, Frame, Label, Settings};
use ndarray::{Array2, ArrayView3};
use rayon::prelude::*;
use std::path::Path;

use super::data::{self, Data, numbered_files};
use crate::page::Page;

const SCENES: u64 = 100;
const MADE_SCENES: u64 = 40;
/// Uncertainty of the given shadow direction.
const BETA_SD_RAD: f64 = 0.05;
const KINDS: [(&str, Kind); 4] = [
    ("level camera, upright, shadow sideways or towards the camera", Kind::Standard),
    ("camera pitched down by 5 to 15 deg", Kind::Pitched),
    ("bending by 40 to 80 deg", Kind::Bending),
    ("shadow behind the person", Kind::Behind),
];
const CUTTERS: [(&str, Cutter); 2] = [("`thesis`", Cutter::Thesis), ("`hybrid`", Cutter::Hybrid)];
const HEAD: [&str; 5] = ["scenes", "method", "shadow removed, %", "subject wrongly removed, %", "IoU, %"];

pub fn measure(page: &mut Page, data: &Data) -> Result<()> {
    page.heading("Shadows off by geometry");
    page.paragraph(&format!(
        "{SCENES} seeded scenes of each kind, 640 x 480: a walking person at 5 to 10 m on level ground, sun 20 to 62 deg up, camera 0.8 to 3 m high; the mask before is person \
         and shadow together, pixels of all scenes are pooled. Asked for in the first kind: at least 78 % removed, at most 2 % wrongly, IoU at \
         least 92. The three harder kinds break an assumption of angles in the picture each and stand apart. \
         The constants of `hybrid` were set on the first 50 scenes of each kind; on 200 further ones (seeds 100 to 299), which nothing was set on, it removes 94.0, 94.6, 94.9 and 85.8 % and wrongly 1.2, 1.5, 1.2 and 2.7 %."
    ));
    let mut rows = Vec::new();
    for (name, kind) in KINDS {
        for (method, cutter) in CUTTERS {
            rows.push(row(name, method, &pooled(kind, cutter, 0..SCENES)?));
        }
    }
    page.table(2, &HEAD, &rows);

    page.heading("Shadows off by colour and texture");
    page.paragraph(&format!(
        "The detectors that Li (2014) compares with, on {MADE_SCENES} of the same scenes coloured in (paving, clothes, sun and sky of different colour, camera noise), compared with the geometric cutters on the same masks. Where there is colour it is the better cue; the cutters need a mask, the sun and the camera's place only."
    ));
    let (name, kind) = KINDS[0];
    let mut rows = Method::ALL
        .par_iter()
        .map(|&method| {
            let score = detected(kind, method, 0..MADE_SCENES)?;
            Ok(row(name, &format!("`{method}`"), &score))
        })
        .collect::<Result<Vec<_>>>()?;
    for (method, cutter) in CUTTERS {
        rows.push(row(name, method, &pooled(kind, cutter, 0..MADE_SCENES)?));
    }
    page.table(2, &HEAD, &rows);

    match data.path("highway") {
        Some(folder) => highway(page, &folder).context("the highway sequence"),
        None => {
            page.paragraph("Skipped: the highway sequence is not at hand.");
            Ok(())
        }
    }
}

fn row(scenes: &str, method: &str, score: &ShadowScore) -> Vec<String> {
    let figures = [score.removed_percent(), score.wrongly_removed_percent(), score.iou_percent()];
    let figures = figures.map(|value| value.map_or_else(|| "-".into(), |value| format!("{value:.1}")));
    [scenes.to_owned(), method.to_owned()].into_iter().chain(figures).collect()
}

fn pooled(kind: Kind, cutter: Cutter, seeds: std::ops::Range<u64>) -> Result<ShadowScore> {
    let scores = seeds
        .into_par_iter()
        .map(|seed| {
            let scene = scene(kind, seed);
            let (left, _) = remove(&scene.silhouette, &scene.camera, scene.sun, BETA_SD_RAD, cutter)
                .with_context(|| format!("scene {seed}"))?;
            let mut score = ShadowScore::default();
            score.add(None, left.view(), scene.truth().view())?;
            Ok(score)
        })
        .collect::<Result<Vec<_>>>()?;
    Ok(scores.iter().fold(ShadowScore::default(), |sum, score| ShadowScore {
        shadow_pixels: sum.shadow_pixels + score.shadow_pixels,
        shadow_removed: sum.shadow_removed + score.shadow_removed,
        subject_pixels: sum.subject_pixels + score.subject_pixels,
        subject_removed: sum.subject_removed + score.subject_removed,
        intersection: sum.intersection + score.intersection,
        union: sum.union + score.union,
    }))
}

pub fn per_scene(scenes: u64) -> Result<Vec<(String, Vec<ShadowScore>)>> {
    let mut found = Vec::new();
    for method in Method::ALL {
        let scores = (0..scenes).map(|seed| detected(Kind::Standard, method, seed..seed + 1));
        found.push((method.to_string(), scores.collect::<Result<Vec<_>>>()?));
    }
    for (name, cutter) in [("thesis", Cutter::Thesis), ("hybrid", Cutter::Hybrid)] {
        let scores = (0..scenes).map(|seed| pooled(Kind::Standard, cutter, seed..seed + 1));
        found.push((name.to_owned(), scores.collect::<Result<Vec<_>>>()?));
    }
    Ok(found)
}

fn detected(kind: Kind, method: Method, seeds: std::ops::Range<u64>) -> Result<ShadowScore> {
    let mut total = ShadowScore::default();
    let mut detector = Detector::new(method);
    for seed in seeds {
        let scene = scene(kind, seed);
        let truth = scene.truth();
        let pictures = colour_in(truth.view(), seed);
        let foreground = scene.silhouette.view();
        let images = Images::new(pictures.frame.view(), pictures.background.view(), foreground)?;
        let shadow = detector.detect(&images);
        let left = Array2::from_shape_fn(truth.dim(), |at| foreground[at] && !shadow[at]);
        total.add(Some(foreground), left.view(), truth.view())?;
    }
    Ok(total)
}

/// Label 255 of the background model against truth 255, and the detectors on its foreground.
fn highway(page: &mut Page, folder: &Path) -> Result<()> {
    let mut detectors = Method::ALL.map(|method| (method, Detector::new(method), ShadowScore::default()));
    let mut plain = ShadowScore::default();
    let mut own = ShadowScore::default();
    let (mut learner, mut separate): (Option<BackgroundModel>, Option<BackgroundModel>) = (None, None);
    let mut scored = 0;
    for (number, path) in numbered_files(&folder.join("input"))? {
        let picture = data::picture(&path)?;
        let size = (picture.height() as usize, picture.width() as usize);
        let rgb = picture.to_rgb8();
        let pixels = ArrayView3::from_shape((size.0, size.1, 3), rgb.as_raw())?;
        let frame = Frame::Rgb(pixels);
        let without = Settings { shadow: None, ..Settings::default() };
        let labels = ready(&mut learner, frame, without)?.apply(frame)?;
        let classes = ready(&mut separate, frame, Settings::default())?.apply(frame)?;
        let truth_path = folder.join(format!("groundtruth/gt{number:06}.png"));
        // The first 469 frames are for learning only.
        if number < 470 || !truth_path.exists() {
            continue;
        }
        let truth = data::picture(&truth_path)?.to_luma8();
        let truth: Vec<Truth> = truth
            .pixels()
            .map(|pixel| {
                Truth::from_grey(pixel.0[0])
                    .with_context(|| format!("grey level {} in {}", pixel.0[0], truth_path.display()))
            })
            .collect::<Result<_>>()?;
        ensure!(truth.len() == size.0 * size.1, "{} has another size than its frame", truth_path.display());
        let truth = Array2::from_shape_vec(size, truth)?;
        let foreground = labels.mapv(|label| label == Label::Foreground);
        let background = learner.as_ref().map(BackgroundModel::background).context("no background yet")?;
        let images = Images::new(pixels, background.view(), foreground.view())?;
        for (_, detector, score) in &mut detectors {
            let shadow = detector.detect(&images);
            let left = Array2::from_shape_fn(size, |at| foreground[at] && !shadow[at]);
            score.add(Some(foreground.view()), left.view(), truth.view())?;
        }
        plain.add(Some(foreground.view()), foreground.view(), truth.view())?;
        let left = Array2::from_shape_fn(size, |at| foreground[at] && classes[at] == Label::Foreground);
        own.add(Some(foreground.view()), left.view(), truth.view())?;
        scored += 1;
    }
    page.paragraph(&format!(
        "The highway sequence of ChangeDetection.net (Goyette et al. 2012), {scored} frames with ground truth at hand, on the foreground of the Gaussian mixture model (Zivkovic 2004). The scene has {} labelled shadow pixels in that \
         foreground{}.",
        plain.shadow_pixels,
        if plain.shadow_pixels == 0 { ", so only wrong removals can be counted" } else { "" },
    ));
    let name = "highway";
    let mut rows =
        vec![row(name, "nothing removed", &plain), row(name, "the model's own shadow option", &own)];
    rows.extend(detectors.iter().map(|(method, _, score)| row(name, &format!("`{method}`"), score)));
    page.table(2, &HEAD, &rows);
    Ok(())
}

fn ready<'a>(
    model: &'a mut Option<BackgroundModel>,
    frame: Frame<'_>,
    settings: Settings,
) -> Result<&'a mut BackgroundModel> {
    if model.is_none() {
        *model = Some(BackgroundModel::like(frame, settings)?);
    }
    model.as_mut().context("the model was just made")
}

//! The background model and the shadow detectors on the highway sequence of ChangeDetection.net (Goyette et al. 2012), where it is at hand.
//!
//! The figures to agree with are those of OpenCV 5.0.0's `createBackgroundSubtractorMOG2()` with its default
//! settings (the same as ours), fed with the same frames in order and scored in the same way: label 255 against
//! truth 255, truth 85 and 170 left out, frames 470 onwards (the sequence's temporal region of interest).

#![allow(clippy::unwrap_used)] // helpers of tests: data that cannot be read must stop the test

use std::{
    fs,
    path::{Path, PathBuf},
};

use farnear_activity::{
    background::{BackgroundModel, Frame, Label, Settings},
    shadow_detectors::{Detector, Images, Method},
    shadow_score::{ShadowScore, Truth},
};
use image::{DynamicImage, GrayImage};
use ndarray::{Array2, ArrayView2, ArrayView3};

fn data() -> Option<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/highway");
    if path.is_dir() {
        Some(path)
    } else {
        println!("skipped: no shared data");
        None
    }
}

/// Frame numbers and pictures, in order.
fn frames(data: &Path) -> Vec<(u32, DynamicImage)> {
    let mut paths: Vec<_> =
        fs::read_dir(data.join("input")).unwrap().map(|entry| entry.unwrap().path()).collect();
    paths.sort();
    paths
        .iter()
        .map(|path| {
            (path.file_stem().unwrap().to_str().unwrap()[2..].parse().unwrap(), image::open(path).unwrap())
        })
        .collect()
}

fn truth(data: &Path, number: u32) -> GrayImage {
    image::open(data.join(format!("groundtruth/gt{number:06}.png"))).unwrap().to_luma8()
}

#[derive(Default)]
struct Counts {
    hit: u32,
    false_alarm: u32,
    missed: u32,
}

impl Counts {
    fn f1(&self) -> f64 {
        2.0 * f64::from(self.hit) / f64::from(2 * self.hit + self.false_alarm + self.missed)
    }
}

fn f1(colour: bool, settings: Settings) -> Option<f64> {
    let data = data()?;
    let mut model: Option<BackgroundModel> = None;
    let mut counts = Counts::default();
    for (number, picture) in frames(&data) {
        let size = (picture.height() as usize, picture.width() as usize);
        let (rgb, grey) = (picture.to_rgb8(), picture.to_luma8());
        let frame = if colour {
            Frame::Rgb(ArrayView3::from_shape((size.0, size.1, 3), rgb.as_raw()).unwrap())
        } else {
            Frame::Grey(ArrayView2::from_shape(size, grey.as_raw()).unwrap())
        };
        let model = model.get_or_insert_with(|| BackgroundModel::like(frame, settings.clone()).unwrap());
        let labels = model.apply(frame).unwrap();
        if number < 470 {
            continue;
        }
        for (truth, label) in truth(&data, number).pixels().zip(&labels) {
            match (truth.0[0], *label == Label::Foreground) {
                (85 | 170, _) => {}
                (255, true) => counts.hit += 1,
                (255, false) => counts.missed += 1,
                (_, true) => counts.false_alarm += 1,
                (_, false) => {}
            }
        }
    }
    println!(
        "colour {colour}, shadow {}: hit {} false {} missed {} F1 {:.4}",
        settings.shadow.is_some(),
        counts.hit,
        counts.false_alarm,
        counts.missed,
        counts.f1()
    );
    Some(counts.f1())
}

/// Within 0.02 of OpenCV's F1.
#[track_caller]
fn agrees(colour: bool, shadow: bool, opencv: f64) {
    let mut settings = Settings::default();
    if !shadow {
        settings.shadow = None;
    }
    if let Some(f1) = f1(colour, settings) {
        assert!((f1 - opencv).abs() <= 0.02, "F1 {f1:.4}, OpenCV {opencv:.4}");
    }
}

#[test]
fn colour_with_shadow_agrees_with_opencv() {
    agrees(true, true, 0.2155);
}

#[test]
fn colour_without_shadow_agrees_with_opencv() {
    agrees(true, false, 0.2037);
}

#[test]
fn grey_with_shadow_agrees_with_opencv() {
    agrees(false, true, 0.1317);
}

#[test]
fn grey_without_shadow_agrees_with_opencv() {
    agrees(false, false, 0.1715);
}

/// Detection and discrimination rates (Sanin et al. 2012) of the five detectors on the background model's foreground.
/// Where the frames at hand have no pixel labelled shadow, only the discrimination rate can be given.
#[test]
fn detectors_keep_most_of_what_moves() {
    let Some(data) = data() else { return };
    let mut detectors = Method::ALL.map(|method| (method, Detector::new(method), ShadowScore::default()));
    let mut model: Option<BackgroundModel> = None;
    for (number, picture) in frames(&data) {
        let size = (picture.height() as usize, picture.width() as usize);
        let rgb = picture.to_rgb8();
        let pixels = ArrayView3::from_shape((size.0, size.1, 3), rgb.as_raw()).unwrap();
        let settings = Settings { shadow: None, ..Settings::default() };
        let model = model.get_or_insert_with(|| BackgroundModel::like(Frame::Rgb(pixels), settings).unwrap());
        let foreground = model.apply(Frame::Rgb(pixels)).unwrap().mapv(|label| label == Label::Foreground);
        if number < 470 {
            continue;
        }
        let background = model.background();
        let images = Images::new(pixels, background.view(), foreground.view()).unwrap();
        let truth = truth(&data, number);
        let truth =
            Array2::from_shape_vec(size, truth.pixels().map(|p| Truth::from_grey(p.0[0]).unwrap()).collect());
        let truth = truth.unwrap();
        for (_, detector, score) in &mut detectors {
            let shadow = detector.detect(&images);
            let left = Array2::from_shape_fn(size, |at| foreground[at] && !shadow[at]);
            score.add(Some(foreground.view()), left.view(), truth.view()).unwrap();
        }
    }
    for (method, _, score) in &detectors {
        let detection =
            score.removed_percent().map_or("no labelled shadow".into(), |rate| format!("{rate:.1} %"));
        let discrimination = score.discrimination_percent().unwrap();
        println!(
            "{}: detection {detection}, discrimination {discrimination:.1} % of {} pixels",
            method.name(),
            score.subject_pixels
        );
        assert!(discrimination > 40.0, "{}: {discrimination:.1} %", method.name());
    }
}

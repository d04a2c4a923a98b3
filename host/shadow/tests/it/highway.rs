//! Background model and shadow detectors on the highway sequence of ChangeDetection.net (Goyette et al.
//! 2012). Reference: OpenCV 5.0.0's `createBackgroundSubtractorMOG2()` with default settings (equal to ours)
//! and the same score: label 255 against truth 255, truth 85 and 170 excluded, frames 470 onwards.

#![allow(clippy::unwrap_used)] // helpers of tests: data that cannot be read must stop the test

use std::{fs, path::PathBuf, sync::OnceLock};

use farnear_shadow::detectors::{Detector, Images, Method};
use farnear_shadow::score::{ShadowScore, Truth};
use farnear_silhouettes::background::{BackgroundModel, Frame, Label, Settings};
use image::{DynamicImage, GrayImage};
use ndarray::{Array2, ArrayView2, ArrayView3};

struct Shot {
    picture: DynamicImage,
    truth: Option<GrayImage>,
}

fn shots() -> &'static [Shot] {
    static SHOTS: OnceLock<Vec<Shot>> = OnceLock::new();
    SHOTS.get_or_init(|| {
        let data = farnear_test_data::path("highway");
        let listed = fs::read_dir(data.join("input")).unwrap();
        let mut paths: Vec<_> = listed.map(|entry| entry.unwrap().path()).collect();
        paths.sort();
        let shot = |path: &PathBuf| {
            let number: u32 = path.file_stem().unwrap().to_str().unwrap()[2..].parse().unwrap();
            let truth = data.join(format!("groundtruth/gt{number:06}.png"));
            Shot {
                picture: image::open(path).unwrap(),
                truth: (number >= 470).then(|| image::open(truth).unwrap().to_luma8()),
            }
        };
        paths.iter().map(shot).collect()
    })
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

fn f1(colour: bool, settings: Settings) -> f64 {
    let mut model: Option<BackgroundModel> = None;
    let mut counts = Counts::default();
    for Shot { picture, truth } in shots() {
        let size = (picture.height() as usize, picture.width() as usize);
        let (rgb, grey) = (picture.to_rgb8(), picture.to_luma8());
        let frame = if colour {
            Frame::Rgb(ArrayView3::from_shape((size.0, size.1, 3), rgb.as_raw()).unwrap())
        } else {
            Frame::Grey(ArrayView2::from_shape(size, grey.as_raw()).unwrap())
        };
        let model = model.get_or_insert_with(|| BackgroundModel::like(frame, settings.clone()).unwrap());
        let labels = model.apply(frame).unwrap();
        let Some(truth) = truth else { continue };
        for (truth, label) in truth.pixels().zip(&labels) {
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
    counts.f1()
}

#[track_caller]
fn agrees(colour: bool, shadow: bool, opencv: f64) {
    let mut settings = Settings::default();
    if !shadow {
        settings.shadow = None;
    }
    let f1 = f1(colour, settings);
    assert!((f1 - opencv).abs() <= 0.02, "F1 {f1:.4}, OpenCV {opencv:.4}");
}

#[test]
#[cfg_attr(not(shared_data), ignore = "needs the real data next to the repository")]
fn colour_with_shadow_agrees_with_opencv() {
    agrees(true, true, 0.2155);
}

#[test]
#[cfg_attr(not(shared_data), ignore = "needs the real data next to the repository")]
fn colour_without_shadow_agrees_with_opencv() {
    agrees(true, false, 0.2037);
}

#[test]
#[cfg_attr(not(shared_data), ignore = "needs the real data next to the repository")]
fn grey_with_shadow_agrees_with_opencv() {
    agrees(false, true, 0.1317);
}

#[test]
#[cfg_attr(not(shared_data), ignore = "needs the real data next to the repository")]
fn grey_without_shadow_agrees_with_opencv() {
    agrees(false, false, 0.1715);
}

/// Rates of Sanin et al. 2012 on the background model's foreground. The sequence has no labelled shadow.
#[test]
#[cfg_attr(not(shared_data), ignore = "needs the real data next to the repository")]
fn detectors_keep_most_of_what_moves() {
    let mut detectors = Method::ALL.map(|method| (method, Detector::new(method), ShadowScore::default()));
    let mut model: Option<BackgroundModel> = None;
    for Shot { picture, truth } in shots() {
        let size = (picture.height() as usize, picture.width() as usize);
        let rgb = picture.to_rgb8();
        let pixels = ArrayView3::from_shape((size.0, size.1, 3), rgb.as_raw()).unwrap();
        let settings = Settings { shadow: None, ..Settings::default() };
        let model = model.get_or_insert_with(|| BackgroundModel::like(Frame::Rgb(pixels), settings).unwrap());
        let foreground = model.apply(Frame::Rgb(pixels)).unwrap().mapv(|label| label == Label::Foreground);
        let Some(truth) = truth else { continue };
        let background = model.background();
        let images = Images::new(pixels, background.view(), foreground.view()).unwrap();
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
        let discrimination = 100.0 - score.wrongly_removed_percent().unwrap();
        println!(
            "{}: detection {detection}, discrimination {discrimination:.1} % of {} pixels",
            method, score.subject_pixels
        );
        assert!(discrimination > 40.0, "{}: {discrimination:.1} %", method);
    }
}

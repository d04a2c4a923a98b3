//! The background model on sequences with known truth, and compared with a transcription of the equations.

use farnear_silhouettes::background::{BackgroundError, BackgroundModel, Frame, Label, Settings};
use ndarray::{Array2, Array3};

const SIZE: (usize, usize) = (60, 80);

/// Repeatable, roughly Gaussian noise of standard deviation `sd` grey levels.
struct Noise(u64);

impl Noise {
    fn draw(&mut self, sd: f32) -> f32 {
        let mut sum = 0.0;
        for _ in 0..4 {
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            sum += (self.0 >> 40) as f32 / (1_u64 << 24) as f32;
        }
        // Four uniform numbers have a variance of 4 / 12.
        (sum - 2.0) * sd * 3.0_f32.sqrt()
    }
}

fn grey(noise: &mut Noise, sd: f32, mut level: impl FnMut(usize, usize) -> f32) -> Array2<u8> {
    Array2::from_shape_fn(SIZE, |(row, column)| (level(row, column) + noise.draw(sd)).clamp(0.0, 255.0) as u8)
}

fn texture(row: usize, column: usize) -> f32 {
    90.0 + 30.0 * ((row / 8 + column / 8) % 2) as f32
}

fn count(labels: &Array2<Label>, label: Label) -> usize {
    labels.iter().filter(|&&found| found == label).count()
}

#[test]
fn a_moving_disc_is_found_over_noise_while_the_gain_drifts() {
    let mut noise = Noise(1);
    let mut model = BackgroundModel::new(SIZE, 1, Settings { shadow: None, ..Settings::default() }).unwrap();
    let (mut hit, mut missed, mut false_alarm) = (0, 0, 0);
    for frame in 0..200_usize {
        // Light increases by a tenth over the sequence.
        let gain = 1.0 + 0.1 * frame as f32 / 200.0;
        // Two pixels a frame: 8 frames per pixel, too few for a background component; once only, because
        // repeated motion becomes background.
        let (x, y) = (2 * frame as i32 - 310, 30);
        let inside = |row: usize, column: usize| (row as i32 - y).pow(2) + (column as i32 - x).pow(2) < 64;
        let picture = grey(&mut noise, 3.0, |row, column| {
            gain * if inside(row, column) { 190.0 } else { texture(row, column) }
        });
        let labels = model.apply(Frame::Grey(picture.view())).unwrap();
        if frame < 150 {
            continue;
        }
        for ((row, column), label) in labels.indexed_iter() {
            match (inside(row, column), *label == Label::Foreground) {
                (true, true) => hit += 1,
                (true, false) => missed += 1,
                (false, true) => false_alarm += 1,
                (false, false) => {}
            }
        }
    }
    let f1 = 2.0 * f64::from(hit) / f64::from(2 * hit + missed + false_alarm);
    assert!(f1 > 0.97, "F1 {f1:.4}: hit {hit}, missed {missed}, false alarms {false_alarm}");
}

#[test]
fn a_still_scene_keeps_one_component_and_a_flickering_one_two() {
    let mut noise = Noise(2);
    let mut model = BackgroundModel::new(SIZE, 1, Settings::default()).unwrap();
    let mut labels = Array2::default(SIZE);
    for frame in 0..300_usize {
        let picture = grey(&mut noise, 2.0, |row, column| {
            let flicker = column < 20 && frame % 2 == 1;
            texture(row, column) + if flicker { 60.0 } else { 0.0 }
        });
        labels = model.apply(Frame::Grey(picture.view())).unwrap();
    }
    let components = model.components();
    let mean = |range: std::ops::Range<usize>| {
        let part = components.slice(ndarray::s![.., range]);
        part.iter().map(|&n| f64::from(n)).sum::<f64>() / part.len() as f64
    };
    assert!((mean(0..20) - 2.0).abs() < 0.05, "{}", mean(0..20));
    assert!((mean(20..80) - 1.0).abs() < 0.05, "{}", mean(20..80));
    assert!(count(&labels, Label::Background) as f64 > 0.99 * labels.len() as f64);
}

#[test]
fn objects_at_rest_become_background() {
    let mut noise = Noise(3);
    let settings = Settings { history_frames: 100, ..Settings::default() };
    let mut model = BackgroundModel::new(SIZE, 1, settings).unwrap();
    for _ in 0..150 {
        model.apply(Frame::Grey(grey(&mut noise, 2.0, texture).view())).unwrap();
    }
    let parked = |row: usize, column: usize| {
        if (20..40).contains(&row) && (30..50).contains(&column) { 220.0 } else { texture(row, column) }
    };
    let mut foreground = Vec::new();
    for _ in 0..60 {
        let labels = model.apply(Frame::Grey(grey(&mut noise, 2.0, parked).view())).unwrap();
        foreground.push(count(&labels, Label::Foreground));
    }
    assert!(foreground[0] > 390, "{}", foreground[0]);
    // (1 - 1/100)^n < 0.9 first holds for n = 11 (Zivkovic 2004, after equation 9); a few more for the prior.
    assert!(foreground[8] > 390, "{foreground:?}");
    assert!(foreground[20] < 20, "{foreground:?}");
}

#[test]
fn a_darker_copy_is_shadow_and_another_colour_is_not() {
    let settings = Settings::default();
    let lit = |row: usize, column: usize, channel: usize| texture(row, column) * [1.0, 0.8, 0.6][channel];
    let mut noise = Noise(4);
    let mut picture = |change: &dyn Fn(usize, usize, usize, f32) -> f32| {
        Array3::from_shape_fn((SIZE.0, SIZE.1, 3), |(row, column, channel)| {
            (change(row, column, channel, lit(row, column, channel)) + noise.draw(1.5)).clamp(0.0, 255.0)
                as u8
        })
    };
    let mut model = BackgroundModel::new(SIZE, 3, settings).unwrap();
    for _ in 0..100 {
        model.apply(Frame::Rgb(picture(&|_, _, _, level| level).view())).unwrap();
    }
    let labels = model
        .apply(Frame::Rgb(
            picture(&|row, column, channel, level| match (row, column) {
                (0..20, 0..20) => 0.7 * level,
                // As dark, but red becomes blue.
                (0..20, 40..60) => 0.7 * lit(row, column, 2 - channel),
                // Darker than the permitted shadow.
                (40..60, 0..20) => 0.3 * level,
                _ => level,
            })
            .view(),
        ))
        .unwrap();
    let share = |label: Label, rows: std::ops::Range<usize>, columns: std::ops::Range<usize>| {
        let part = labels.slice(ndarray::s![rows, columns]).to_owned();
        count(&part, label) as f64 / part.len() as f64
    };
    assert!(share(Label::Shadow, 0..20, 0..20) > 0.97);
    assert!(share(Label::Foreground, 0..20, 40..60) > 0.97);
    assert!(share(Label::Foreground, 40..60, 0..20) > 0.97);
    assert!(share(Label::Background, 40..60, 40..60) > 0.97);
}

#[test]
fn the_background_picture_is_the_empty_scene() {
    let mut noise = Noise(5);
    let mut model = BackgroundModel::new(SIZE, 1, Settings::default()).unwrap();
    for frame in 0..200_usize {
        let picture =
            grey(
                &mut noise,
                2.0,
                |row, column| {
                    if column.abs_diff(frame % 80) < 6 { 230.0 } else { texture(row, column) }
                },
            );
        model.apply(Frame::Grey(picture.view())).unwrap();
    }
    for ((row, column, _), &level) in model.background().indexed_iter() {
        // 2 grey levels of noise, averaged; truncation removes half a level.
        assert!((f32::from(level) - texture(row, column)).abs() <= 3.0, "row {row} column {column}: {level}");
    }
}

#[test]
fn nothing_is_learnt_at_rate_nought() {
    let mut noise = Noise(6);
    let mut model = BackgroundModel::new(SIZE, 1, Settings::default()).unwrap();
    for _ in 0..30 {
        model.apply(Frame::Grey(grey(&mut noise, 2.0, texture).view())).unwrap();
    }
    let before = model.background();
    for _ in 0..50 {
        let labels = model.apply_at(Frame::Grey(Array2::from_elem(SIZE, 250).view()), 0.0).unwrap();
        assert_eq!(count(&labels, Label::Foreground), labels.len());
    }
    assert_eq!(model.background(), before);
}

#[test]
fn odd_frames_are_refused_by_name() {
    let none = BackgroundModel::new((0, 5), 1, Settings::default());
    assert!(matches!(none, Err(BackgroundError::Empty { height: 0, width: 5 })));
    let two = BackgroundModel::new((4, 5), 2, Settings::default());
    assert!(matches!(two, Err(BackgroundError::Channels { channels: 2 })));
    let bad = BackgroundModel::new((4, 5), 1, Settings { history_frames: 0, ..Settings::default() });
    assert!(matches!(bad, Err(BackgroundError::History)));

    let mut model = BackgroundModel::new((4, 5), 1, Settings::default()).unwrap();
    let error = model.apply(Frame::Grey(Array2::zeros((5, 4)).view())).unwrap_err();
    assert!(error.to_string().contains("4x5") && error.to_string().contains("5x4"), "{error}");
    assert!(model.apply(Frame::Rgb(Array3::zeros((4, 5, 3)).view())).is_err());
    assert_eq!(model.frames_seen(), 0);
}

/// One pixel's mixture by the equations in f64: (weight, mean, variance).
#[derive(Default)]
struct Plain(Vec<(f64, f64, f64)>);

impl Plain {
    fn observe(&mut self, x: f64, rate: f64) -> bool {
        self.0.sort_by(|a, b| b.0.total_cmp(&a.0));
        let near =
            |threshold: f64, (_, mean, variance): (f64, f64, f64)| (x - mean).powi(2) < threshold * variance;
        let owner = self.0.iter().position(|&component| near(9.0, component));
        let (mut background, mut heavier) = (false, 0.0);
        for (index, component) in self.0.iter_mut().enumerate() {
            let considered = owner.is_none_or(|owner| index <= owner);
            background |= considered && heavier < f64::from(0.9_f32) && near(16.0, *component);
            let o = f64::from(u8::from(owner == Some(index)));
            component.0 += rate * (o - component.0) - rate * f64::from(0.05_f32);
            let step = (rate / component.0).min(1.0);
            if owner == Some(index) {
                let offset = x - component.1;
                component.1 += step * offset;
                component.2 = (component.2 + step * (offset * offset - component.2)).clamp(4.0, 75.0);
            }
            heavier += component.0.max(0.0);
        }
        self.0.retain(|component| component.0 > 0.0);
        if owner.is_none() {
            self.0.sort_by(|a, b| b.0.total_cmp(&a.0));
            self.0.truncate(4);
            self.0.push((rate, x, 15.0));
        }
        let total: f64 = self.0.iter().map(|component| component.0).sum();
        self.0.iter_mut().for_each(|component| component.0 /= total);
        background
    }
}

#[test]
fn the_kernel_agrees_with_the_equations_written_plainly() {
    let settings = Settings { shadow: None, history_frames: 50 };
    let mut model = BackgroundModel::new(SIZE, 1, settings).unwrap();
    let mut plain: Vec<Plain> = (0..SIZE.0 * SIZE.1).map(|_| Plain::default()).collect();
    let mut noise = Noise(7);
    let (mut differ, mut all) = (0_usize, 0_usize);
    for frame in 1..=150_u32 {
        // Pixels alternate between levels at different rates, so components appear, grow and vanish.
        let picture = grey(&mut noise, 4.0, |row, column| {
            let pace = 2 + (row * 7 + column * 3) % 23;
            60.0 + 35.0 * ((frame as usize / pace + row) % 5) as f32
        });
        let labels = model.apply(Frame::Grey(picture.view())).unwrap();
        let rate = if frame == 1 { 1.0 } else { 1.0 / f64::from((2 * frame).min(50)) };
        for ((mixture, &level), label) in plain.iter_mut().zip(&picture).zip(&labels) {
            let background = mixture.observe(f64::from(level), rate);
            differ += usize::from(background != (*label == Label::Background));
            all += 1;
        }
    }
    // f32 and f64 may differ at thresholds and for equal weights.
    assert!(differ * 1000 < all, "{differ} of {all} labels differ");
    let counts = model.components();
    let same = counts.iter().zip(&plain).filter(|(n, plain)| usize::from(**n) == plain.0.len()).count();
    assert!(same * 100 > 98 * counts.len(), "{same} of {} pixels have as many components", counts.len());
}

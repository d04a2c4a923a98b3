//! Frame rates of the background model, frame to silhouette and frame to embedded point; one thread, 640x480. Scene:
//! textured background with noise, a tenth of the pixels flickering (foliage), three moving discs. The highway sequence
//! of ChangeDetection.net, doubled to 640x480, is timed if present. `FARNEAR_JSON=1` prints JSON.

use std::{fs, hint::black_box, time::Instant};

use farnear_recognition::embedding::{
    descriptor::{ANGLES, Scaling, centroid_distance},
    rbf::Rbf,
};
use farnear_silhouettes::background::{BackgroundModel, Frame, Settings};
use farnear_silhouettes::mask::{
    centre::{SIDE_PX, centred},
    extractor::{Extractor, ExtractorSettings},
};
use ndarray::{Array2, Array3, ArrayView1, s};

const SIZE: (usize, usize) = (480, 640);
const FRAMES: usize = 60;

struct Noise(u64);

impl Noise {
    fn next(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0
    }

    /// Roughly Gaussian with a standard deviation of 3 grey levels: the sum of four uniform bytes.
    fn grey_levels(&mut self) -> f32 {
        let bytes = self.next().to_le_bytes();
        let sum: u32 = bytes[..4].iter().map(|&byte| u32::from(byte)).sum();
        (sum as f32 - 510.0) / 147.8 * 3.0
    }
}

fn sequence() -> Vec<Array3<u8>> {
    let (height, width) = SIZE;
    let mut noise = Noise(7);
    (0..FRAMES)
        .map(|frame| {
            Array3::from_shape_fn((height, width, 3), |(row, column, channel)| {
                let foliage = row < height / 10 && (frame / 3 + column / 5) % 4 == 0;
                let base = 90.0 + 40.0 * ((row / 16 + column / 16) % 2) as f32 + 10.0 * channel as f32;
                let inside = (0..3).any(|disc| {
                    let x = (60 + 9 * frame + 200 * disc) % width;
                    let y = 140 + 110 * disc;
                    row.abs_diff(y).pow(2) + column.abs_diff(x).pow(2) < 45 * 45
                });
                let level = if inside {
                    210.0
                } else if foliage {
                    base + 70.0
                } else {
                    base
                };
                (level + noise.grey_levels()).clamp(0.0, 255.0) as u8
            })
        })
        .collect()
}

fn highway() -> Option<Vec<Array3<u8>>> {
    let folder = farnear_test_data::path("highway/input");
    let mut paths: Vec<_> = fs::read_dir(folder).ok()?.flatten().map(|entry| entry.path()).collect();
    paths.sort();
    let frames = paths.iter().take(FRAMES).map(|path| {
        let small = image::open(path).ok()?.to_rgb8();
        Some(Array3::from_shape_fn((SIZE.0, SIZE.1, 3), |(row, column, channel)| {
            let (x, y) = ((column / 2) as u32, (row / 2) as u32);
            small[(x.min(small.width() - 1), y.min(small.height() - 1))].0[channel]
        }))
    });
    frames.collect::<Option<Vec<_>>>().filter(|frames| frames.len() == FRAMES)
}

/// Milliseconds per frame: best and median of five passes, after a warm-up.
fn milliseconds(mut frame: impl FnMut(usize)) -> [f64; 2] {
    (0..FRAMES).for_each(&mut frame);
    let mut passes: Vec<f64> = (0..5)
        .map(|_| {
            let start = Instant::now();
            (0..FRAMES).for_each(&mut frame);
            1e3 * start.elapsed().as_secs_f64() / FRAMES as f64
        })
        .collect();
    passes.sort_by(f64::total_cmp);
    [passes[0], passes[2]]
}

fn map() -> Rbf {
    let mut noise = Noise(11);
    let mut uniform = || (noise.next() >> 40) as f32 / (1 << 24) as f32;
    let centres = Array2::from_shape_fn((1500, ANGLES), |_| 0.7 * uniform());
    let weights = Array2::from_shape_fn((1500, 3), |_| uniform() - 0.5);
    Rbf::assemble(centres, weights, 0.1, 1e-3, 1e5)
}

fn time(scene: &str, colour: &[Array3<u8>]) {
    let grey: Vec<_> = colour.iter().map(|frame| frame.slice(s![.., .., 1]).to_owned()).collect();
    let mut model = BackgroundModel::new(SIZE, 1, Settings::default()).expect("settings hold");
    let times = milliseconds(|i| {
        black_box(model.apply(Frame::Grey(grey[i].view())).expect("same size"));
    });
    report(&format!("background_grey_{scene}"), times, Some(&model));

    let mut model = BackgroundModel::new(SIZE, 3, Settings::default()).expect("settings hold");
    let times = milliseconds(|i| {
        black_box(model.apply(Frame::Rgb(colour[i].view())).expect("same size"));
    });
    report(&format!("background_colour_{scene}"), times, Some(&model));

    let first = Frame::Rgb(colour[0].view());
    let mut extractor = Extractor::like(first, ExtractorSettings::for_frame(first)).expect("settings hold");
    let times = milliseconds(|i| {
        let found = extractor.extract(Frame::Rgb(colour[i].view())).expect("same size");
        black_box(centred(found.subject.mask.view(), SIDE_PX));
    });
    report(&format!("frame_to_silhouette_{scene}"), times, None);

    let map = map();
    let times = milliseconds(|i| {
        let found = extractor.extract(Frame::Rgb(colour[i].view())).expect("same size");
        if let Ok(described) = centroid_distance(found.subject.mask.view(), Scaling::KeepAspect) {
            black_box(map.embed(ArrayView1::from(&described)).expect("same width"));
        }
    });
    report(&format!("frame_to_point_{scene}"), times, None);
}

fn report(name: &str, [min, median]: [f64; 2], model: Option<&BackgroundModel>) {
    if std::env::var_os("FARNEAR_JSON").is_some() {
        println!(
            "{{\"name\": \"{name}\", \"backend\": \"-\", \"threads\": 1, \"min_ms\": {min:.4}, \"median_ms\": {median:.4}}}"
        );
        return;
    }
    let components = model.map_or(String::new(), |model| {
        let all = model.components();
        let mean = all.iter().map(|&count| f64::from(count)).sum::<f64>() / all.len() as f64;
        format!(", {mean:.2} components a pixel")
    });
    println!("{name}: {min:.3} ms a frame, {:.0} frames/s, 640x480, one thread{components}", 1e3 / min);
}

fn main() {
    time("made", &sequence());
    match highway() {
        Some(frames) => time("highway", &frames),
        None => eprintln!("highway: skipped, not at hand"),
    }
}

//! The pair of Watanabe & Nayar, where it is present.

use std::path::Path;

use farnear_depth::operators::Operators;
use farnear_depth::optics::OpticsFile;
use farnear_depth::pipeline::{Settings, depth_from_pair};
use ndarray::{Array2, s};

fn grey(path: &Path) -> Array2<f32> {
    let image = image::open(path).expect("readable image").to_rgb32f();
    let (width, height) = image.dimensions();
    Array2::from_shape_fn((height as usize, width as usize), |(y, x)| {
        image.get_pixel(x as u32, y as u32).0.iter().sum::<f32>() / 3.0
    })
}

fn median_and_sd(region: ndarray::ArrayView2<f32>) -> [f64; 2] {
    let mut values: Vec<f64> = region.iter().filter(|v| v.is_finite()).map(|v| f64::from(*v)).collect();
    values.sort_by(f64::total_cmp);
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / values.len() as f64;
    [values[values.len() / 2], variance.sqrt()]
}

#[test]
#[cfg_attr(not(shared_data), ignore = "needs the real data next to the repository")]
fn breakfast_has_the_reference_depths() {
    let folder = farnear_test_data::path("breakfast");
    let text = std::fs::read_to_string(folder.join("optics.toml")).unwrap();
    let optics = toml::from_str::<OpticsFile>(&text).unwrap().check().unwrap();
    let operators = Operators::for_optics(&optics).unwrap();
    let [far, near] = ["far", "near"].map(|n| grey(&folder.join(format!("breakfast_{n}.png"))));
    let settings = Settings { median_px: 5, ..Settings::default() };
    let map = depth_from_pair(far.view(), near.view(), &operators, &optics, &settings).unwrap();
    assert!(map.warnings.is_empty(), "{:?}", map.warnings);
    println!("{:?} low texture {}", map.warnings, map.low_texture_fraction);
    // Medians of an independent implementation with the same PSF, design and windows, +-12 mm.
    for (name, rows, columns, reference) in [
        ("wall", 20..130, 30..600, 741.0),
        ("toast", 230..400, 70..200, 635.0),
        ("cup", 220..340, 330..450, 638.0),
        ("front of the table", 440..470, 300..600, 623.0),
    ] {
        let region = map.depth_mm.slice(s![rows, columns]);
        let missing = region.iter().filter(|d| d.is_nan()).count() as f64 / region.len() as f64;
        let [median, sd] = median_and_sd(region);
        println!("{name}: median {median:.1} mm, SD {sd:.1} mm, missing {missing:.3}");
        assert!((median - reference).abs() < 12.0, "{name}: {median}");
        assert!(name != "wall" || sd < 0.02 * median, "{name}: SD {sd}");
    }
}

use ndarray::{ArrayView2, s};
use serde::{Serialize, Serializer};

use super::{Entries, Measured, PlaneFigures, Rectangle, Unit};
use crate::quantile;

/// Side of blocks with independent means, px: wider than usual windows.
const BLOCK_PX: usize = 24;

/// Figures in the unit of the map.
#[derive(Clone, PartialEq, Debug)]
pub struct RegionFigures {
    pub unit: Unit,
    pub region: Rectangle,
    pub pixels: usize,
    /// Share of the region's pixels with a depth.
    pub fill_rate: f64,
    /// `None` without any depth, as the next five.
    pub mean: Option<f64>,
    /// From block means, because neighbouring depths share windows. `None` with fewer than four blocks.
    pub standard_error: Option<f64>,
    pub median: Option<f64>,
    pub standard_deviation: Option<f64>,
    pub range: Option<[f64; 2]>,
    /// Root mean square of the predicted deviations.
    pub predicted_deviation: Option<f64>,
    pub plane: Option<PlaneFigures>,
}

impl Serialize for RegionFigures {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        let mut to = Entries::new(to.serialize_map(None)?, self.unit);
        to.field("unit", &self.unit)?;
        to.field("region", &self.region)?;
        to.field("pixels", &self.pixels)?;
        to.field("fill_rate", &self.fill_rate)?;
        to.length("mean", self.mean)?;
        to.length("standard_error", self.standard_error)?;
        to.length("median", self.median)?;
        to.length("standard_deviation", self.standard_deviation)?;
        to.length("range", self.range)?;
        to.length("predicted_deviation", self.predicted_deviation)?;
        if let Some(plane) = &self.plane {
            to.field("plane", plane)?;
        }
        to.end()
    }
}

pub fn region(map: &Measured, at: Rectangle) -> crate::Result<RegionFigures> {
    map.check(&at)?;
    let Rectangle { x, y, width, height } = at;
    let window = s![y..y + height, x..x + width];
    let depths: Vec<f64> =
        map.depth.slice(window).iter().filter(|z| z.is_finite()).map(|z| f64::from(*z)).collect();
    let count = depths.len() as f64;
    let some = !depths.is_empty();
    let mean = depths.iter().sum::<f64>() / count;
    let variance = depths.iter().map(|z| (z - mean).powi(2)).sum::<f64>() / count;
    let predicted = map.deviation.as_ref().and_then(|deviation| {
        let squares: Vec<f64> =
            deviation.slice(window).iter().filter(|d| d.is_finite()).map(|d| f64::from(*d).powi(2)).collect();
        (!squares.is_empty()).then(|| (squares.iter().sum::<f64>() / squares.len() as f64).sqrt())
    });
    Ok(RegionFigures {
        unit: map.unit,
        region: at,
        pixels: depths.len(),
        fill_rate: count / (width * height) as f64,
        mean: some.then_some(mean),
        standard_error: standard_error(map.depth.slice(window)),
        median: quantile::of_map(map.depth.slice(window), 0.5),
        standard_deviation: some.then(|| variance.sqrt()),
        range: some
            .then(|| depths.iter().fold([f64::MAX, f64::MIN], |[low, high], z| [low.min(*z), high.max(*z)])),
        predicted_deviation: predicted,
        plane: PlaneFigures::of(map, at),
    })
}

fn standard_error(depths: ArrayView2<f32>) -> Option<f64> {
    let mean_of = |block: ArrayView2<f32>| {
        let finite: Vec<f64> = block.iter().filter(|z| z.is_finite()).map(|z| f64::from(*z)).collect();
        (2 * finite.len() > block.len()).then(|| finite.iter().sum::<f64>() / finite.len() as f64)
    };
    let means: Vec<f64> = depths.exact_chunks((BLOCK_PX, BLOCK_PX)).into_iter().filter_map(mean_of).collect();
    let n = means.len() as f64;
    let mean = means.iter().sum::<f64>() / n;
    let variance = means.iter().map(|m| (m - mean).powi(2)).sum::<f64>() / (n - 1.0);
    (means.len() >= 4).then(|| (variance / n).sqrt())
}

#[cfg(test)]
mod tests {
    use farnear_files::mesh::{Lateral, Projection};
    use ndarray::Array2;

    use super::*;

    fn slanted() -> Measured {
        let mut depth_mm = Array2::from_shape_fn((40, 60), |(y, x)| 900.0 + 0.05 * x as f32 + 0.0 * y as f32);
        depth_mm[[0, 0]] = f32::NAN;
        let projection = Projection { centre_mm: 50.0, distance_mm: 50.0, pixel_um: 7.4, axis_px: None };
        Measured {
            deviation: Some(Array2::from_elem((40, 60), 0.5)),
            depth: depth_mm,
            unit: Unit::Mm,
            lateral: Lateral::Lens(projection),
            remarks: Vec::new(),
        }
    }

    #[test]
    fn a_slant_is_measured() {
        let found = region(&slanted(), Rectangle { x: 0, y: 0, width: 60, height: 40 }).unwrap();
        assert_eq!(found.pixels, 2399);
        assert!((found.fill_rate - 2399.0 / 2400.0).abs() < 1e-12);
        assert_eq!(found.predicted_deviation, Some(0.5));
        // Two blocks of 24 pixels are too few for a standard error.
        assert_eq!(found.standard_error, None);
        assert!((found.median.unwrap() - 901.5).abs() < 0.06, "{found:?}");
        // A pixel covers 7.4 um * 17 = 0.126 mm at 900 mm, so 0.05 mm per pixel is a slope of 0.397.
        let plane = found.plane.unwrap().plane;
        assert!((plane.slope_x - 0.397).abs() < 0.002, "{plane:?}");
        assert!(plane.rms_mm < 0.01, "{plane:?}");
    }

    #[test]
    fn the_median_of_an_even_number_of_depths_is_between_the_middle_two() {
        let depth = ndarray::array![[901.0, 907.0, f32::NAN, 902.0, 905.0]];
        let map = Measured { depth, deviation: None, ..slanted() };
        assert_eq!(region(&map, map.all()).unwrap().median, Some(903.5));
    }

    #[test]
    fn figures_have_the_unit_of_the_map_in_their_names() {
        let map = |unit, lateral| Measured { unit, lateral, deviation: None, ..slanted() };
        let at = Rectangle { x: 1, y: 0, width: 59, height: 40 };
        let found = |map: &Measured| serde_json::to_value(region(map, at).unwrap()).unwrap();
        let stage = found(&map(Unit::Um, Lateral::Pixel(0.1)));
        assert!(stage["mean_um"].is_number() && stage["unit"] == "um", "{stage}");
        assert!((stage["plane"]["slope_x"].as_f64().unwrap() - 0.5).abs() < 1e-3, "{stage}");
        let images = found(&map(Unit::Image, Lateral::Unknown));
        assert!(images["median_images"].is_number() && images["plane"]["tilt_deg"].is_null(), "{images}");
        let slope = images["plane"]["slope_x_images_per_px"].as_f64().unwrap();
        assert!((slope - 0.05).abs() < 1e-4, "{images}");
        let text = images.to_string() + &stage.to_string();
        assert!(!text.contains("_mm"), "{text}");
    }

    #[test]
    fn a_region_without_depth_has_no_figures_and_one_outside_is_refused() {
        let map = slanted();
        let found = region(&map, Rectangle { x: 0, y: 0, width: 1, height: 1 }).unwrap();
        assert_eq!((found.pixels, found.mean, found.plane), (0, None, None));
        for (x, width) in [(59, 2), (0, 0), (usize::MAX, 2)] {
            assert!(region(&map, Rectangle { x, y: 0, width, height: 1 }).unwrap_err().is_usage());
        }
    }
}

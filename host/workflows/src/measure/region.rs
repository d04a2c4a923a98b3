//! Figures of a part of a map.

use ndarray::s;
use serde::Serialize;

use super::{Measured, Plane, Rectangle, fit};
use crate::error::Result;

/// Figures of a region.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct RegionFigures {
    /// Which region.
    pub region: Rectangle,
    /// Pixels with a depth.
    pub pixels: usize,
    /// Their part of all pixels of the region.
    pub fill_rate: f64,
    /// Mean depth; none where there is no depth at all, as the next three.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mean_mm: Option<f64>,
    /// Standard deviation of the depths.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub standard_deviation_mm: Option<f64>,
    /// Smallest and largest.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub range_mm: Option<[f64; 2]>,
    /// Root mean square of the deviations predicted for each pixel.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub predicted_deviation_mm: Option<f64>,
    /// The plane through the region.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub plane: Option<Plane>,
}

/// Looks at a region.
///
/// # Errors
/// [`crate::WorkflowError::Parameter`] outside the map.
pub fn region(map: &Measured, at: Rectangle) -> Result<RegionFigures> {
    map.check(&at)?;
    let Rectangle { x, y, width, height } = at;
    let window = s![y..y + height, x..x + width];
    let depths: Vec<f64> =
        map.depth_mm.slice(window).iter().filter(|z| z.is_finite()).map(|z| f64::from(*z)).collect();
    let count = depths.len() as f64;
    let some = !depths.is_empty();
    let mean = depths.iter().sum::<f64>() / count;
    let variance = depths.iter().map(|z| (z - mean).powi(2)).sum::<f64>() / count;
    let predicted = map.deviation_mm.as_ref().and_then(|deviation| {
        let squares: Vec<f64> =
            deviation.slice(window).iter().filter(|d| d.is_finite()).map(|d| f64::from(*d).powi(2)).collect();
        (!squares.is_empty()).then(|| (squares.iter().sum::<f64>() / squares.len() as f64).sqrt())
    });
    let points: Vec<_> = (y..y + height)
        .flat_map(|row| (x..x + width).filter_map(move |column| map.point_mm(column, row)))
        .collect();
    Ok(RegionFigures {
        region: at,
        pixels: depths.len(),
        fill_rate: count / (width * height) as f64,
        mean_mm: some.then_some(mean),
        standard_deviation_mm: some.then(|| variance.sqrt()),
        range_mm: some
            .then(|| depths.iter().fold([f64::MAX, f64::MIN], |[low, high], z| [low.min(*z), high.max(*z)])),
        predicted_deviation_mm: predicted,
        plane: fit(&points),
    })
}

#[cfg(test)]
mod tests {
    use farnear_files::mesh::Projection;
    use ndarray::Array2;

    use super::*;

    fn slanted() -> Measured {
        let mut depth_mm = Array2::from_shape_fn((40, 60), |(y, x)| 900.0 + 0.05 * x as f32 + 0.0 * y as f32);
        depth_mm[[0, 0]] = f32::NAN;
        let projection = Projection { focal_length_mm: 50.0, pixel_um: 7.4 };
        Measured { deviation_mm: Some(Array2::from_elem((40, 60), 0.5)), depth_mm, projection }
    }

    #[test]
    fn a_slant_is_measured() {
        let found = region(&slanted(), Rectangle { x: 0, y: 0, width: 60, height: 40 }).unwrap();
        assert_eq!(found.pixels, 2399);
        assert!((found.fill_rate - 2399.0 / 2400.0).abs() < 1e-12);
        assert_eq!(found.predicted_deviation_mm, Some(0.5));
        // A pixel sees 7.4 um * 17 = 0.126 mm at 900 mm, so 0.05 mm per pixel is a slope of 0.397.
        let plane = found.plane.unwrap();
        assert!((plane.slope_x - 0.397).abs() < 0.002, "{plane:?}");
        assert!(plane.rms_mm < 0.01, "{plane:?}");
    }

    #[test]
    fn a_region_without_depth_has_no_figures_and_one_outside_is_refused() {
        let map = slanted();
        let found = region(&map, Rectangle { x: 0, y: 0, width: 1, height: 1 }).unwrap();
        assert_eq!((found.pixels, found.mean_mm, found.plane), (0, None, None));
        for (x, width) in [(59, 2), (0, 0), (usize::MAX, 2)] {
            assert!(region(&map, Rectangle { x, y: 0, width, height: 1 }).unwrap_err().is_usage());
        }
    }
}

//! Height maps and pictures, stretched over the image.

use ndarray::Array2;

use crate::scene_error::SceneError;

/// A height field: depths in mm, rows from the top.
#[derive(Debug, Clone, PartialEq)]
pub struct HeightMap(Array2<f32>);

impl HeightMap {
    /// Accepts depths in mm; fails for an empty map or invalid values.
    pub fn new(depth_mm: Array2<f32>) -> Result<Self, SceneError> {
        check("depth", &depth_mm, "a finite depth in mm above 0", |value| value > 0.0)?;
        Ok(Self(depth_mm))
    }

    pub(crate) fn depth_mm(&self, x: f64, y: f64) -> f64 {
        sample(&self.0, x, y)
    }
}

/// A surface picture: radiance scaled to a mean of 1.
#[derive(Debug, Clone, PartialEq)]
pub struct Picture(Array2<f32>);

impl Picture {
    /// Accepts radiances >= 0 in any unit; fails for an empty, invalid or black picture.
    pub fn new(mut radiance: Array2<f32>) -> Result<Self, SceneError> {
        check("texture", &radiance, "a finite radiance of 0 or more", |value| value >= 0.0)?;
        let mean = radiance.iter().map(|&value| f64::from(value)).sum::<f64>() / radiance.len() as f64;
        if mean <= 0.0 {
            return Err(SceneError::Black);
        }
        radiance.mapv_inplace(|value| (f64::from(value) / mean) as f32);
        Ok(Self(radiance))
    }

    pub(crate) fn radiance(&self, x: f64, y: f64) -> f64 {
        sample(&self.0, x, y)
    }
}

fn check(
    what: &'static str,
    map: &Array2<f32>,
    expected: &'static str,
    good: impl Fn(f32) -> bool,
) -> Result<(), SceneError> {
    let (height, width) = map.dim();
    if map.is_empty() {
        return Err(SceneError::Empty { what, height, width });
    }
    match map.indexed_iter().find(|&(_, &value)| !(value.is_finite() && good(value))) {
        None => Ok(()),
        Some(((row, column), &value)) => Err(SceneError::MapValue { what, value, row, column, expected }),
    }
}

fn sample(map: &Array2<f32>, x: f64, y: f64) -> f64 {
    let (height, width) = map.dim();
    let taps = |position: f64, size: usize| {
        let position = position * size as f64 - 0.5;
        let low = position.floor();
        let index = |i: f64| {
            // Mirrored at the outer edges: ... 1 0 | 0 1 2 ... n-1 | n-1 n-2 ...
            let folded = (i as i64).rem_euclid(2 * size as i64) as usize;
            if folded < size { folded } else { 2 * size - 1 - folded }
        };
        (index(low), index(low + 1.0), position - low)
    };
    let (left, right, fx) = taps(x, width);
    let (top, bottom, fy) = taps(y, height);
    let at = |row: usize, column: usize| f64::from(map[[row, column]]);
    let upper = at(top, left) + fx * (at(top, right) - at(top, left));
    let lower = at(bottom, left) + fx * (at(bottom, right) - at(bottom, left));
    upper + fy * (lower - upper)
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::array;

    #[test]
    fn a_map_passes_through_its_pixel_centres_and_is_mirrored_outside() {
        let map = HeightMap::new(array![[1.0, 2.0, 4.0], [3.0, 5.0, 9.0]]).unwrap();
        assert_eq!(map.depth_mm(0.5 / 3.0, 0.25), 1.0);
        assert_eq!(map.depth_mm(2.5 / 3.0, 0.75), 9.0);
        assert!((map.depth_mm(2.0 / 3.0, 0.25) - 3.0).abs() < 1e-12); // half-way between 2 and 4
        assert!((map.depth_mm(-0.5 / 3.0, 0.25) - 1.0).abs() < 1e-12);
        assert!((map.depth_mm(3.5 / 3.0, 1.25) - 9.0).abs() < 1e-12);
    }

    #[test]
    fn a_picture_is_scaled_to_mean_one() {
        let picture = Picture::new(array![[50.0, 150.0]]).unwrap();
        assert_eq!((picture.radiance(0.25, 0.5), picture.radiance(0.75, 0.5)), (0.5, 1.5));
    }

    #[test]
    fn rejects_invalid_maps_by_name() {
        let text = |result: Result<HeightMap, SceneError>| result.unwrap_err().to_string();
        assert!(text(HeightMap::new(array![[900.0, f32::NAN]])).contains("holds NaN at row 0, column 1"));
        assert!(text(HeightMap::new(array![[900.0], [-2.0]])).contains("holds -2 at row 1, column 0"));
        assert!(text(HeightMap::new(Array2::zeros((0, 4)))).contains("0 x 4"));
        assert!(Picture::new(Array2::zeros((2, 2))).unwrap_err().to_string().contains("black"));
    }
}

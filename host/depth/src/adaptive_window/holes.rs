//! Pixels without a value in a tile.

use ndarray::{Array2, ArrayView2, s};

use super::rows::Place;
use crate::{border::reflect, metrics::dilate_square};

/// Surroundings of pixels without a value.
pub(super) struct Holes {
    /// Pixels of the tile whose smallest window contains one: they have no depth.
    pub own: Array2<bool>,
    /// Pixels, with the halo, whose filters contain one; larger windows leave them out.
    pub of_filters: Array2<bool>,
}

impl Holes {
    /// `None` without holes. `halo`: rows and columns around the tile; filters reach `reach` px, the smallest window has
    /// `side` px.
    pub fn of(
        [far, near]: [ArrayView2<'_, f32>; 2],
        place: Place,
        halo: [usize; 2],
        [reach, side]: [usize; 2],
    ) -> Option<Self> {
        let (height, width) = far.dim();
        // Reflection adds no hole that is not within the halo of the image itself.
        let [rows, columns] =
            [(place.top, place.rows, halo[0], height), (place.left, place.columns, halo[1], width)]
                .map(|(first, count, halo, n)| first.saturating_sub(halo)..(first + count + halo).min(n));
        let whole = [far, near].iter().all(|image| {
            let rows = image.slice(s![rows.clone(), columns.clone()]);
            rows.rows()
                .into_iter()
                .all(|row| row.iter().map(|v| u32::from(v.is_finite())).sum::<u32>() as usize == row.len())
        });
        if whole {
            return None;
        }
        let holes =
            Array2::from_shape_fn((place.rows + 2 * halo[0], place.columns + 2 * halo[1]), |(y, x)| {
                let y = reflect((place.top + y) as isize - halo[0] as isize, height);
                let x = reflect((place.left + x) as isize - halo[1] as isize, width);
                !(far[(y, x)].is_finite() && near[(y, x)].is_finite())
            });
        holes.iter().any(|hole| *hole).then(|| {
            let wide = dilate_square(&holes, reach + side / 2);
            let own = s![halo[0]..halo[0] + place.rows, halo[1]..halo[1] + place.columns];
            Self { own: wide.slice(own).to_owned(), of_filters: dilate_square(&holes, reach) }
        })
    }
}

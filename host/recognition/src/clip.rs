//! Clips: one performance from one or more views, as numbers per frame.

use crate::embedding::descriptor::{
    ANGLES, CELL_PIXELS, CELLS, CELLS_ACROSS, CentroidDistance, CoarseSilhouette, Scaling, described,
};
use farnear_silhouettes::mask::Mask;
use farnear_silhouettes::silhouette::{
    capsule::Capsule,
    raster::Point,
    view::{Canvas, View, draw, extent},
};
use ndarray::{Array2, ArrayViewMut1, Axis};
use rayon::prelude::*;

/// Box numbers per frame: height, width, centroid x and y, pixels.
pub const BOX_NUMBERS: usize = 4;

/// One view of one performance.
#[derive(Clone, Debug, PartialEq)]
pub struct Track {
    /// Centroid distances, one frame per row.
    pub descriptors: Array2<f32>,
    /// Coarse silhouettes, one frame per row.
    pub cells: Array2<u8>,
    /// Height, width, centroid x and y in pixels per frame; `None` for cropped silhouettes.
    pub boxes: Option<Array2<f32>>,
    /// Number of skipped empty masks.
    pub empty_frames: usize,
}

/// One performance of an activity by a person.
#[derive(Clone, Debug, PartialEq)]
pub struct Clip {
    /// Subject name; clips of a subject are never split between training and test.
    pub subject: String,
    /// Activity name, the answer of recognition.
    pub activity: String,
    /// Views, equal in number and order for all clips of a set.
    pub views: Vec<Track>,
}

impl Track {
    /// Describes the masks of a clip. With `full_frames` they are camera frames and the box's motion is kept.
    pub fn from_masks(masks: &[Mask], scaling: Scaling, full_frames: bool) -> Self {
        let found: Vec<Option<(CentroidDistance, CoarseSilhouette, [f32; BOX_NUMBERS])>> = masks
            .par_iter()
            .map(|mask| {
                let (descriptor, cells, bounds) = described(mask.view(), scaling).ok()?;
                let (mut n, mut sx, mut sy) = (0.0_f64, 0.0, 0.0);
                for (y, row) in mask.axis_iter(Axis(0)).enumerate().take(bounds.bottom).skip(bounds.top) {
                    for x in (bounds.left..bounds.right).filter(|&x| row[x]) {
                        n += 1.0;
                        sx += x as f64;
                        sy += y as f64;
                    }
                }
                let motion =
                    [bounds.height() as f32, bounds.width() as f32, (sx / n) as f32, (sy / n) as f32];
                Some((descriptor, cells, motion))
            })
            .collect();
        let kept: Vec<_> = found.iter().flatten().collect();
        let descriptors = Array2::from_shape_fn((kept.len(), ANGLES), |(f, a)| kept[f].0[a]);
        let cells = Array2::from_shape_fn((kept.len(), CELLS), |(f, k)| kept[f].1[k]);
        let boxes =
            full_frames.then(|| Array2::from_shape_fn((kept.len(), BOX_NUMBERS), |(f, k)| kept[f].2[k]));
        Self { descriptors, cells, boxes, empty_frames: masks.len() - kept.len() }
    }

    /// Draws capsule bodies on one canvas (10 mm per pixel); the track is empty without a finite point.
    pub fn from_bodies(bodies: &[Vec<Capsule>], view: &View, scaling: Scaling) -> Self {
        const MM_PER_PX: f64 = 10.0;
        let reach: Vec<Point> = bodies.iter().flat_map(|body| extent(body, view)).collect();
        let masks: Vec<Mask> = match Canvas::fitting(&reach, MM_PER_PX, 2) {
            Some(canvas) => bodies.iter().map(|body| draw(body, view, &canvas)).collect(),
            None => Vec::new(),
        };
        Self::from_masks(&masks, scaling, true)
    }

    /// Number of frames with a silhouette.
    pub fn frames(&self) -> usize {
        self.descriptors.nrows()
    }

    /// Input of principal components: centroid distances and, if `row` has room, the coarse silhouette,
    /// weighted to vary equally over everyday activities.
    pub(super) fn seen(&self, frame: usize, row: ArrayViewMut1<f32>) {
        const WEIGHT: f32 = 0.35 / CELL_PIXELS as f32;
        let (mut distances, mut cells) = row.split_at(Axis(0), ANGLES);
        distances.assign(&self.descriptors.row(frame));
        if !cells.is_empty() {
            cells.zip_mut_with(&self.cells.row(frame), |out, &cell| *out = WEIGHT * f32::from(cell));
        }
    }

    /// Mirrored track: angle a becomes 180 - a; columns and x are reversed.
    pub fn mirrored(&self) -> Self {
        let angles: Vec<usize> = (0..ANGLES).map(|a| (ANGLES + ANGLES / 2 - a) % ANGLES).collect();
        let cells: Vec<usize> = (0..CELLS)
            .map(|k| k / CELLS_ACROSS * CELLS_ACROSS + CELLS_ACROSS - 1 - k % CELLS_ACROSS)
            .collect();
        let boxes = self.boxes.as_ref().map(|boxes| {
            let mut boxes = boxes.clone();
            boxes.column_mut(2).mapv_inplace(|x| -x);
            boxes
        });
        Self {
            descriptors: self.descriptors.select(Axis(1), &angles),
            cells: self.cells.select(Axis(1), &cells),
            boxes,
            empty_frames: self.empty_frames,
        }
    }

    /// Frames selected by index in this order (shuffled, slowed, sped up, cut).
    pub fn select(&self, frames: &[usize]) -> Self {
        Self {
            descriptors: self.descriptors.select(Axis(0), frames),
            cells: self.cells.select(Axis(0), frames),
            boxes: self.boxes.as_ref().map(|boxes| boxes.select(Axis(0), frames)),
            empty_frames: self.empty_frames,
        }
    }
}

impl Clip {
    /// Mirrored performance: view v becomes the mirror of view n - v. Several views are assumed at equal steps all
    /// round, the first from the front; for others the mirrored views do not belong to one performance.
    pub fn mirrored(&self) -> Self {
        let n = self.views.len();
        let views = (0..n).map(|v| self.views[(n - v) % n].mirrored()).collect();
        Self { subject: self.subject.clone(), activity: self.activity.clone(), views }
    }

    /// Selects frames of all views; `choose` maps a track's length to frame indices.
    pub fn select(&self, choose: impl Fn(usize) -> Vec<usize>) -> Self {
        let views = self.views.iter().map(|view| view.select(&choose(view.frames()))).collect();
        Self { subject: self.subject.clone(), activity: self.activity.clone(), views }
    }

    /// Windows of `length` frames, half overlapping; a shorter clip is one. Cuts views to the shortest.
    pub fn windows(&self, length: usize) -> Vec<Self> {
        let length = length.max(1);
        let frames = self.views.iter().map(Track::frames).min().unwrap_or(0);
        let step = length.div_ceil(2);
        let last = frames.saturating_sub(length);
        let starts = (0..last).step_by(step).chain([last]);
        starts.map(|from| self.select(|_| (from..(from + length).min(frames)).collect())).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mirrored_track_is_the_track_of_mirrored_masks() {
        // As large as the frame, so that scaling takes the same pixels of both.
        let mask =
            Mask::from_shape_fn((100, 60), |(y, x)| (20..40).contains(&x) || (y < 30 && x > 35) || y > 95);
        let turned = Mask::from_shape_fn((100, 60), |(y, x)| mask[[y, 59 - x]]);
        let of = |mask: &Mask| Track::from_masks(std::slice::from_ref(mask), Scaling::KeepAspect, true);
        let (mirrored, expected) = (of(&mask).mirrored(), of(&turned));
        assert_eq!(mirrored.cells, expected.cells);
        assert_ne!(mirrored.cells, of(&mask).cells);
        // A ray may just hit or miss a corner: all but a few of 360.
        let off =
            mirrored.descriptors.iter().zip(&expected.descriptors).filter(|(a, b)| (*a - *b).abs() > 0.011);
        assert!(off.count() < 8, "a step of the march and a pixel's half");
        let (found, expected) = (mirrored.boxes.expect("full frames"), expected.boxes.expect("full frames"));
        assert_eq!(found.row(0).to_vec()[..2], expected.row(0).to_vec()[..2]);
        assert!((found[[0, 2]] + 59.0 - expected[[0, 2]]).abs() < 1e-3, "x turns round");
        assert!((found[[0, 3]] - expected[[0, 3]]).abs() < 1e-3);
    }
}

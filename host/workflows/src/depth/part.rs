//! Depth of a part of the images.

use farnear_depth::{optics::binned_place, prepare::CameraFrames};
use ndarray::{Array2, s};
use serde::{Deserialize, Serialize};

use super::pair::Pair;
use crate::{
    error::{Result, WorkflowError},
    measure::Rectangle,
};

/// Margin around the part, px: more than two windows of 21 px and a chain of operators.
pub(super) const AROUND_PX: usize = 40;

/// Position of a map in its images; recorded in `depth.toml`.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct Part {
    /// Left column of the map in the images.
    pub x: usize,
    pub y: usize,
    pub image_width: usize,
    pub image_height: usize,
    /// Pixels of the images per side of a pixel of the map.
    #[serde(default = "one", skip_serializing_if = "is_one")]
    pub bin: usize,
}

fn one() -> usize {
    1
}

fn is_one(bin: &usize) -> bool {
    *bin == 1
}

impl Part {
    /// Images of (height, width) of which averaging leaves out columns or rows at the end.
    pub fn of_bins((height, width): (usize, usize), bin: usize) -> Option<Self> {
        let is_less = !width.is_multiple_of(bin) || !height.is_multiple_of(bin);
        is_less.then_some(Self { x: 0, y: 0, image_width: width, image_height: height, bin })
    }

    /// Whether a map of (height, width) can be this part.
    pub fn fits(&self, (height, width): (usize, usize)) -> bool {
        let lies_within = |begin: usize, size: usize, all: usize| {
            size.checked_mul(self.bin).and_then(|size| begin.checked_add(size)).is_some_and(|end| end <= all)
        };
        lies_within(self.x, width, self.image_width) && lies_within(self.y, height, self.image_height)
    }

    /// Optical axis (centre of the images) in the map: column and row.
    pub fn axis_px(&self) -> [f64; 2] {
        let of = |size: usize, begin: usize| {
            binned_place(0.5 * (size as f64 - 1.0) - begin as f64, self.bin as f64)
        };
        [of(self.image_width, self.x), of(self.image_height, self.y)]
    }
}

#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Cut {
    wanted: Rectangle,
    seen: Rectangle,
    image: (usize, usize),
}

impl Cut {
    /// Cuts a part with a margin. Without `around` keeps the whole images: distortion depends on the position.
    pub fn out_of(pair: &mut Pair, wanted: Rectangle, around: Option<usize>) -> Result<Self> {
        let image @ (height, width) = pair.far.dim();
        wanted.check_within(image)?;
        let along = |begin: usize, size: usize, all: usize| {
            let around = around.unwrap_or(all);
            let from = begin.saturating_sub(around);
            (from, (begin + size + around).min(all) - from)
        };
        let (x, seen_width) = along(wanted.x, wanted.width, width);
        let (y, seen_height) = along(wanted.y, wanted.height, height);
        let cut = Self { wanted, seen: Rectangle { x, y, width: seen_width, height: seen_height }, image };
        if pair.near.dim() == image {
            for image in [&mut pair.far, &mut pair.near] {
                *image = of(image, cut.seen);
            }
        }
        Ok(cut)
    }

    pub fn frames(&self, frames: &CameraFrames) -> Result<CameraFrames> {
        let (height, width) = frames.dark().dim();
        if (height, width) != self.image {
            let of = format!("{width}x{height} px, the images have {}x{}", self.image.1, self.image.0);
            return Err(WorkflowError::parameter("camera", of, "frames of the images' size"));
        }
        let Rectangle { x, y, width, height } = self.seen;
        let place = s![y..y + height, x..x + width];
        let (dark, response) =
            (frames.dark().slice(place).to_owned(), frames.response().slice(place).to_owned());
        let parts = CameraFrames::new(dark, response, frames.bad_pixels().slice(place).to_owned());
        parts.map_err(|error| WorkflowError::parameter("camera", "frames", error.to_string()))
    }

    pub fn wanted<T: Clone>(&self, map: &mut Array2<T>) {
        if !map.is_empty() {
            let Rectangle { x, y, width, height } = self.wanted;
            *map = of(map, Rectangle { x: x - self.seen.x, y: y - self.seen.y, width, height });
        }
    }

    pub fn part(&self) -> Part {
        let Rectangle { x, y, .. } = self.wanted;
        Part { x, y, image_width: self.image.1, image_height: self.image.0, bin: 1 }
    }
}

fn of<T: Clone>(map: &Array2<T>, Rectangle { x, y, width, height }: Rectangle) -> Array2<T> {
    map.slice(s![y..y + height, x..x + width]).to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_axis_of_averaged_images_is_their_middle() {
        assert_eq!(Part::of_bins((480, 640), 4), None);
        // Column 321 is the middle of 643; 160 averaged columns have theirs at 79.5.
        let part = Part::of_bins((480, 643), 4).unwrap();
        assert_eq!(part.axis_px(), [79.875, 59.5]);
        assert!(part.fits((120, 160)) && !part.fits((120, 161)));
        assert!(!Part { x: usize::MAX, ..part }.fits((120, 160)));
        let kept: Part = toml::from_str(&toml::to_string(&part).unwrap()).unwrap();
        assert_eq!(kept, part);
        let whole: Part = toml::from_str("x = 5\ny = 0\nimage_width = 9\nimage_height = 9\n").unwrap();
        assert_eq!((whole.bin, whole.axis_px()), (1, [-1.0, 4.0]));
    }
}

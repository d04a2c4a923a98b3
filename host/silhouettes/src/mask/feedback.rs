//! Feedback from people to the background, which would learn a motionless person within seconds. A region that entered
//! over the picture's edge or walked is a person for as long as it exists. A region that appears and never moves is
//! furniture, a change of light, or a hole left by a person who was part of the background; it is learned. The outline
//! of a hole is sharper in the background than in the frame. A hole shows the background, which is learned at once.

use ndarray::ArrayView3;

use super::{BoundingBox, Mask, bits::BitMask, people::Person};
use crate::background::Frame;

/// Largest step per frame of a standing person, in heights.
const STANDING: f64 = 0.02;
/// Frames of standing after which a person has stopped moving.
const STOPPED_FRAMES: u32 = 25;
/// Frames between two checks of a standing region's outline.
const OUTLINE_FRAMES: u32 = 50;
/// Distance from the first place after which a region has walked, in heights.
const WALKED: f64 = 0.2;
const REMEMBERED_FRAMES: u32 = 10;
/// Margin around people that is not learned: picture height over this.
const MARGIN: usize = 60;
/// Ratio of the outline's sharpness in background and frame above which a region is a hole.
const HOLE: f64 = 1.3;
/// Distance of the compared sides from the outline.
const ASIDE_PX: isize = 3;

#[derive(Clone, Debug)]
struct Track {
    bounds: BoundingBox,
    middle: (f64, f64),
    origin: (f64, f64),
    walked: bool,
    still_frames: u32,
    unseen_frames: u32,
}

/// Follows regions and decides where nothing is learned.
#[derive(Clone, Debug)]
pub struct Feedback {
    size: (usize, usize),
    tracks: Vec<Track>,
    held: Option<Mask>,
}

impl Feedback {
    #[must_use]
    pub fn new(size: (usize, usize)) -> Self {
        Self { size, tracks: Vec::new(), held: None }
    }

    /// Pixels excluded from learning in the next frame; `None` without people.
    #[must_use]
    pub fn held(&self) -> Option<&Mask> {
        self.held.as_ref()
    }

    pub fn forget(&mut self) {
        self.tracks.clear();
        self.held = None;
    }

    #[must_use]
    pub fn stopped(&self, bounds: BoundingBox) -> bool {
        let track = self.tracks.iter().max_by_key(|track| shared(track.bounds, bounds));
        track.is_some_and(|track| {
            shared(track.bounds, bounds) > 0 && track.walked && track.still_frames >= STOPPED_FRAMES
        })
    }

    /// Adds the people of a frame and returns the pixels of holes, if any; `background` is the empty scene for the
    /// comparison of outlines.
    pub fn follow(
        &mut self,
        people: &[Person],
        frame: Frame<'_>,
        background: impl Fn() -> ndarray::Array3<u8>,
    ) -> Option<Mask> {
        let mut order: Vec<&Person> = people.iter().collect();
        order.sort_by_key(|person| std::cmp::Reverse(person.area));
        let mut tracks = Vec::with_capacity(order.len());
        let size = self.size;
        let (mut held, mut holes) = (None, None);
        let paint = |person: &Person, mask: &mut Option<Mask>| {
            let mask = mask.get_or_insert_with(|| Mask::from_elem(size, false));
            person.fragments.iter().for_each(|fragment| fragment.paint(mask, true));
        };
        for person in order {
            let mut track = self.taken(person.bounds).unwrap_or_else(|| Track {
                bounds: person.bounds,
                middle: person.centroid(),
                origin: person.centroid(),
                walked: false,
                still_frames: 0,
                unseen_frames: 0,
            });
            let middle = person.centroid();
            let height = person.bounds.height() as f64;
            let step = (middle.0 - track.middle.0).hypot(middle.1 - track.middle.1);
            track.still_frames =
                if step <= STANDING * height { track.still_frames.saturating_add(1) } else { 0 };
            let way = (middle.0 - track.origin.0).hypot(middle.1 - track.origin.1);
            track.walked |= way >= WALKED * height || person.bounds.touches_edge(self.size);
            (track.bounds, track.middle, track.unseen_frames) = (person.bounds, middle, 0);
            if track.still_frames % OUTLINE_FRAMES == STOPPED_FRAMES {
                let mask = person.mask(self.size);
                let empty = background();
                if sharpness(&mask, Frame::Rgb(empty.view())) > HOLE * sharpness(&mask, frame) {
                    (track.walked, track.origin) = (false, middle);
                    paint(person, &mut holes);
                }
            }
            if track.walked {
                paint(person, &mut held);
            }
            tracks.push(track);
        }
        // Briefly undetected people keep their last place.
        for mut track in self.tracks.drain(..) {
            track.unseen_frames += 1;
            if track.unseen_frames <= REMEMBERED_FRAMES && track.walked {
                tracks.push(track);
            }
        }
        self.tracks = tracks;
        let margin = (self.size.0 / MARGIN).max(2);
        let widened = |mask: Mask| BitMask::pack(mask.view()).dilated(margin).unpack();
        self.held = held.map(widened);
        let mut holes = holes.map(widened);
        if let (Some(holes), Some(held)) = (&mut holes, &self.held) {
            holes.zip_mut_with(held, |hole, held| *hole &= !held);
        }
        holes
    }

    fn taken(&mut self, bounds: BoundingBox) -> Option<Track> {
        let best = (0..self.tracks.len()).max_by_key(|&index| shared(self.tracks[index].bounds, bounds))?;
        (shared(self.tracks[best].bounds, bounds) > 0).then(|| self.tracks.swap_remove(best))
    }
}

fn shared(a: BoundingBox, b: BoundingBox) -> usize {
    let rows = a.bottom.min(b.bottom).saturating_sub(a.top.max(b.top));
    rows * a.right.min(b.right).saturating_sub(a.left.max(b.left))
}

/// Mean difference between the two sides of a mask's outline, grey levels.
fn sharpness(mask: &Mask, frame: Frame<'_>) -> f64 {
    let (height, width) = mask.dim();
    let level = |row: usize, column: usize| -> f64 {
        match frame {
            Frame::Grey(pixels) => f64::from(pixels[[row, column]]),
            Frame::Rgb(pixels) => mean(pixels, row, column),
        }
    };
    let (mut sum, mut count) = (0.0, 0_usize);
    let inside = |row: isize, column: isize| {
        (0..height as isize).contains(&row) && (0..width as isize).contains(&column)
    };
    for ((row, column), _) in mask.indexed_iter().filter(|(_, set)| **set) {
        for (down, right) in [(0, 1), (0, -1), (1, 0), (-1, 0)] {
            let at = |steps: isize| (row as isize + steps * down, column as isize + steps * right);
            let (next, outer, inner) = (at(1), at(ASIDE_PX), at(1 - ASIDE_PX));
            if !inside(outer.0, outer.1)
                || !inside(inner.0, inner.1)
                || mask[[next.0 as usize, next.1 as usize]]
            {
                continue;
            }
            let of = |(row, column): (isize, isize)| level(row as usize, column as usize);
            sum += (of(outer) - of(inner)).abs();
            count += 1;
        }
    }
    sum / count.max(1) as f64
}

fn mean(pixels: ArrayView3<'_, u8>, row: usize, column: usize) -> f64 {
    let channels = pixels.dim().2;
    (0..channels).map(|channel| f64::from(pixels[[row, column, channel]])).sum::<f64>() / channels as f64
}

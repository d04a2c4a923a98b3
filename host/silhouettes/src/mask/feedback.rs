//! Feedback from people to the background, which would learn a motionless person within seconds. A region that entered
//! over the picture's edge or walked is a person for as long as it exists. People who meet are one region, and people
//! again when they part. A region that appears and never moves, or grows to one side as a door that opens, is
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
/// Sides of a region's box within its height over this are in place.
const IN_PLACE: usize = 15;
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
    first: BoundingBox,
    middle: (f64, f64),
    origin: (f64, f64),
    walked: bool,
    /// Other people in the same region.
    hidden: usize,
    still_frames: u32,
    unseen_frames: u32,
}

impl Track {
    fn new(person: &Person, walked: bool) -> Self {
        Self {
            bounds: person.bounds,
            first: person.bounds,
            middle: person.centroid(),
            origin: person.centroid(),
            walked,
            hidden: 0,
            still_frames: 0,
            unseen_frames: 0,
        }
    }

    fn is_person(&self) -> bool {
        self.walked || self.hidden > 0
    }
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
            shared(track.bounds, bounds) > 0 && track.is_person() && track.still_frames >= STOPPED_FRAMES
        })
    }

    /// Those of a followed frame's people who entered or walked; all unless one of them is inside the picture.
    #[must_use]
    pub fn walkers(&self, people: Vec<Person>) -> Vec<Person> {
        let is_walker = |person: &Person| {
            self.tracks.iter().any(|track| track.is_person() && track.bounds == person.bounds)
        };
        let is_inside = |person: &Person| is_walker(person) && !person.bounds.touches_edge(self.size);
        if people.iter().any(is_inside) { people.into_iter().filter(is_walker).collect() } else { people }
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
        let size = self.size;
        let (mut held, mut holes) = (None, None);
        let paint = |person: &Person, mask: &mut Option<Mask>| {
            let mask = mask.get_or_insert_with(|| Mask::from_elem(size, false));
            person.fragments.iter().for_each(|fragment| fragment.paint(mask, true));
        };
        let (found, mut tracks) = self.assigned(&order);
        for (person, mut track) in order.into_iter().zip(found) {
            let middle = person.centroid();
            let height = person.bounds.height() as f64;
            let step = (middle.0 - track.middle.0).hypot(middle.1 - track.middle.1);
            track.still_frames =
                if step <= STANDING * height { track.still_frames.saturating_add(1) } else { 0 };
            let way = (middle.0 - track.origin.0).hypot(middle.1 - track.origin.1);
            let at_edge = person.bounds.touches_edge(self.size);
            let entered = track.first.touches_edge(self.size);
            let hinged = !at_edge && !entered && hinged(track.first, person.bounds);
            // Another person moves the middle of a region, too. A door and the person in it are one region.
            track.walked |= (way >= WALKED * height && !hinged && track.hidden == 0) || at_edge;
            track.walked &= !(hinged && track.still_frames >= STOPPED_FRAMES);
            (track.bounds, track.middle, track.unseen_frames) = (person.bounds, middle, 0);
            if track.still_frames % OUTLINE_FRAMES == STOPPED_FRAMES {
                let mask = person.mask(self.size);
                let empty = background();
                if sharpness(&mask, Frame::Rgb(empty.view())) > HOLE * sharpness(&mask, frame) {
                    (track.walked, track.hidden) = (false, 0);
                    (track.first, track.origin) = (person.bounds, middle);
                    paint(person, &mut holes);
                }
            }
            if track.is_person() {
                paint(person, &mut held);
            }
            tracks.push(track);
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

    /// The track of each person, with its last place, and those of briefly undetected people, who keep theirs. People
    /// whose place is in another's region are hidden there; a new region where people were hidden is one of them.
    fn assigned(&mut self, people: &[&Person]) -> (Vec<Track>, Vec<Track>) {
        let mut found: Vec<Track> = Vec::with_capacity(people.len());
        for person in people {
            let track = self.taken(person.bounds).unwrap_or_else(|| {
                let from = found
                    .iter_mut()
                    .find(|track| track.hidden > 0 && shared(track.bounds, person.bounds) > 0);
                Track::new(person, from.map(|track| track.hidden -= 1).is_some())
            });
            found.push(track);
        }
        let mut undetected = Vec::new();
        for mut track in self.tracks.drain(..).filter(Track::is_person) {
            track.unseen_frames += 1;
            match people.iter().position(|person| shared(person.bounds, track.bounds) > 0) {
                Some(index) => found[index].hidden += 1 + track.hidden,
                None if track.unseen_frames <= REMEMBERED_FRAMES => undetected.push(track),
                None => {}
            }
        }
        (found, undetected)
    }

    fn taken(&mut self, bounds: BoundingBox) -> Option<Track> {
        let best = (0..self.tracks.len()).max_by_key(|&index| shared(self.tracks[index].bounds, bounds))?;
        (shared(self.tracks[best].bounds, bounds) > 0).then(|| self.tracks.swap_remove(best))
    }
}

/// Whether the left or the right side moved and all others are in place: a door, a drawer or a curtain.
fn hinged(first: BoundingBox, now: BoundingBox) -> bool {
    let tolerance = (now.height() / IN_PLACE).max(2);
    let is_in_place = |a: usize, b: usize| a.abs_diff(b) <= tolerance;
    is_in_place(first.top, now.top)
        && is_in_place(first.bottom, now.bottom)
        && is_in_place(first.left, now.left) != is_in_place(first.right, now.right)
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

#[cfg(test)]
mod tests {
    use ndarray::{Array2, Array3, s};

    use super::*;
    use crate::mask::{people::people, subject::SubjectSettings};

    const SIZE: (usize, usize) = (100, 100);

    fn follow(feedback: &mut Feedback, boxes: &[(usize, usize)]) -> Vec<Person> {
        let mut mask = Mask::from_elem(SIZE, false);
        for &(left, right) in boxes {
            mask.slice_mut(s![20..80, left..right]).fill(true);
        }
        let people = people(mask.view(), &SubjectSettings::for_size(SIZE));
        let frame = Array2::zeros(SIZE);
        feedback.follow(&people, Frame::Grey(frame.view()), || Array3::zeros((SIZE.0, SIZE.1, 3)));
        people
    }

    #[test]
    fn a_door_that_opens_is_not_a_person() {
        let mut feedback = Feedback::new(SIZE);
        for step in 0..30 {
            follow(&mut feedback, &[(40, 43 + step)]);
        }
        assert!(feedback.held().is_none());
        // A person comes through it and walks on.
        let mut people = Vec::new();
        for step in 0..60 {
            let left = 30_usize.saturating_sub(step).max(5);
            people = follow(&mut feedback, &[(40, 72), (left, left + 12)]);
        }
        assert_eq!(people.len(), 2);
        let held = feedback.held().expect("the person");
        assert!(held[[50, 8]] && !held[[50, 60]]);
        let walkers = feedback.walkers(people);
        assert_eq!(walkers.iter().map(|person| person.bounds.left).collect::<Vec<_>>(), [5]);
    }

    #[test]
    fn a_standing_person_is_one_after_another_walked_past() {
        let mut feedback = Feedback::new(SIZE);
        for step in 0..40 {
            follow(&mut feedback, &[(step, step + 14)]);
        }
        for step in 0..90 {
            let left = 99_usize.saturating_sub(step);
            let people = follow(&mut feedback, &[(39, 53), (left, (left + 18).min(100))]);
            let held = feedback.held().expect("both");
            assert!(held[[50, 45]] && held[[50, left]], "step {step}");
            assert_eq!(feedback.walkers(people.clone()).len(), people.len(), "step {step}");
        }
        for _ in 0..30 {
            follow(&mut feedback, &[(39, 53)]);
        }
        let people = follow(&mut feedback, &[(39, 53)]);
        assert!(feedback.held().is_some() && feedback.stopped(people[0].bounds));
        // A chair that appears is not one.
        for step in 0..60 {
            follow(
                &mut feedback,
                &[(39_usize.saturating_sub(step), 53_usize.saturating_sub(step)), (55, 70)],
            );
        }
        assert!(feedback.held().is_none_or(|held| !held[[50, 60]]));
    }

    #[test]
    fn who_entered_or_sits_down_is_a_person() {
        let mut feedback = Feedback::new(SIZE);
        for right in 1..15 {
            follow(&mut feedback, &[(0, right)]);
        }
        for _ in 0..40 {
            follow(&mut feedback, &[(3, 17)]);
        }
        assert!(feedback.held().is_some_and(|held| held[[50, 10]]));
        let first = BoundingBox { top: 20, bottom: 80, left: 40, right: 60 };
        assert!(!hinged(first, BoundingBox { top: 44, ..first }));
        assert!(hinged(first, BoundingBox { right: 75, ..first }));
    }

    #[test]
    fn a_region_that_walked_is_a_person_and_one_alone_is_kept() {
        let mut feedback = Feedback::new(SIZE);
        let people = follow(&mut feedback, &[(40, 60)]);
        assert_eq!(feedback.walkers(people).len(), 1);
        for step in 0..15 {
            follow(&mut feedback, &[(40 + step, 60 + step)]);
        }
        assert!(feedback.held().is_some());
    }
}

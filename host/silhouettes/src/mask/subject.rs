//! The subject among the regions of a cleaned mask: the person nearest to the last one, or the largest
//! without a last one. Doubts are flagged; a frame without a person gives an empty mask.

use std::{collections::VecDeque, fmt};

use ndarray::ArrayView2;

use super::{
    BoundingBox, Mask,
    people::{Person, people},
};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Flag {
    Empty,
    /// The mask holds one of them.
    SeveralPeople {
        /// Regions of a person's size.
        count: usize,
    },
    /// Part of the subject may be outside.
    CutByEdge,
    /// Parts of the subject resemble the background.
    Fragments {
        count: usize,
    },
    /// For a second or longer.
    StoppedMoving,
    /// The background is not learned yet.
    Learning,
    /// More moves than a person: the light or the camera changed.
    SceneChanged {
        moving_percent: u8,
    },
}

impl fmt::Display for Flag {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Empty => write!(out, "empty"),
            Self::SeveralPeople { count } => write!(out, "several-people:{count}"),
            Self::CutByEdge => write!(out, "cut-by-edge"),
            Self::Fragments { count } => write!(out, "fragments:{count}"),
            Self::StoppedMoving => write!(out, "stopped-moving"),
            Self::Learning => write!(out, "learning"),
            Self::SceneChanged { moving_percent } => write!(out, "scene-changed:{moving_percent}%"),
        }
    }
}

impl Flag {
    /// Whether the frame's mask must not be used as a silhouette of one person.
    #[must_use]
    pub fn spoils(self) -> bool {
        !matches!(self, Self::CutByEdge | Self::Fragments { .. } | Self::StoppedMoving)
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SubjectSettings {
    pub smallest_person_px: usize,
    pub smallest_fragment_px: usize,
    /// Largest gap between stacked fragments of one person, pixels.
    pub widest_break_px: usize,
    /// A person counts from this share of the usual area of earlier ones; less is noise of a background model, or a rest of a
    /// person. 0 for masks that are given.
    pub usual_share: f64,
}

impl SubjectSettings {
    #[must_use]
    pub fn for_size((height, width): (usize, usize)) -> Self {
        let pixels = height * width;
        Self {
            smallest_person_px: (pixels / 1000).max(1),
            smallest_fragment_px: (pixels / 10_000).max(1),
            widest_break_px: height / 40,
            usual_share: 0.0,
        }
    }
}

#[derive(Clone, Debug, PartialEq)]
pub struct Subject {
    /// Full frame; all unset without a person.
    pub mask: Mask,
    /// `None` without a person.
    pub bounds: Option<BoundingBox>,
    /// Empty for a reliable frame.
    pub flags: Vec<Flag>,
}

/// A second person counts from this share of the largest's area.
const RIVAL_SHARE: f64 = 0.3;
/// Frames without a person after which the last place is forgotten.
const FORGET_AFTER_FRAMES: u32 = 10;
/// Frames with only smaller regions after which the usual area is forgotten: they may be people far away.
const FORGET_AREA_AFTER_FRAMES: u32 = 500;
/// Subjects after which their usual area and number of pieces are known.
const KNOWN_AFTER: usize = 10;
/// Subjects whose usual area is remembered: few, for people who walk away.
const REMEMBERED: usize = 20;
/// Mean number of pieces above which masks are doubtful. Measured on public videos: mostly 1 to 4; 16 with a camera in the hand,
/// 14 with a drifting exposure.
const MOST_PIECES: f64 = 5.0;

/// Chooses the subject frame by frame and remembers its place and usual area.
#[derive(Clone, Debug)]
pub struct SubjectChooser {
    settings: SubjectSettings,
    last: Option<(f64, f64)>,
    absent_frames: u32,
    /// Areas of the last subjects that no edge cuts.
    areas: VecDeque<usize>,
    smaller_frames: u32,
    left_out: usize,
    pieces: Pieces,
}

/// Number of pieces of the people so far.
#[derive(Clone, Copy, Debug, Default)]
pub struct Pieces {
    people: usize,
    pieces: usize,
}

impl Pieces {
    pub fn count(&mut self, person: &Person) {
        self.people += 1;
        self.pieces += person.fragments.len();
    }

    /// Why the masks of all people so far are doubtful.
    #[must_use]
    pub fn doubt(&self) -> Option<String> {
        let pieces = self.pieces as f64 / self.people.max(1) as f64;
        (self.people >= KNOWN_AFTER && pieces > MOST_PIECES).then(|| {
            format!(
                "the person is in {pieces:.1} pieces on average, so that masks and answers are doubtful: does the camera move, does \
                 its exposure drift, or do the clothes resemble the background?"
            )
        })
    }
}

impl SubjectChooser {
    #[must_use]
    pub fn new(settings: SubjectSettings) -> Self {
        Self {
            settings,
            last: None,
            absent_frames: 0,
            areas: VecDeque::new(),
            smaller_frames: 0,
            left_out: 0,
            pieces: Pieces::default(),
        }
    }

    /// Why the masks of all frames so far are doubtful.
    #[must_use]
    pub fn doubts(&self) -> Vec<String> {
        let left_out = (self.left_out > 0).then(|| {
            format!(
                "{} frames have an empty mask, because all that moves in them is below {:.0} % of the usual area of the person before: \
                 noise, a part of a person, or a person much farther away",
                self.left_out,
                100.0 * self.settings.usual_share
            )
        });
        self.pieces.doubt().into_iter().chain(left_out).collect()
    }

    /// Median; `None` before the first [`KNOWN_AFTER`] areas.
    fn usual_area(&self) -> Option<usize> {
        let mut areas: Vec<usize> = self.areas.iter().copied().collect();
        areas.sort_unstable();
        areas.get(areas.len() / 2).copied().filter(|_| areas.len() >= KNOWN_AFTER)
    }

    /// The subject of the next frame's cleaned mask.
    pub fn choose(&mut self, mask: ArrayView2<'_, bool>) -> Subject {
        self.among(people(mask, &self.settings), mask.dim())
    }

    /// [`Self::choose`] among the people of a mask of this (height, width).
    pub fn among(&mut self, mut people: Vec<Person>, size: (usize, usize)) -> Subject {
        let largest = people.iter().map(|person| person.area).max().unwrap_or(0);
        let usual = self.usual_area().unwrap_or(0);
        let least = (RIVAL_SHARE * largest as f64).max(self.settings.usual_share * usual as f64);
        people.retain(|person| person.area as f64 >= least);
        let subject = match self.last {
            Some(last) => people.iter().min_by(|a, b| distance(a, last).total_cmp(&distance(b, last))),
            None => people.iter().max_by_key(|person| person.area),
        };
        let Some(subject) = subject else {
            self.absent_frames = self.absent_frames.saturating_add(1);
            if self.absent_frames >= FORGET_AFTER_FRAMES {
                self.last = None;
            }
            self.smaller_frames = self.smaller_frames.saturating_add(u32::from(largest > 0));
            self.left_out += usize::from(largest > 0);
            if self.smaller_frames >= FORGET_AREA_AFTER_FRAMES {
                self.areas.clear();
            }
            return Subject { mask: Mask::from_elem(size, false), bounds: None, flags: vec![Flag::Empty] };
        };
        (self.absent_frames, self.smaller_frames) = (0, 0);
        self.last = Some(subject.centroid());
        self.pieces.count(subject);
        let mut flags = Vec::new();
        if people.len() > 1 {
            flags.push(Flag::SeveralPeople { count: people.len() });
        }
        if subject.bounds.touches_edge(size) {
            flags.push(Flag::CutByEdge);
        } else {
            self.areas.truncate(REMEMBERED - 1);
            self.areas.push_front(subject.area);
        }
        if subject.fragments.len() > 1 {
            flags.push(Flag::Fragments { count: subject.fragments.len() });
        }
        Subject { bounds: Some(subject.bounds), mask: subject.mask(size), flags }
    }
}

fn distance(person: &Person, (row, column): (f64, f64)) -> f64 {
    let centre = person.centroid();
    (centre.0 - row).hypot(centre.1 - column)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mask::area;
    use ndarray::s;

    const SIZE: (usize, usize) = (240, 320);

    fn people(boxes: &[[usize; 4]]) -> Mask {
        let mut mask = Mask::from_elem(SIZE, false);
        for &[top, left, bottom, right] in boxes {
            mask.slice_mut(s![top..bottom, left..right]).fill(true);
        }
        mask
    }

    fn chooser() -> SubjectChooser {
        SubjectChooser::new(SubjectSettings { usual_share: 0.1, ..SubjectSettings::for_size(SIZE) })
    }

    #[test]
    fn one_person_is_chosen_without_a_flag_and_specks_are_left_out() {
        let subject = chooser().choose(people(&[[50, 100, 150, 140], [10, 10, 12, 12]]).view());
        assert_eq!(subject.mask, people(&[[50, 100, 150, 140]]));
        assert_eq!(subject.flags, []);
    }

    #[test]
    fn a_person_broken_at_the_belt_is_one_person() {
        let broken = people(&[[50, 100, 98, 140], [102, 105, 150, 135]]);
        let subject = chooser().choose(broken.view());
        assert_eq!(subject.mask, broken);
        assert_eq!(subject.flags, [Flag::Fragments { count: 2 }]);
        assert!(!subject.flags[0].spoils());
    }

    #[test]
    fn two_people_are_flagged_and_the_one_seen_before_is_followed() {
        let mut chooser = chooser();
        chooser.choose(people(&[[60, 40, 140, 70]]).view());
        let both = chooser.choose(people(&[[60, 44, 140, 74], [40, 200, 160, 250]]).view());
        assert_eq!(both.flags, [Flag::SeveralPeople { count: 2 }]);
        assert_eq!(both.mask, people(&[[60, 44, 140, 74]]));
        // Without a last place the larger one is chosen and flagged.
        let fresh = super::tests::chooser().choose(people(&[[60, 44, 140, 74], [40, 200, 160, 250]]).view());
        assert_eq!(fresh.mask, people(&[[40, 200, 160, 250]]));
        assert!(fresh.flags[0].spoils());
    }

    #[test]
    fn no_person_gives_an_empty_mask_and_a_flag() {
        let subject = chooser().choose(people(&[[5, 5, 8, 8]]).view());
        assert_eq!(area(subject.mask.view()), 0);
        assert_eq!((subject.bounds, subject.flags), (None, vec![Flag::Empty]));
    }

    #[test]
    fn the_last_place_is_forgotten_after_a_while() {
        let mut chooser = chooser();
        chooser.choose(people(&[[60, 10, 140, 40]]).view());
        for _ in 0..10 {
            chooser.choose(people(&[]).view());
        }
        let subject = chooser.choose(people(&[[60, 10, 120, 40], [40, 200, 160, 250]]).view());
        assert_eq!(subject.mask, people(&[[40, 200, 160, 250]]));
    }

    #[test]
    fn regions_much_smaller_than_the_people_before_are_no_person() {
        let (person, noise) = (people(&[[60, 40, 140, 70]]), people(&[[100, 100, 107, 120]]));
        let mut chooser = chooser();
        let mut is_chosen = |mask: &Mask| chooser.choose(mask.view()).bounds.is_some();
        assert!(is_chosen(&noise));
        for _ in 0..30 {
            assert!(is_chosen(&person));
        }
        for _ in 0..200 {
            assert!(!is_chosen(&noise));
        }
        // Half as high, and so a quarter of the area: farther away.
        assert!(is_chosen(&people(&[[60, 40, 100, 55]])));
        let refused = (0..1000).take_while(|_| !is_chosen(&noise)).count();
        assert_eq!(refused, 500);
        let doubts = chooser.doubts().join("; ");
        assert!(
            doubts.starts_with("700 frames have an empty mask") && doubts.contains("below 10 %"),
            "{doubts}"
        );
    }

    #[test]
    fn a_person_who_walks_away_is_always_chosen() {
        let mut chooser = chooser();
        let sides = |frame: u32| {
            let share = 0.95_f64.powf(0.5 * f64::from(frame));
            [200.0_f64, 100.0].map(|side| (side * share).round() as usize)
        };
        for frame in std::iter::repeat_n(0, 100).chain(1..=60) {
            let [height, width] = sides(frame);
            let subject = chooser.choose(people(&[[20, 100, 20 + height, 100 + width]]).view());
            assert!(subject.bounds.is_some(), "frame {frame}");
        }
    }

    #[test]
    fn small_people_of_given_masks_count() {
        let mut chooser = SubjectChooser::new(SubjectSettings::for_size(SIZE));
        for _ in 0..30 {
            chooser.choose(people(&[[20, 100, 220, 200]]).view());
        }
        let far = people(&[[100, 100, 120, 110]]);
        assert_eq!(chooser.choose(far.view()).mask, far);
    }

    #[test]
    fn people_in_many_pieces_make_the_recording_doubtful() {
        let stripes: Vec<[usize; 4]> =
            (0..8).map(|stripe| [40 + 14 * stripe, 100, 50 + 14 * stripe, 140]).collect();
        for (pieces, expected) in [(1, None), (4, None), (8, Some("in 8.0 pieces on average"))] {
            let mut chooser = chooser();
            for _ in 0..20 {
                chooser.choose(people(&stripes[..pieces]).view());
            }
            let doubts = chooser.doubts();
            assert_eq!(doubts.len(), usize::from(expected.is_some()), "{doubts:?}");
            assert!(expected.is_none_or(|part| doubts[0].contains(part)), "{doubts:?}");
        }
    }

    #[test]
    fn a_subject_at_the_edge_is_flagged_but_usable() {
        let subject = chooser().choose(people(&[[100, 280, 200, 320]]).view());
        assert_eq!(subject.flags, [Flag::CutByEdge]);
        assert!(!Flag::CutByEdge.spoils());
    }
}

//! Tracking of several people. Each person has a constant-velocity Kalman filter. Blobs of the mask ([`super::people`])
//! are assigned at minimum cost ([`super::assignment`]): distance from the prediction and height change, in standard
//! deviations. People who share a blob are reported as crossing, without silhouettes. After separation they are
//! identified by their motion; the crossing is ambiguous if the swap is nearly as likely.

mod motion;

use ndarray::{Array2, ArrayView2};

use super::{
    BoundingBox, Mask,
    assignment::assigned,
    people::{Person, people},
    subject::{Pieces, SubjectSettings},
};
use motion::Motion;

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrackingSettings {
    pub subject: SubjectSettings,
    /// Frames, not cut by the left or right edge, before a new person is reported; earlier it may be a speck.
    pub confirmed_after_frames: usize,
    /// Frames without detection after which a person has left.
    pub gone_after_frames: usize,
}

impl TrackingSettings {
    #[must_use]
    pub fn for_size(size: (usize, usize)) -> Self {
        Self { subject: SubjectSettings::for_size(size), confirmed_after_frames: 3, gone_after_frames: 12 }
    }
}

#[derive(Clone, Debug, PartialEq)]
pub enum Sight {
    /// An independent silhouette.
    Alone {
        mask: Mask,
        bounds: BoundingBox,
        /// Touches the image's edge; part of it may be outside.
        cut_by_edge: bool,
        /// Masks of the preceding frames, before confirmation.
        before: Vec<Mask>,
    },
    /// In one blob with these people.
    Crossing {
        with: Vec<usize>,
        bounds: BoundingBox,
    },
    Missed,
}

#[derive(Clone, Debug, PartialEq)]
pub struct Followed {
    /// Number from 1 in order of appearance.
    pub person: usize,
    pub sight: Sight,
    pub parted: Vec<Parting>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Parting {
    pub from: usize,
    /// Whether the two may be swapped.
    pub ambiguous: bool,
}

/// Largest cost of an assignment: five standard deviations.
const GATE: f64 = 25.0;
/// Cost from which a swap is ruled out: odds of twenty to one.
const SURE: f64 = 6.0;
/// Standard deviation of log height from frame to frame.
const HEIGHT_SPREAD: f64 = 0.2;
/// Share of a person's predicted box in a blob that occludes them.
const HIDDEN: f64 = 0.4;
/// A blob up to this multiple of the largest person's area may hold one person.
const ONE_ALONE: f64 = 1.15;
const FOLLOWING: f64 = 0.2;
/// Frames before a person is reported whom the left or right edge cuts; earlier it may be a hand or a foot of a person who
/// comes in or leaves.
const CUT_FRAMES: usize = 12;

#[derive(Clone, Debug)]
struct Track {
    /// Number from 1 on; 0 until confirmed.
    person: usize,
    row: Motion,
    column: Motion,
    height: f64,
    width: f64,
    area: f64,
    seen: usize,
    missed: usize,
    /// Frames in which neither the left nor the right edge cut the person.
    uncut: usize,
    before: Vec<Mask>,
    /// People in the same crossing, until they separate.
    crossing: Vec<usize>,
}

impl Track {
    fn new(blob: &Person) -> Self {
        let (row, column) = blob.centroid();
        let height = blob.bounds.height() as f64;
        Self {
            person: 0,
            row: Motion::new(row, height),
            column: Motion::new(column, height),
            height,
            width: blob.bounds.width() as f64,
            area: blob.area as f64,
            seen: 0,
            missed: 0,
            uncut: 0,
            before: Vec::new(),
            crossing: Vec::new(),
        }
    }

    /// Cost of a blob, squared standard deviations.
    fn cost(&self, blob: &Person) -> f64 {
        let (row, column) = blob.centroid();
        let of_place = |motion: &Motion, at: f64| (at - motion.at).powi(2) / motion.variance(self.height);
        let higher = (blob.bounds.height() as f64 / self.height).ln() / HEIGHT_SPREAD;
        of_place(&self.row, row) + of_place(&self.column, column) + higher * higher
    }

    fn correct(&mut self, blob: &Person) {
        let (row, column) = blob.centroid();
        self.row.correct(row, self.height);
        self.column.correct(column, self.height);
        let follow = |usual: &mut f64, now: f64| *usual += FOLLOWING * (now - *usual);
        follow(&mut self.height, blob.bounds.height() as f64);
        follow(&mut self.width, blob.bounds.width() as f64);
        follow(&mut self.area, blob.area as f64);
    }

    /// Share of the predicted box that lies in another.
    fn covered_by(&self, bounds: BoundingBox) -> f64 {
        let shared = |at: f64, length: f64, low: usize, high: usize| {
            let (from, to) = (at - 0.5 * length, at + 0.5 * length);
            ((to.min(high as f64) - from.max(low as f64)) / length.max(1.0)).max(0.0)
        };
        shared(self.row.at, self.height, bounds.top, bounds.bottom)
            * shared(self.column.at, self.width, bounds.left, bounds.right)
    }
}

#[derive(Clone, Debug)]
pub struct Tracker {
    settings: TrackingSettings,
    tracks: Vec<Track>,
    people: usize,
    pieces: Pieces,
}

impl Tracker {
    #[must_use]
    pub fn new(settings: TrackingSettings) -> Self {
        Self { settings, tracks: Vec::new(), people: 0, pieces: Pieces::default() }
    }

    /// Why the masks of all people so far are doubtful.
    #[must_use]
    pub fn doubt(&self) -> Option<String> {
        self.pieces.doubt()
    }

    /// All people in the next frame's cleaned mask, without those who have left.
    pub fn follow(&mut self, mask: ArrayView2<'_, bool>) -> Vec<Followed> {
        let size = mask.dim();
        let blobs = people(mask, &self.settings.subject);
        for track in &mut self.tracks {
            track.row.predict(track.height);
            track.column.predict(track.height);
        }
        let costs = Array2::from_shape_fn((self.tracks.len(), blobs.len()), |(track, blob)| {
            self.tracks[track].cost(&blobs[blob])
        });
        let blob_of = assigned(costs.view(), GATE);
        let shared = self.shared(&blobs, &blob_of);
        let mut found: Vec<Followed> = Vec::new();
        let partings = self.partings(&costs, &blob_of, &shared);
        for (index, parted) in partings.into_iter().enumerate() {
            let at = shared[index].or(blob_of[index]);
            let others: Vec<&Track> = (0..self.tracks.len())
                .filter(|&other| other != index && shared[other].is_some() && shared[other] == shared[index])
                .map(|other| &self.tracks[other])
                .collect();
            let together: Vec<usize> = others.iter().map(|other| other.person).collect();
            let largest = others.iter().map(|other| other.area).fold(self.tracks[index].area, f64::max);
            // In a blob no larger than the largest of its people the occluded one may have left.
            let gone =
                blob_of[index].is_none() && at.is_some_and(|at| blobs[at].area as f64 <= ONE_ALONE * largest);
            let sight = self.sight(index, at.map(|at| &blobs[at]), (together, gone), size);
            found.push(Followed { person: self.tracks[index].person, sight, parted });
        }
        let taken = |blob: &usize| blob_of.contains(&Some(*blob)) || shared.contains(&Some(*blob));
        for blob in (0..blobs.len()).filter(|blob| !taken(blob)).map(|blob| &blobs[blob]) {
            self.tracks.push(Track::new(blob));
            self.sight(self.tracks.len() - 1, Some(blob), (Vec::new(), false), size);
        }
        let gone = self.settings.gone_after_frames;
        self.tracks.retain(|track| track.missed < if track.person == 0 { 1 } else { gone });
        found.retain(|followed| followed.person > 0);
        found.sort_by_key(|followed| followed.person);
        found
    }

    /// The blob that each track shares: its own, or one around its prediction.
    fn shared(&self, blobs: &[Person], blob_of: &[Option<usize>]) -> Vec<Option<usize>> {
        let mut shared = vec![None; self.tracks.len()];
        for (index, track) in self.tracks.iter().enumerate() {
            if blob_of[index].is_some() || track.person == 0 {
                continue;
            }
            let cover = |blob: &usize| track.covered_by(blobs[*blob].bounds);
            let best = (0..blobs.len()).max_by(|a, b| cover(a).total_cmp(&cover(b)));
            let Some(blob) = best.filter(|blob| cover(blob) >= HIDDEN) else { continue };
            shared[index] = Some(blob);
        }
        for (index, blob) in blob_of.iter().enumerate() {
            if self.tracks[index].person > 0 && blob.is_some_and(|blob| shared.contains(&Some(blob))) {
                shared[index] = *blob;
            }
        }
        let is_cut = |track: usize| self.tracks[track].uncut < self.settings.confirmed_after_frames;
        // A single track in another's blob is not sharing it. Tracks that the edge has always cut are pieces of one person.
        let alone: Vec<usize> = (0..shared.len())
            .filter(|&index| {
                let sharing = || (0..shared.len()).filter(|&other| shared[other] == shared[index]);
                shared[index].is_some() && (sharing().count() == 1 || sharing().all(is_cut))
            })
            .collect();
        for index in alone {
            shared[index] = None;
        }
        shared
    }

    fn partings(
        &mut self,
        costs: &Array2<f64>,
        blob_of: &[Option<usize>],
        shared: &[Option<usize>],
    ) -> Vec<Vec<Parting>> {
        let mut partings = vec![Vec::new(); self.tracks.len()];
        for index in 0..self.tracks.len() {
            if shared[index].is_some() {
                continue;
            }
            let Some(own) = blob_of[index] else { continue };
            let crossed = std::mem::take(&mut self.tracks[index].crossing);
            for person in crossed {
                let other = self.tracks.iter().position(|track| track.person == person);
                let theirs = other
                    .and_then(|other| Some((other, blob_of[other].filter(|_| shared[other].is_none())?)));
                let ambiguous = theirs.is_none_or(|(other, theirs)| {
                    let kept = costs[(index, own)] + costs[(other, theirs)];
                    costs[(index, theirs)] + costs[(other, own)] - kept < SURE
                });
                partings[index].push(Parting { from: person, ambiguous });
            }
        }
        partings
    }

    /// Updates the track; it may share its blob, or be occluded and perhaps gone.
    fn sight(
        &mut self,
        index: usize,
        blob: Option<&Person>,
        (together, gone): (Vec<usize>, bool),
        size: (usize, usize),
    ) -> Sight {
        let track = &mut self.tracks[index];
        let Some(blob) = blob else {
            track.missed += 1;
            return Sight::Missed;
        };
        let bounds = blob.bounds;
        if !together.is_empty() {
            track.missed = if gone { track.missed + 1 } else { 0 };
            track.row.keep_within(bounds.top, bounds.bottom);
            track.column.keep_within(bounds.left, bounds.right);
            for &person in &together {
                if !track.crossing.contains(&person) {
                    track.crossing.push(person);
                }
            }
            return Sight::Crossing { with: together, bounds };
        }
        track.correct(blob);
        (track.seen, track.missed) = (track.seen + 1, 0);
        track.uncut += usize::from(bounds.left > 0 && bounds.right < size.1);
        let mask = blob.mask(size);
        if track.person == 0 {
            if track.uncut < self.settings.confirmed_after_frames && track.seen < CUT_FRAMES {
                track.before.push(mask);
                return Sight::Missed;
            }
            self.people += 1;
            track.person = self.people;
        }
        self.pieces.count(blob);
        let before = std::mem::take(&mut track.before);
        Sight::Alone { mask, bounds, cut_by_edge: bounds.touches_edge(size), before }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::s;

    const SIZE: (usize, usize) = (120, 320);

    fn frame(boxes: &[(f64, usize, usize)]) -> Mask {
        let mut mask = Mask::from_elem(SIZE, false);
        for &(left, top, height) in boxes {
            let left = left.round() as usize;
            mask.slice_mut(s![top..top + height, left..(left + 20).min(SIZE.1)]).fill(true);
        }
        mask
    }

    fn tracker() -> Tracker {
        Tracker::new(TrackingSettings::for_size(SIZE))
    }

    fn left_of(followed: &[Followed], person: usize) -> Option<usize> {
        followed.iter().find(|f| f.person == person).and_then(|f| match &f.sight {
            Sight::Alone { bounds, .. } => Some(bounds.left),
            _ => None,
        })
    }

    #[test]
    fn two_people_who_keep_apart_keep_their_numbers_and_their_masks() {
        let mut tracker = tracker();
        for n in 0..40 {
            let x = f64::from(n);
            let found = tracker.follow(frame(&[(20.0 + x, 20, 70), (260.0 - x, 30, 60)]).view());
            if n < 2 {
                assert!(found.is_empty(), "not known yet");
                continue;
            }
            assert_eq!(found.len(), 2, "frame {n}");
            for (followed, (left, top, height)) in found.iter().zip([(20.0 + x, 20, 70), (260.0 - x, 30, 60)])
            {
                let Sight::Alone { mask, before, cut_by_edge, .. } = &followed.sight else { panic!("{n}") };
                assert_eq!(*mask, frame(&[(left, top, height)]));
                assert_eq!(before.len(), if n == 2 { 2 } else { 0 });
                assert!(!cut_by_edge && followed.parted.is_empty());
            }
        }
    }

    #[test]
    fn crossing_people_are_reported_and_distinguished_by_speed() {
        let mut tracker = tracker();
        let (mut crossing, mut parted) = (0, Vec::new());
        let mut last = Vec::new();
        for n in 0..60 {
            let x = 4.0 * f64::from(n);
            last = tracker.follow(frame(&[(20.0 + x, 20, 70), (270.0 - x, 24, 70)]).view());
            for followed in &last {
                if let Sight::Crossing { with, .. } = &followed.sight {
                    assert_eq!(with, &[3 - followed.person]);
                    crossing += 1;
                }
                parted.extend(followed.parted.iter().map(|parting| (followed.person, *parting)));
            }
        }
        // 20 wide and 8 closer per frame: five frames of contact each.
        assert!((6..=14).contains(&crossing), "{crossing}");
        let sure = |from: usize| Parting { from, ambiguous: false };
        assert_eq!(parted, [(1, sure(2)), (2, sure(1))]);
        assert_eq!([left_of(&last, 1), left_of(&last, 2)], [Some(256), Some(34)]);
    }

    #[test]
    fn a_smaller_person_who_stays_behind_a_larger_one_is_dropped() {
        let mut tracker = tracker();
        let mut crossed = false;
        let mut last = Vec::new();
        for n in 0..60 {
            // The smaller one walks behind the larger one and is not seen again.
            let left = (80.0 + 3.0 * f64::from(n)).min(150.0);
            last = tracker.follow(frame(&[(150.0, 15, 100), (left, 40, 60)]).view());
            crossed |= last.iter().any(|followed| matches!(followed.sight, Sight::Crossing { .. }));
        }
        assert!(crossed);
        assert_eq!(last.len(), 1, "{last:?}");
        assert!(matches!(last[0].sight, Sight::Alone { .. }), "{last:?}");
    }

    #[test]
    fn people_who_meet_stand_and_part_slowly_are_ambiguous() {
        let mut tracker = tracker();
        let mut parted = Vec::new();
        for n in 0..120 {
            let gap = match n {
                0..30 => 80.0 - 2.5 * f64::from(n),
                30..70 => 5.0,
                _ => 5.0 + 2.0 * f64::from(n - 70),
            };
            let found =
                tracker.follow(frame(&[(150.0 - 0.5 * gap, 20, 70), (150.0 + 0.5 * gap, 20, 70)]).view());
            parted.extend(found.iter().flat_map(|followed| followed.parted.clone()));
            assert!(found.iter().all(|followed| followed.person <= 2), "frame {n}: no new person");
        }
        assert_eq!(parted.len(), 2, "{parted:?}");
        assert!(parted.iter().all(|parting| parting.ambiguous), "{parted:?}");
    }

    /// A body of which a hand and a foot come in over the left edge first, and leave over the right edge last.
    fn walker(at: f64) -> Mask {
        let mut mask = Mask::from_elem(SIZE, false);
        for (rows, left, right) in [(20..90, 0.0, 20.0), (30..50, -18.0, 38.0), (75..90, -18.0, 38.0)] {
            let [left, right] = [left, right].map(|x: f64| (at + x).clamp(0.0, SIZE.1 as f64) as usize);
            mask.slice_mut(s![rows, left..right]).fill(true);
        }
        mask
    }

    #[test]
    fn pieces_of_one_person_who_comes_in_over_the_edge_are_one_person() {
        // The pieces are apart for 18 pixels: 4, 9 and 36 frames.
        for pace in [4.0, 2.0, 0.5] {
            let mut tracker = tracker();
            let (mut alone, mut last) = (0, 0);
            for n in 0..((SIZE.1 as f64 + 60.0) / pace) as usize {
                for followed in tracker.follow(walker(n as f64 * pace - 40.0).view()) {
                    assert!(!matches!(followed.sight, Sight::Crossing { .. }), "frame {n}: {followed:?}");
                    if let Sight::Alone { before, .. } = &followed.sight {
                        alone += 1 + before.len();
                        last = last.max(followed.person);
                    }
                }
            }
            // Pieces that are apart for longer than that are numbered, but never cross.
            assert!(pace < 1.0 || last == 1, "{last} people");
            assert!(alone as f64 > SIZE.1 as f64 / pace * 0.9, "{alone} at {pace}");
        }
    }

    #[test]
    fn somebody_whom_the_edge_cuts_is_reported_later_with_all_masks() {
        let mut tracker = tracker();
        let found: Vec<usize> = (0..20)
            .map(|_| tracker.follow(frame(&[(310.0, 20, 70)]).view()))
            .map(|found| {
                found
                    .iter()
                    .map(|followed| match &followed.sight {
                        Sight::Alone { before, cut_by_edge: true, .. } => 1 + before.len(),
                        other => panic!("{other:?}"),
                    })
                    .sum()
            })
            .collect();
        assert_eq!(found.iter().position(|count| *count > 0), Some(CUT_FRAMES - 1));
        assert_eq!(found.iter().sum::<usize>(), 20);
    }

    #[test]
    fn specks_are_ignored_and_people_who_leave_are_dropped() {
        let mut tracker = tracker();
        for n in 0..50 {
            let mut mask = if n < 20 { frame(&[(100.0, 20, 70)]) } else { Mask::from_elem(SIZE, false) };
            if n % 7 == 0 {
                mask.slice_mut(s![5..12, 200..210]).fill(true);
            }
            let found = tracker.follow(mask.view());
            let expected = usize::from((2..32).contains(&n));
            assert_eq!(found.len(), if n == 31 { found.len() } else { expected }, "frame {n}: {found:?}");
            if n >= 20 {
                assert!(found.iter().all(|followed| followed.sight == Sight::Missed));
            }
        }
        let mut again = Vec::new();
        for _ in 0..4 {
            again = tracker.follow(frame(&[(100.0, 20, 70)]).view());
        }
        assert_eq!(again[0].person, 2, "a person who returns late is new");
    }
}

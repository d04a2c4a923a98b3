//! Follows people through frames by the file's own numbers, else by place.

use std::collections::{BTreeMap, HashSet};

use super::{layouts::NAMES, points::Person};
use crate::silhouette::capsule::Point3;

pub type Track = Vec<Vec<Option<Point3>>>;

/// Limit of people, which bounds the memory; those seen least are left out.
const MOST: usize = 16;
/// After this many frames without a person, the next one in that place is another person.
const FORGOTTEN_AFTER: usize = 30;
/// Largest step per frame, in body heights.
const WIDEST_STEP: f64 = 0.5;
/// People seen for a smaller share than the one seen most are passers-by or false detections.
const LEAST_SHARE: f64 = 0.1;

struct Followed {
    last: usize,
    centre: Point3,
    height: f64,
    heights: f64,
    /// Frame and index in it.
    seen: Vec<(usize, usize)>,
}

pub struct People {
    /// Of those seen most.
    pub tracks: Vec<Track>,
    pub others: usize,
    /// Places between which a single person leaps; 0 for people who were followed.
    pub places: usize,
}

pub fn followed(frames: &[Vec<Person>]) -> People {
    let numbered = numbered(frames);
    let mut all: Vec<Followed> = Vec::new();
    // Those without a number who are not forgotten.
    let mut recent: Vec<usize> = Vec::new();
    let mut of_id: BTreeMap<i64, usize> = BTreeMap::new();
    for (frame, people) in frames.iter().enumerate() {
        let mut pairs: Vec<(f64, usize, usize)> = Vec::new();
        let mut taken = vec![false; people.len()];
        recent.retain(|index| frame - all[*index].last <= FORGOTTEN_AFTER);
        for (place, person) in people.iter().enumerate() {
            let Some((centre, height)) = extent(person) else {
                taken[place] = true;
                continue;
            };
            if let Some(id) = person.id.filter(|_| numbered) {
                taken[place] = true;
                let index = *of_id.entry(id).or_insert_with(|| {
                    all.push(begun(centre, height));
                    all.len() - 1
                });
                add(&mut all[index], frame, place, centre, height);
                continue;
            }
            for &index in &recent {
                let track = &all[index];
                let step = distance(centre, track.centre);
                let reach = WIDEST_STEP * height.max(track.height);
                if step <= reach {
                    pairs.push((step, index, place));
                }
            }
        }
        pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut used = HashSet::new();
        for (_, index, place) in pairs {
            if !taken[place] && used.insert(index) {
                taken[place] = true;
                if let Some((centre, height)) = extent(&people[place]) {
                    add(&mut all[index], frame, place, centre, height);
                }
            }
        }
        for (place, person) in people.iter().enumerate().filter(|(place, _)| !taken[*place]) {
            if let Some((centre, height)) = extent(person) {
                let mut track = begun(centre, height);
                add(&mut track, frame, place, centre, height);
                recent.push(all.len());
                all.push(track);
            }
        }
    }
    let mut places = 0;
    if of_id.is_empty()
        && let Some(alone) = alone(&all)
    {
        places = all.len();
        all = vec![alone];
    }
    all.sort_by(|a, b| b.heights.total_cmp(&a.heights));
    let longest = all.iter().map(|track| track.seen.len()).max().unwrap_or(0);
    all.retain(|track| track.seen.len() as f64 >= LEAST_SHARE * longest as f64);
    let others = all.len().saturating_sub(MOST);
    let points = |track: &Followed| {
        let mut whole: Track = vec![Vec::new(); frames.len()];
        for &(frame, place) in &track.seen {
            whole[frame].clone_from(&frames[frame][place].points);
        }
        whole
            .iter_mut()
            .filter(|points| points.is_empty())
            .for_each(|points| points.resize(NAMES.len(), None));
        whole
    };
    People { tracks: all.iter().take(MOST).map(points).collect(), others, places }
}

/// One person of all frames, if none of them shows two, and people stay in place for less than two frames on average and each for
/// less than half of them: a collection of pictures.
fn alone(all: &[Followed]) -> Option<Followed> {
    let mut seen: Vec<(usize, usize)> = all.iter().flat_map(|track| &track.seen).copied().collect();
    seen.sort_unstable();
    let are_single = seen.windows(2).all(|two| two[0].0 < two[1].0);
    let is_leaping = all.iter().all(|track| 2 * track.seen.len() < seen.len());
    let are_short = 2 * all.len() > seen.len();
    (are_single && is_leaping && are_short).then(|| Followed { seen, ..begun([0.0; 3], 0.0) })
}

/// Whether the file's numbers tell people apart: not if most frames of several people repeat one, as those of AlphaPose
/// without tracking, where everybody is 0.
fn numbered(frames: &[Vec<Person>]) -> bool {
    let [mut several, mut repeated] = [0_usize; 2];
    for people in frames {
        let mut ids: Vec<i64> = people.iter().filter_map(|person| person.id).collect();
        let count = ids.len();
        ids.sort_unstable();
        ids.dedup();
        several += usize::from(count > 1);
        repeated += usize::from(count > ids.len());
    }
    2 * repeated <= several
}

fn begun(centre: Point3, height: f64) -> Followed {
    Followed { last: 0, centre, height, heights: 0.0, seen: Vec::new() }
}

fn add(track: &mut Followed, frame: usize, place: usize, centre: Point3, height: f64) {
    // A number that occurs twice in a frame: the first counts.
    if track.seen.last().is_some_and(|(last, _)| *last == frame) {
        return;
    }
    (track.last, track.centre, track.height) = (frame, centre, height);
    track.heights += height;
    track.seen.push((frame, place));
}

/// Centre and longest side of the box around a person's points; `None` with fewer than four.
fn extent(person: &Person) -> Option<(Point3, f64)> {
    let points: Vec<Point3> = person.points.iter().flatten().copied().collect();
    let side = |k: usize| {
        let values = || points.iter().map(|p| p[k]);
        (values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max))
    };
    let sides = [side(0), side(1), side(2)];
    let height = sides.iter().map(|(low, high)| high - low).fold(0.0, f64::max);
    (points.len() >= 4 && height > 0.0).then_some((sides.map(|(low, high)| 0.5 * (low + high)), height))
}

pub fn distance(a: Point3, b: Point3) -> f64 {
    (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>().sqrt()
}

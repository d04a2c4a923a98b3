//! Training clips from recorded motion with synthetic cameras and segmentation ([`super::everyday`]). A
//! recording is seen from several sides; frame rate, cut, clothes, camera and damage are random, from a seed.

use super::everyday::camera::Camera;
use crate::clip::Track;
use crate::embedding::descriptor::Scaling;
use farnear_silhouettes::silhouette::{
    capsule::{Capsule, Point3},
    template::Template,
};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use std::collections::{HashMap, HashSet};

/// A person's body frame by frame, millimetres, z up.
#[derive(Clone, Debug)]
pub enum Bodies<'a> {
    /// Capsules around bones.
    Capsules(Vec<Vec<Capsule>>),
    /// Named points of a suit, or joints, with a template of parts.
    Parts(Vec<HashMap<&'a str, Point3>>, Template),
}

const USUAL_HZ: f64 = 30.0;
const FRAMES: [usize; 2] = [6, 64];
/// Longer recordings are cut to a piece; shorter ones lose a little at both ends.
const LONG_S: f64 = 6.0;
/// Closed gaps between parts: as in Li 2014, and for parts with thickness, which fills joints.
const CLOSED_MM: [f64; 2] = [126.0, 40.0];
/// Cameras tried until one sees at least half of the frames.
const LOOKS: usize = 8;

/// A recording from `count` sides, one track each; fewer without a visible person.
pub fn tracks(bodies: &Bodies, rate_hz: f64, count: usize, seed: u64, scaling: Scaling) -> Vec<Track> {
    let mut bodies = bodies.clone();
    bodies.drop_undrawn();
    let Some(stature_mm) = bodies.set_down() else { return Vec::new() };
    (0..count)
        .into_par_iter()
        .map(|side| {
            let mut rng = ChaCha8Rng::seed_from_u64(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ side as u64);
            let from_deg = 360.0 * (side as f64 + rng.random_range(0.0..1.0)) / count as f64;
            let clip =
                bodies.selected(&cut(bodies.frames(), rate_hz, &mut rng)).dressed(rng.random_range(0.8..1.3));
            let mut track = Track::from_masks(&[], scaling, true);
            for _ in 0..LOOKS {
                let camera = Camera::drawn(&mut rng).seen_from(from_deg);
                track = clip.seen_by(&camera, stature_mm, scaling, &mut rng);
                if 2 * track.frames() > clip.frames() {
                    break;
                }
            }
            track
        })
        .filter(|track| track.frames() > 0)
        .collect()
}

fn cut(frames: usize, rate_hz: f64, rng: &mut ChaCha8Rng) -> Vec<usize> {
    let recorded_hz = if rate_hz > 0.0 { rate_hz } else { USUAL_HZ };
    let seconds = frames as f64 / recorded_hz;
    let (begin_s, end_s) = if seconds > LONG_S {
        let length = rng.random_range(1.5..5.0);
        let begin = rng.random_range(0.0..seconds - length);
        (begin, begin + length)
    } else {
        let mut lost = || rng.random_range(0.0..0.08) * seconds;
        (lost(), seconds - lost())
    };
    let clip_hz = rng.random_range(7.0..26.0_f64).min(recorded_hz);
    let count =
        (((end_s - begin_s) * clip_hz).round() as usize).clamp(FRAMES[0], FRAMES[1]).min(frames.max(1));
    let at = |n: usize| {
        let t = begin_s + (end_s - begin_s) * (n as f64 + 0.5) / count as f64;
        ((t * recorded_hz) as usize).min(frames.saturating_sub(1))
    };
    (0..count).map(at).collect()
}

impl Bodies<'_> {
    fn frames(&self) -> usize {
        match self {
            Self::Capsules(frames) => frames.len(),
            Self::Parts(frames, _) => frames.len(),
        }
    }

    /// Keeps points that the template draws, and frames with any.
    fn drop_undrawn(&mut self) {
        match self {
            Self::Capsules(frames) => frames.retain(|body| body.iter().any(Capsule::is_finite)),
            Self::Parts(frames, template) => {
                let markers = template.parts.iter().flat_map(|part| &part.markers);
                let drawn: HashSet<&str> = markers.map(String::as_str).collect();
                frames.iter_mut().for_each(|points| points.retain(|name, _| drawn.contains(*name)));
                frames.retain(|points| !points.is_empty());
            }
        }
    }

    fn each(&mut self, mut change: impl FnMut(&mut Point3)) {
        match self {
            Self::Capsules(frames) => frames.iter_mut().flatten().for_each(|capsule| {
                change(&mut capsule.from);
                change(&mut capsule.to);
            }),
            Self::Parts(frames, _) => frames.iter_mut().flat_map(HashMap::values_mut).for_each(change),
        }
    }

    fn extents(&self) -> Vec<[Point3; 2]> {
        let of = |points: &mut dyn Iterator<Item = Point3>| {
            points.filter(|p| p.iter().all(|v| v.is_finite())).fold(
                [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]],
                |[low, high], p| {
                    [std::array::from_fn(|k| low[k].min(p[k])), std::array::from_fn(|k| high[k].max(p[k]))]
                },
            )
        };
        match self {
            Self::Capsules(frames) => {
                let ends = |body: &Vec<Capsule>| of(&mut body.iter().flat_map(|c| [c.from, c.to]));
                frames.iter().map(ends).collect()
            }
            Self::Parts(frames, _) => frames.iter().map(|points| of(&mut points.values().copied())).collect(),
        }
    }

    /// Moves the ground to 0 and the path's middle to the origin; returns the 90th percentile of the extent.
    fn set_down(&mut self) -> Option<f64> {
        let extents = self.extents();
        let rank = |mut values: Vec<f64>, share: f64| {
            values.retain(|v| v.is_finite());
            values.sort_by(f64::total_cmp);
            values.get((share * values.len().saturating_sub(1) as f64) as usize).copied()
        };
        let ground = rank(extents.iter().map(|[low, _]| low[2]).collect(), 0.02)?;
        let sides = |[low, high]: &[Point3; 2]| (0..3).map(|k| high[k] - low[k]).fold(0.0, f64::max);
        let stature_mm = rank(extents.iter().map(sides).collect(), 0.9)?.clamp(300.0, 3000.0);
        let middle: [f64; 2] = [0, 1].map(|k| {
            extents.iter().map(|[low, high]| 0.5 * (low[k] + high[k])).sum::<f64>()
                / extents.len().max(1) as f64
        });
        self.each(|p| *p = [p[0] - middle[0], p[1] - middle[1], p[2] - ground]);
        Some(stature_mm)
    }

    fn selected(&self, frames: &[usize]) -> Self {
        match self {
            Self::Capsules(all) => {
                Self::Capsules(frames.iter().filter_map(|&n| all.get(n).cloned()).collect())
            }
            Self::Parts(all, template) => {
                Self::Parts(frames.iter().filter_map(|&n| all.get(n).cloned()).collect(), template.clone())
            }
        }
    }

    fn dressed(mut self, thickness: f64) -> Self {
        match &mut self {
            Self::Capsules(frames) => frames.iter_mut().flatten().for_each(|c| c.radius_mm *= thickness),
            Self::Parts(_, template) => {
                template.parts.iter_mut().for_each(|part| part.thickness_mm *= thickness)
            }
        }
        self
    }

    fn seen_by(&self, camera: &Camera, stature_mm: f64, scaling: Scaling, rng: &mut ChaCha8Rng) -> Track {
        match self {
            Self::Capsules(frames) => camera.track(frames, stature_mm, scaling, rng),
            Self::Parts(frames, template) => {
                let thick = template.parts.iter().any(|part| part.thickness_mm > 0.0);
                let gap_mm = CLOSED_MM[usize::from(thick)];
                camera.track_of_parts(frames, (template, gap_mm), stature_mm, scaling, rng)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn capsules(frames: usize) -> Vec<Vec<Capsule>> {
        let at = |x: f64, z: f64| [3000.0 + x, 500.0, 1000.0 + z];
        (0..frames)
            .map(|n| {
                let up = 1600.0 * n as f64 / frames as f64;
                vec![
                    Capsule::new(at(0.0, 0.0), at(0.0, 1700.0), 120.0),
                    Capsule::new(at(0.0, 1300.0), at(600.0, up), 50.0),
                ]
            })
            .collect()
    }

    #[test]
    fn recordings_are_seen_from_all_sides_and_the_same_seed_sees_the_same() {
        let found = tracks(&Bodies::Capsules(capsules(60)), 30.0, 6, 4, Scaling::default());
        assert_eq!(found.len(), 6);
        assert_eq!(found, tracks(&Bodies::Capsules(capsules(60)), 30.0, 6, 4, Scaling::default()));
        assert_ne!(found[0], found[3]);
        for track in &found {
            let boxes = track.boxes.as_ref().expect("full frames");
            assert!((6..=64).contains(&track.frames()) && boxes.nrows() == track.frames());
        }
        assert!(tracks(&Bodies::Capsules(Vec::new()), 30.0, 6, 4, Scaling::default()).is_empty());
    }

    #[test]
    fn a_suit_looks_like_the_capsules_it_represents() {
        let template = Template::parse(
            "name = 'post'\n[[part]]\nname = 'post'\nmarkers = ['low', 'high']\nthickness_mm = 120.0\n\
             [[part]]\nname = 'arm'\nmarkers = ['shoulder', 'hand']\nthickness_mm = 50.0\n",
        )
        .expect("a template");
        let bodies = capsules(60);
        let frames: Vec<HashMap<&str, Point3>> = bodies
            .iter()
            .map(|body| {
                [
                    ("low", body[0].from),
                    ("high", body[0].to),
                    ("shoulder", body[1].from),
                    ("hand", body[1].to),
                ]
                .into()
            })
            .collect();
        // A tripod that no part names, also before the person comes.
        let before = vec![HashMap::new(); 20];
        let with_tripod = before.iter().chain(&frames).map(|frame| {
            let mut frame: HashMap<&str, Point3> = frame.clone();
            frame.insert("tripod", [12_000.0, 500.0, -800.0]);
            frame
        });
        let with_tripod = Bodies::Parts(with_tripod.collect(), template.clone());
        let suit = tracks(&Bodies::Parts(frames, template), 30.0, 4, 9, Scaling::default());
        assert_eq!(tracks(&with_tripod, 30.0, 4, 9, Scaling::default()), suit);
        let post = tracks(&Bodies::Capsules(bodies), 30.0, 4, 9, Scaling::default());
        for (a, b) in suit.iter().zip(&post) {
            assert_eq!(a.frames(), b.frames());
            let off = (&a.descriptors - &b.descriptors).mapv(f32::abs).mean().unwrap_or(1.0);
            // Perspective scales capsules but not a suit's parts, and small gaps are closed: a pixel or two
            // of a hundred.
            assert!(off < 0.03, "{off}");
        }
    }

    #[test]
    fn long_recordings_are_cut_to_pieces_and_short_ones_hardly() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        for _ in 0..50 {
            let long = cut(3000, 100.0, &mut rng);
            assert!(long[long.len() - 1] - long[0] < 500 && long.len() <= 64);
            let short = cut(40, 20.0, &mut rng);
            assert!(short[0] <= 4 && short[short.len() - 1] >= 34 && short.windows(2).all(|p| p[0] <= p[1]));
            assert_eq!(cut(1, 0.0, &mut rng), [0]);
        }
    }
}

//! Augmentation: drops random frames (irregular cameras) and shifts whole clips (build, clothes, tracker),
//! because synthetic people have even frame rates and exact shapes (Tobin et al., IROS 2017).

use super::training::NetworkSettings;
use ndarray::{Array1, Array2, Axis};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

/// Embedded frames of a clip.
#[derive(Clone, Debug, PartialEq)]
pub struct Embedded {
    /// Frames x dimensions, over the gallery's spread.
    pub points: Array2<f32>,
    /// Height, width and centroid, if known.
    pub boxes: Option<Array2<f32>>,
}

const FEWEST: usize = 6;

/// Clips as a training step sees them, drawn with its own seed.
pub(super) fn varied(clips: &[Embedded], settings: &NetworkSettings) -> Vec<Embedded> {
    let mut rng = ChaCha8Rng::seed_from_u64(settings.seed);
    let spread = spread(clips);
    clips.iter().map(|clip| clip.varied(settings, &spread, &mut rng)).collect()
}

pub(super) fn spread(clips: &[Embedded]) -> Array1<f32> {
    let frames: usize = clips.iter().map(|clip| clip.points.nrows()).sum();
    let n = frames.max(1) as f32;
    let mean_of = |of: &dyn Fn(&Embedded) -> Array1<f32>| {
        clips.iter().map(of).reduce(|sum, next| sum + next).unwrap_or_default() / n
    };
    let mean = mean_of(&|clip| clip.points.sum_axis(Axis(0)));
    mean_of(&|clip| (&clip.points - &mean).mapv(|v| v * v).sum_axis(Axis(0))).mapv(f32::sqrt)
}

impl Embedded {
    pub(super) fn varied(
        &self,
        settings: &NetworkSettings,
        spread: &Array1<f32>,
        rng: &mut ChaCha8Rng,
    ) -> Self {
        self.thinned(settings.keep, rng).shifted(spread, settings.shift, rng)
    }

    fn thinned(&self, least: f32, rng: &mut ChaCha8Rng) -> Self {
        if least >= 1.0 {
            return self.clone();
        }
        let frames = self.points.nrows();
        let share = least + (1.0 - least) * rng.random::<f32>();
        let mut chosen = Vec::with_capacity(frames);
        for frame in 0..frames {
            let needed = chosen.len() + frames - frame <= FEWEST;
            if rng.random::<f32>() < share || needed {
                chosen.push(frame);
            }
        }
        Self {
            points: self.points.select(Axis(0), &chosen),
            boxes: self.boxes.as_ref().map(|boxes| boxes.select(Axis(0), &chosen)),
        }
    }

    /// Adds an offset per component, equal in all frames, drawn with `shift` times the component's `spread`.
    fn shifted(mut self, spread: &Array1<f32>, shift: f32, rng: &mut ChaCha8Rng) -> Self {
        if shift > 0.0 {
            let offsets: Array1<f32> =
                spread.iter().map(|v| shift * v * rng.sample::<f32, _>(StandardNormal)).collect();
            self.points += &offsets;
        }
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn numbered(frames: usize) -> Embedded {
        Embedded {
            points: Array2::from_shape_fn((frames, 3), |(frame, k)| (10 * frame + k) as f32),
            boxes: Some(Array2::from_shape_fn((frames, 4), |(frame, _)| frame as f32)),
        }
    }

    #[test]
    fn frames_are_left_out_in_their_order_and_none_of_the_shortest_clips() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let whole = numbered(40);
        let counts: Vec<usize> = (0..200)
            .map(|_| {
                let thinned = whole.thinned(0.5, &mut rng);
                let numbers = thinned.boxes.expect("boxes").column(0).to_vec();
                assert!(numbers.windows(2).all(|pair| pair[0] < pair[1]), "{numbers:?}");
                let rows: Vec<usize> = numbers.iter().map(|number| *number as usize).collect();
                assert_eq!(thinned.points, whole.points.select(Axis(0), &rows));
                assert_eq!(numbered(FEWEST).thinned(0.0, &mut rng), numbered(FEWEST));
                assert_eq!(whole.thinned(1.0, &mut rng), whole);
                numbers.len()
            })
            .collect();
        // Shares are uniform between a half and all: mean three quarters, with extremes.
        let mean = counts.iter().sum::<usize>() as f32 / 200.0;
        assert!((28.5..31.5).contains(&mean), "{mean}");
        assert!(counts.iter().any(|n| *n < 22) && counts.iter().any(|n| *n > 37), "{counts:?}");
        assert!((0..200).all(|_| whole.thinned(0.0, &mut rng).points.nrows() >= FEWEST));
    }

    #[test]
    fn a_whole_clip_is_shifted_by_as_much_as_its_components_vary() {
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        let spread = Array1::from_vec(vec![1.0, 10.0, 0.0]);
        assert_eq!(numbered(9).shifted(&spread, 0.0, &mut rng), numbered(9));
        let mut squares = Array1::<f32>::zeros(3);
        for _ in 0..500 {
            let moved = numbered(9).shifted(&spread, 0.2, &mut rng).points - numbered(9).points;
            let offset = moved.row(0).to_owned();
            assert!((&moved - &offset).iter().all(|v| v.abs() < 1e-4), "the same in all frames: {moved}");
            squares += &offset.mapv(|v| v * v / 500.0);
        }
        // The spread of 500 values is known to a thirtieth; four of these.
        assert!((squares[0].sqrt() - 0.2).abs() < 0.03 && (squares[1].sqrt() - 2.0).abs() < 0.3, "{squares}");
        assert_eq!(squares[2], 0.0);
    }
}

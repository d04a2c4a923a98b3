//! Unknown activities by the conformal rule (Vovk et al., Algorithmic Learning in a Random World, 2005). A
//! clip is unknown if its distance exceeds the k-th of n calibration distances of other people, k =
//! ceil((n + 1) (1 - share)). A new person of the same population is wrongly called unknown with at most that
//! probability. Each activity with enough clips has its own limit (Mondrian); the others share one.

use serde::{Deserialize, Serialize};

/// Distance limits for unknown answers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Limits {
    /// Distance limit per class.
    pub distances: Vec<f32>,
    /// Share of known clips that is called unknown.
    pub false_alarms: f32,
}

impl Limits {
    /// Default share of false alarms.
    pub const FALSE_ALARMS: f32 = 0.05;

    /// No limits: nothing is unknown.
    pub fn none(classes: usize) -> Self {
        Self { distances: vec![f32::INFINITY; classes], false_alarms: 0.0 }
    }

    /// From class and distance of calibration clips.
    pub fn conformal(scored: &[(usize, f32)], classes: usize, false_alarms: f32) -> Self {
        let all = limit(scored.iter().map(|(_, distance)| *distance).collect(), false_alarms)
            .unwrap_or(f32::INFINITY);
        let of_class = |class: usize| {
            let own = scored.iter().filter(|(answer, _)| *answer == class).map(|(_, distance)| *distance);
            limit(own.collect(), false_alarms).unwrap_or(all)
        };
        Self { distances: (0..classes).map(of_class).collect(), false_alarms }
    }

    /// Smallest number of clips for this share.
    pub fn fewest(false_alarms: f32) -> usize {
        (1..).find(|clips| place(*clips, false_alarms) <= *clips).unwrap_or(usize::MAX)
    }

    /// Outlier score of an answer; above 1 is unknown.
    pub fn score(&self, class: usize, distance: f32) -> f32 {
        distance / self.distances.get(class).copied().unwrap_or(f32::INFINITY).max(1e-9)
    }
}

fn limit(mut distances: Vec<f32>, false_alarms: f32) -> Option<f32> {
    distances.retain(|distance| distance.is_finite());
    distances.sort_by(f32::total_cmp);
    distances.get(place(distances.len(), false_alarms).checked_sub(1)?).copied()
}

/// Rank of the limit, from 1.
fn place(distances: usize, false_alarms: f32) -> usize {
    ((distances + 1) as f64 * (1.0 - f64::from(false_alarms))).ceil() as usize
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng, SeedableRng};

    #[test]
    fn at_most_the_stated_share_of_what_is_known_is_called_unknown() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(8);
        let (mut alarms, mut asked) = (0, 0);
        for _ in 0..400 {
            // Any distribution works: heavy tails, different for two classes.
            let mut draw =
                |class: usize| (class, (1.0 / rng.random_range(0.01..1.0_f32)) * (1 + 9 * class) as f32);
            let scored: Vec<(usize, f32)> = (0..120).map(|i| draw(i % 2)).collect();
            let limits = Limits::conformal(&scored, 2, 0.05);
            for i in 0..20 {
                let (class, distance) = draw(i % 2);
                alarms += u32::from(limits.score(class, distance) > 1.0);
                asked += 1;
            }
        }
        let share = f64::from(alarms) / f64::from(asked);
        // 5 % of 8000 with a spread of 0.25 points, slightly less by rounding to whole clips.
        assert!((0.03..=0.058).contains(&share), "{share}");
    }

    #[test]
    fn classes_with_few_clips_share_a_limit_and_none_means_all_are_known() {
        let scored: Vec<(usize, f32)> = (0..99).map(|i| (0, i as f32)).chain([(1, 5.0)]).collect();
        let limits = Limits::conformal(&scored, 3, 0.05);
        assert_eq!(limits.distances[1], limits.distances[2]);
        assert_eq!(Limits::conformal(&[], 2, 0.05), Limits { false_alarms: 0.05, ..Limits::none(2) });
        assert_eq!(Limits::none(2).score(1, 1e9), 0.0);
        assert_eq!(Limits::fewest(0.05), 19);
    }
}

//! How long clips of an activity last.
//!
//! The durations of a hidden semi-Markov model's states (Yu, Artificial Intelligence 174, 2010), log-normal here: people differ by factors. The
//! spread is drawn towards one that any activity may have, as if that had been seen in some clips more, so that it is not 0 of one clip.

use super::clip::Clip;
use serde::{Deserialize, Serialize};

/// Spread of the logarithm of lengths where nothing is known of an activity.
const SPREAD: f32 = 0.6;
/// Clips that this counts as much as.
const PRIOR_CLIPS: f32 = 2.0;

/// Lengths of an activity's clips.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Lengths {
    /// Mean of the logarithm of frames.
    pub mean_ln: f32,
    /// Its spread.
    pub spread: f32,
}

impl Lengths {
    /// About a number of frames, of an activity of which no more is known.
    pub fn about(frames: usize) -> Self {
        Self { mean_ln: (frames.max(1) as f32).ln(), spread: SPREAD }
    }

    /// Of each activity's clips.
    pub(super) fn of(clips: &[Clip], activities: &[String]) -> Vec<Self> {
        activities.iter().map(|activity| Self::of_activity(clips, activity)).collect()
    }

    fn of_activity(clips: &[Clip], activity: &str) -> Self {
        let own = clips.iter().filter(|clip| clip.activity == activity);
        let ln: Vec<f32> = own.map(|clip| (clip.views[0].frames().max(1) as f32).ln()).collect();
        let count = ln.len() as f32;
        let mean_ln = ln.iter().sum::<f32>() / count.max(1.0);
        let squares: f32 = ln.iter().map(|v| (v - mean_ln) * (v - mean_ln)).sum();
        let variance = (squares + PRIOR_CLIPS * SPREAD * SPREAD) / (count + PRIOR_CLIPS);
        Self { mean_ln, spread: variance.sqrt() }
    }

    /// How unlikely it is that one lasts so many frames, in nats, against the likeliest of an activity of which nothing is known.
    pub fn unlikely(&self, frames: f32) -> f32 {
        let off = (frames.ln() - self.mean_ln) / self.spread;
        0.5 * off * off + (self.spread / SPREAD).ln()
    }

    /// Whether they can be lengths at all.
    pub(super) fn is_sound(&self) -> bool {
        self.mean_ln.is_finite() && self.spread.is_finite() && self.spread > 0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::clip::Track;
    use crate::embedding::descriptor::{ANGLES, CELLS};
    use ndarray::Array2;

    #[test]
    fn lengths_are_those_of_the_activitys_clips() {
        let clip = |activity: &str, frames: usize| {
            let (descriptors, cells) = (Array2::zeros((frames, ANGLES)), Array2::zeros((frames, CELLS)));
            let view = Track { descriptors, cells, boxes: None, empty_frames: 0 };
            Clip { subject: "a".into(), activity: activity.into(), views: vec![view] }
        };
        let clips = [clip("wave", 10), clip("sit", 20), clip("sit", 80)];
        let [sit, wave] = Lengths::of(&clips, &["sit".into(), "wave".into()])[..] else { panic!("two") };
        // The geometric mean of 20 and 80 is 40, each a factor of 2 away: (2 ln(2)^2 + 2 * 0.36) / 4 by hand.
        assert!((sit.mean_ln.exp() - 40.0).abs() < 1e-3, "{sit:?}");
        assert!((sit.spread - 0.420_2_f32.sqrt()).abs() < 1e-3, "{sit:?}");
        // One clip: two thirds of what any activity may have.
        assert!((wave.spread - (0.36_f32 * 2.0 / 3.0).sqrt()).abs() < 1e-6, "{wave:?}");
        assert_eq!(Lengths::about(10).unlikely(10.0), 0.0);
        assert!(wave.unlikely(10.0) < wave.unlikely(20.0) && wave.unlikely(20.0) < wave.unlikely(2.0));
        assert!(sit.is_sound() && !Lengths { mean_ln: 1.0, spread: 0.0 }.is_sound());
    }
}

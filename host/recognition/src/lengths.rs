//! Durations of activities: log-normal, as in a hidden semi-Markov model (Yu, Artificial Intelligence 174,
//! 2010). The spread has a prior worth some clips, so that a single clip does not give 0.

use super::clip::Clip;
use serde::{Deserialize, Serialize};

const SPREAD: f32 = 0.6;
/// Number of clips that the prior counts for.
const PRIOR_CLIPS: f32 = 2.0;

/// Distribution of an activity's clip lengths.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Lengths {
    /// Mean of the log of frames.
    pub mean_ln: f32,
    /// Spread of the log of frames.
    pub spread: f32,
}

impl Lengths {
    /// Prior around a number of frames.
    pub fn about(frames: usize) -> Self {
        Self { mean_ln: (frames.max(1) as f32).ln(), spread: SPREAD }
    }

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

    /// Negative log likelihood of a length, in nats, relative to the prior's maximum.
    pub fn unlikely(&self, frames: f32) -> f32 {
        let off = (frames.ln() - self.mean_ln) / self.spread;
        0.5 * off * off + (self.spread / SPREAD).ln()
    }

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
        // The geometric mean of 20 and 80 is 40, each a factor of 2 away: (2 ln(2)^2 + 2 * 0.36) / 4.
        assert!((sit.mean_ln.exp() - 40.0).abs() < 1e-3, "{sit:?}");
        assert!((sit.spread - 0.420_2_f32.sqrt()).abs() < 1e-3, "{sit:?}");
        // One clip: two thirds of the prior's variance.
        assert!((wave.spread - (0.36_f32 * 2.0 / 3.0).sqrt()).abs() < 1e-6, "{wave:?}");
        assert_eq!(Lengths::about(10).unlikely(10.0), 0.0);
        assert!(wave.unlikely(10.0) < wave.unlikely(20.0) && wave.unlikely(20.0) < wave.unlikely(2.0));
        assert!(sit.is_sound() && !Lengths { mean_ln: 1.0, spread: 0.0 }.is_sound());
    }
}

//! Calibration of confidences, and separation of known from unknown by a score.

const BINS: usize = 15;

/// Reliability diagram: confidences and right answers in bins of equal width.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Reliability {
    /// Per bin: answers, sum of confidences, right ones.
    bins: [(u32, f64, u32); BINS],
}

impl Reliability {
    /// Adds an answer with confidence 0 to 1.
    pub fn count(&mut self, confidence: f32, right: bool) {
        let bin = &mut self.bins[((confidence * BINS as f32) as usize).min(BINS - 1)];
        *bin = (bin.0 + 1, bin.1 + f64::from(confidence), bin.2 + u32::from(right));
    }

    /// Mean confidence, share of right answers and count of each non-empty bin.
    pub fn curve(&self) -> Vec<(f64, f64, u32)> {
        let filled = self.bins.iter().filter(|(answers, ..)| *answers > 0);
        filled.map(|&(n, sum, right)| (sum / f64::from(n), f64::from(right) / f64::from(n), n)).collect()
    }

    /// Expected calibration error (Naeini et al., AAAI 2015); 0 without answers.
    pub fn expected_error(&self) -> f64 {
        let curve = self.curve();
        let all: u32 = curve.iter().map(|(.., n)| n).sum();
        let off = curve.iter().map(|(sure, right, n)| (sure - right).abs() * f64::from(*n));
        off.sum::<f64>() / f64::from(all.max(1))
    }
}

/// Area under the ROC curve: probability that an unknown clip scores higher than a known one; ties count half
/// (Mann and Whitney 1947). NaN if either is empty.
pub fn area_under_roc(known: &[f32], strange: &[f32]) -> f64 {
    let mut all: Vec<(f32, bool)> =
        known.iter().map(|v| (*v, false)).chain(strange.iter().map(|v| (*v, true))).collect();
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (mut below, mut wins, mut from) = (0.0, 0.0, 0);
    while from < all.len() {
        let to = from + all[from..].iter().take_while(|entry| entry.0 == all[from].0).count().max(1);
        let strange_here = all[from..to].iter().filter(|entry| entry.1).count() as f64;
        let known_here = (to - from) as f64 - strange_here;
        wins += strange_here * (below + 0.5 * known_here);
        below += known_here;
        from = to;
    }
    wins / (known.len() as f64 * strange.len() as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn answers_that_are_as_sure_as_right_have_no_error() {
        let mut fair = Reliability::default();
        (0..100).for_each(|i| fair.count(0.75, i < 75));
        (0..10).for_each(|_| fair.count(1.0, true));
        assert!(fair.expected_error() < 1e-9);
        let mut boastful = Reliability::default();
        (0..100).for_each(|i| boastful.count(0.95, i < 45));
        assert!((boastful.expected_error() - 0.5).abs() < 1e-6);
        assert_eq!(Reliability::default().expected_error(), 0.0);
        assert_eq!(boastful.curve().len(), 1);
    }

    #[test]
    fn areas_are_known_for_small_cases() {
        assert_eq!(area_under_roc(&[1.0, 2.0], &[3.0, 4.0]), 1.0);
        assert_eq!(area_under_roc(&[3.0, 4.0], &[1.0, 2.0]), 0.0);
        assert_eq!(area_under_roc(&[1.0, 1.0], &[1.0]), 0.5);
        assert_eq!(area_under_roc(&[1.0, 3.0], &[2.0, f32::INFINITY]), 0.75);
        assert!(area_under_roc(&[], &[1.0]).is_nan());
    }
}

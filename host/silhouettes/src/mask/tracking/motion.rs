//! Kalman filter of position and velocity along one axis (Journal of Basic Engineering 82, 1960), in pixels.

/// Standard deviations of a measured position and of the velocity change per frame, in heights.
const MEASURED: f64 = 0.04;
const PACE: f64 = 0.012;

#[derive(Clone, Copy, Debug)]
pub(super) struct Motion {
    /// Predicted position, px.
    pub at: f64,
    pace: f64,
    covariance: [f64; 3],
}

impl Motion {
    pub fn new(at: f64, height: f64) -> Self {
        // Up to a tenth of a height per frame initially.
        Self { at, pace: 0.0, covariance: [(MEASURED * height).powi(2), 0.0, (0.1 * height).powi(2)] }
    }

    pub fn predict(&mut self, height: f64) {
        self.at += self.pace;
        let [a, b, c] = self.covariance;
        let q = (PACE * height).powi(2);
        self.covariance = [a + 2.0 * b + c + 0.25 * q, b + c + 0.5 * q, c + q];
    }

    /// Variance of a measurement, px squared.
    pub fn variance(&self, height: f64) -> f64 {
        self.covariance[0] + (MEASURED * height).powi(2)
    }

    pub fn correct(&mut self, measured: f64, height: f64) {
        let [a, b, c] = self.covariance;
        let s = self.variance(height);
        let (gain, of_pace) = (a / s, b / s);
        let off = measured - self.at;
        self.at += gain * off;
        self.pace += of_pace * off;
        self.covariance = [a * (1.0 - gain), b * (1.0 - gain), c - of_pace * b];
    }

    /// Limits the position to an interval, as for an occluded person.
    pub fn keep_within(&mut self, low: usize, high: usize) {
        let within = self.at.clamp(low as f64, high as f64);
        if within != self.at {
            // A person who has not emerged has slowed down.
            (self.at, self.pace) = (within, 0.5 * self.pace);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_steady_pace_is_learned_and_carried_on_with_growing_doubt() {
        let mut motion = Motion::new(100.0, 80.0);
        for n in 1..30 {
            motion.predict(80.0);
            motion.correct(100.0 + 3.0 * f64::from(n), 80.0);
        }
        let sure = motion.variance(80.0);
        for _ in 0..10 {
            motion.predict(80.0);
        }
        assert!((motion.at - 217.0).abs() < 2.0, "{}", motion.at);
        assert!(motion.variance(80.0) > 2.0 * sure);
        motion.keep_within(0, 200);
        assert!(motion.at == 200.0 && motion.pace < 2.0);
    }
}

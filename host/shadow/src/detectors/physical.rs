//! Physical: a shadow removes the direct light's share, which is equal on all matt surfaces and can be learnt
//! (Huang and Chen, "Moving cast shadow detection using physics-based features", CVPR 2009).
//!
//! With direct light d, ambient light a and reflectance b, a lit pixel is b (d + a) and a shaded one b a, so
//! `g = (background - frame) / background = d / (d + a)` per channel. Its direction is
//! `theta = atan2(g_green, g_red)` and `phi = acos(g_blue / |g|)`. A weak detector (darker, within a cone
//! around the background's colour) proposes pixels. Their angles feed a Gaussian mixture with a confidence
//! that drops at new gradients. A proposed pixel near a heavy component is shadow.

use ndarray::Array2;

use super::images::{Images, gradient, intensity, rgb};
use farnear_silhouettes::mask::Mask;

/// Proposed brightness relative to the background.
const DARKEST: f32 = 0.2;
const LIGHTEST: f32 = 0.95;
/// Largest angle between the frame's and the background's colour.
const CONE_DEG: f32 = 12.0;
/// Gradient difference at confidence exp(-1/2), grey levels per pixel.
const GRADIENT_SCALE: f32 = 8.0;
/// Share of the mixture replaced per frame, 0 to 1.
const LEARNING_RATE: f32 = 0.1;
/// Distance within which a pixel belongs to a component, standard deviations.
const REACH_SD: f32 = 2.0;
/// Smallest weight of a shadow component.
const LEAST_WEIGHT: f32 = 0.25;
const COMPONENTS: usize = 5;
/// Standard deviation of a new component, radians, and lower limit.
const FIRST_SD: f32 = 0.12;
const LEAST_SD: f32 = 0.03;
/// Smallest confidence-weighted number of pixels for learning.
const LEAST_EVIDENCE: f32 = 20.0;

#[derive(Clone, Copy, Debug)]
struct Component {
    weight: f32,
    mean: [f32; 2],
    variance: f32,
}

impl Component {
    fn distance_sd(&self, angles: [f32; 2]) -> f32 {
        let squared: f32 = angles.iter().zip(self.mean).map(|(x, mean)| (x - mean).powi(2)).sum();
        (squared / self.variance).sqrt()
    }
}

#[derive(Clone, Debug, Default)]
pub struct Physical {
    mixture: Vec<Component>,
}

impl Physical {
    pub fn detect(&mut self, images: &Images<'_>) -> Mask {
        let (frame, background) = (intensity(images.frame), intensity(images.background));
        let (frame_slope, background_slope) = (gradient(&frame), gradient(&background));
        let mut proposed: Array2<Option<[f32; 2]>> = Array2::from_elem(images.size(), None);
        let mut samples = Vec::new();
        for (at, _) in images.foreground.indexed_iter().filter(|&(_, &set)| set) {
            let (f, b) = (rgb(images.frame, at), rgb(images.background, at));
            if !Self::weakly_shadow(f, b) {
                continue;
            }
            let angles = direction(f, b);
            proposed[at] = Some(angles);
            // Gradient of the shaded background, compared with the frame's.
            let shade = frame[at] / background[at].max(1.0);
            let [across, down] =
                [0, 1].map(|axis| frame_slope[at][axis] - shade * background_slope[at][axis]);
            let excess = (across * across + down * down) / GRADIENT_SCALE.powi(2);
            samples.push((angles, (-0.5 * excess).exp()));
        }
        self.learn(&samples);
        images.foreground_where(|at| proposed[at].is_some_and(|angles| self.is_shadow(angles)))
    }

    fn weakly_shadow(frame: [f32; 3], background: [f32; 3]) -> bool {
        let dot = |a: [f32; 3], b: [f32; 3]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f32>();
        let (along, length) = (dot(frame, background), dot(background, background));
        let norm = (length * dot(frame, frame)).sqrt();
        norm > 0.0
            && (DARKEST..=LIGHTEST).contains(&(along / length))
            && along >= norm * CONE_DEG.to_radians().cos()
    }

    fn is_shadow(&self, angles: [f32; 2]) -> bool {
        self.mixture
            .iter()
            .any(|component| component.weight >= LEAST_WEIGHT && component.distance_sd(angles) <= REACH_SD)
    }

    /// One update: each sample joins the nearest component within reach; the rest start a new one.
    fn learn(&mut self, samples: &[([f32; 2], f32)]) {
        let evidence: f32 = samples.iter().map(|&(_, confidence)| confidence).sum();
        if evidence < LEAST_EVIDENCE {
            return;
        }
        if self.mixture.is_empty() {
            let middle = [0, 1].map(|axis| weighted_median(samples, axis));
            self.mixture.push(Component { weight: 1.0, mean: middle, variance: FIRST_SD * FIRST_SD });
        }
        // Per component: confidence, angles, squared distances; the last entry is for outliers.
        let mut sums = vec![(0.0_f32, [0.0_f32; 2], 0.0_f32); self.mixture.len() + 1];
        for &(angles, confidence) in samples {
            let nearest = self
                .mixture
                .iter()
                .enumerate()
                .map(|(index, component)| (index, component.distance_sd(angles)))
                .min_by(|a, b| a.1.total_cmp(&b.1))
                .filter(|&(_, distance)| distance <= REACH_SD);
            let (index, squared) = nearest.map_or((self.mixture.len(), 0.0), |(index, distance)| {
                (index, distance * distance * self.mixture[index].variance)
            });
            let sum = &mut sums[index];
            sum.0 += confidence;
            sum.2 += confidence * squared;
            for (total, angle) in sum.1.iter_mut().zip(angles) {
                *total += confidence * angle;
            }
        }
        for (component, &(confidence, angles, squared)) in self.mixture.iter_mut().zip(&sums) {
            component.weight += LEARNING_RATE * (confidence / evidence - component.weight);
            if confidence > 0.0 {
                // New and old evidence are weighted by their shares of the weight.
                let step =
                    (LEARNING_RATE * confidence / evidence / component.weight.max(LEARNING_RATE)).min(1.0);
                for (mean, total) in component.mean.iter_mut().zip(angles) {
                    *mean += step * (total / confidence - *mean);
                }
                // Half, because the variance is per axis and the distance has two.
                component.variance += step * (0.5 * squared / confidence - component.variance);
                component.variance = component.variance.max(LEAST_SD * LEAST_SD);
            }
        }
        let strays = sums[self.mixture.len()];
        if strays.0 > 0.1 * evidence {
            if self.mixture.len() == COMPONENTS {
                self.mixture.sort_by(|a, b| b.weight.total_cmp(&a.weight));
                self.mixture.pop();
            }
            let mean = strays.1.map(|total| total / strays.0);
            self.mixture.push(Component { weight: LEARNING_RATE, mean, variance: FIRST_SD * FIRST_SD });
        }
        let total: f32 = self.mixture.iter().map(|component| component.weight).sum();
        self.mixture.iter_mut().for_each(|component| component.weight /= total);
    }
}

/// Direction of the missing light, (theta, phi) in radians.
fn direction(frame: [f32; 3], background: [f32; 3]) -> [f32; 2] {
    let lost = [0, 1, 2].map(|channel| (background[channel] - frame[channel]) / background[channel].max(1.0));
    let norm = lost.iter().map(|share| share * share).sum::<f32>().sqrt().max(f32::MIN_POSITIVE);
    [lost[1].atan2(lost[0]), (lost[2] / norm).clamp(-1.0, 1.0).acos()]
}

fn weighted_median(samples: &[([f32; 2], f32)], axis: usize) -> f32 {
    let mut sorted: Vec<(f32, f32)> =
        samples.iter().map(|&(angles, weight)| (angles[axis], weight)).collect();
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
    let half = 0.5 * sorted.iter().map(|&(_, weight)| weight).sum::<f32>();
    let mut sum = 0.0;
    for &(angle, weight) in &sorted {
        sum += weight;
        if sum >= half {
            return angle;
        }
    }
    sorted.last().map_or(0.0, |&(angle, _)| angle)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_direction_of_missing_light_is_independent_of_the_surface() {
        // Sun to sky in the three channels: 3, 2 and 1.
        let lit = |surface: [f32; 3]| [4.0 * surface[0], 3.0 * surface[1], 2.0 * surface[2]];
        let expected = direction([30.0, 30.0, 30.0], lit([30.0, 30.0, 30.0]));
        for surface in [[10.0, 40.0, 25.0], [60.0, 20.0, 5.0], [5.0, 5.0, 50.0]] {
            let found = direction(surface, lit(surface));
            assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-5), "{surface:?}: {found:?}");
        }
        // g = (3/4, 2/3, 1/2).
        assert!((expected[0] - (2.0_f32 / 3.0).atan2(0.75)).abs() < 1e-6);
    }

    #[test]
    fn the_median_is_weighted_by_confidence() {
        let samples = [([1.0, 0.0], 1.0), ([2.0, 0.0], 1.0), ([9.0, 0.0], 3.0)];
        assert_eq!(weighted_median(&samples, 0), 9.0);
    }

    #[test]
    fn ignores_too_little_evidence() {
        let mut detector = Physical::default();
        detector.learn(&[([0.8, 0.9], 1.0); 5]);
        assert!(detector.mixture.is_empty());
        detector.learn(&[([0.8, 0.9], 1.0); 50]);
        assert!(detector.is_shadow([0.8, 0.9]) && !detector.is_shadow([1.5, 0.2]));
    }

    #[test]
    fn a_component_has_the_weighted_mean_and_spread_of_its_samples() {
        let mut detector = Physical::default();
        let samples: Vec<_> =
            (0..50).map(|i| if i < 25 { ([1.0, 1.0], 3.0) } else { ([1.2, 1.0], 2.0) }).collect();
        // 0.9 to the power of 200 is nothing.
        (0..200).for_each(|_| detector.learn(&samples));
        // Mean 1 + 0.4 * 0.2; variance per axis half of 0.6 * 0.08^2 + 0.4 * 0.12^2.
        let spread = 0.0048_f32.sqrt();
        for (angles, distance) in
            [([1.08, 1.0], 0.0), ([1.08 + spread, 1.0], 1.0), ([1.08, 1.0 - 2.0 * spread], 2.0)]
        {
            let found = detector.mixture[0].distance_sd(angles);
            assert!((found - distance).abs() < 1e-3, "{angles:?}: {found}");
        }
        assert_eq!(detector.mixture.len(), 1);
    }

    #[test]
    fn a_second_light_is_learned_and_forgotten_and_strays_are_not() {
        let (first, second, between) = ([0.5, 0.5], [1.2, 0.9], [0.85, 0.7]);
        let samples = |of_second| -> Vec<_> {
            (0..50).map(|i| (if i < of_second { second } else { first }, 1.0)).collect()
        };
        let mut detector = Physical::default();
        (0..50).for_each(|_| detector.learn(&samples(5)));
        assert!(detector.is_shadow(first) && detector.mixture.len() == 1, "a tenth may be noise");
        (0..50).for_each(|_| detector.learn(&samples(20)));
        assert!(detector.is_shadow(first) && detector.is_shadow(second) && !detector.is_shadow(between));
        (0..50).for_each(|_| detector.learn(&samples(0)));
        assert!(detector.is_shadow(first) && !detector.is_shadow(second));
        let total: f32 = detector.mixture.iter().map(|component| component.weight).sum();
        assert!((total - 1.0).abs() < 1e-5);
    }

    #[test]
    fn the_weakest_component_makes_room_for_a_new_one() {
        let mut detector = Physical::default();
        for light in 0..=COMPONENTS {
            // Ever fewer of the first; 1 apart, far beyond the reach of two standard deviations.
            let samples: Vec<_> =
                (0..50).map(|i| ([if i < 30 { 0.0 } else { 1.0 + light as f32 }, 0.0], 1.0)).collect();
            detector.learn(&samples);
        }
        assert_eq!(detector.mixture.len(), COMPONENTS);
        let means = || detector.mixture.iter().map(|component| component.mean[0]);
        assert!(means().any(|mean| mean == 0.0) && means().any(|mean| mean == 1.0 + COMPONENTS as f32));
    }
}

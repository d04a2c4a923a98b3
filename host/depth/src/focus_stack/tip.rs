//! The tip of a sharpness curve: its reciprocal as a parabola, by weighted least squares (see the parent module).

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Tip {
    pub place: f32,
    pub reliability: f32,
    /// The curve's largest value.
    pub sharpness: f32,
    /// Rise above the curve's mean, relative to it.
    pub rise: f32,
}

/// The tip of a sharpness curve over the stack's positions; NaN = not seen. The largest of many values that are almost equal
/// is one of noise, so a tip with twice the values of the fit is found in means of several, of which the fit's inner half is left.
pub(super) fn tip(curve: &[f32], positions: &[f64], fit_points: usize) -> Tip {
    let seen = || curve.iter().filter(|value| value.is_finite());
    let most = seen().fold(0.0_f32, |most, value| most.max(*value));
    let mean = seen().sum::<f32>() / seen().count().max(1) as f32;
    let upper = seen().filter(|value| **value > 0.5 * (most + mean)).count();
    let together = upper / (fit_points / 2 + 1);
    if upper < 2 * fit_points || curve.len() < LEAST_MEANS * together {
        return tip_of(curve, positions, fit_points);
    }
    let means: Vec<f32> = curve.chunks(together).map(mean_of_seen).collect();
    let places: Vec<f64> =
        positions.chunks(together).map(|part| part.iter().sum::<f64>() / part.len() as f64).collect();
    let tip = tip_of(&means, &places, fit_points);
    let [before, after] = [tip.place.floor(), tip.place.ceil()].map(|place| places[place as usize]);
    let position = before + f64::from(tip.place.fract()) * (after - before);
    Tip { place: place_of(positions, position) as f32, ..tip }
}

/// Fewest means of a curve.
const LEAST_MEANS: usize = 5;

/// NaN without a finite value.
fn mean_of_seen(values: &[f32]) -> f32 {
    let [sum, count] = values
        .iter()
        .filter(|value| value.is_finite())
        .fold([0.0_f32; 2], |[sum, count], value| [sum + value, count + 1.0]);
    sum / count
}

fn tip_of(curve: &[f32], positions: &[f64], fit_points: usize) -> Tip {
    let seen = || (0..curve.len()).filter(|i| curve[*i].is_finite());
    let count = seen().count();
    let largest = seen().max_by(|a, b| curve[*a].total_cmp(&curve[*b])).unwrap_or(0);
    let most = if count == 0 { 0.0 } else { curve[largest] };
    let mean = seen().map(|i| curve[i]).sum::<f32>() / count.max(1) as f32;
    let rise = if most > 0.0 { (1.0 - mean / most).clamp(0.0, 1.0) } else { 0.0 };
    let unreliable = Tip { place: largest as f32, reliability: 0.0, sharpness: most, rise };
    if 2 * count < curve.len() {
        // Nor does it count in its surroundings.
        return Tip { rise: 0.0, ..unreliable };
    }
    if largest == 0 || largest + 1 == curve.len() || most <= 0.0 {
        return unreliable;
    }
    if !(curve[largest - 1].is_finite() && curve[largest + 1].is_finite()) {
        return Tip { rise: 0.0, ..unreliable };
    }
    let half = fit_points / 2;
    let window = largest.saturating_sub(half)..(largest + half + 1).min(curve.len());
    let unit = (positions[largest + 1] - positions[largest - 1]) / 2.0;
    let [mut reciprocal, mut logarithm] = [Parabola::default(), Parabola::default()];
    let seen: Vec<usize> = window.filter(|i| curve[*i].is_finite()).collect();
    let coarse = is_coarse(curve, &seen, largest);
    for (at, &i) in seen.iter().enumerate() {
        let value = f64::from((curve[i] / most).max(1e-6));
        let t = (positions[i] - positions[largest]) / unit;
        // A sample next to a gap also counts for the gap: the samples then weigh as if they were even.
        let [before, after] = [at.saturating_sub(1), (at + 1).min(seen.len() - 1)];
        let spacing = (positions[seen[after]] - positions[seen[before]]) / (unit * (after - before) as f64);
        // Equal noise of all values: the weight is the squared inverse derivative. Three points need none, and fourth powers of
        // low ones are below the precision of the sums.
        let weight = if coarse { 1.0 } else { value.powi(4) * spacing };
        if !coarse || i.abs_diff(largest) <= 1 {
            reciprocal.add(t, -1.0 / value, weight);
        }
        logarithm.add(t, value.ln(), value * value * spacing);
    }
    let (Some((tip, _)), Some((_, determination))) = (reciprocal.tip(), logarithm.tip()) else {
        return unreliable;
    };
    let place = place_of(positions, positions[largest] + tip * unit);
    // A maximum beyond the neighbours does not belong to this curve: two peaks, or noise.
    if (place - largest as f64).abs() > 1.5 || tip.abs() > 3.0 {
        return unreliable;
    }
    let reliability = rise * determination.clamp(0.0, 1.0) as f32;
    Tip { place: place as f32, reliability, sharpness: most, rise }
}

/// Largest low value relative to the tip's. With steps of the width at half height, `1 / (1 + t^2)` has at most 0.2 beyond the tip
/// and one neighbour; with half of these steps it has 0.5 next to the tip.
const LOW: f32 = 0.4;
/// Largest height of a low value above the least value, relative to the tip's height.
const LOW_ABOVE_LEAST: f32 = 0.2;

/// Whether all values but the largest and one neighbour are low: the steps are about as wide as the curve, or wider. Values
/// beyond the neighbours are noise and the floor of a strong blur there, which would move the tip by up to half an image.
fn is_coarse(curve: &[f32], seen: &[usize], largest: usize) -> bool {
    let most = curve[largest];
    let least = seen.iter().fold(most, |least, i| least.min(curve[*i]));
    let larger = if curve[largest - 1] > curve[largest + 1] { largest - 1 } else { largest + 1 };
    let is_low = |i: usize| {
        let above_least = curve[i] - least;
        curve[i] < LOW * most && above_least < LOW_ABOVE_LEAST * (most - least)
    };
    seen.iter().all(|i| *i == largest || *i == larger || is_low(*i))
}

/// The image number at a position, from 0 and as a fraction between images; the first or last beyond the ends.
pub(super) fn place_of(positions: &[f64], position: f64) -> f64 {
    let falling = positions.len() > 1 && positions[1] < positions[0];
    let sign = if falling { -1.0 } else { 1.0 };
    let after = positions.partition_point(|p| sign * p < sign * position);
    match after {
        0 => 0.0,
        after if after == positions.len() => (after - 1) as f64,
        after => {
            let [low, high] = [positions[after - 1], positions[after]];
            (after - 1) as f64 + (position - low) / (high - low)
        }
    }
}

#[derive(Debug, Default)]
struct Parabola {
    /// Sums of the weights times `t^0` to `t^4`.
    powers: [f64; 5],
    /// Sums of the weights times `v t^0` to `v t^2`.
    values: [f64; 3],
    /// Sum of the weights times `v^2`.
    square: f64,
}

impl Parabola {
    fn add(&mut self, t: f64, v: f64, weight: f64) {
        let mut power = weight;
        for i in 0..5 {
            self.powers[i] += power;
            if i < 3 {
                self.values[i] += power * v;
            }
            power *= t;
        }
        self.square += weight * v * v;
    }

    /// Tip, and the part of the variance that the parabola explains; `None` without a maximum.
    fn tip(&self) -> Option<(f64, f64)> {
        let [s0, s1, s2, s3, s4] = self.powers;
        let [v0, v1, v2] = self.values;
        let minors = [s2 * s4 - s3 * s3, s1 * s4 - s2 * s3, s1 * s3 - s2 * s2];
        let determinant = s0 * minors[0] - s1 * minors[1] + s2 * minors[2];
        if determinant.abs() < 1e-12 * s0 * s0 * s0 {
            return None;
        }
        let a = (v0 * minors[0] - v1 * minors[1] + v2 * minors[2]) / determinant;
        let b = (-v0 * minors[1] + v1 * (s0 * s4 - s2 * s2) - v2 * (s0 * s3 - s1 * s2)) / determinant;
        let c = (v0 * minors[2] - v1 * (s0 * s3 - s1 * s2) + v2 * (s0 * s2 - s1 * s1)) / determinant;
        let explained = a * v0 + b * v1 + c * v2 - v0 * v0 / s0;
        let total = self.square - v0 * v0 / s0;
        (c < 0.0 && total > 0.0).then(|| (-b / (2.0 * c), explained / total))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `v = 2 + t - 3 t^2` at these places, with errors that are orthogonal to all parabolas.
    fn parabola(weight: f64, errors: [f64; 4]) -> Parabola {
        let mut parabola = Parabola::default();
        for (t, error) in [-1.0, 0.0, 1.0, 2.0].into_iter().zip(errors) {
            parabola.add(t, 2.0 + t - 3.0 * t * t + error, weight);
        }
        parabola
    }

    #[test]
    fn the_tip_and_the_explained_part_do_not_depend_on_the_unit_of_the_weights() {
        // Values -2, 2, 0, -8: their mean is -2, the squares about it sum to 56; the errors' squares to 20.
        for weight in [1e-4, 1.0, 1e4] {
            let (tip, explained) = parabola(weight, [0.0; 4]).tip().unwrap();
            assert!((tip - 1.0 / 6.0).abs() < 1e-9 && (explained - 1.0).abs() < 1e-9, "{tip} {explained}");
            let (tip, explained) = parabola(weight, [-1.0, 3.0, -3.0, 1.0]).tip().unwrap();
            assert!(
                (tip - 1.0 / 6.0).abs() < 1e-9 && (explained - 56.0 / 76.0).abs() < 1e-9,
                "{tip} {explained}"
            );
        }
    }

    #[test]
    fn a_tip_of_many_noisy_values_is_found_in_their_means() {
        let positions: Vec<f64> = (0..200).map(|i| 0.05 * f64::from(i)).collect();
        for seed in 0..50_u32 {
            let curve: Vec<f32> = (0..200_u32)
                .map(|i| {
                    let noise = ((i * 200 + seed).wrapping_mul(2_654_435_761) >> 16) as f32 / 65_536.0 - 0.5;
                    (1.0 + 0.3 * noise) / (1.0 + ((i as f32 - 101.3) / 30.0).powi(2))
                })
                .collect();
            let tip = tip(&curve, &positions, 11);
            assert!((tip.place - 101.3).abs() < 1.0 && tip.reliability > 0.1, "{seed}: {tip:?}");
        }
    }

    /// Steps of 1 to 4 times the width at half height; a floor as of noise.
    #[test]
    fn the_floor_around_a_coarse_peak_does_not_move_the_tip() {
        let positions = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0];
        let found = |steps: f32, tip_at: f32| {
            let value = |p: &f64| (1.0 / (1.0 + (steps * (*p as f32 - tip_at)).powi(2))).hypot(0.03);
            tip(&positions.each_ref().map(value), &positions, 11)
        };
        for (steps, most) in [(2.0, 0.01), (2.5, 0.02), (4.0, 0.05), (8.0, 0.2)] {
            for tip_at in [1.6, 2.0, 2.25, 2.5, 2.75, 3.0, 3.4] {
                let found = found(steps, tip_at);
                let error = (found.place - tip_at).abs();
                assert!(error < most && found.reliability > 0.2, "{steps}, {tip_at}: {found:?}");
            }
        }
        // On an image.
        assert!((found(8.0, 2.0).place - 2.0).abs() < 1e-4);
        // Neighbours whose fourth power is below the precision of the sums.
        assert_eq!(tip(&[0.001, 0.002, 1.0, 0.002, 0.001, 0.001], &positions, 11).place, 2.0);
    }

    #[test]
    fn only_a_single_peak_of_one_or_two_images_is_coarse() {
        for (curve, expected) in [
            (vec![0.02, 0.05, 1.0, 0.5, 0.04, 0.02], true),
            (vec![0.3, 0.34, 1.0, 0.9, 0.3, 0.31], true),
            // A bad image next to the tip; two surfaces; half a width apart; four images close to the tip.
            (vec![0.6, 0.8, 0.05, 1.0, 0.9, 0.7, 0.5], false),
            (vec![0.1, 1.0, 0.1, 0.9, 0.1], false),
            (vec![0.1, 0.2, 0.5, 1.0, 0.5, 0.2, 0.1], false),
            (vec![0.83, 1.0, 1.0, 0.83], false),
        ] {
            let largest = (0..curve.len()).max_by(|a, b| f32::total_cmp(&curve[*a], &curve[*b])).unwrap();
            let seen: Vec<usize> = (0..curve.len()).collect();
            assert_eq!(is_coarse(&curve, &seen, largest), expected, "{curve:?}");
        }
    }

    #[test]
    fn two_places_a_constant_or_a_minimum_have_no_tip() {
        let of = |samples: &[(f64, f64)]| {
            let mut parabola = Parabola::default();
            samples.iter().for_each(|&(t, v)| parabola.add(t, v, 1.0));
            parabola.tip()
        };
        assert_eq!(of(&[(0.0, 1.0), (1.0, 2.0), (1.0, 3.0)]), None);
        assert_eq!(of(&[(-1.0, 1.0), (0.0, 1.0), (1.0, 1.0)]), None);
        assert_eq!(of(&[(-1.0, 1.0), (0.0, 0.5), (1.0, 2.0)]), None);
        assert!(of(&[(-1.0, 1.0), (0.0, 1.5), (1.0, 1.2)]).is_some());
    }

    #[test]
    fn places_lie_between_the_images_in_either_direction() {
        for sign in [1.0, -1.0] {
            let positions = [2.0, 3.0, 5.0, 9.0].map(|position| sign * position);
            for (position, place) in
                [(0.0, 0.0), (2.0, 0.0), (2.25, 0.25), (3.0, 1.0), (6.0, 2.25), (9.0, 3.0), (20.0, 3.0)]
            {
                assert_eq!(place_of(&positions, sign * position), place, "{position}");
            }
        }
    }
}

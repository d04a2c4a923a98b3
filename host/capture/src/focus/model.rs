//! Where the focus lies, from focus measures of a few blurred images.
//!
//! The blur's radius grows with the distance `e` from focus, and a sum of squared gradients falls with a power of the
//! radius: with the fourth for a texture with a flat spectrum, with the second for one whose power falls with the square
//! of frequency. So `ln M = a - n/2 ln((p - p0)^2 + w^2)`, where `w` is the distance at which the blur becomes as large
//! as the pixel. `p0` is searched on a grid; `a` and `n` follow by linear least squares.

/// Step of the grid, nm; a tenth of what the piezo covers would do.
const GRID_NM: f64 = 4_000.0;
/// Texture between the two kinds above.
const USUAL_POWER: f64 = 3.0;
/// Weight of the usual power against the samples: decides only while there are hardly more samples than unknowns.
const PRIOR: f64 = 1e-5;
/// Measures of light and noise fall with no power at all, and no texture makes them fall faster than this.
const POWERS: (f64, f64) = (0.5, 6.0);

/// A focus measure at a place, nm.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Sample {
    pub place: f64,
    pub value: f64,
}

/// The place of the best focus within a range, nm. With one sample, or with none, the middle of the range.
pub(super) fn estimate(samples: &[Sample], width: f64, (low, high): (f64, f64)) -> f64 {
    let steps = ((high - low) / GRID_NM).ceil().max(1.0) as usize;
    let candidates = (0..=steps).map(|step| low + (high - low) * step as f64 / steps as f64);
    let usable: Vec<Sample> = samples.iter().copied().filter(|sample| sample.value > 0.0).collect();
    if usable.len() < 2 {
        return (low + high) / 2.0;
    }
    let misfits = candidates.map(|place| (place, misfit(&usable, width, place)));
    misfits.min_by(|a, b| a.1.total_cmp(&b.1)).map_or((low + high) / 2.0, |(place, _)| place)
}

/// Sum of squared differences of `ln M` from the model with its focus at `focus`.
fn misfit(samples: &[Sample], width: f64, focus: f64) -> f64 {
    let x = |sample: &Sample| -0.5 * ((sample.place - focus).powi(2) + width * width).ln();
    let count = samples.len() as f64;
    let (mean_x, mean_y) = samples.iter().fold((0.0, 0.0), |(sum_x, sum_y), sample| {
        (sum_x + x(sample) / count, sum_y + sample.value.ln() / count)
    });
    let (mut xx, mut xy) = (0.0, 0.0);
    for sample in samples {
        let (dx, dy) = (x(sample) - mean_x, sample.value.ln() - mean_y);
        xx += dx * dx;
        xy += dx * dy;
    }
    let power = ((xy + PRIOR * USUAL_POWER) / (xx + PRIOR)).clamp(POWERS.0, POWERS.1);
    let residual = |sample: &Sample| sample.value.ln() - mean_y - power * (x(sample) - mean_x);
    samples.iter().map(|sample| residual(sample).powi(2)).sum::<f64>() + PRIOR * (power - USUAL_POWER).powi(2)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(place: f64, focus: f64, width: f64, power: f64) -> Sample {
        let value = 1e4 * ((place - focus).powi(2) + width * width).powf(-power / 2.0) * 1e20;
        Sample { place, value }
    }

    #[test]
    fn a_few_blurred_images_tell_where_the_focus_is() {
        for focus in [-900e3, -250e3, 40e3, 600e3] {
            for power in [2.0, 3.0, 4.0] {
                // Three images of one place tell the side, and the distance to a factor of two.
                let first: Vec<Sample> =
                    [-95e3, 0.0, 95e3].map(|place| sample(place, focus, 230e3, power)).into();
                let range = (-1000e3, 1000e3);
                let rough = estimate(&first, 230e3, range);
                assert!(rough * focus > 0.0 || focus.abs() < 50e3, "{focus} {power}: {rough}");
                assert!((rough - focus).abs() < 0.7 * focus.abs() + 30e3, "{focus} {power}: {rough}");
                // Three more there tell it well.
                let mut all = first;
                all.extend([-95e3, 0.0, 95e3].map(|place| sample(rough + place, focus, 230e3, power)));
                let better = estimate(&all, 230e3, range);
                assert!((better - focus).abs() < 20e3, "{focus} {power}: {better}");
            }
        }
    }

    #[test]
    fn nothing_to_go_by_gives_the_middle() {
        assert_eq!(estimate(&[], 1.0, (10.0, 20.0)), 15.0);
        assert_eq!(estimate(&[Sample { place: 3.0, value: 0.0 }; 3], 1.0, (10.0, 20.0)), 15.0);
    }
}

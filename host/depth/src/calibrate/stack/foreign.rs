//! A slice that fits no response: defocused, exchanged or foreign. Without its one or two pairs the response fits the
//! other pairs far better. Several such slices are not found: the error stays large.

use super::ENOUGH_DEPTHS;
use super::curve::Curve;
use super::response::Sample;

/// Largest error without a foreign slice, relative to the error with it.
const FAR_BETTER: f64 = 0.5;
/// RMS error of normalised depth below which no slice is looked for.
const SMALL: f64 = 0.05;

/// The foreign slice; two slices where they have one pair only, of which either may be foreign; else none.
pub(super) fn find(samples: &[Sample], degree: usize, pair_step: usize, slices: usize) -> Vec<usize> {
    let Some(usual) = rms(samples, degree).filter(|usual| *usual > SMALL) else { return Vec::new() };
    let without = |slice: usize| {
        let uses = |s: &Sample| s.far == slice || s.far + pair_step == slice;
        let (of, others): (Vec<Sample>, Vec<Sample>) = samples.iter().partition(|s| uses(s));
        let pairs = pairs(&of);
        let enough = !pairs.is_empty() && self::pairs(&others).len() >= ENOUGH_DEPTHS;
        let rms = rms(&others, degree).filter(|rms| enough && *rms < FAR_BETTER * usual)?;
        Some((rms, slice, pairs))
    };
    // The slices of one pair differ where one of them has another pair, which fits.
    let best =
        (0..slices).filter_map(without).min_by(|a, b| a.2.len().cmp(&b.2.len()).then(a.0.total_cmp(&b.0)));
    match best {
        None => Vec::new(),
        Some((_, _, pairs)) if pairs.len() == 1 => vec![pairs[0], pairs[0] + pair_step],
        Some((_, slice, _)) => vec![slice],
    }
}

/// Far slices of the pairs.
fn pairs(samples: &[Sample]) -> Vec<usize> {
    let mut far: Vec<usize> = samples.iter().map(|s| s.far).collect();
    far.sort_unstable();
    far.dedup();
    far
}

/// Error of a response fitted to these samples.
fn rms(samples: &[Sample], degree: usize) -> Option<f64> {
    let original = || samples.iter().filter(|s| s.original);
    let stage = Curve::fit(original(), degree.min(Curve::largest_degree(original())), None)?.stage(None);
    let errors = original().filter_map(|s| Some(stage.respond(s.measured, s.coarseness)?[0] - s.truth));
    let (sum, n) = errors.fold((0.0, 0.0), |(sum, n), error| (sum + error * error, n + 1.0));
    Some((sum / n).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    const PAIR_STEP: usize = 4;

    /// Pairs 3 to 9 of 16 slices of a tilted target, measured with little scatter; pairs of this slice measure nonsense.
    fn samples(foreign: Option<usize>) -> Vec<Sample> {
        let of_pair = |far: usize| {
            (0..60).map(move |i| {
                let place = f64::from(i) / 59.0;
                let truth = -0.9 + 0.25 * (far as f64 - 3.0) + 0.3 * place;
                let nonsense = foreign.is_some_and(|slice| slice == far || slice == far + PAIR_STEP);
                let error = if nonsense { 0.6 * (0.5 - place) } else { 0.01 * (40.0 * place).sin() };
                Sample { far, ..Sample::exact(truth + error, truth) }
            })
        };
        (3..10).flat_map(of_pair).collect()
    }

    #[test]
    fn a_foreign_slice_is_found_by_its_pairs() {
        // Slice 8 is in pairs 4 and 8, slices 6 and 10 are one pair.
        assert_eq!(find(&samples(Some(8)), 2, PAIR_STEP, 16), [8]);
        for slice in [6, 10] {
            assert_eq!(find(&samples(Some(slice)), 2, PAIR_STEP, 16), [6, 10]);
        }
        assert!(find(&samples(None), 2, PAIR_STEP, 16).is_empty());
    }
}

//! A slice that fits no response: defocused, exchanged or foreign. It belongs to two pairs; without these the response
//! fits the other pairs far better. Several such slices are not found: the error stays large.

use super::ENOUGH_DEPTHS;
use super::curve::Curve;
use super::response::{Sample, Samples};

/// Largest error without a foreign slice, relative to the error with it.
const FAR_BETTER: f64 = 0.5;
/// RMS error of normalised depth below which no slice is looked for.
const SMALL: f64 = 0.05;
/// Removes the pairs of a foreign slice and returns that slice.
pub(super) fn leave_out(
    samples: &mut Samples,
    degree: usize,
    pair_step: usize,
    slices: usize,
) -> Option<usize> {
    let (slice, kept) = foreign(&samples.of, degree, pair_step, slices)?;
    samples.pairs = pairs(&kept);
    samples.of = kept;
    Some(slice)
}

fn foreign(
    samples: &[Sample],
    degree: usize,
    pair_step: usize,
    slices: usize,
) -> Option<(usize, Vec<Sample>)> {
    let usual = rms(samples, degree).filter(|usual| *usual > SMALL)?;
    let without = |slice: usize| {
        let uses = |s: &Sample| s.far == slice || s.far + pair_step == slice;
        let others: Vec<Sample> = samples.iter().filter(|s| !uses(s)).copied().collect();
        let left = (others.len() < samples.len() && pairs(&others) >= ENOUGH_DEPTHS).then_some(others)?;
        Some((rms(&left, degree)?, slice, left))
    };
    let better = (0..slices).filter_map(without).filter(|(rms, ..)| *rms < FAR_BETTER * usual);
    // A pair at the end belongs to two slices, of which the other has a good pair.
    let best = better.min_by(|a, b| pairs(&b.2).cmp(&pairs(&a.2)).then(a.0.total_cmp(&b.0)));
    best.map(|(_, slice, left)| (slice, left))
}

fn pairs(samples: &[Sample]) -> usize {
    let mut far: Vec<usize> = samples.iter().map(|s| s.far).collect();
    far.sort_unstable();
    far.dedup();
    far.len()
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
    fn samples(foreign: Option<usize>) -> Samples {
        let of = (3..10)
            .flat_map(|far| (0..60).map(move |i| (far, f64::from(i) / 59.0)))
            .map(|(far, place)| {
                let truth = -0.9 + 0.25 * (far as f64 - 3.0) + 0.3 * place;
                let nonsense = foreign.is_some_and(|slice| slice == far || slice == far + PAIR_STEP);
                let error = if nonsense { 0.6 * (0.5 - place) } else { 0.01 * (40.0 * place).sin() };
                Sample { far, ..Sample::exact(truth + error, truth) }
            })
            .collect();
        Samples { of, looked_at: 420, pairs: 7 }
    }

    #[test]
    fn a_foreign_slice_is_found_by_its_two_pairs() {
        for slice in [4, 8, 12] {
            let mut samples = samples(Some(slice));
            assert_eq!(leave_out(&mut samples, 2, PAIR_STEP, 16), Some(slice));
            assert!(samples.pairs < 7 && samples.of.iter().all(|s| s.far != slice));
        }
    }

    #[test]
    fn slices_that_fit_stay() {
        let mut good = samples(None);
        assert_eq!(leave_out(&mut good, 2, PAIR_STEP, 16), None);
        assert_eq!((good.pairs, good.of.len()), (7, 420));
    }
}

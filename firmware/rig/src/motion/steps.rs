//! Absolute nanometres to and from STEP pulses of 625 / 4 nm; rounding (halves away from zero) never accumulates.

use farnear_protocol::Nanometres;

use crate::io::ENCODER_NM_PER_COUNT;
use crate::settings::STEP_PM;

/// Four pulses: an integer, so that one direction divides by 4 and the other avoids slow 64-bit divisions.
const FOUR_STEPS_NM: i32 = 625;
const _: () = assert!(STEP_PM as i64 * 4 == FOUR_STEPS_NM as i64 * 1_000);

pub(crate) const fn to_steps(position: Nanometres) -> i32 {
    const HALF: i32 = FOUR_STEPS_NM / 2;
    let nm = position.0;
    if nm >= i32::MIN / 8 && nm <= i32::MAX / 8 {
        let four = 4 * nm;
        return (if four < 0 { four - HALF } else { four + HALF }) / FOUR_STEPS_NM;
    }
    divide_rounded(nm as i64 * 4, FOUR_STEPS_NM as i64) as i32 // smaller than the nanometres
}

/// Saturates beyond 2 m.
pub(crate) const fn to_nanometres(steps: i32) -> Nanometres {
    saturate(divide_rounded(steps as i64 * FOUR_STEPS_NM as i64, 4))
}

/// Saturates beyond 2 m.
pub(crate) const fn encoder_to_nanometres(counts: i32) -> Nanometres {
    saturate(counts as i64 * ENCODER_NM_PER_COUNT as i64)
}

pub(crate) const fn to_encoder(position: Nanometres) -> i32 {
    divide_rounded(position.0 as i64, ENCODER_NM_PER_COUNT as i64) as i32
}

const fn divide_rounded(value: i64, by: i64) -> i64 {
    let half = if value < 0 { -by / 2 } else { by / 2 };
    (value + half) / by
}

const fn saturate(value: i64) -> Nanometres {
    if value > i32::MAX as i64 {
        Nanometres(i32::MAX)
    } else if value < i32::MIN as i64 {
        Nanometres(i32::MIN)
    } else {
        Nanometres(value as i32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_travel_is_83200_pulses() {
        assert_eq!(to_steps(Nanometres(13_000_000)), 83_200);
        assert_eq!(to_nanometres(83_200), Nanometres(13_000_000));
        assert_eq!(to_nanometres(1), Nanometres(156));
        assert_eq!(to_nanometres(2), Nanometres(313)); // 312.5
        assert_eq!(to_nanometres(-2), Nanometres(-313));
    }

    proptest! {
        #[test]
        fn there_and_back_is_exact(steps in -200_000i32..200_000) {
            prop_assert_eq!(to_steps(to_nanometres(steps)), steps);
        }

        #[test]
        fn a_position_is_at_most_half_a_pulse_off(nm in any::<i32>()) {
            let off = i64::from(to_nanometres(to_steps(Nanometres(nm))).0) - i64::from(nm);
            prop_assert!(off.abs() <= 79, "{}", off); // 78.125, rounded to whole nanometres
        }
    }
}

//! The ramp on which a stretched piezo is lowered: a stack released suddenly swings into tension.

/// Ticks while the supply sinks: 4.4 of the 4.95 ms that are left (docs/rig.md).
pub const FAST: u32 = 22;

/// The DAC's code after `at` of `over` ticks.
pub fn code(from: u16, to: u16, at: u32, over: u32) -> u16 {
    let (left, over) = (i64::from(over.saturating_sub(at)), i64::from(over.max(1)));
    let (way, to) = (i64::from(from) - i64::from(to), i64::from(to));
    // 3 t^2 - 2 t^3 of the remaining time; 44 bits. The result lies between the two.
    (to + way * left * left * (3 * over - 2 * left) / (over * over * over)) as u16
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fast_ramp_ends_at_its_target_in_small_steps() {
        for (from, to) in [(u16::MAX, 0), (52_000, 0), (100, 60_000), (0, 0)] {
            let mut before = from;
            for at in 1..=FAST {
                let now = code(from, to, at, FAST);
                // The middle of the ramp is one and a half times as steep as its mean.
                let most = u32::from(from.abs_diff(to)) * 3 / 2 / FAST + 1;
                assert!(u32::from(now.abs_diff(before)) <= most, "{from} to {to}: {now} after {before}");
                before = now;
            }
            assert_eq!((before, code(from, to, FAST + 1, FAST)), (to, to));
        }
    }

    #[test]
    fn a_fast_ramp_has_smooth_ends_and_is_half_way_in_its_middle() {
        for (from, to) in [(u16::MAX, 1), (100, 60_000)] {
            let way = from.abs_diff(to);
            let [first, last] = [1, FAST - 1].map(|at| code(from, to, at, FAST));
            // 3 t^2 - 2 t^3 at a 22nd of the time is 0.6 % of the way; of a straight ramp it is 4.5 %.
            assert!(from.abs_diff(first) < way / 100 && last.abs_diff(to) < way / 100, "{first} {last}");
            assert!(code(from, to, FAST / 2, FAST).abs_diff(from.midpoint(to)) <= 1);
        }
    }
}

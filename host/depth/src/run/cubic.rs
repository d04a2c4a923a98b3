//! The cubic `c1 alpha + c3 alpha^3 = c0` on the branch through 0.
//!
//! For `c3 < 0` the branch ends at the turning point `sqrt(c1 / (-3 c3))`, where the left side is largest: a larger
//! `c0` has no solution there and gets the turning point. Everything is clamped to [`MAX_ALPHA`].
//!
//! The cubic is odd, so it is solved for `|c0|`. Newton from `|c0| / c1` then stays on one side of the root (the left
//! side is concave for `c3 < 0`, convex for `c3 > 0`) and needs no safeguard but the upper limit. Four steps reach 1e-6
//! for `|alpha| <= 1.1` and `-0.2 <= c3 / c1 <= 0.6`; near the turning point, where the slope vanishes, the slope is kept
//! above 2 % of `c1`.

use super::MAX_ALPHA;

/// Newton steps after the first.
pub(crate) const STEPS: usize = 3;

/// The slope of the cubic, relative to `c1`, below which Newton's step is shortened.
pub(crate) const SLOPE_FLOOR: f32 = 0.02;

/// The root in plain numbers, also the reference of the vectorised one; `c1` must be positive.
pub(crate) fn root(c0: f32, c1: f32, c3: f32) -> f32 {
    let ratio = (c0 / c1).abs();
    let cubic = c3 / c1;
    let limit = (1.0 / (3.0 * (-cubic).max(1e-6))).sqrt().min(MAX_ALPHA);
    let mut alpha = ratio.min(limit);
    for _ in 0..=STEPS {
        let square = alpha * alpha;
        let slope = (3.0 * cubic * square + 1.0).max(SLOPE_FLOOR);
        let value = cubic * square * alpha + (alpha - ratio);
        alpha = (alpha - value / slope).min(limit);
    }
    alpha.copysign(c0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn roots_are_found_on_the_branch_through_zero() {
        for cubic in [-0.2_f32, -0.1, 0.0, 0.2, 0.8] {
            for i in -20..=20 {
                let alpha = 0.05 * i as f32;
                let found = root(2.0 * (alpha + cubic * alpha.powi(3)), 2.0, 2.0 * cubic);
                assert!((found - alpha).abs() < 2e-5, "{cubic} {alpha}: {found}");
            }
        }
    }

    #[test]
    fn beyond_the_turning_point_the_branch_ends() {
        let turning = (1.0_f32 / 3.0).sqrt();
        assert!((root(10.0, 1.0, -1.0) - turning).abs() < 1e-6);
        assert_eq!(root(-10.0, 1.0, 0.0), -MAX_ALPHA);
    }
}

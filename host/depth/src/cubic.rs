//! The cubic `c1 alpha + c3 alpha^3 = c0` on the branch through 0.
//!
//! For `c3 < 0` the branch ends at the turning point `sqrt(c1 / (-3 c3))`; a larger `c0` has no solution and returns
//! the turning point. Everything is clamped to [`MAX_ALPHA`]. The cubic is odd, so it is solved for `q = |c0| / c1`.
//! With `r = c3 / c1` and `t = r q^2` the root is `q g(t)`, `g + t g^3 = 1`: one function of one variable, which a
//! quotient of two quadratics approximates to 1 % ([`START`]). Two Newton steps reach 1e-6 for `|alpha| <= 1.1` and
//! `-0.2 <= r <= 0.8`. Near the turning point, where the slope vanishes, it is kept above 2 % of `c1`.

/// The largest |alpha| reported; a little beyond the working range, where the cubic still holds.
pub const MAX_ALPHA: f32 = 1.2;

pub(crate) const STEPS: usize = 2;

/// The start `q (1 + a1 t + a2 t^2) / (1 + b1 t + b2 t^2)` as `[a1, a2, b1, b2]`: least largest error after Newton's
/// next step for `|alpha| <= 1.1` and `-0.25 <= r <= 0.8` (iteratively reweighted least squares on a grid).
pub(crate) const START: [f32; 4] = [6.001_283, 2.430_091, 6.880_628, 6.063_041];

/// Least `t` with a root; alpha is the turning point there.
pub(crate) const LEAST_T: f32 = -4.0 / 27.0;

/// Slope, relative to `c1`, below which Newton's step is shortened.
pub(crate) const SLOPE_FLOOR: f32 = 0.02;

/// The root in scalar code, reference of the vectorised one; `c1` must be positive.
#[cfg(test)]
pub(crate) fn root(c0: f32, c1: f32, c3: f32) -> f32 {
    let ratio = (c0 / c1).abs();
    let cubic = c3 / c1;
    let limit = (1.0 / (3.0 * (-cubic).max(1e-6))).sqrt().min(MAX_ALPHA);
    let t = (cubic * ratio * ratio).max(LEAST_T);
    let [a1, a2, b1, b2] = START;
    let mut alpha = ratio * ((a2 * t + a1) * t + 1.0) / ((b2 * t + b1) * t + 1.0);
    for _ in 0..STEPS {
        let square = alpha * alpha;
        let slope = (3.0 * cubic * square + 1.0).max(SLOPE_FLOOR);
        let value = cubic * square * alpha + (alpha - ratio);
        alpha -= value / slope;
    }
    alpha.min(limit).copysign(c0)
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

//! Gauss-Legendre quadrature with eight nodes (exact for polynomials of degree 15).

/// Positive half of the nodes on -1..1 with their weights (Abramowitz & Stegun, table 25.4).
const NODES: [(f64, f64); 4] = [
    (0.183_434_642_495_649_8, 0.362_683_783_378_362),
    (0.525_532_409_916_329, 0.313_706_645_877_887_3),
    (0.796_666_477_413_626_7, 0.222_381_034_453_374_48),
    (0.960_289_856_497_536_3, 0.101_228_536_290_376_26),
];

/// Integral of `f` from `a` to `b`.
pub(crate) fn integrate(a: f64, b: f64, mut f: impl FnMut(f64) -> f64) -> f64 {
    let (middle, half) = (0.5 * (a + b), 0.5 * (b - a));
    half * NODES.iter().map(|&(x, w)| w * (f(middle - half * x) + f(middle + half * x))).sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn degree_fifteen_is_exact() {
        let integral = integrate(-0.5, 2.0, |x| x.powi(15) - 3.0 * x.powi(8));
        let exact = (2f64.powi(16) - 0.5f64.powi(16)) / 16.0 - (2f64.powi(9) + 0.5f64.powi(9)) / 3.0;
        assert!((integral / exact - 1.0).abs() < 1e-13, "{integral} {exact}");
    }
}

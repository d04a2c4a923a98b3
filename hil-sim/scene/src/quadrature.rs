//! Gauss-Legendre quadrature: `n` nodes are exact for polynomials of degree `2n - 1`.

/// Positive nodes on -1..1 with weights (Abramowitz & Stegun, table 25.4).
pub(crate) const FOUR: [(f64, f64); 2] = [
    (0.339_981_043_584_856_26, 0.652_145_154_862_546_1),
    (0.861_136_311_594_052_6, 0.347_854_845_137_453_85),
];

pub(crate) const EIGHT: [(f64, f64); 4] = [
    (0.183_434_642_495_649_8, 0.362_683_783_378_362),
    (0.525_532_409_916_329, 0.313_706_645_877_887_3),
    (0.796_666_477_413_626_7, 0.222_381_034_453_374_48),
    (0.960_289_856_497_536_3, 0.101_228_536_290_376_26),
];

pub(crate) fn integrate(nodes: &[(f64, f64)], a: f64, b: f64, mut f: impl FnMut(f64) -> f64) -> f64 {
    let (middle, half) = (0.5 * (a + b), 0.5 * (b - a));
    half * nodes.iter().map(|&(x, w)| w * (f(middle - half * x) + f(middle + half * x))).sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_stated_degrees_are_exact() {
        for (nodes, degree) in [(&FOUR[..], 7), (&EIGHT[..], 15)] {
            let integral = integrate(nodes, -0.5, 2.0, |x| x.powi(degree) - 3.0 * x.powi(6));
            let power = |x: f64| x.powi(degree + 1) / f64::from(degree + 1) - 3.0 * x.powi(7) / 7.0;
            let exact = power(2.0) - power(-0.5);
            assert!((integral / exact - 1.0).abs() < 1e-12, "{degree}: {integral} {exact}");
        }
    }
}

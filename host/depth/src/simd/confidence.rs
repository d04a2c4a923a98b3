//! Texture energy of a row to its confidence.

use super::dispatch;
use super::lanes::Lanes;
use super::solve::TINY;
use crate::confidence;

dispatch! {
    /// Texture to confidence in place ([`confidence::confidence`]); returns the numbers of low-texture pixels and of pixels
    /// without any confidence. At most 2^24 pixels.
    fn confidence_row(texture: &mut [f32], misfit: &[f32], scale: f32) -> [usize; 2] = confidence_generic
}

#[inline(always)]
fn confidence_generic<L: Lanes>(has: L::Has, texture: &mut [f32], misfit: &[f32], scale: f32) -> [usize; 2] {
    assert!(texture.len() == misfit.len() && texture.len() <= 1 << 24);
    let threshold = confidence::LOW_TEXTURE * scale;
    let least = confidence::NO_TEXTURE * scale;
    let [mut low, mut with] = [L::splat(has, 0.0); 2];
    let whole = texture.len() / L::N * L::N;
    for x in (0..whole).step_by(L::N) {
        let energy = L::load(has, &texture[x..]);
        let misfit = L::load(has, &misfit[x..]);
        low = low.add(energy.one_where_less(L::splat(has, threshold)));
        let any = L::splat(has, least).one_where_less(energy);
        with = with.add(any);
        let divisor = energy.add(L::splat(has, threshold));
        let divisor = divisor.mul_add(misfit, divisor).max(L::splat(has, TINY));
        any.mul(energy).mul(divisor.reciprocal(has)).store(&mut texture[x..]);
    }
    let [low, with] = [low.to_array(), with.to_array()];
    let [mut low, mut with] = [&low[..L::N], &with[..L::N]].map(|counts| counts.iter().sum::<f32>() as usize);
    for (texture, misfit) in texture[whole..].iter_mut().zip(&misfit[whole..]) {
        low += usize::from(*texture < threshold);
        *texture = confidence::confidence(*texture, *misfit, scale);
        with += usize::from(*texture > 0.0);
    }
    [low, texture.len() - with]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simd::Backend;

    #[test]
    fn rows_of_confidence_agree_with_the_formula() {
        let texture: Vec<f32> =
            (0..83).map(|i| if i % 7 == 0 { 0.0 } else { 1e-9 * 1.5_f32.powi(i) }).collect();
        let misfit: Vec<f32> = (0..83).map(|i| 0.3 * (i % 11) as f32).collect();
        for scale in [0.0, 1e-3, 5.0] {
            for backend in Backend::available() {
                let mut found = texture.clone();
                let [low, without] = confidence_row(backend, &mut found, &misfit, scale);
                assert_eq!(low, texture.iter().filter(|t| **t < 0.05 * scale).count());
                assert_eq!(without, found.iter().filter(|c| **c == 0.0).count());
                for ((texture, misfit), found) in texture.iter().zip(&misfit).zip(&found) {
                    let expected = confidence::confidence(*texture, *misfit, scale);
                    assert!((found - expected).abs() < 1e-6, "{backend:?} {texture}: {found} {expected}");
                }
            }
        }
    }
}

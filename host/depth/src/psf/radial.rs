//! A measured or drawn PSF: its light in rings around its centre.
//!
//! An image of the PSF (a point of light far out of focus) or of the aperture becomes [`RINGS`] rings of equal width,
//! each with its part of the light. The profile scales with the blur radius (geometric optics), so one image serves
//! every depth. Light within a ring is uniform: the OTF is exactly that of a sum of rings. Kernels have eight-fold
//! symmetry, and a lens rotates its PSF by half a turn across the focus, so non-round parts are averaged over the
//! circle; [`RadialPsf::from_image`] reports how large they are.

use ndarray::ArrayView2;

use super::PsfError;

/// Rings of a profile.
pub const RINGS: usize = 48;

/// Allowed outer radii in blur radii.
const EXTENT_RANGE: [f64; 2] = [0.1, 8.0];

/// Least parts of a pixel per ring when sampling an image.
const PARTS_PER_RING: f64 = 3.0;

/// A round point spread function, ring by ring.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RadialPsf {
    /// Radius of the outermost ring in blur radii.
    extent: f64,
    /// Part of the light in each ring, the innermost first.
    light: [f32; RINGS],
}

/// A profile of an image, and its quality.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Drawn {
    /// The profile.
    pub psf: RadialPsf,
    /// Part of the image's energy (squares) outside the circular mean: 0 for a round image.
    pub not_round: f64,
}

impl RadialPsf {
    /// A profile of `extent` blur radii; `light` of each ring in any unit. Returns [`PsfError::Profile`] for another
    /// number of rings, or negative or no light; [`PsfError::Range`] for the extent.
    pub fn new(extent: f64, light: &[f32]) -> Result<Self, PsfError> {
        super::check_range("extent", extent, EXTENT_RANGE)?;
        let light: [f32; RINGS] = light
            .try_into()
            .map_err(|_| PsfError::Profile(format!("{} rings, expected {RINGS}", light.len())))?;
        if let Some(wrong) = light.iter().find(|light| !(light.is_finite() && **light >= 0.0)) {
            return Err(PsfError::Profile(format!("a ring with light {wrong}, expected 0 or more")));
        }
        let total: f64 = light.iter().map(|light| f64::from(*light)).sum();
        if total <= 0.0 {
            return Err(PsfError::Profile("no light at all".into()));
        }
        // A normalised profile stays unchanged, so that a stored one is restored exactly.
        let scale = if (total - 1.0).abs() < 1e-6 { 1.0 } else { total.recip() };
        Ok(Self { extent, light: light.map(|light| (f64::from(light) * scale) as f32) })
    }

    /// The profile of an image of the PSF or aperture, black = no light, about its centroid. `radius_px` is the blur
    /// radius (the aperture's edge) in the image, at most half the shorter side; `None`: that half. [`PsfError::Profile`] without
    /// light.
    pub fn from_image(image: ArrayView2<f32>, radius_px: Option<f64>) -> Result<Drawn, PsfError> {
        let (height, width) = image.dim();
        let largest_px = 0.5 * height.min(width) as f64;
        let radius_px = radius_px.unwrap_or(largest_px);
        super::check_range("radius", radius_px, [1.0, largest_px])?;
        if let Some(wrong) = image.iter().find(|value| !(value.is_finite() && **value >= 0.0)) {
            return Err(PsfError::Profile(format!("a pixel of {wrong}, expected 0 or more")));
        }
        let lit = || image.indexed_iter().filter(|(_, value)| **value > 0.0);
        let sums = lit().fold([0.0_f64; 3], |[n, sx, sy], ((y, x), value)| {
            let value = f64::from(*value);
            [n + value, sx + value * x as f64, sy + value * y as f64]
        });
        let [total, cx, cy] = [sums[0], sums[1] / sums[0], sums[2] / sums[0]];
        if total <= 0.0 {
            return Err(PsfError::Profile("no light at all".into()));
        }
        let away = |y: f64, x: f64| (y - cy).hypot(x - cx);
        let farthest = lit().map(|((y, x), _)| away(y as f64, x as f64)).fold(0.0, f64::max) + 0.5;
        let extent = (farthest / radius_px).clamp(EXTENT_RANGE[0], EXTENT_RANGE[1]);
        let ring_px = extent * radius_px / RINGS as f64;
        // A ring may be narrower than a pixel: each pixel is split.
        let parts = (PARTS_PER_RING / ring_px).ceil().clamp(1.0, 24.0) as usize;
        let share = 1.0 / (parts * parts) as f64;
        let mut sums = vec![[0.0_f64; 3]; RINGS];
        for ((y, x), value) in image.indexed_iter() {
            for part in 0..parts * parts {
                let inside = |i: usize| (i as f64 + 0.5) / parts as f64 - 0.5;
                let r = away(y as f64 + inside(part / parts), x as f64 + inside(part % parts));
                if let Some(ring) = sums.get_mut((r / ring_px) as usize) {
                    let value = f64::from(*value);
                    *ring = [ring[0] + share, ring[1] + share * value, ring[2] + share * value * value];
                }
            }
        }
        let mean = |[n, sum, _]: &[f64; 3]| if *n > 0.0 { sum / n } else { 0.0 };
        let energy: f64 = sums.iter().map(|ring| ring[2]).sum();
        let round: f64 = sums.iter().map(|ring| ring[0] * mean(ring).powi(2)).sum();
        // The ring's own area, not the parts inside it: an image may end before its corners.
        let light: Vec<f32> =
            sums.iter().enumerate().map(|(i, ring)| (mean(ring) * (2 * i + 1) as f64) as f32).collect();
        Ok(Drawn { psf: Self::new(extent, &light)?, not_round: (1.0 - round / energy).max(0.0) })
    }

    /// Radius of the outermost ring in blur radii.
    pub fn extent(&self) -> f64 {
        self.extent
    }

    /// Part of the light in each ring, the innermost first.
    pub fn light(&self) -> &[f32; RINGS] {
        &self.light
    }

    /// Mean square distance from the middle, in squared blur radii.
    pub fn second_moment(&self) -> f64 {
        let width = self.extent / RINGS as f64;
        let of_ring = |(i, light): (usize, &f32)| {
            let [a, b] = [i as f64 * width, (i + 1) as f64 * width];
            f64::from(*light) * 0.5 * (a * a + b * b)
        };
        self.light.iter().enumerate().map(of_ring).sum()
    }

    /// OTF at `z`, blur radius times radial frequency.
    fn transform(&self, z: f64) -> f64 {
        if z < 1e-4 {
            return 1.0 - 0.25 * z * z * self.second_moment();
        }
        let width = self.extent / RINGS as f64;
        // r J1(z r): the transform of a disc of radius r, up to 2 / z.
        let disc = |i: usize| i as f64 * width * libm::j1(z * i as f64 * width);
        let (mut sum, mut inner) = (0.0, 0.0);
        for (i, light) in self.light.iter().enumerate() {
            let outer = disc(i + 1);
            let area = width * width * (2 * i + 1) as f64;
            sum += f64::from(*light) * (outer - inner) / area;
            inner = outer;
        }
        2.0 * sum / z
    }
}

/// The OTF of a profile, tabulated.
#[derive(Debug, Clone)]
pub struct RadialTable {
    psf: RadialPsf,
    step: f64,
    values: Vec<f64>,
}

impl RadialTable {
    pub(super) fn new(psf: RadialPsf, max_z: f64) -> Self {
        // Parabolas between entries: the error is a thousandth of (step x extent)^3.
        let step = 0.02 / psf.extent.max(1.0);
        let entries = (max_z / step).ceil() as usize + 3;
        let values = (0..entries).map(|i| psf.transform(step * i as f64)).collect();
        Self { psf, step, values }
    }

    /// `z` must be 0 or more; beyond the table it is computed.
    pub(super) fn at(&self, z: f64) -> f64 {
        let x = z / self.step;
        let i = (x + 0.5) as usize;
        let Some(after) = self.values.get(i + 1) else { return self.psf.transform(z) };
        // The OTF is even in z.
        let before = self.values[if i == 0 { 1 } else { i - 1 }];
        let (f, here) = (x - i as f64, self.values[i]);
        here + 0.5 * f * (after - before) + 0.5 * f * f * (after - 2.0 * here + before)
    }
}

#[cfg(test)]
mod tests {
    use ndarray::Array2;

    use super::*;
    use crate::psf::{Otf, Psf};

    fn disc(side: usize, inner: f64) -> Array2<f32> {
        let middle = 0.5 * (side as f64 - 1.0);
        let r = |y: usize, x: usize| (y as f64 - middle).hypot(x as f64 - middle) / (0.5 * side as f64);
        Array2::from_shape_fn((side, side), |(y, x)| if (inner..1.0).contains(&r(y, x)) { 1.0 } else { 0.0 })
    }

    #[test]
    fn a_drawn_disc_is_a_pill_box_and_a_drawn_ring_a_ring() {
        for (inner, known) in [(0.0, Psf::PillBox), (0.6, Psf::Ring { inner: 0.6 })] {
            let drawn = RadialPsf::from_image(disc(201, inner).view(), None).unwrap();
            // Edges between pixels are neither round nor straight.
            assert!(drawn.not_round < 0.03, "{}", drawn.not_round);
            let (otf, known) = (Psf::Radial(drawn.psf).otf(2.7), known.otf(2.7));
            for i in 0..80 {
                let w = 0.05 * f64::from(i);
                assert!((otf.at(2.7, w) - known.at(2.7, w)).abs() < 0.01, "{inner} {w}");
            }
        }
    }

    #[test]
    fn the_table_is_the_transform() {
        let psf = RadialPsf::from_image(disc(61, 0.5).view(), Some(20.0)).unwrap().psf;
        let Otf::Radial(table) = Psf::Radial(psf).otf(3.0) else { panic!("another OTF") };
        for i in 0..2000 {
            let z = 0.00731 * f64::from(i);
            assert!((table.at(z) - psf.transform(z)).abs() < 1e-5, "{z}");
        }
        assert!((psf.extent() - 1.55).abs() < 0.05, "{}", psf.extent());
    }

    #[test]
    fn a_radius_outside_the_image_is_refused() {
        let drawn = |radius_px| RadialPsf::from_image(disc(61, 0.5).view(), Some(radius_px));
        assert!(drawn(30.5).is_ok());
        for radius_px in [31.0, 200.0, f64::NAN] {
            let error = drawn(radius_px).unwrap_err().to_string();
            assert!(
                error.contains(&format!("radius = {radius_px}, expected a number from 1 to 30.5")),
                "{error}"
            );
        }
    }

    #[test]
    fn asymmetric_profiles_are_reported_and_invalid_ones_rejected() {
        let bar = Array2::from_shape_fn((61, 61), |(y, _)| if y.abs_diff(30) < 6 { 1.0 } else { 0.0 });
        assert!(RadialPsf::from_image(bar.view(), None).unwrap().not_round > 0.3);
        for (image, phrase) in [
            (Array2::zeros((9, 9)), "no light"),
            (Array2::from_elem((9, 9), -1.0), "-1"),
            (Array2::from_elem((9, 9), f32::NAN), "NaN"),
        ] {
            let error = RadialPsf::from_image(image.view(), None).unwrap_err().to_string();
            assert!(error.contains(phrase), "{error}");
        }
        assert!(RadialPsf::new(1.0, &[1.0; 3]).unwrap_err().to_string().contains("3 rings"));
    }

    #[test]
    fn a_profile_survives_its_text() {
        let psf = Psf::Radial(RadialPsf::from_image(disc(41, 0.3).view(), None).unwrap().psf);
        let text = toml::to_string(&psf).unwrap();
        assert_eq!(toml::from_str::<Psf>(&text).unwrap(), psf);
    }
}

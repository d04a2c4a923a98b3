//! Convolution kernels with the eight-fold symmetry of a round lens, and their frequency responses.
//!
//! A kernel of odd size `2 r + 1` is given by the coefficients at `0 <= dy <= dx <= r`, row by row in `dx`: (0,0),
//! (1,0), (1,1), (2,0), ... A 7x7 kernel has ten. Its response is real and zero-phase,
//! `sum c(dx, dy) cos(u dx) cos(v dy)`; its sign matters, so magnitudes must not be taken. Cost: O(r^2) per response.

use ndarray::Array2;
use serde::{Deserialize, Serialize};

/// Declares the operator sizes, [`SIZES`], and `with_size!`. (`$` is passed in, because nested macros cannot write it.)
macro_rules! sizes {
    ($dollar:tt: $($size:literal)+) => {
        /// Allowed operator sizes.
        pub const SIZES: [usize; [$($size),+].len()] = [$($size),+];

        /// `with_size!(value, SIZE => expression)`: the expression with `SIZE` as a constant, one of [`SIZES`].
        macro_rules! with_size {
            ($dollar value:expr, $dollar constant:ident => $dollar expression:expr) => {
                match $dollar value {
                    $($size => {
                        const $dollar constant: usize = $size;
                        $dollar expression
                    })+
                    other => unreachable!("kernel size {other}"),
                }
            };
        }
    };
}
sizes!($: 5 7 9 11 13);
pub(crate) use with_size;

/// The largest of [`SIZES`].
pub const LARGEST_SIZE: usize = SIZES[SIZES.len() - 1];

/// [`SIZES`] in words, such as "5, 7 or 9".
pub fn sizes_in_words() -> String {
    let [rest @ .., last] = SIZES.map(|size| size.to_string());
    format!("{} or {last}", rest.join(", "))
}

/// An error of a kernel.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages name the fields")]
pub enum KernelError {
    #[error("kernel size {0}: must be {sizes}", sizes = sizes_in_words())]
    Size(usize),
    #[error("a {size}x{size} kernel of eight-fold symmetry has {expected} coefficients, not {found}")]
    Coefficients { size: usize, expected: usize, found: usize },
    #[error("coefficient {0} of the kernel is not finite")]
    NotFinite(usize),
}

/// Number of free coefficients of a kernel of `size`.
pub const fn free_coefficients(size: usize) -> usize {
    let side = size / 2 + 1;
    side * (side + 1) / 2
}

/// Offsets `(dx, dy)`, `dy <= dx`, of the free coefficients in order.
pub fn offsets(size: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..=size / 2).flat_map(|dx| (0..=dx).map(move |dy| (dx, dy)))
}

/// Number of taps that share the free coefficient at `(dx, dy)`.
pub fn taps((dx, dy): (usize, usize)) -> f64 {
    match (dx, dy) {
        (0, 0) => 1.0,
        (_, 0) => 4.0,
        (a, b) if a == b => 4.0,
        _ => 8.0,
    }
}

/// Response at `(u, v)`, rad/px, of the kernel whose only free coefficient, at `(dx, dy)`, is 1.
pub fn basis_response((dx, dy): (usize, usize), u: f64, v: f64) -> f64 {
    let [dx_f, dy_f] = [dx as f64, dy as f64];
    let one = |a: f64, b: f64| (u * a).cos() * (v * b).cos();
    let both = if dx == dy { one(dx_f, dy_f) } else { one(dx_f, dy_f) + one(dy_f, dx_f) };
    let mirrored = |d: usize| if d == 0 { 1.0 } else { 2.0 };
    both * mirrored(dx) * mirrored(dy)
}

/// [`basis_response`] of every free coefficient of a kernel of `size`, in order.
pub fn basis_responses(size: usize, u: f64, v: f64) -> Vec<f64> {
    offsets(size).map(|offset| basis_response(offset, u, v)).collect()
}

/// An eight-fold symmetric kernel.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "RawKernel", into = "RawKernel")]
pub struct Kernel {
    size: usize,
    octant: Vec<f64>,
}

#[derive(Serialize, Deserialize)]
struct RawKernel {
    size: usize,
    octant: Vec<f64>,
}

impl TryFrom<RawKernel> for Kernel {
    type Error = KernelError;

    fn try_from(raw: RawKernel) -> Result<Self, KernelError> {
        Self::new(raw.size, raw.octant)
    }
}

impl From<Kernel> for RawKernel {
    fn from(kernel: Kernel) -> Self {
        Self { size: kernel.size, octant: kernel.octant }
    }
}

impl Kernel {
    /// A kernel from the free coefficients `octant` in the order of [`offsets`]. [`KernelError`] if they do not fit.
    pub fn new(size: usize, octant: Vec<f64>) -> Result<Self, KernelError> {
        if !SIZES.contains(&size) {
            return Err(KernelError::Size(size));
        }
        let expected = free_coefficients(size);
        if octant.len() != expected {
            return Err(KernelError::Coefficients { size, expected, found: octant.len() });
        }
        match octant.iter().position(|c| !c.is_finite()) {
            Some(i) => Err(KernelError::NotFinite(i)),
            None => Ok(Self { size, octant }),
        }
    }

    /// `N` kernels of `size` from consecutive free coefficients; errors as [`Self::new`].
    pub fn several<const N: usize>(size: usize, octants: &[f64]) -> Result<[Self; N], KernelError> {
        let (n, found) = (free_coefficients(size), octants.len());
        if found != N * n {
            return Err(KernelError::Coefficients { size, expected: N * n, found });
        }
        let kernels = octants.chunks_exact(n).map(|octant| Self::new(size, octant.to_vec()));
        let kernels: Vec<Self> = kernels.collect::<Result<_, _>>()?;
        kernels.try_into().map_err(|_| KernelError::Coefficients { size, expected: N * n, found })
    }

    /// Width and height.
    pub fn size(&self) -> usize {
        self.size
    }

    /// The free coefficients in the order of [`offsets`].
    pub fn octant(&self) -> &[f64] {
        &self.octant
    }

    /// The coefficient at the offset `(dx, dy)` from the centre; 0 outside.
    pub fn at(&self, dx: isize, dy: isize) -> f64 {
        let [a, b] = [dx.unsigned_abs(), dy.unsigned_abs()];
        let [long, short] = [a.max(b), a.min(b)];
        if long > self.size / 2 { 0.0 } else { self.octant[long * (long + 1) / 2 + short] }
    }

    /// All taps, (size, size).
    pub fn to_array(&self) -> Array2<f64> {
        let r = (self.size / 2) as isize;
        Array2::from_shape_fn((self.size, self.size), |(y, x)| self.at(x as isize - r, y as isize - r))
    }

    /// Real, zero-phase frequency response at `(u, v)` in rad/px.
    pub fn response(&self, u: f64, v: f64) -> f64 {
        offsets(self.size).zip(&self.octant).map(|(offset, c)| c * basis_response(offset, u, v)).sum()
    }

    /// The kernel times `factor`.
    pub fn scaled(&self, factor: f64) -> Self {
        Self { size: self.size, octant: self.octant.iter().map(|c| c * factor).collect() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_response_is_the_transform_of_the_taps() {
        for size in SIZES {
            let octant = (0..free_coefficients(size)).map(|i| (1.7 * i as f64 + 0.3).sin()).collect();
            let kernel = Kernel::new(size, octant).unwrap();
            let r = (size / 2) as f64;
            let all: f64 = offsets(size).map(taps).sum();
            assert_eq!(all, (size * size) as f64);
            for (u, v) in [(0.0, 0.0), (0.4, 1.1), (3.0, 0.2), (2.0, 2.0)] {
                let direct: f64 = kernel
                    .to_array()
                    .indexed_iter()
                    .map(|((y, x), c)| c * (u * (x as f64 - r) + v * (y as f64 - r)).cos())
                    .sum();
                assert!((kernel.response(u, v) - direct).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn kernels_that_do_not_fit_are_refused() {
        assert_eq!(Kernel::new(6, vec![]), Err(KernelError::Size(6)));
        assert_eq!(
            Kernel::new(7, vec![0.0; 9]),
            Err(KernelError::Coefficients { size: 7, expected: 10, found: 9 })
        );
        assert_eq!(Kernel::new(5, vec![0.0, f64::NAN, 0.0, 0.0, 0.0, 0.0]), Err(KernelError::NotFinite(1)));
        assert!(toml::from_str::<Kernel>("size = 7\noctant = [1.0]").is_err());
        let too_large = Kernel::new(15, vec![0.0; 36]).unwrap_err().to_string();
        assert_eq!(too_large, "kernel size 15: must be 5, 7, 9, 11 or 13");
    }
}

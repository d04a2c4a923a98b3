//! Inner loops of the run time for the processor's vector unit.
//!
//! Each loop is written once over [`Lanes`](lanes::Lanes) and compiled for AVX-512, AVX2 with FMA, NEON on 64-bit ARM,
//! and portable four-lane code; [`Backend::best`] selects at run time. All rows are *valid* convolutions: output column
//! `x` comes from the input columns `x..x + 2r`, so every load of an output vector starts aligned and rows only get
//! shorter. Rows are padded by [`Plane::PADDING`], because a vector may read past the last useful column. Variants
//! differ by rounding in the last bits (fused or separate multiply-add).
#![allow(unsafe_code)] // std::arch intrinsics and unchecked loads; each block states why it is sound.
#![allow(clippy::needless_range_loop)] // Indexed loops on purpose: see `Lanes` on closures.

mod choice;
mod convolve;
mod lanes;
mod median;
#[cfg(all(target_arch = "aarch64", target_feature = "neon"))]
mod neon;
mod peak;
mod preparation;
mod registration;
mod rows;
#[cfg(test)]
mod same_everywhere;
mod windows;

use serde::{Deserialize, Serialize};

pub(crate) use choice::{Contrast, choose_certain, contrast_row, decide_row};
pub(crate) use convolve::{MAX_ROWS, READ_BEYOND, Taps, convolve, convolve_rows};
pub(crate) use median::median_row;
pub(crate) use preparation::{
    add_energies, compare_row, halve_row, roll_row, sum, sum_of_squares, weigh_rows,
};
pub(crate) use registration::{
    StepSums, between_rows, divide_by_polynomial, divide_by_root, find_taps, products, step_row,
};
pub(crate) use rows::{
    CubicRow, Extremes, SEVEN_BLOCK, WindowRow, confidence_row, extremes, normalise_row, vertical_sums,
    vertical_sums_of_seven,
};
pub(crate) use windows::{
    Believed, CubicSums, Deviation, Found, MAX_LANES, OfNoise, Residual, add_products, add_row, believe_row,
    deviation_row, dimensionless_row, move_products, residual_row, roots, row_sums, sum_rows,
};

/// Calls the generic function inside one with the backend's instructions enabled, so that it is compiled with them.
macro_rules! dispatch {
    ($(#[$attribute:meta])* fn $name:ident $(<const $n:ident: usize>)?($($argument:ident: $type:ty),* $(,)?) $(-> $result:ty)? = $generic:ident) => {
        $(#[$attribute])*
        pub(crate) fn $name $(<const $n: usize>)?(backend: crate::simd::Backend, $($argument: $type),*) $(-> $result)? {
            #[cfg(target_arch = "x86_64")]
            #[target_feature(enable = "avx512f")]
            fn avx512 $(<const $n: usize>)?($($argument: $type),*) $(-> $result)? {
                $generic::<crate::simd::lanes::Avx512 $(, $n)?>($($argument),*)
            }
            #[cfg(target_arch = "x86_64")]
            #[target_feature(enable = "avx2,fma")]
            fn avx2 $(<const $n: usize>)?($($argument: $type),*) $(-> $result)? {
                $generic::<crate::simd::lanes::Avx2 $(, $n)?>($($argument),*)
            }
            match backend.checked() {
                // SAFETY: `checked` falls back to portable code unless the processor has the instructions.
                #[cfg(target_arch = "x86_64")]
                crate::simd::Backend::Avx512 => unsafe { avx512 $(::<$n>)?($($argument),*) },
                #[cfg(target_arch = "x86_64")]
                crate::simd::Backend::Avx2 => unsafe { avx2 $(::<$n>)?($($argument),*) },
                // The target guarantees NEON: nothing to enable or detect.
                #[cfg(all(target_arch = "aarch64", target_feature = "neon"))]
                crate::simd::Backend::Neon => $generic::<crate::simd::neon::Neon $(, $n)?>($($argument),*),
                _ => $generic::<crate::simd::lanes::Portable $(, $n)?>($($argument),*),
            }
        }
    };
}
use dispatch;

/// A vector unit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Backend {
    /// 16 lanes, x86-64 with AVX-512F.
    Avx512,
    /// 8 lanes, x86-64 with AVX2 and FMA.
    Avx2,
    /// 4 lanes, 64-bit ARM.
    Neon,
    /// Four lanes of portable code, on any processor.
    Portable,
}

impl Backend {
    /// The fastest first.
    const ALL: [Self; 4] = [Self::Avx512, Self::Avx2, Self::Neon, Self::Portable];

    /// The fastest available.
    pub fn best() -> Self {
        Self::ALL.into_iter().find(|b| b.is_available()).unwrap_or(Self::Portable)
    }

    /// All available, the fastest first.
    pub fn available() -> Vec<Self> {
        Self::ALL.into_iter().filter(|b| b.is_available()).collect()
    }

    /// Whether this processor has it.
    pub fn is_available(self) -> bool {
        match self {
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => is_x86_feature_detected!("avx512f"),
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma"),
            #[cfg(not(target_arch = "x86_64"))]
            Self::Avx512 | Self::Avx2 => false,
            Self::Neon => cfg!(all(target_arch = "aarch64", target_feature = "neon")),
            Self::Portable => true,
        }
    }

    /// The backend if available, else portable code. The standard library caches detection.
    fn checked(self) -> Self {
        if self.is_available() { self } else { Self::Portable }
    }
}

/// A block of rows with a common, vector-aligned stride.
#[derive(Debug, Clone)]
pub(crate) struct Plane {
    storage: Vec<Line>,
    stride: usize,
    rows: usize,
}

#[derive(Debug, Clone, Copy)]
#[repr(C, align(64))]
struct Line([f32; 16]);

impl Plane {
    /// Readable and writable numbers beyond the requested width of each row.
    pub const PADDING: usize = 96;

    pub fn new(rows: usize, width: usize) -> Self {
        let stride = (width + Self::PADDING).next_multiple_of(16);
        Self { storage: vec![Line([0.0; 16]); rows * stride / 16], stride, rows }
    }

    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Numbers in a row, including padding.
    pub fn stride(&self) -> usize {
        self.stride
    }

    pub fn all(&self) -> &[f32] {
        // SAFETY: `Line` is a transparent-in-effect array of 16 f32 without padding (size 64, alignment 64), and the
        // vector holds exactly rows * stride numbers.
        unsafe { std::slice::from_raw_parts(self.storage.as_ptr().cast(), self.rows * self.stride) }
    }

    pub fn all_mut(&mut self) -> &mut [f32] {
        // SAFETY: as in `all`; the borrow is exclusive.
        unsafe { std::slice::from_raw_parts_mut(self.storage.as_mut_ptr().cast(), self.rows * self.stride) }
    }

    /// With its padding.
    pub fn row(&self, y: usize) -> &[f32] {
        &self.all()[y * self.stride..(y + 1) * self.stride]
    }

    pub fn row_mut(&mut self, y: usize) -> &mut [f32] {
        let stride = self.stride;
        &mut self.all_mut()[y * stride..(y + 1) * stride]
    }
}

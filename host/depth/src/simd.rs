//! The inner loops of the run time for whatever vector unit the processor has.
//!
//! Each loop is written once over [`Lanes`] and compiled three times: AVX-512, AVX2 with FMA, and portable code of
//! four lanes that any compiler turns into what it can. Which one runs is decided at run time ([`Backend::best`]).
//! All rows are *valid* convolutions: output column `x` comes from the input columns `x..x + 2r`, so every load of an
//! output vector starts aligned and rows only get shorter. Rows are padded to [`Plane::PADDING`] beyond their content,
//! because a vector may read past the last useful column.
//!
//! Rounding differs between the variants in the last bits only (fused or separate multiply-add).
#![allow(clippy::needless_range_loop)] // Indexed loops on purpose: see `Lanes` on closures.

mod confidence;
mod convolve;
mod input;
mod lags;
#[allow(unsafe_code)] // std::arch intrinsics, behind types that prove the processor has them.
mod lanes;
mod median;
mod peak;
mod plane;
mod solve;
mod window_sums;

use serde::{Deserialize, Serialize};

pub(crate) use confidence::confidence_row;
pub(crate) use convolve::{MAX_ROWS, READ_BEYOND, Taps, convolve, convolve_rows};
pub(crate) use input::{Extremes, extremes, normalise_row};
pub(crate) use lags::{Lag, lagged_products};
pub(crate) use median::median_row;
pub(crate) use plane::Plane;
pub(crate) use solve::CubicRow;
pub(crate) use window_sums::{SEVEN_BLOCK, WindowRow, vertical_sums, vertical_sums_of_seven};

/// Calls the generic function for the backend inside a function that has the backend's instructions enabled, so that
/// the whole loop is inlined and compiled with them. Its first argument is the proof that the processor has them.
macro_rules! dispatch {
    ($(#[$attribute:meta])* fn $name:ident($($argument:ident: $type:ty),* $(,)?) $(-> $result:ty)? = $generic:ident) => {
        $(#[$attribute])*
        #[allow(unsafe_code)] // Each call states why it is sound.
        pub(crate) fn $name(backend: crate::simd::Backend, $($argument: $type),*) $(-> $result)? {
            use crate::simd::lanes;
            #[cfg(target_arch = "x86_64")]
            #[target_feature(enable = "avx512f")]
            fn avx512(has: lanes::HasAvx512, $($argument: $type),*) $(-> $result)? {
                $generic::<lanes::Avx512>(has, $($argument),*)
            }
            #[cfg(target_arch = "x86_64")]
            #[target_feature(enable = "avx2,fma")]
            fn avx2(has: lanes::HasAvx2, $($argument: $type),*) $(-> $result)? {
                $generic::<lanes::Avx2>(has, $($argument),*)
            }
            #[cfg(target_arch = "x86_64")]
            match backend {
                crate::simd::Backend::Avx512 => {
                    if let Some(has) = lanes::HasAvx512::detect() {
                        // SAFETY: the processor has the instructions, as `has` proves.
                        return unsafe { avx512(has, $($argument),*) };
                    }
                }
                crate::simd::Backend::Avx2 => {
                    if let Some(has) = lanes::HasAvx2::detect() {
                        // SAFETY: as above.
                        return unsafe { avx2(has, $($argument),*) };
                    }
                }
                crate::simd::Backend::Portable => {}
            }
            let _ = backend;
            $generic::<lanes::Portable>((), $($argument),*)
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
    /// Whatever the compiler makes of four lanes, on any processor.
    Portable,
}

impl Backend {
    /// The fastest that this processor has.
    pub fn best() -> Self {
        Self::available()[0]
    }

    /// All that this processor has, the fastest first.
    pub fn available() -> Vec<Self> {
        [Self::Avx512, Self::Avx2, Self::Portable].into_iter().filter(|b| b.is_available()).collect()
    }

    /// Whether this processor has it.
    pub fn is_available(self) -> bool {
        match self {
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => lanes::HasAvx512::detect().is_some(),
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => lanes::HasAvx2::detect().is_some(),
            #[cfg(not(target_arch = "x86_64"))]
            Self::Avx512 | Self::Avx2 => false,
            Self::Portable => true,
        }
    }
}

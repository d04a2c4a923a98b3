//! Image size, normalised coordinates, regions, and errors.

use core::{fmt, ops::Range};

use super::REGIONS;

/// Size of the corrected depth maps, px.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Frame {
    width: u16,
    height: u16,
}

impl Frame {
    /// Smallest side: two pixels per region, for a centre to blend from.
    pub const SMALLEST: u16 = 2 * REGIONS as u16;
    /// Largest side: the last of 8192 columns is accurate to 4e-6.
    pub const LARGEST: u16 = 8192;

    /// A frame of `width` by `height` pixels, each [`Self::SMALLEST`] to [`Self::LARGEST`], else [`Error::FrameSize`].
    pub fn new(width: u16, height: u16) -> Result<Self, Error> {
        let fits = |length| (Self::SMALLEST..=Self::LARGEST).contains(&length);
        if fits(width) && fits(height) {
            Ok(Self { width, height })
        } else {
            Err(Error::FrameSize { width, height })
        }
    }

    /// Width of the frame in pixels.
    pub fn width(self) -> u16 {
        self.width
    }

    /// Height of the frame in pixels.
    pub fn height(self) -> u16 {
        self.height
    }

    pub(super) fn columns(self) -> Axis {
        Axis { length: self.width }
    }

    pub(super) fn rows(self) -> Axis {
        Axis { length: self.height }
    }

    pub(super) fn check_row(self, row: u16, pixels: usize) -> Result<(), Error> {
        if row >= self.height {
            return Err(Error::NoSuchRow { row, height: self.height });
        }
        if pixels != usize::from(self.width) {
            return Err(Error::RowLength { pixels, width: self.width });
        }
        Ok(())
    }
}

#[derive(Clone, Copy)]
pub(super) struct Axis {
    length: u16,
}

impl Axis {
    /// Normalised coordinate, Q1.31: -1 at the first pixel, +1 (minus a few units) at the last.
    pub(super) fn coordinate(self, index: u16) -> i32 {
        i32::MIN.wrapping_add(i32::from(index).wrapping_mul(self.coordinate_step()))
    }

    /// Step of [`Self::coordinate`], rounded down so that it never exceeds +1.
    pub(super) fn coordinate_step(self) -> i32 {
        // At least 6 pixels per side; the maximum proves to the compiler that no division by 0 occurs.
        (u32::MAX / u32::from(self.length - 1).max(1)) as i32
    }

    /// Pixels of a region; the three tile the axis.
    pub(super) fn region(self, region: usize) -> Range<u16> {
        let start = |region: usize| (usize::from(self.length) * region / REGIONS) as u16;
        start(region)..start(region + 1)
    }

    pub(super) fn region_of(self, index: u16) -> usize {
        (1..REGIONS).take_while(|&region| index >= self.region(region).start).count()
    }

    /// The four bands of a blend, in order: before the first centre, between centres, after the last.
    pub(super) fn bands(self) -> [Band; REGIONS + 1] {
        // First plus last pixel: twice the centre, an integer.
        let centres: [i64; REGIONS] = core::array::from_fn(|region| {
            let pixels = self.region(region);
            i64::from(pixels.start) + i64::from(pixels.end) - 1
        });
        core::array::from_fn(|band| {
            let (before, after) = (band.saturating_sub(1), band.min(REGIONS - 1));
            let boundary = |centre: i64| centre.unsigned_abs().div_ceil(2) as u16;
            let start = if band == 0 { 0 } else { boundary(centres[before]) };
            let end = if band == REGIONS { self.length } else { boundary(centres[after]) };
            let weights = if before == after {
                Weights { first: 0, step: 0 }
            } else {
                // At least 6 pixels per side, so centres differ.
                let span = (centres[after] - centres[before]).max(1);
                let into = 2 * i64::from(start) - centres[before];
                Weights { first: ((into << 31) / span) as i32, step: ((2_i64 << 31) / span) as i32 }
            };
            Band { pixels: start..end, before, after, weights }
        })
    }
}

/// Part of an axis with the same two regions.
#[derive(Clone, Debug)]
pub(super) struct Band {
    pub(super) pixels: Range<u16>,
    /// Region with full weight at the start...
    pub(super) before: usize,
    /// ...and at the end; equal in the outer bands.
    pub(super) after: usize,
    weights: Weights,
}

#[derive(Clone, Copy, Debug)]
struct Weights {
    first: i32,
    step: i32,
}

impl Band {
    pub(super) fn is_outer(&self) -> bool {
        self.before == self.after
    }

    /// Weight of region `after`, Q1.31; 0 in the outer bands.
    pub(super) fn weight(&self, index: u16) -> i32 {
        self.weights.first + i32::from(index - self.pixels.start) * self.weights.step
    }
}

/// Why a correction was rejected.
#[derive(Clone, Copy, PartialEq, Debug)]
#[non_exhaustive]
#[allow(missing_docs, reason = "the names describe these fields")]
pub enum Error {
    EmptyRange {
        one_end_mm: f32,
        other_end_mm: f32,
    },
    CoefficientTooLarge {
        value: f64,
    },
    /// Outside of [`Frame::SMALLEST`] to [`Frame::LARGEST`].
    FrameSize {
        width: u16,
        height: u16,
    },
    /// Samples do not determine the terms.
    Underdetermined {
        samples: u32,
        terms: u16,
    },
    TooManySamples {
        most: u32,
    },
    TableTooSmall {
        given: usize,
        needed: usize,
    },
    NoSuchRow {
        row: u16,
        height: u16,
    },
    RowLength {
        pixels: usize,
        width: u16,
    },
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::EmptyRange { one_end_mm, other_end_mm } => {
                write!(f, "the working range {one_end_mm} to {other_end_mm} mm has no finite extent")
            }
            Self::CoefficientTooLarge { value } => {
                write!(
                    f,
                    "the coefficient {value} is not below 4 in magnitude; fit on a wider spread of samples"
                )
            }
            Self::FrameSize { width, height } => {
                let (least, most) = (Frame::SMALLEST, Frame::LARGEST);
                write!(f, "a frame of {width} x {height} pixels; each side must be {least} to {most}")
            }
            Self::Underdetermined { samples, terms } => write!(
                f,
                "{samples} samples do not determine {terms} terms; take four depths or more, and pixels all over the image"
            ),
            Self::TooManySamples { most } => write!(f, "more than {most} samples; take every other pixel"),
            Self::TableTooSmall { given, needed } => {
                write!(f, "a table of {given} words where {needed} are needed")
            }
            Self::NoSuchRow { row, height } => write!(f, "row {row} of a frame with {height} rows"),
            Self::RowLength { pixels, width } => {
                write!(f, "a row of {pixels} pixels for a correction made for {width}")
            }
        }
    }
}

impl core::error::Error for Error {}

//! Images of a stack, read by rows.

use std::ops::Range;

use ndarray::{ArrayView2, CowArray, Ix2, s};

use super::StackError;

/// Images in the order of their focus, in memory or in a file; pixels that were not seen are NaN.
pub trait Slices: Sync {
    /// Why rows cannot be read.
    type Error: From<StackError> + Send;

    /// Number of images.
    fn count(&self) -> usize;

    /// Height and width of an image.
    fn dim(&self, index: usize) -> (usize, usize);

    /// Some rows of an image.
    ///
    /// # Errors
    /// Those of reading.
    fn rows(&self, index: usize, rows: Range<usize>) -> Result<CowArray<'_, f32, Ix2>, Self::Error>;

    /// Step between the codes of the images, in their scale; 0 = not known.
    fn code_step(&self) -> f32 {
        0.0
    }

    /// Called after each band of rows, with the rows that are done and all there are: once for the curves, once for the
    /// correction along edges.
    ///
    /// # Errors
    /// Any error stops the measurement.
    fn measured(&self, _rows: usize, _of: usize) -> Result<(), Self::Error> {
        Ok(())
    }
}

impl Slices for [ArrayView2<'_, f32>] {
    type Error = StackError;

    fn count(&self) -> usize {
        self.len()
    }

    fn dim(&self, index: usize) -> (usize, usize) {
        self[index].dim()
    }

    fn rows(&self, index: usize, rows: Range<usize>) -> Result<CowArray<'_, f32, Ix2>, StackError> {
        Ok(self[index].slice(s![rows, ..]).into())
    }
}

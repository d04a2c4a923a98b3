//! Rows of numbers side by side in memory.

/// A block of rows with a common stride, each row aligned to a cache line.
#[derive(Debug)]
pub(crate) struct Plane {
    storage: Vec<f32>,
    /// Where the first row begins in the storage.
    start: usize,
    stride: usize,
    rows: usize,
}

/// Numbers in a cache line.
const LINE: usize = 16;

impl Plane {
    /// Numbers beyond the asked width that may be read and written in each row.
    pub const PADDING: usize = 80;

    /// Zeros of `rows` x `width`.
    pub fn new(rows: usize, width: usize) -> Self {
        let stride = (width + Self::PADDING).next_multiple_of(LINE);
        let storage = vec![0.0; rows * stride + LINE - 1];
        // Where the allocation cannot be aligned (which only an interpreter of the language may say) rows start anywhere.
        let start = storage.as_ptr().align_offset(LINE * size_of::<f32>()).min(LINE - 1);
        Self { storage, start, stride, rows }
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Numbers in a row, padding included.
    pub fn stride(&self) -> usize {
        self.stride
    }

    /// All rows after each other.
    pub fn all(&self) -> &[f32] {
        &self.storage[self.start..self.start + self.rows * self.stride]
    }

    /// All rows after each other, to write.
    pub fn all_mut(&mut self) -> &mut [f32] {
        &mut self.storage[self.start..self.start + self.rows * self.stride]
    }

    /// A row with its padding.
    pub fn row(&self, y: usize) -> &[f32] {
        &self.all()[y * self.stride..(y + 1) * self.stride]
    }

    /// A row with its padding, to write.
    pub fn row_mut(&mut self, y: usize) -> &mut [f32] {
        let stride = self.stride;
        &mut self.all_mut()[y * stride..(y + 1) * stride]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_begin_at_cache_lines_and_do_not_overlap() {
        let mut plane = Plane::new(3, 50);
        assert_eq!((plane.rows(), plane.stride()), (3, 144));
        for y in 0..3 {
            assert_eq!(plane.row(y).as_ptr().align_offset(64), 0);
            plane.row_mut(y).fill(y as f32);
        }
        assert!(plane.all().chunks(144).zip([0.0, 1.0, 2.0]).all(|(row, y)| row.iter().all(|v| *v == y)));
    }
}

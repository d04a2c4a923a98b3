//! Several exposures of one thing as one image: the noise falls with the root of their number.

use ndarray::{Array2, Zip};

use crate::{camera::Image, expose::CaptureError};

/// Bits of an image file.
const BITS_MAX: u32 = 16;

/// Images of one size and depth of bits, summed up.
#[derive(Clone, PartialEq, Debug)]
pub struct Average {
    first: Image,
    /// Sum of the codes; 65,535 images of 16 bits fit.
    sum: Array2<u32>,
    /// Pixels that were saturated in any of the images: their mean would say less light than there was.
    saturated: Array2<bool>,
    count: u32,
}

impl Average {
    /// Begins with an image.
    pub fn of(image: Image) -> Self {
        let white = white(image.bits.into());
        let sum = image.pixels.mapv(u32::from);
        let saturated = sum.mapv(|code| code >= white);
        Self { first: image, sum, saturated, count: 1 }
    }

    /// Adds another one.
    ///
    /// # Errors
    /// [`CaptureError::Unlike`] for one of another size or depth of bits.
    pub fn add(&mut self, image: &Image) -> Result<(), CaptureError> {
        let ((far_height, far_width), (near_height, near_width)) = (self.sum.dim(), image.pixels.dim());
        let (far_bits, near_bits) = (self.first.bits, image.bits);
        if (far_width, far_height, far_bits) != (near_width, near_height, near_bits) {
            return Err(CaptureError::Unlike {
                far_width,
                far_height,
                far_bits,
                near_width,
                near_height,
                near_bits,
            });
        }
        let white = white(image.bits.into());
        Zip::from(&mut self.sum).and(&mut self.saturated).and(&image.pixels).for_each(
            |sum, saturated, code| {
                *sum += u32::from(*code);
                *saturated |= u32::from(*code) >= white;
            },
        );
        self.count += 1;
        Ok(())
    }

    /// The mean: with a bit more for each doubling, as far as 16 carry them; black and white stay where they were. One image is given
    /// back as it came.
    pub fn finish(self) -> Image {
        if self.count == 1 {
            return self.first;
        }
        let before = u32::from(self.first.bits);
        let bits = (before + self.count.ilog2() + u32::from(!self.count.is_power_of_two())).min(BITS_MAX);
        let (whole, of) = (u64::from(white(bits)), u64::from(white(before)) * u64::from(self.count));
        let pixels = Zip::from(&self.sum).and(&self.saturated).map_collect(|sum, saturated| {
            let mean = (u64::from(*sum) * whole + of / 2) / of;
            // What was never saturated stays below white.
            (if *saturated { whole } else { mean.min(whole - 1) }) as u16
        });
        Image { pixels, bits: bits as u8 }
    }
}

fn white(bits: u32) -> u32 {
    (1 << bits) - 1
}

#[cfg(test)]
mod tests {
    use ndarray::array;

    use super::*;

    fn image(pixels: Array2<u16>) -> Image {
        Image { pixels, bits: 8 }
    }

    #[test]
    fn the_mean_has_more_bits_and_keeps_white() {
        let mut average = Average::of(image(array![[0, 100, 254, 255]]));
        for pixels in [array![[0, 101, 255, 255]], array![[1, 100, 254, 255]], array![[0, 100, 254, 255]]] {
            average.add(&image(pixels)).unwrap();
        }
        let mean = average.finish();
        assert_eq!(mean.bits, 10);
        // 0.25 and 100.25 of 255 are 1 and 402 of 1023.
        assert_eq!(mean.pixels, array![[1, 402, 1023, 1023]]);
    }

    #[test]
    fn one_image_is_itself_and_another_size_is_refused() {
        let one = image(array![[7, 255]]);
        assert_eq!(Average::of(one.clone()).finish(), one);
        let error = Average::of(one).add(&image(array![[7]])).unwrap_err();
        assert!(matches!(error, CaptureError::Unlike { far_width: 2, near_width: 1, .. }), "{error}");
    }
}

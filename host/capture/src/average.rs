//! Averages several exposures: noise falls with the square root of their number.

use ndarray::{Array2, Zip};

use crate::camera::Image;

const BITS_MAX: u32 = 16;

#[derive(Clone, PartialEq, Debug)]
pub struct Average {
    first: Image,
    /// 65,535 16-bit images fit.
    sum: Array2<u32>,
    /// Pixels saturated in any image: their mean would be too dark.
    saturated: Array2<bool>,
    count: u32,
}

impl Average {
    pub fn of(image: Image) -> Self {
        let white = white(image.bits.into());
        let sum = image.pixels.mapv(u32::from);
        let saturated = sum.mapv(|code| code >= white);
        Self { first: image, sum, saturated, count: 1 }
    }

    /// Adds an image of the first one's size and bits, which the images of one program have.
    pub fn add(&mut self, image: &Image) {
        let white = white(image.bits.into());
        Zip::from(&mut self.sum).and(&mut self.saturated).and(&image.pixels).for_each(
            |sum, saturated, code| {
                *sum += u32::from(*code);
                *saturated |= u32::from(*code) >= white;
            },
        );
        self.count += 1;
    }

    /// The mean, one more bit per doubling up to 16; black and white keep their meaning. One image is unchanged.
    pub fn finish(self) -> Image {
        if self.count == 1 {
            return self.first;
        }
        let before = u32::from(self.first.bits);
        let bits = (before + self.count.ilog2() + u32::from(!self.count.is_power_of_two())).min(BITS_MAX);
        let (whole, of) = (u64::from(white(bits)), u64::from(white(before)) * u64::from(self.count));
        let pixels = Zip::from(&self.sum).and(&self.saturated).map_collect(|sum, saturated| {
            let mean = (u64::from(*sum) * whole + of / 2) / of;
            // Unsaturated pixels stay below white.
            (if *saturated { whole } else { mean.min(whole - 1) }) as u16
        });
        // Exposures of one scene are rounded alike.
        Image { pixels, bits: bits as u8, coding_variance: self.first.coding_variance }
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
        Image::new(pixels, 8)
    }

    #[test]
    fn the_mean_has_more_bits_and_preserves_white() {
        let mut average = Average::of(image(array![[0, 100, 254, 255]]));
        for pixels in [array![[0, 101, 255, 255]], array![[1, 100, 254, 255]], array![[0, 100, 254, 255]]] {
            average.add(&image(pixels));
        }
        let mean = average.finish();
        assert_eq!(mean.bits, 10);
        // 0.25 and 100.25 of 255 are 1 and 402 of 1023.
        assert_eq!(mean.pixels, array![[1, 402, 1023, 1023]]);
    }

    #[test]
    fn returns_a_single_image_unchanged() {
        let one = image(array![[7, 255]]);
        assert_eq!(Average::of(one.clone()).finish(), one);
    }

    #[test]
    fn three_images_need_two_more_bits_and_16_bits_are_the_most() {
        let of = |bits, codes: [u16; 3]| {
            let mut images = codes.map(|code| Image::new(array![[code]], bits)).into_iter();
            let mut average = Average::of(images.next().expect("three"));
            images.for_each(|image| average.add(&image));
            let mean = average.finish();
            (mean.bits, mean.pixels[[0, 0]])
        };
        // 32 / 3 of 255 are 42.8 of 1023.
        assert_eq!(of(8, [10, 11, 11]), (10, 43));
        assert_eq!(of(15, [10_000, 10_000, 10_001]), (16, 20_001));
        assert_eq!(of(16, [10_000, 10_000, 10_002]), (16, 10_001));
    }
}

//! Camera pixels to 16-bit grey (YUV: luma, MJPEG: mean of colours); names of Video4Linux, ffmpeg, PFNC. One pass.

use std::{fmt, str::FromStr};

use farnear_files::image_file::{GreyImage, Samples, decode_grey};
use ndarray::Array2;

use super::Image;

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Layout {
    /// One byte per pixel (GREY, gray, Mono8), or the luma of planar YUV.
    Grey8 {
        /// Ignored bytes after each picture, in twelfths of its pixels: 0 grey, 6 4:2:0, 12 4:2:2, 24 4:4:4.
        colour_twelfths: u8,
    },
    /// Two bytes per pixel, little-endian, with `bits` significant: Y10, Y12, Y16, gray12le, Mono12.
    Grey16 {
        bits: u8,
    },
    /// Ten bits per pixel, LSB first: Mono10p.
    Packed10,
    /// Twelve bits per pixel, LSB first: Mono12p.
    Packed12,
    /// Two 10-bit pixels in three bytes: Mono10Packed; the middle byte has the low bits of both.
    GigePacked10,
    /// As [`Self::GigePacked10`] with 12-bit pixels: Mono12Packed.
    GigePacked12,
    /// Two pixels in four bytes, luma first: YUYV, yuyv422.
    Yuyv,
    Jpeg,
}

/// As in ffmpeg's `-pix_fmt`.
const RAW_NAMES: [(&str, Layout); 8] = [
    ("gray", Layout::Grey8 { colour_twelfths: 0 }),
    ("gray10le", Layout::Grey16 { bits: 10 }),
    ("gray12le", Layout::Grey16 { bits: 12 }),
    ("gray14le", Layout::Grey16 { bits: 14 }),
    ("gray16le", Layout::Grey16 { bits: 16 }),
    ("yuv420p", Layout::Grey8 { colour_twelfths: 6 }),
    ("yuv422p", Layout::Grey8 { colour_twelfths: 12 }),
    ("yuyv422", Layout::Yuyv),
];

impl FromStr for Layout {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        RAW_NAMES.iter().find(|(name, _)| *name == text).map(|(_, layout)| *layout).ok_or_else(|| {
            format!(
                "`{text}` is not a format of raw frames: expected {}",
                RAW_NAMES.map(|(name, _)| name).join(", ")
            )
        })
    }
}

#[derive(Clone, PartialEq, Eq, Debug)]
pub struct BadFrame(pub String);

impl fmt::Display for BadFrame {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str(&self.0)
    }
}

impl Layout {
    /// Significant bits of a pixel; 8 for a JPEG.
    pub fn bits(self) -> u8 {
        match self {
            Self::Grey16 { bits } => bits,
            Self::Packed10 | Self::GigePacked10 => 10,
            Self::Packed12 | Self::GigePacked12 => 12,
            Self::Grey8 { .. } | Self::Yuyv | Self::Jpeg => 8,
        }
    }

    /// Bytes per frame; `None` for JPEG or overflow.
    pub fn frame_bytes(self, width: usize, height: usize) -> Option<usize> {
        let pixels = width.checked_mul(height)?;
        let halves = |side: usize| side.div_ceil(2);
        match self {
            Self::Grey8 { colour_twelfths: 0 } => Some(pixels),
            Self::Grey8 { colour_twelfths: 6 } => {
                pixels.checked_add(2 * halves(width).checked_mul(halves(height))?)
            }
            Self::Grey8 { colour_twelfths: 12 } => pixels.checked_add(2 * halves(width).checked_mul(height)?),
            Self::Grey8 { .. } => pixels.checked_mul(3),
            Self::Grey16 { .. } | Self::Yuyv => pixels.checked_mul(2),
            Self::Packed10 => Some(pixels.checked_mul(10)?.div_ceil(8)),
            Self::Packed12 | Self::GigePacked10 | Self::GigePacked12 => {
                Some(pixels.checked_mul(12)?.div_ceil(8))
            }
            Self::Jpeg => None,
        }
    }

    /// Bytes per row without padding; `None` if rows do not start at whole bytes.
    pub fn row_bytes(self, width: usize) -> Option<usize> {
        match self {
            Self::Grey8 { .. } => Some(width),
            Self::Grey16 { .. } | Self::Yuyv => width.checked_mul(2),
            Self::Packed10 | Self::Packed12 | Self::GigePacked10 | Self::GigePacked12 | Self::Jpeg => None,
        }
    }

    /// As [`Self::frame_bytes`] with rows of `stride` bytes.
    pub fn padded_frame_bytes(self, stride: usize, height: usize) -> Option<usize> {
        let per_pixel = self.row_bytes(1)?;
        self.frame_bytes(stride.div_ceil(per_pixel), height)
    }

    /// Removes row padding. Fails for too few bytes.
    pub fn without_padding(
        self,
        bytes: &[u8],
        width: usize,
        height: usize,
        stride: usize,
    ) -> Result<Vec<u8>, BadFrame> {
        let Some(row) = self.row_bytes(width) else { return Ok(bytes.to_vec()) };
        if stride <= row {
            return Ok(bytes.to_vec());
        }
        let rows: Vec<&[u8]> =
            bytes.chunks(stride).take(height).filter_map(|chunk| chunk.get(..row)).collect();
        if rows.len() < height {
            let came = bytes.len();
            return Err(BadFrame(format!(
                "{came} bytes where {height} rows of {stride} bytes were announced"
            )));
        }
        Ok(rows.concat())
    }

    /// As [`Self::decode`] with `padding` bytes after each row.
    pub fn decode_padded(
        self,
        bytes: &[u8],
        width: usize,
        height: usize,
        padding: usize,
    ) -> Result<Image, BadFrame> {
        if padding == 0 {
            return self.decode(bytes, width, height);
        }
        let row = self.row_bytes(width).ok_or_else(|| {
            BadFrame(format!(
                "{padding} bytes after each row of a packed format: set one of whole bytes (Mono8, Mono10, Mono12, Mono16)"
            ))
        })?;
        let rows = self.without_padding(bytes, width, height, row.saturating_add(padding))?;
        self.decode(&rows, width, height)
    }

    /// Decodes a frame; surplus bytes are ignored. Fails for too few bytes, values above the bit depth, or a bad JPEG.
    pub fn decode(self, bytes: &[u8], width: usize, height: usize) -> Result<Image, BadFrame> {
        if self == Self::Jpeg {
            return jpeg(bytes, width, height);
        }
        let due = self
            .frame_bytes(width, height)
            .ok_or_else(|| BadFrame(format!("{width}x{height} px are more than there is memory for")))?;
        if bytes.len() < due {
            let came = bytes.len();
            return Err(BadFrame(format!("{came} bytes where a frame of {width}x{height} px has {due}")));
        }
        let pixels = width * height;
        let values: Vec<u16> = match self {
            Self::Grey8 { .. } => bytes[..pixels].iter().map(|byte| u16::from(*byte)).collect(),
            Self::Grey16 { .. } => {
                bytes[..due].chunks_exact(2).map(|pair| u16::from_le_bytes([pair[0], pair[1]])).collect()
            }
            Self::Yuyv => bytes[..due].iter().step_by(2).map(|byte| u16::from(*byte)).collect(),
            Self::Packed10 => bit_stream(bytes, pixels, 10),
            Self::Packed12 => bit_stream(bytes, pixels, 12),
            Self::GigePacked10 => gige_packed(bytes, pixels, 2),
            Self::GigePacked12 => gige_packed(bytes, pixels, 4),
            Self::Jpeg => Vec::new(),
        };
        let bits = self.bits();
        if let Some(value) = values.iter().find(|value| u32::from(**value) >> bits != 0) {
            return Err(BadFrame(format!("a pixel of {value} in a picture of {bits} bits")));
        }
        let pixels =
            Array2::from_shape_vec((height, width), values).map_err(|error| BadFrame(error.to_string()))?;
        Ok(Image::new(pixels, bits))
    }
}

/// Values of `bits` bits each, LSB first; the caller checks the length.
fn bit_stream(bytes: &[u8], pixels: usize, bits: u32) -> Vec<u16> {
    let mut bytes = bytes.iter();
    let (mut waiting, mut count) = (0_u32, 0);
    (0..pixels)
        .map(|_| {
            while count < bits {
                waiting |= u32::from(bytes.next().copied().unwrap_or(0)) << count;
                count += 8;
            }
            let value = waiting & ((1 << bits) - 1);
            (waiting, count) = (waiting >> bits, count - bits);
            value as u16
        })
        .collect()
}

/// Two pixels in three bytes: the upper eight bits outside, the `low` other ones in a half of the middle byte.
fn gige_packed(bytes: &[u8], pixels: usize, low: u32) -> Vec<u16> {
    (0..pixels)
        .map(|index| {
            let group = index / 2 * 3;
            let middle = bytes.get(group + 1).copied().unwrap_or(0);
            let (high, half) = match index % 2 {
                0 => (bytes[group], middle),
                _ => (bytes[group + 2], middle >> 4),
            };
            (u16::from(high) << low) | (u16::from(half) & ((1 << low) - 1))
        })
        .collect()
}

fn jpeg(bytes: &[u8], width: usize, height: usize) -> Result<Image, BadFrame> {
    let image = of_picture(decode_grey(bytes).map_err(BadFrame)?).map_err(BadFrame)?;
    let (came_height, came_width) = image.pixels.dim();
    if (came_width, came_height) != (width, height) {
        return Err(BadFrame(format!(
            "{came_width}x{came_height} px where {width}x{height} px were announced"
        )));
    }
    Ok(image)
}

/// Converts a picture file; rejects floating-point pixels.
pub fn of_picture(picture: GreyImage) -> Result<Image, String> {
    let Samples::Integer(bits) = picture.samples else {
        return Err("a camera's image has integer pixels, this one has float".into());
    };
    if picture.pixels.iter().any(|value| value.is_nan()) {
        return Err("a camera's image has a value in each pixel, this one has transparent ones: save it without alpha".into());
    }
    let full_scale = f32::from(((1u32 << bits) - 1) as u16);
    let pixels = picture.pixels.mapv(|value| (value * full_scale).round() as u16);
    Ok(Image { pixels, bits, coding_variance: picture.coding_variance })
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::array;
    use proptest::prelude::*;

    #[test]
    fn each_layout_decodes_to_its_defined_grey_values() {
        let grey = Layout::Grey8 { colour_twelfths: 0 };
        assert_eq!(grey.decode(&[1, 2, 3, 4], 2, 2).unwrap().pixels, array![[1, 2], [3, 4]]);
        let y10 = Layout::Grey16 { bits: 10 }.decode(&[0xff, 0x03, 1, 0], 2, 1).unwrap();
        assert_eq!((y10.pixels, y10.bits), (array![[1023, 1]], 10));
        // Luma, blue, luma, red.
        assert_eq!(Layout::Yuyv.decode(&[10, 99, 20, 98], 2, 1).unwrap().pixels, array![[10, 20]]);
        // 4:2:0 of 3x1 px: three of luma, two and two of colour.
        let planar = Layout::Grey8 { colour_twelfths: 6 };
        assert_eq!(planar.frame_bytes(3, 1), Some(7));
        assert_eq!(planar.decode(&[7, 8, 9, 0, 0, 0, 0], 3, 1).unwrap().pixels, array![[7, 8, 9]]);
        // PFNC: Mono12p stores the low byte of the first pixel first, Mono12Packed its high byte.
        let bytes = [0xbc, 0x3a, 0x12];
        assert_eq!(Layout::Packed12.decode(&bytes, 2, 1).unwrap().pixels, array![[0xabc, 0x123]]);
        let bytes = [0xab, 0x3c, 0x12];
        assert_eq!(Layout::GigePacked12.decode(&bytes, 2, 1).unwrap().pixels, array![[0xabc, 0x123]]);
        // Mono10Packed uses two bits of each half.
        let bytes = [0xab, 0xde, 0x12];
        assert_eq!(Layout::GigePacked10.decode(&bytes, 2, 1).unwrap().pixels, array![[0x2ae, 0x049]]);
        // 0x155, 0x2aa, 0x3ff, 0x001 in forty bits, LSB first.
        let bytes = [0x55, 0xa9, 0xfa, 0x7f, 0x00];
        assert_eq!(Layout::Packed10.decode(&bytes, 4, 1).unwrap().pixels, array![[0x155, 0x2aa, 0x3ff, 1]]);
    }

    #[test]
    fn a_jpeg_is_decoded_and_its_size_is_checked() {
        let mut jpeg = Vec::new();
        image::codecs::jpeg::JpegEncoder::new_with_quality(&mut jpeg, 100)
            .encode(&[128; 64], 8, 8, image::ExtendedColorType::L8)
            .unwrap();
        let image = Layout::Jpeg.decode(&jpeg, 8, 8).unwrap();
        // A uniform picture survives JPEG to one quantisation step, which is 1 at quality 100.
        assert!(image.pixels.iter().all(|value| value.abs_diff(128) <= 1), "{:?}", image.pixels);
        let other = Layout::Jpeg.decode(&jpeg, 16, 8).unwrap_err().to_string();
        assert!(other.contains("8x8 px where 16x8"), "{other}");
        assert!(Layout::Jpeg.decode(&jpeg[..20], 8, 8).is_err());
    }

    #[test]
    fn rejects_short_frames_and_values_above_the_bit_depth() {
        let short = Layout::Grey16 { bits: 12 }.decode(&[0; 7], 2, 2).unwrap_err().to_string();
        assert!(short.contains("7 bytes where a frame of 2x2 px has 8"), "{short}");
        let bright = Layout::Grey16 { bits: 12 }.decode(&[0, 0x10], 1, 1).unwrap_err().to_string();
        assert!(bright.contains("a pixel of 4096 in a picture of 12 bits"), "{bright}");
        assert!("gray13le".parse::<Layout>().unwrap_err().contains("gray12le"));
    }

    #[test]
    fn padded_rows_lose_their_padding() {
        let y16 = Layout::Grey16 { bits: 16 };
        let padded = [1, 0, 2, 0, 99, 99, 3, 0, 4, 0]; // the last row may lack it
        assert_eq!(y16.without_padding(&padded, 2, 2, 6).unwrap(), [1, 0, 2, 0, 3, 0, 4, 0]);
        assert!(y16.without_padding(&padded, 2, 3, 6).is_err());
        assert_eq!(Layout::Yuyv.without_padding(&[1, 2, 3, 4], 2, 1, 4).unwrap(), [1, 2, 3, 4]);
        assert_eq!(y16.decode_padded(&padded, 2, 2, 2).unwrap().pixels, array![[1, 2], [3, 4]]);
        assert_eq!(y16.decode_padded(&padded, 2, 2, 0).unwrap().pixels, array![[1, 2], [99 * 257, 3]]);
        let packed = Layout::Packed12.decode_padded(&[0; 12], 2, 2, 3).unwrap_err().to_string();
        assert!(packed.contains("3 bytes after each row"), "{packed}");
    }

    fn any_layout() -> impl Strategy<Value = Layout> {
        prop_oneof![
            Just(Layout::Packed10),
            Just(Layout::Packed12),
            Just(Layout::GigePacked10),
            Just(Layout::GigePacked12),
            Just(Layout::Yuyv),
            Just(Layout::Jpeg),
            (9_u8..=16).prop_map(|bits| Layout::Grey16 { bits }),
            prop_oneof![Just(0_u8), Just(6), Just(12), Just(24)]
                .prop_map(|colour_twelfths| Layout::Grey8 { colour_twelfths }),
        ]
    }

    proptest! {
        #[test]
        fn no_bytes_make_it_panic(
            layout in any_layout(),
            bytes in prop::collection::vec(any::<u8>(), 0..200),
            width in 0_usize..20,
            height in 0_usize..20,
        ) {
            if let Ok(image) = layout.decode(&bytes, width, height) {
                prop_assert_eq!(image.pixels.dim(), (height, width));
            }
        }
    }
}

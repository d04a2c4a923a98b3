//! YUV4MPEG2 streams (8 to 12 bits, 4:2:0, 4:2:2, 4:4:4, grey) to 8-bit RGB by ITU-R BT.601, section 2.5.1; studio
//! range unless `XCOLORRANGE=FULL`. Nearest chroma sample.

use std::{
    cell::Cell,
    io::{self, Read},
    path::{Path, PathBuf},
    rc::Rc,
};

use ndarray::{Array2, Array3};
use y4m::{Colorspace, Decoder};

use super::{Pixels, VideoError, VideoFrame, numbered};

/// Limit for damaged headers.
const LONGEST_SIDE_PX: usize = 16_384;

/// Counts bytes, to distinguish the end from a truncation.
struct Counting<R> {
    reader: R,
    bytes: Rc<Cell<u64>>,
}

impl<R: Read> Read for Counting<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.reader.read(buffer)?;
        self.bytes.set(self.bytes.get() + count as u64);
        Ok(count)
    }
}

pub(super) struct Y4m<R: Read> {
    path: PathBuf,
    decoder: Decoder<Counting<R>>,
    bytes: Rc<Cell<u64>>,
    frames: usize,
    full_range: bool,
}

impl<R: Read> Y4m<R> {
    pub(super) fn new(path: &Path, reader: R) -> Result<Self, VideoError> {
        let bytes = Rc::new(Cell::new(0));
        let header = |reason: String| VideoError::Y4m { path: path.into(), frame: 0, reason };
        let limits = y4m::Limits { bytes: 6 * LONGEST_SIDE_PX * LONGEST_SIDE_PX };
        let decoder = Decoder::new_with_limits(Counting { reader, bytes: bytes.clone() }, limits);
        let decoder = decoder.map_err(|error| match error {
            y4m::Error::EOF => header("the header is missing or broken off".into()),
            y4m::Error::UnknownColorspace => header(
                "its colour space is unsupported; expected mono, 420, 422 or 444 with 8, 10 or 12 bits"
                    .into(),
            ),
            other => header(other.to_string()),
        })?;
        let (width, height) = (decoder.get_width(), decoder.get_height());
        if width > LONGEST_SIDE_PX || height > LONGEST_SIDE_PX {
            return Err(header(format!(
                "{width}x{height} pixels; at most {LONGEST_SIDE_PX} a side are read"
            )));
        }
        let full_range = decoder
            .get_raw_params()
            .split(|&byte| byte == b' ')
            .any(|parameter| parameter == b"XCOLORRANGE=FULL");
        Ok(Self { path: path.into(), decoder, bytes, frames: 0, full_range })
    }

    /// Frames per second by the header (`F30000:1001`); `None` without it or for `F0:0`.
    pub(super) fn rate_hz(&self) -> Option<f64> {
        let mut parameters = self.decoder.get_raw_params().split(|&byte| byte == b' ');
        let is_stated = parameters.any(|parameter| parameter.starts_with(b"F"));
        let rate = self.decoder.get_framerate();
        (is_stated && rate.num > 0 && rate.den > 0).then(|| rate.num as f64 / rate.den as f64)
    }

    /// Notice to the user about pixels that are not square (`A64:45`).
    pub(super) fn remark(&self) -> Option<String> {
        let mut parameters = self.decoder.get_raw_params().split(|&byte| byte == b' ');
        let aspect =
            parameters.find_map(|parameter| std::str::from_utf8(parameter.strip_prefix(b"A")?).ok())?;
        let (over, under) = aspect.split_once(':')?;
        (over != under && over != "0").then(|| {
            format!("its pixels are {over}:{under}, not square: widen them first (ffmpeg -vf scale=round(iw*sar):ih,setsar=1)")
        })
    }
}

impl<R: Read> Iterator for Y4m<R> {
    type Item = Result<VideoFrame, VideoError>;

    fn next(&mut self) -> Option<Self::Item> {
        let (width, height) = (self.decoder.get_width(), self.decoder.get_height());
        let (colour_space, depth) = (self.decoder.get_colorspace(), self.decoder.get_bit_depth());
        let before = self.bytes.get();
        let damaged = |reason: String| {
            Some(Err(VideoError::Y4m { path: self.path.clone(), frame: self.frames + 1, reason }))
        };
        let frame = match self.decoder.read_frame() {
            Ok(frame) => frame,
            Err(y4m::Error::EOF) if self.bytes.get() == before => return None,
            Err(y4m::Error::EOF) => {
                return damaged(format!("it breaks off after {} of its bytes", self.bytes.get() - before));
            }
            Err(error) => return damaged(error.to_string()),
        };
        self.frames += 1;
        let sample = |plane: &[u8], at: usize| -> f32 {
            if depth == 8 {
                f32::from(plane[at])
            } else {
                f32::from(u16::from_le_bytes([plane[2 * at], plane[2 * at + 1]]))
                    / f32::from(1_u16 << (depth - 8))
            }
        };
        let luma = |at: usize| {
            let level = sample(frame.get_y_plane(), at);
            if self.full_range { level } else { (level - 16.0) * 255.0 / 219.0 }
        };
        let grey = |level: f32| level.round().clamp(0.0, 255.0) as u8;
        let pixels = match subsampling(colour_space) {
            None => Pixels::Grey(Array2::from_shape_fn((height, width), |(y, x)| grey(luma(y * width + x)))),
            Some((across, down)) => {
                let chroma_width = width.div_ceil(across);
                let scale = if self.full_range { 1.0 } else { 255.0 / 224.0 };
                let mut rgb = Array3::zeros((height, width, 3));
                for (y, mut row) in rgb.outer_iter_mut().enumerate() {
                    for (x, mut pixel) in row.outer_iter_mut().enumerate() {
                        let at = y / down * chroma_width + x / across;
                        let blue = scale * (sample(frame.get_u_plane(), at) - 128.0);
                        let red = scale * (sample(frame.get_v_plane(), at) - 128.0);
                        let level = luma(y * width + x);
                        pixel[0] = grey(level + 1.402 * red);
                        pixel[1] = grey(level - 0.344_136 * blue - 0.714_136 * red);
                        pixel[2] = grey(level + 1.772 * blue);
                    }
                }
                Pixels::Rgb(rgb)
            }
        };
        Some(Ok(VideoFrame { name: numbered(self.frames), pixels }))
    }
}

/// Pixels per chroma sample, horizontally and vertically; `None` without chroma.
fn subsampling(colour_space: Colorspace) -> Option<(usize, usize)> {
    match colour_space {
        Colorspace::Cmono | Colorspace::Cmono12 => None,
        Colorspace::C422 | Colorspace::C422p10 | Colorspace::C422p12 => Some((2, 1)),
        Colorspace::C444 | Colorspace::C444p10 | Colorspace::C444p12 => Some((1, 1)),
        _ => Some((2, 2)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn frames(stream: &[u8]) -> Result<Vec<Pixels>, VideoError> {
        Y4m::new(Path::new("test.y4m"), stream)?.map(|frame| frame.map(|frame| frame.pixels)).collect()
    }

    fn stream(header: &str, frames: &[&[u8]]) -> Vec<u8> {
        let mut bytes = format!("YUV4MPEG2 {header}\n").into_bytes();
        for frame in frames {
            bytes.extend(b"FRAME\n");
            bytes.extend(*frame);
        }
        bytes
    }

    #[test]
    fn decodes_bt601_primaries() {
        // Studio-range codes of BT.601's 100 % colour bars: white, red, green, blue.
        let planes = [235, 81, 145, 41, 128, 90, 54, 240, 128, 240, 34, 110];
        let Pixels::Rgb(rgb) = &frames(&stream("W4 H1 F25:1 C444", &[&planes])).unwrap()[0] else { panic!() };
        let expected = [[255, 255, 255], [255, 0, 0], [0, 255, 0], [0, 0, 255]];
        for (column, colour) in expected.iter().enumerate() {
            for (channel, &level) in colour.iter().enumerate() {
                // The codes are rounded, which the matrix doubles.
                assert!(i16::from(rgb[[0, column, channel]]).abs_diff(level) <= 2, "column {column}: {rgb}");
            }
        }
    }

    #[test]
    fn odd_sizes_with_shared_chroma_and_grey() {
        // 3 x 3 at 4:2:0 has 2 x 2 chroma samples.
        let mut planes = vec![128; 9];
        planes.extend([128; 8]);
        let read = frames(&stream("W3 H3 F25:1 C420jpeg XCOLORRANGE=FULL", &[&planes, &planes])).unwrap();
        assert_eq!(read, vec![Pixels::Rgb(Array3::from_elem((3, 3, 3), 128)); 2]);
        let read = frames(&stream("W2 H1 F25:1 Cmono XCOLORRANGE=FULL", &[&[7, 9]])).unwrap();
        assert_eq!(read, [Pixels::Grey(Array2::from_shape_vec((1, 2), vec![7, 9]).unwrap())]);
    }

    #[test]
    fn pixels_that_are_not_square_are_reported() {
        let remark = |header: &str| {
            let bytes = stream(header, &[&[7, 9]]);
            Y4m::new(Path::new("a.y4m"), bytes.as_slice()).unwrap().remark()
        };
        assert!(
            remark("W2 H1 F25:1 A64:45 Cmono").is_some_and(|remark| remark.contains("64:45, not square"))
        );
        for square in ["W2 H1 F25:1 A1:1 Cmono", "W2 H1 F25:1 A0:0 Cmono", "W2 H1 F25:1 Cmono"] {
            assert_eq!(remark(square), None, "{square}");
        }
    }

    #[test]
    fn ten_bits_become_eight() {
        let code = 512_u16.to_le_bytes();
        let read = frames(&stream("W1 H1 F25:1 C444p10 XCOLORRANGE=FULL", &[&[code; 3].concat()])).unwrap();
        assert_eq!(read, [Pixels::Rgb(Array3::from_elem((1, 1, 3), 128))]);
    }

    #[test]
    fn a_truncated_stream_reports_its_position() {
        let text = frames(&stream("W2 H2 F25:1 Cmono", &[&[1, 2, 3, 4], &[1, 2]])).unwrap_err().to_string();
        assert!(text.contains("frame 2") && text.contains("breaks off"), "{text}");
        let text = frames(b"YUV4MPEG2 W99999999 H2\n").unwrap_err().to_string();
        assert!(text.contains("99999999x2"), "{text}");
        let text = frames(&stream("W2 H2 C999", &[])).unwrap_err().to_string();
        assert!(text.contains("colour space"), "{text}");
        assert!(frames(b"RIFF").is_err());
    }

    proptest! {
        #[test]
        fn no_bytes_make_it_panic(header in "[ WHFCXI0-9:monop]{0,40}", body in prop::collection::vec(any::<u8>(), 0..200)) {
            let mut bytes = format!("YUV4MPEG2 {header}\n").into_bytes();
            bytes.extend(body);
            let _ = frames(&bytes);
        }
    }
}

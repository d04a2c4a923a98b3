//! Background model over frames: size checks, learning rate, labels.

use ndarray::{Array2, Array3, ArrayView1, ArrayView2, ArrayView3, Axis};
use pulp::Arch;

use super::{
    kernel::{self, TILE, Update},
    shake::{self, Shift},
};

/// Largest difference between a grey pixel's channels after compression.
const EQUAL_CHANNELS: u8 = 6;
const COLOURLESS_BUT_ONE_IN: usize = 500;
const DARK: u8 = 16;

#[derive(Clone, Copy, Debug)]
pub enum Frame<'a> {
    /// Shape (height, width).
    Grey(ArrayView2<'a, u8>),
    /// RGB, shape (height, width, 3).
    Rgb(ArrayView3<'a, u8>),
}

impl Frame<'_> {
    #[must_use]
    pub fn size(&self) -> (usize, usize) {
        match self {
            Self::Grey(pixels) => pixels.dim(),
            Self::Rgb(pixels) => (pixels.dim().0, pixels.dim().1),
        }
    }

    #[must_use]
    pub fn channels(&self) -> usize {
        match self {
            Self::Grey(_) => 1,
            Self::Rgb(pixels) => pixels.dim().2,
        }
    }

    /// Whether the frame has colours. Infrared and other grey videos come in three channels, equal but for
    /// compression. A dark frame, before a recording fades in, counts as colour.
    #[must_use]
    pub fn has_colour(&self) -> bool {
        let Self::Rgb(pixels) = self else { return false };
        let of_pixel = |pixel: ArrayView1<'_, u8>| {
            let (least, most) =
                pixel.iter().fold((u8::MAX, 0), |(a, b), level| (a.min(*level), b.max(*level)));
            (most - least > EQUAL_CHANNELS, most > DARK)
        };
        let pixels = pixels.lanes(Axis(2)).into_iter().map(of_pixel);
        let (all, coloured, lit) =
            pixels.fold((0_usize, 0_usize, 0_usize), |(all, coloured, lit), (colour, light)| {
                (all + 1, coloured + usize::from(colour), lit + usize::from(light))
            });
        coloured > all / COLOURLESS_BUT_ONE_IN || lit < all / 2
    }
}

#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// History T; the learning rate is 1 / T after T frames.
    pub history_frames: u32,
    /// Darkest shadow relative to the lit background, 0 to 1; `None` labels shadow as foreground.
    pub shadow: Option<f32>,
}

impl Default for Settings {
    fn default() -> Self {
        Self { history_frames: 500, shadow: Some(0.5) }
    }
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Label {
    #[default]
    Background,
    /// A darker copy of the background (only with [`Settings::shadow`]).
    Shadow,
    Foreground,
}

/// Errors leave the model unchanged.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum BackgroundError {
    #[error("background model: history_frames is 0, but must be at least 1")]
    History,
    #[error("background model: a frame of {width}x{height} pixels is empty")]
    Empty { height: usize, width: usize },
    #[error("background model: {channels} channels per pixel; give 1 (grey) or 3 (red, green, blue)")]
    Channels { channels: usize },
    #[error(
        "background model: this frame is {}x{} with {found_channels} channel(s), but the video began with {}x{} \
         and {expected_channels}; scale the frames to one size or start a new model",
        .found.1, .found.0, .expected.1, .expected.0
    )]
    Changed {
        found: (usize, usize),
        found_channels: usize,
        expected: (usize, usize),
        expected_channels: usize,
    },
}

/// An adaptive Gaussian mixture per pixel.
/// ```
/// use farnear_silhouettes::background::{BackgroundModel, Frame, Label, Settings};
/// use ndarray::Array2;
/// let mut model = BackgroundModel::new((48, 64), 1, Settings::default())?;
/// let empty = Array2::from_elem((48, 64), 100_u8);
/// for _ in 0..20 {
///     model.apply(Frame::Grey(empty.view()))?;
/// }
/// let mut somebody = empty.clone();
/// somebody[[20, 30]] = 180;
/// let labels = model.apply(Frame::Grey(somebody.view()))?;
/// assert_eq!(labels[[20, 30]], Label::Foreground);
/// assert_eq!(labels[[20, 31]], Label::Background);
/// # Ok::<(), farnear_silhouettes::background::BackgroundError>(())
/// ```
pub struct BackgroundModel {
    settings: Settings,
    size: (usize, usize),
    channels: usize,
    state: Vec<f32>,
    used: Vec<u8>,
    codes: Vec<u8>,
    frames_seen: u32,
    arch: Arch,
}

impl BackgroundModel {
    /// An untrained model for 1 or 3 channels. Memory: 4 (2 + channels) bytes per pixel and component.
    pub fn new(size: (usize, usize), channels: usize, settings: Settings) -> Result<Self, BackgroundError> {
        if settings.history_frames == 0 {
            return Err(BackgroundError::History);
        }
        let (height, width) = size;
        let pixels = height * width;
        if pixels == 0 {
            return Err(BackgroundError::Empty { height, width });
        }
        if channels != 1 && channels != 3 {
            return Err(BackgroundError::Channels { channels });
        }
        let tiles = pixels.div_ceil(TILE);
        Ok(Self {
            state: vec![0.0; kernel::state_len(tiles, channels)],
            used: vec![0; tiles],
            codes: vec![kernel::BACKGROUND; pixels],
            frames_seen: 0,
            arch: Arch::new(),
            settings,
            size,
            channels,
        })
    }

    pub fn like(frame: Frame<'_>, settings: Settings) -> Result<Self, BackgroundError> {
        Self::new(frame.size(), frame.channels(), settings)
    }

    /// Learns the next frame and labels its pixels. The learning rate is 1 / (2 n) for frame n >= 2, then 1 /
    /// history. All of the first frame is foreground. Fails for a frame of another size or kind.
    pub fn apply(&mut self, frame: Frame<'_>) -> Result<Array2<Label>, BackgroundError> {
        self.apply_at(frame, self.usual_rate())
    }

    /// The learning rate that [`Self::apply`] would use for the next frame.
    #[must_use]
    pub fn usual_rate(&self) -> f32 {
        let n = self.frames_seen.saturating_add(1);
        if n == 1 { 1.0 } else { 1.0 / self.settings.history_frames.min(n.saturating_mul(2)) as f32 }
    }

    /// [`BackgroundModel::apply`] with another learning rate, clamped to 0 (labels only; unexplained samples
    /// leave a component without weight) to 1 (forgets everything).
    pub fn apply_at(&mut self, frame: Frame<'_>, rate: f32) -> Result<Array2<Label>, BackgroundError> {
        self.apply_outside(frame, rate, None)
    }

    /// Learns nothing where `held` is set, nor within 15 pixels to its sides.
    pub fn apply_outside(
        &mut self,
        frame: Frame<'_>,
        rate: f32,
        held: Option<&Array2<bool>>,
    ) -> Result<Array2<Label>, BackgroundError> {
        if frame.size() != self.size || frame.channels() != self.channels {
            return Err(BackgroundError::Changed {
                found: frame.size(),
                found_channels: frame.channels(),
                expected: self.size,
                expected_channels: self.channels,
            });
        }
        let held: Vec<bool> = match held.filter(|held| held.dim() == self.size) {
            Some(held) => {
                let mut tiles = vec![false; self.used.len()];
                for (pixel, _) in held.iter().enumerate().filter(|(_, held)| **held) {
                    tiles[pixel / TILE] = true;
                }
                tiles
            }
            None => Vec::new(),
        };
        let rate = if rate.is_finite() { rate.clamp(0.0, 1.0) } else { 0.0 };
        match frame {
            Frame::Grey(pixels) => match pixels.as_slice() {
                Some(samples) => self.update::<1>(samples, rate, &held),
                None => self.update::<1>(&pixels.iter().copied().collect::<Vec<_>>(), rate, &held),
            },
            Frame::Rgb(pixels) => match pixels.as_slice() {
                Some(samples) => self.update::<3>(samples, rate, &held),
                None => self.update::<3>(&pixels.iter().copied().collect::<Vec<_>>(), rate, &held),
            },
        }
        self.frames_seen = self.frames_seen.saturating_add(1);
        let (_, width) = self.size;
        Ok(Array2::from_shape_fn(self.size, |(row, column)| match self.codes[row * width + column] {
            kernel::FOREGROUND => Label::Foreground,
            kernel::SHADOW => Label::Shadow,
            _ => Label::Background,
        }))
    }

    /// Replaces the background by the frame's pixels where `places` is set. Both have the model's size and channels.
    pub fn replace(&mut self, frame: Frame<'_>, places: &Array2<bool>) {
        let component_len = kernel::component_len(self.channels);
        let stride = self.used.len() * component_len;
        let (_, width) = self.size;
        for ((row, column), _) in places.indexed_iter().filter(|(_, set)| **set) {
            let (tile, lane) = split(row * width + column);
            let first = tile * component_len + lane;
            for component in 0..usize::from(self.used[tile]) {
                self.state[first + component * stride] = if component == 0 { 1.0 } else { 0.0 };
            }
            self.state[first + kernel::VARIANCE_OFFSET] = kernel::INITIAL_VARIANCE;
            for channel in 0..self.channels {
                let level = match frame {
                    Frame::Grey(pixels) => pixels[[row, column]],
                    Frame::Rgb(pixels) => pixels[[row, column, channel]],
                };
                self.state[first + kernel::mean_offset(channel)] = f32::from(level);
            }
        }
    }

    fn update<const CHANNELS: usize>(&mut self, pixels: &[u8], rate: f32, held: &[bool]) {
        self.arch.dispatch(Update::<CHANNELS> {
            settings: &self.settings,
            rate,
            state: &mut self.state,
            used: &mut self.used,
            pixels,
            labels: &mut self.codes,
            held,
        });
    }

    #[must_use]
    pub fn size(&self) -> (usize, usize) {
        self.size
    }

    #[must_use]
    pub fn channels(&self) -> usize {
        self.channels
    }

    #[must_use]
    pub fn frames_seen(&self) -> u32 {
        self.frames_seen
    }

    /// Levels of background and frame every `step` pixels both ways, per channel.
    #[must_use]
    pub fn compared(&self, frame: Frame<'_>, step: usize) -> Vec<Vec<[u8; 2]>> {
        let (height, width) = self.size;
        let mut pairs = vec![Vec::new(); self.channels];
        for row in (step / 2..height).step_by(step) {
            for column in (step / 2..width).step_by(step) {
                for (channel, pairs) in pairs.iter_mut().enumerate() {
                    let level = match frame {
                        Frame::Grey(pixels) => pixels.get([row, column]).copied(),
                        Frame::Rgb(pixels) => pixels.get([row, column, channel]).copied(),
                    };
                    pairs.push([self.mean(row * width + column, channel), level.unwrap_or_default()]);
                }
            }
        }
        pairs
    }

    /// Shift of the frame against the background, whole pixels; 0 unless a shift explains it clearly better.
    #[must_use]
    pub fn shift(&self, frame: Frame<'_>, step: usize) -> Shift {
        let (height, width) = self.size;
        let reach = shake::REACH_PX.min(height.min(width) as isize / 8);
        let margin = reach as usize;
        let channel = self.channels / 2;
        let mut places = Vec::new();
        for row in (margin..height.saturating_sub(margin)).step_by(step) {
            for column in (margin..width.saturating_sub(margin)).step_by(step) {
                places.push((row, column, f32::from(self.mean(row * width + column, channel))));
            }
        }
        let off = |(down, right): Shift| -> f32 {
            let of = |&(row, column, level): &(usize, usize, f32)| {
                let (row, column) = (row.wrapping_add_signed(down), column.wrapping_add_signed(right));
                let found = match frame {
                    Frame::Grey(pixels) => pixels[[row, column]],
                    Frame::Rgb(pixels) => pixels[[row, column, channel]],
                };
                (f32::from(found) - level).abs().min(shake::MOST)
            };
            places.iter().map(of).sum::<f32>() / places.len().max(1) as f32
        };
        let still = off((0, 0));
        if still < shake::STILL {
            return (0, 0);
        }
        let all = (-reach..=reach).flat_map(|down| (-reach..=reach).map(move |right| (down, right)));
        let best = all.map(|shift| (off(shift), shift)).min_by(|a, b| a.0.total_cmp(&b.0));
        best.filter(|(left, _)| *left <= shake::BETTER * still).map_or((0, 0), |(_, shift)| shift)
    }

    fn mean(&self, pixel: usize, channel: usize) -> u8 {
        let (tile, lane) = split(pixel);
        self.state[tile * kernel::component_len(self.channels) + kernel::mean_offset(channel) + lane].round()
            as u8
    }

    /// The empty scene: means of the heaviest components, (height, width, channels); first 0.
    #[must_use]
    pub fn background(&self) -> Array3<u8> {
        let (height, width) = self.size;
        Array3::from_shape_fn((height, width, self.channels), |(row, column, channel)| {
            self.mean(row * width + column, channel)
        })
    }

    /// Components per pixel, (height, width).
    #[must_use]
    pub fn components(&self) -> Array2<u8> {
        let (_, width) = self.size;
        let component_len = kernel::component_len(self.channels);
        let stride = self.used.len() * component_len;
        Array2::from_shape_fn(self.size, |(row, column)| {
            let (tile, lane) = split(row * width + column);
            let weight = |component: usize| self.state[component * stride + tile * component_len + lane];
            (0..usize::from(self.used[tile])).filter(|&component| weight(component) > 0.0).count() as u8
        })
    }
}

fn split(pixel: usize) -> (usize, usize) {
    (pixel / TILE, pixel % TILE)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(number: usize, (height, width): (usize, usize)) -> Array3<u8> {
        Array3::from_shape_fn((height, width, 3), |(row, column, channel)| {
            let hash = (number * 7919 + row * 104_729 + column * 1_299_709 + channel * 15_485_863) % 1009;
            let noise = (hash % 13) as u8;
            let block = number % 7 > 3 && row > 4 && column > width / 2;
            if block { 200 + noise } else { 60 + 10 * (row % 5) as u8 + noise }
        })
    }

    #[test]
    fn every_vector_width_gives_the_same_bits() {
        // The last tile is partial.
        let size = (11, 13);
        let mut narrow = BackgroundModel::new(size, 3, Settings::default()).unwrap();
        narrow.arch = Arch::Scalar;
        let mut wide = BackgroundModel::new(size, 3, Settings::default()).unwrap();
        for number in 0..60 {
            let frame = frame(number, size);
            let labels = narrow.apply(Frame::Rgb(frame.view())).unwrap();
            assert_eq!(labels, wide.apply(Frame::Rgb(frame.view())).unwrap(), "frame {number}");
        }
        assert_eq!(narrow.state, wide.state);
        assert_eq!(narrow.components(), wide.components());
    }

    #[test]
    fn weights_sum_to_one_and_stay_sorted() {
        let size = (8, 16);
        let mut model = BackgroundModel::new(size, 3, Settings::default()).unwrap();
        let component_len = kernel::component_len(3);
        let stride = model.used.len() * component_len;
        for number in 0..80 {
            model.apply(Frame::Rgb(frame(number, size).view())).unwrap();
            for pixel in 0..8 * 16 {
                let (tile, lane) = split(pixel);
                let weights: Vec<f32> =
                    (0..5).map(|k| model.state[k * stride + tile * component_len + lane]).collect();
                assert!((weights.iter().sum::<f32>() - 1.0).abs() < 1e-5, "{weights:?}");
                assert!(weights.windows(2).all(|pair| pair[0] >= pair[1]), "{weights:?}");
            }
        }
    }

    #[test]
    fn replaced_pixels_know_only_the_new_background() {
        let size = (8, 20);
        let level = |level: u8| Array3::from_elem((8, 20, 3), level);
        let mut model = BackgroundModel::new(size, 3, Settings::default()).unwrap();
        for number in 0..40 {
            model.apply(Frame::Rgb(level(if number % 2 == 0 { 60 } else { 120 }).view())).unwrap();
        }
        let places = Array2::from_shape_fn(size, |(row, column)| row == 2 && (14..18).contains(&column));
        model.replace(Frame::Rgb(level(200).view()), &places);
        for (shade, new) in [(200, true), (60, false)] {
            let labels = model.apply_at(Frame::Rgb(level(shade).view()), 0.0).unwrap();
            for (place, label) in places.iter().zip(&labels) {
                assert_eq!(*label == Label::Background, *place == new, "{shade}");
            }
        }
    }

    #[test]
    fn a_view_with_gaps_is_read_like_a_copy() {
        let size = (6, 10);
        let whole = frame(3, (6, 20));
        let gappy = whole.slice(ndarray::s![.., ..;2, ..]);
        let mut first = BackgroundModel::new(size, 3, Settings::default()).unwrap();
        let mut second = BackgroundModel::new(size, 3, Settings::default()).unwrap();
        first.apply(Frame::Rgb(gappy)).unwrap();
        second.apply(Frame::Rgb(gappy.to_owned().view())).unwrap();
        assert_eq!(first.state, second.state);
    }
}

//! Sudden changes of light or exposure: one gain and one offset per channel, estimated from the background.

use ndarray::{Array2, Array3};

use super::Frame;

/// Distance between compared pixels, both ways.
pub const STEP_PX: usize = 8;
/// Grey levels from the background's.
const CHANGED: f32 = 25.0;
/// Share of changed pixels that starts the search, and the largest share of it that may remain.
const SUSPECT: f64 = 0.25;
const EXPLAINED: f64 = 0.5;
const GAINS: std::ops::RangeInclusive<f32> = 0.2..=5.0;
/// Backgrounds of less contrast give a gain only, grey levels.
const CONTRAST: f32 = 15.0;

/// Levels in the background's light, a table per channel.
#[derive(Clone, Debug, PartialEq)]
pub struct Light {
    tables: Vec<[u8; 256]>,
}

pub enum Relit {
    Grey(Array2<u8>),
    Rgb(Array3<u8>),
}

impl Relit {
    pub fn frame(&self) -> Frame<'_> {
        match self {
            Self::Grey(pixels) => Frame::Grey(pixels.view()),
            Self::Rgb(pixels) => Frame::Rgb(pixels.view()),
        }
    }
}

impl Light {
    pub fn unchanged(channels: usize) -> Self {
        Self { tables: vec![std::array::from_fn(|level| level as u8); channels] }
    }

    /// A frame in the background's light; `None` if it is unchanged.
    pub fn relit(&self, frame: Frame<'_>) -> Option<Relit> {
        if *self == Self::unchanged(self.tables.len()) {
            return None;
        }
        Some(match frame {
            Frame::Grey(pixels) => Relit::Grey(pixels.mapv(|level| self.tables[0][usize::from(level)])),
            Frame::Rgb(pixels) => {
                let mut relit = pixels.to_owned();
                for (channel, mut plane) in relit.axis_iter_mut(ndarray::Axis(2)).enumerate() {
                    plane.mapv_inplace(|level| self.tables[channel][usize::from(level)]);
                }
                Relit::Rgb(relit)
            }
        })
    }

    /// The new light, if one explains most of a changed picture, from levels of background and frame.
    pub fn changed(&self, pairs: &[Vec<[u8; 2]>]) -> Option<Self> {
        let before = self.changed_share(pairs);
        if before < SUSPECT {
            return None;
        }
        let tables = pairs.iter().map(|pairs| fitted(pairs)).collect::<Option<Vec<[u8; 256]>>>()?;
        let fitted = Self { tables };
        let unchanged = Self::unchanged(self.tables.len());
        // Light that is switched back is exactly the old one.
        let best = [unchanged, fitted].into_iter().min_by(|a, b| {
            let slack = |light: &Self| light.changed_share(pairs);
            slack(a).total_cmp(&(slack(b) + 0.02))
        })?;
        (best.changed_share(pairs) <= EXPLAINED * before).then_some(best)
    }

    fn changed_share(&self, pairs: &[Vec<[u8; 2]>]) -> f64 {
        let count = pairs.first().map_or(0, Vec::len);
        let off = |pixel: usize| {
            self.tables.iter().zip(pairs).any(|(table, pairs)| {
                let [background, level] = pairs[pixel];
                (f32::from(table[usize::from(level)]) - f32::from(background)).abs() > CHANGED
            })
        };
        (0..count).filter(|&pixel| off(pixel)).count() as f64 / count.max(1) as f64
    }
}

/// The table from frame to background levels: a line through the medians of the darker and the lighter half.
fn fitted(pairs: &[[u8; 2]]) -> Option<[u8; 256]> {
    let mut sorted: Vec<[u8; 2]> =
        pairs.iter().copied().filter(|[_, level]| (3..=252).contains(level)).collect();
    sorted.sort_unstable();
    let (dark, light) = sorted.split_at(sorted.len() / 2);
    let middle = |half: &[[u8; 2]]| -> Option<[f32; 2]> {
        let of = |k: usize| {
            let mut levels: Vec<u8> = half.iter().map(|pair| pair[k]).collect();
            levels.sort_unstable();
            levels.get(levels.len() / 2).map(|level| f32::from(*level))
        };
        Some([of(0)?, of(1)?])
    };
    let ([dark_then, dark_now], [light_then, light_now]) = (middle(dark)?, middle(light)?);
    let (gain, offset) = if light_then - dark_then > CONTRAST && light_now > dark_now {
        let gain = (light_now - dark_now) / (light_then - dark_then);
        (gain, dark_now - gain * dark_then)
    } else {
        ((dark_now + light_now) / (dark_then + light_then).max(1.0), 0.0)
    };
    GAINS.contains(&gain).then(|| {
        std::array::from_fn(|level| ((level as f32 - offset) / gain).round().clamp(0.0, 255.0) as u8)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pairs(now: impl Fn(f32) -> f32) -> Vec<Vec<[u8; 2]>> {
        let of = |n: u32| {
            let then = 60 + (n * 37 % 120) as u8;
            [then, now(f32::from(then)).clamp(0.0, 255.0) as u8]
        };
        vec![(0..500).map(of).collect()]
    }

    #[test]
    fn a_gain_and_an_offset_are_found_and_taken_back() {
        let before = Light::unchanged(1);
        assert_eq!(before.changed(&pairs(|level| level + 3.0)), None, "noise");
        let dimmed = before.changed(&pairs(|level| 0.5 * level + 8.0)).expect("a change");
        for level in [80.0_f32, 140.0] {
            let now = (0.5 * level + 8.0) as u8;
            assert!((f32::from(dimmed.tables[0][usize::from(now)]) - level).abs() <= 4.0, "{level}");
        }
        assert_eq!(dimmed.changed(&pairs(|level| level)), Some(Light::unchanged(1)));
    }

    #[test]
    fn another_scene_is_not_a_change_of_light() {
        let mut scene = pairs(|_| 0.0);
        scene[0].iter_mut().enumerate().for_each(|(n, pair)| pair[1] = (n * 89 % 251) as u8);
        assert_eq!(Light::unchanged(1).changed(&scene), None);
    }
}

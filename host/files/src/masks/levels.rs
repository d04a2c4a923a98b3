//! The person's grey level in a folder of masks: 0 and 255, any two others, or a background model's labels (0, 127 or
//! 128, and 255 of OpenCV and others; 0, 50, 85, 170 and 255 of ChangeDetection.net).

use std::path::{Path, PathBuf};

use ndarray::Array2;

use super::{MaskError, grey};
use crate::{image_file::Reading, video::pictures};

/// Levels that label more than a person: shadow, not evaluated, unknown.
const LABELS: [u8; 7] = [0, 50, 85, 127, 128, 170, 255];
/// Shadow of OpenCV and others: with 0 alone it does not identify the person's level.
const SHADOW: [u8; 2] = [127, 128];
/// Surveyed pictures of a folder; more while they hold one level only.
const SURVEYED: usize = 8;
/// JPEG rings: levels this near to black or white (part of the range) are those, save one pixel in [`ONE_BETWEEN_IN`].
const RINGING: f64 = 0.157;
const ONE_BETWEEN_IN: u64 = 50;
/// Fewer levels than this, of which one is near black or white, are labels: JPEG has many.
const FEW: usize = 6;
/// Largest share of people in a frame, per cent.
const MOST_PEOPLE: u64 = 70;
/// Largest share of people in the border of frames, per cent.
const MOST_OF_BORDER: u64 = 75;
/// Two levels nearer than this with others between them are a picture, not a mask.
const LEAST_GAP: u8 = 40;

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Levels {
    pub set_from: u8,
    /// Notice to the user about the levels; `None` for black and white.
    pub remark: Option<String>,
    /// Share of the surveyed pixels that are set, per cent.
    pub percent_set: u64,
    /// Of the pixels at the border of the pictures.
    pub percent_of_border: u64,
    pub reading: Reading,
}

#[derive(Clone, Debug)]
pub struct Histogram {
    counts: [u64; 256],
    border: [u64; 256],
    reading: Reading,
}

impl Histogram {
    #[must_use]
    pub fn new(reading: Reading) -> Self {
        Self { counts: [0; 256], border: [0; 256], reading }
    }

    /// Reads pictures throughout a folder until the person's level is among them.
    pub fn of(files: &[PathBuf]) -> Result<Self, MaskError> {
        let reading = pictures::reading_of(files);
        let mut histogram = Self::new(reading);
        let step = files.len().div_ceil(SURVEYED).max(1);
        let spread: Vec<usize> = (0..files.len()).step_by(step).collect();
        for &index in &spread {
            histogram.add(&grey(&files[index], reading)?);
        }
        for (index, file) in files.iter().enumerate() {
            if !histogram.undecided() {
                break;
            }
            if index % step != 0 {
                histogram.add(&grey(file, reading)?);
            }
        }
        Ok(histogram)
    }

    pub fn add(&mut self, picture: &Array2<u8>) {
        for &level in picture {
            self.counts[usize::from(level)] += 1;
        }
        let (height, width) = picture.dim();
        for ((row, column), &level) in picture.indexed_iter() {
            if row == 0 || column == 0 || row + 1 == height || column + 1 == width {
                self.border[usize::from(level)] += 1;
            }
        }
    }

    fn present(&self) -> Vec<u8> {
        (0..=u8::MAX).filter(|&level| self.counts[usize::from(level)] > 0).collect()
    }

    /// Labels of several things, such as 0, 15 and 255 of PASCAL VOC.
    #[must_use]
    pub fn are_labels(&self) -> bool {
        let present = self.present();
        let [low, between @ .., high] = present.as_slice() else { return false };
        let near = |level: &u8| !(low + margin(*low, *high)..=high - margin(*low, *high)).contains(level);
        let known = present.iter().all(|level| LABELS.contains(level));
        !known && present.len() < FEW && between.iter().any(near)
    }

    /// Whether other pictures of the folder may hold the person's level.
    fn undecided(&self) -> bool {
        let present = self.present();
        present.len() < 2 || SHADOW.iter().any(|shadow| present == [0, *shadow])
    }

    /// The levels of masks; `None` for other pictures.
    #[must_use]
    pub fn levels(&self) -> Option<Levels> {
        if self.are_labels() {
            return None;
        }
        match self.present().as_slice() {
            [] | [_] | [0, 255] => Some(self.set_from(128, None)),
            &[low, high] => {
                let remark = format!("two grey levels, {low} and {high}: {high} is taken as the person");
                Some(self.set_from(high, Some(remark)))
            }
            labels if labels.last() == Some(&255) && labels.iter().all(|level| LABELS.contains(level)) => {
                let remark = format!(
                    "grey levels {}: 255 is taken as the person, the levels between as shadow or unknown",
                    listed(labels)
                );
                Some(self.set_from(255, Some(remark)))
            }
            &[low, .., high] if high - low >= LEAST_GAP => self.two_clusters(low, high),
            _ => None,
        }
    }

    fn two_clusters(&self, low: u8, high: u8) -> Option<Levels> {
        let margin = margin(low, high);
        let all: u64 = self.counts.iter().sum();
        let between: u64 = (low + margin..=high - margin).map(|level| self.counts[usize::from(level)]).sum();
        if between * ONE_BETWEEN_IN > all {
            return None;
        }
        let middle = low + (high - low).div_ceil(2);
        if (96..=160).contains(&middle) {
            return Some(self.set_from(128, None));
        }
        let remark = format!("grey levels near {low} and near {high}: set from {middle} on");
        Some(self.set_from(middle, Some(remark)))
    }

    fn set_from(&self, set_from: u8, remark: Option<String>) -> Levels {
        let percent = |counts: &[u64; 256]| {
            let all: u64 = counts.iter().sum();
            100 * counts[usize::from(set_from)..].iter().sum::<u64>() / all.max(1)
        };
        let (percent_set, percent_of_border) = (percent(&self.counts), percent(&self.border));
        Levels { set_from, remark, percent_set, percent_of_border, reading: self.reading }
    }
}

/// How far ringing leads from black and white.
fn margin(low: u8, high: u8) -> u8 {
    (RINGING * f64::from(high - low)) as u8
}

fn listed(levels: &[u8]) -> String {
    levels.iter().map(u8::to_string).collect::<Vec<_>>().join(", ")
}

impl Default for Levels {
    fn default() -> Self {
        Self {
            set_from: 128,
            remark: None,
            percent_set: 0,
            percent_of_border: 0,
            reading: Reading::default(),
        }
    }
}

impl Levels {
    /// The levels of masks from their histogram; `first` is for messages. Fails for labels of several things, and if nothing
    /// would be set.
    pub fn of_masks(histogram: &Histogram, first: &Path) -> Result<Self, MaskError> {
        if let Some(levels) = histogram.levels() {
            return Ok(levels);
        }
        let present = histogram.present();
        if histogram.are_labels() {
            return Err(MaskError::Labels { path: first.into(), levels: present });
        }
        if present.last().is_none_or(|&level| level < 128) {
            return Err(MaskError::Levels { path: first.into(), levels: present });
        }
        Ok(histogram.set_from(128, Some(format!("{} grey levels: set from 128 on", present.len()))))
    }

    /// Refuses full frames whose background is set.
    pub fn check_people(&self, path: &Path) -> Result<(), MaskError> {
        let (percent, of_border) = (self.percent_set, self.percent_of_border);
        if percent >= MOST_PEOPLE || of_border >= MOST_OF_BORDER {
            return Err(MaskError::Inverted { path: path.into(), percent, of_border });
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn levels(counts: &[(u8, u64)]) -> Option<Levels> {
        let mut histogram = Histogram::new(Reading::default());
        for &(level, count) in counts {
            histogram.counts[usize::from(level)] = count;
        }
        histogram.levels()
    }

    fn plain(counts: &[(u8, u64)]) -> Option<(u8, Option<String>)> {
        levels(counts).map(|levels| (levels.set_from, levels.remark))
    }

    #[test]
    fn masks_of_two_levels_are_set_at_the_higher_one() {
        for (low, high) in [(0, 1), (0, 100), (16, 235), (1, 2)] {
            let found = levels(&[(low, 900), (high, 100)]).expect("masks");
            assert_eq!(found.set_from, high);
            assert!(found.remark.is_some_and(|text| text.contains(&format!("{low} and {high}"))));
        }
        assert_eq!(plain(&[(0, 900), (255, 100)]), Some((128, None)));
        assert_eq!(plain(&[(0, 900)]), Some((128, None)));
    }

    #[test]
    fn shadow_and_unknown_labels_are_not_the_person() {
        for labels in [
            &[(0, 9), (127, 9), (255, 9)][..],
            &[(0, 9), (128, 9), (255, 9)],
            &[(0, 9), (50, 9), (85, 9), (170, 9), (255, 9)],
        ] {
            let found = levels(labels).expect("masks");
            assert_eq!(found.set_from, 255);
            assert!(found.remark.is_some());
        }
    }

    fn of_masks(counts: &[(u8, u64)]) -> Result<Levels, MaskError> {
        let mut histogram = Histogram::new(Reading::default());
        for &(level, count) in counts {
            histogram.counts[usize::from(level)] = count;
        }
        Levels::of_masks(&histogram, Path::new("m.png"))
    }

    #[test]
    fn labels_of_several_things_and_inverted_masks_are_refused() {
        for labels in [&[(0, 900), (15, 200), (255, 60)][..], &[(0, 900), (1, 90), (2, 90), (255, 9)]] {
            assert!(matches!(of_masks(labels), Err(MaskError::Labels { .. })), "{labels:?}");
        }
        let people = |counts: &[(u8, u64)]| of_masks(counts)?.check_people(Path::new("masks"));
        assert!(matches!(people(&[(0, 90), (255, 910)]), Err(MaskError::Inverted { percent: 91, .. })));
        assert!(people(&[(0, 400), (255, 600)]).is_ok());
        // A large person, black in front of white.
        let picture = Array2::from_shape_fn((40, 30), |(row, column)| {
            if row > 2 && row < 37 && column > 5 && column < 25 { 0 } else { 255 }
        });
        let mut histogram = Histogram::new(Reading::default());
        histogram.add(&picture);
        let levels = Levels::of_masks(&histogram, Path::new("m.png")).expect("two levels");
        let found = levels.check_people(Path::new("masks"));
        assert!(matches!(found, Err(MaskError::Inverted { percent: 46, .. })), "{found:?}");
        assert!(of_masks(&[(0, 900), (3, 9), (5, 9), (250, 9), (253, 9), (255, 90)]).is_ok());
    }

    #[test]
    fn jpeg_ringing_is_tolerated_and_pictures_are_rejected_as_masks() {
        let ringing = [(0, 900), (1, 9), (3, 20), (250, 20), (254, 9), (255, 60)];
        assert_eq!(plain(&ringing), Some((128, None)));
        let dim = [(0, 900), (1, 9), (2, 20), (98, 20), (99, 9), (100, 60)];
        assert_eq!(levels(&dim).map(|levels| levels.set_from), Some(50));
        let picture: Vec<(u8, u64)> = (20..200).map(|level| (level, 5)).collect();
        assert_eq!(levels(&picture), None);
        let dark: Vec<(u8, u64)> = (0..30).map(|level| (level, 5)).collect();
        assert_eq!(levels(&dark), None);
    }
}

//! Reads the masks of a view from a folder or a video.

use std::{
    collections::HashSet,
    path::{Path, PathBuf},
};

use farnear_files::{
    masks::{
        self, MaskError,
        levels::{Histogram, Levels},
    },
    video::{Pixels, Video, VideoFrame, pictures},
};
use farnear_silhouettes::mask::{
    Mask,
    centre::SIDE_PX,
    extractor::{Extractor, ExtractorSettings},
    subject::{Flag, SubjectChooser, SubjectSettings},
};
use ndarray::Axis;

use crate::{error::Result, silhouettes::frame_of};

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum ViewKind {
    Masks,
    /// A video from which masks are extracted.
    Video,
}

farnear_silhouettes::named!(ViewKind, "kind of view", "masks" => Masks, "video" => Video);

impl ViewKind {
    /// Guesses the kind from the grey levels. Masks have two levels, or labels of a background model.
    pub fn guess(path: &Path) -> Result<Self> {
        let files = if path.is_dir() { pictures::list(path)? } else { vec![path.to_path_buf()] };
        let ending = files[0].extension().unwrap_or_default().to_string_lossy().to_lowercase();
        if !pictures::EXTENSIONS.contains(&ending.as_str()) {
            return Ok(Self::Video);
        }
        // A video is recognised by its first picture, without surveying the rest.
        let reading = pictures::reading_of(&files);
        let mut first = Histogram::new(reading);
        match masks::grey(&files[0], reading) {
            Ok(picture) => first.add(&picture),
            Err(error) => return Self::of_coloured(error, reading),
        }
        let are_masks = |seen: &Histogram| seen.levels().is_some() || seen.are_labels();
        let all = if are_masks(&first) { Histogram::of(&files) } else { Ok(first) };
        match all {
            Ok(all) if are_masks(&all) || are_mattes(&files, reading)? => Ok(Self::Masks),
            Ok(_) => Ok(Self::Video),
            Err(error) => Self::of_coloured(error, reading),
        }
    }

    /// One colour on black is a mask, which its reader refuses with the colour.
    fn of_coloured(error: MaskError, reading: masks::Reading) -> Result<Self> {
        let MaskError::Coloured { path, .. } = &error else { return Err(error.into()) };
        let Pixels::Rgb(picture) = pictures::read(path, reading)? else { return Ok(Self::Video) };
        let mut colours: HashSet<[u8; 3]> = HashSet::new();
        let are_few = picture.lanes(Axis(2)).into_iter().all(|pixel| {
            colours.insert([pixel[0], pixel[1], pixel[2]]);
            colours.len() <= 2
        });
        let is_mask = are_few && colours.len() == 2 && colours.contains(&[0; 3]);
        Ok(if is_mask { Self::Masks } else { Self::Video })
    }
}

/// Whether most pixels of the first, middle and last picture are black or white, and fewer grey than white, as of masks with soft
/// edges.
fn are_mattes(files: &[PathBuf], reading: masks::Reading) -> Result<bool> {
    let mut any_white = false;
    for index in [0, files.len() / 2, files.len().saturating_sub(1)] {
        let picture = match masks::grey(&files[index], reading) {
            Ok(picture) => picture,
            Err(MaskError::Coloured { .. }) => return Ok(false),
            Err(error) => return Err(error.into()),
        };
        let count = |wanted: u8| picture.iter().filter(|level| **level == wanted).count();
        let white = count(u8::MAX);
        let either = count(0) + white;
        if 4 * either < 3 * picture.len() || (white > 0 && picture.len() - either > white) {
            return Ok(false);
        }
        any_white |= white > 0;
    }
    Ok(any_white)
}

#[derive(Clone, PartialEq, Eq, Debug)]
pub struct View {
    pub path: PathBuf,
    pub kind: ViewKind,
}

impl View {
    pub(super) fn is_cut_out(&self) -> Result<bool> {
        if self.kind == ViewKind::Video {
            return Ok(false);
        }
        let first = masks::listed(&self.path)?.into_iter().next();
        let first = first.map(|file| masks::grey(&file, masks::Reading::default())).transpose()?;
        Ok(first.is_some_and(|picture| picture.dim() == (SIDE_PX, SIDE_PX)))
    }
}

pub(super) struct Seen {
    pub name: String,
    pub mask: Mask,
    pub flags: Vec<Flag>,
    /// The video's frame; `None` for masks.
    pub picture: Option<Pixels>,
}

pub(super) struct Moved {
    pub name: String,
    /// Or why the frame has no mask.
    pub mask: std::result::Result<Mask, Flag>,
    pub picture: Option<Pixels>,
}

pub(super) fn size(picture: &Pixels) -> (usize, usize) {
    match picture {
        Pixels::Grey(grey) => grey.dim(),
        Pixels::Rgb(rgb) => (rgb.dim().0, rgb.dim().1),
    }
}

pub(super) enum Frames {
    Masks {
        files: std::vec::IntoIter<PathBuf>,
        levels: Levels,
        remark: Option<String>,
        first: Option<Box<First>>,
    },
    Video {
        video: Box<Video>,
        extractor: Option<Box<Extractor>>,
    },
}

pub(super) struct First {
    name: String,
    size: (usize, usize),
    chooser: SubjectChooser,
}

impl Frames {
    pub fn open(view: &View) -> Result<Self> {
        Ok(match view.kind {
            ViewKind::Masks => {
                let files = masks::listed(&view.path)?;
                let levels = masks::levels_of(&files)?;
                if !view.is_cut_out()? {
                    levels.check_people(&view.path)?;
                }
                let remark =
                    levels.remark.as_ref().map(|remark| format!("{}: {remark}", view.path.display()));
                Self::Masks { files: files.into_iter(), levels, remark, first: None }
            }
            ViewKind::Video => Self::Video { video: Box::new(Video::open(&view.path)?), extractor: None },
        })
    }

    /// New notices to the user about how the view is read; some come at the end.
    pub fn take_remarks(&mut self) -> Vec<String> {
        match self {
            Self::Masks { remark, .. } => remark.take().into_iter().collect(),
            Self::Video { video, .. } => video.take_remarks(),
        }
    }

    /// Frames per second of a video; `None` for masks.
    pub fn rate_hz(&self) -> Option<f64> {
        match self {
            Self::Masks { .. } => None,
            Self::Video { video, .. } => video.rate_hz(),
        }
    }

    /// Why the masks of all frames so far are doubtful.
    pub fn doubts(&self) -> Vec<String> {
        match self {
            Self::Masks { first, .. } => first.iter().flat_map(|first| first.chooser.doubts()).collect(),
            Self::Video { extractor, .. } => {
                extractor.iter().flat_map(|extractor| extractor.doubts()).collect()
            }
        }
    }

    /// Returns `None` at the end.
    pub fn next(&mut self) -> Result<Option<Seen>> {
        match self {
            Self::Masks { files, levels, first, .. } => {
                files.next().map(|file| seen_in_mask(&file, levels, first)).transpose()
            }
            Self::Video { video, extractor } => {
                video.next().transpose()?.map(|frame| seen_in_frame(frame, extractor)).transpose()
            }
        }
    }
}

impl Frames {
    /// The next frame's mask of everyone; `None` at the end.
    pub fn next_moving(&mut self) -> Result<Option<Moved>> {
        match self {
            Self::Masks { files, levels, first, .. } => files
                .next()
                .map(|file| {
                    let (name, mask, _) = like_first(&file, levels, first)?;
                    Ok(Moved { name, mask: Ok(mask), picture: None })
                })
                .transpose(),
            Self::Video { video, extractor } => video
                .next()
                .transpose()?
                .map(|VideoFrame { name, pixels }| {
                    let mask = extractor_for(&pixels, extractor)?.moving(frame_of(&pixels))?.mask;
                    Ok(Moved { name, mask, picture: Some(pixels) })
                })
                .transpose(),
        }
    }
}

/// Reads a mask, which must have the size of the view's first.
fn like_first<'f>(
    file: &Path,
    levels: &Levels,
    first: &'f mut Option<Box<First>>,
) -> Result<(String, Mask, &'f mut First)> {
    let mask = masks::read(file, levels)?;
    let (name, found) = (pictures::stem(file), mask.dim());
    let first = first.get_or_insert_with(|| {
        Box::new(First {
            name: name.clone(),
            size: found,
            chooser: SubjectChooser::new(SubjectSettings::for_size(found)),
        })
    });
    if found != first.size {
        let (path, expected) = (file.into(), first.size);
        return Err(MaskError::Size { path, found, first: first.name.clone(), expected }.into());
    }
    Ok((name, mask, first))
}

fn extractor_for<'e>(
    pixels: &Pixels,
    extractor: &'e mut Option<Box<Extractor>>,
) -> Result<&'e mut Extractor> {
    let frame = frame_of(pixels);
    Ok(match extractor {
        Some(extractor) => extractor,
        None => extractor.insert(Box::new(Extractor::like(frame, ExtractorSettings::for_frame(frame))?)),
    })
}

fn seen_in_mask(file: &Path, levels: &Levels, first: &mut Option<Box<First>>) -> Result<Seen> {
    let (name, mask, first) = like_first(file, levels, first)?;
    let found = mask.dim();
    let mut flags = first.chooser.choose(mask.view()).flags;
    // Cut-out silhouettes always touch the picture's edge.
    flags.retain(|flag| found != (SIDE_PX, SIDE_PX) || *flag != Flag::CutByEdge);
    Ok(Seen { name, mask, flags, picture: None })
}

/// Learns the background with `extractor`, made for the first frame.
pub(super) fn seen_in_frame(frame: VideoFrame, extractor: &mut Option<Box<Extractor>>) -> Result<Seen> {
    let VideoFrame { name, pixels } = frame;
    let found = extractor_for(&pixels, extractor)?.extract(frame_of(&pixels))?.subject;
    Ok(Seen { name, mask: found.mask, flags: found.flags, picture: Some(pixels) })
}

#[cfg(test)]
mod tests {
    use farnear_files::masks::encoded;
    use ndarray::Array2;

    use super::*;

    /// Three masks, the first one empty, whose background, shadow and person have these levels.
    fn folder([background, shadow, person]: [u8; 3]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().expect("a folder");
        for number in 0..3 {
            let levels = Array2::from_shape_fn((120, 90), |(row, column)| match (row, column) {
                (20..100, 30..50) if number > 0 => person,
                (95..100, 50..70) if number > 0 => shadow,
                _ => background,
            });
            let png = encoded(&levels, |level| *level).expect("a picture");
            std::fs::write(folder.path().join(format!("m{number}.png")), png).expect("written");
        }
        folder
    }

    #[test]
    fn masks_of_any_two_levels_and_of_background_models_are_the_same_masks() {
        for levels in [[0, 0, 255], [0, 0, 1], [0, 127, 255], [0, 50, 255], [10, 10, 90]] {
            let folder = folder(levels);
            let path = folder.path().to_path_buf();
            assert_eq!(ViewKind::guess(&path).expect("a kind"), ViewKind::Masks, "{levels:?}");
            let view = View { path, kind: ViewKind::Masks };
            let mut frames = Frames::open(&view).expect("masks");
            assert_eq!(frames.take_remarks().len(), usize::from(levels != [0, 0, 255]), "{levels:?}");
            let mut areas = Vec::new();
            while let Some(seen) = frames.next().expect("a mask") {
                areas.push(seen.mask.iter().filter(|set| **set).count());
            }
            assert_eq!(areas, [0, 1600, 1600], "{levels:?}");
        }
    }

    #[test]
    fn soft_edges_and_one_colour_on_black_are_those_of_masks() {
        let folder = tempfile::tempdir().expect("a folder");
        let soft = Array2::from_shape_fn((120, 90), |(row, column)| match (row, column) {
            (20..100, 30..50) => 255,
            (20..100, 26..30 | 50..54) => (50 + 13 * column % 150) as u8,
            _ => 0,
        });
        let path = folder.path().join("soft.png");
        std::fs::write(&path, encoded(&soft, |level| *level).expect("a picture")).expect("written");
        assert_eq!(ViewKind::guess(&path).expect("a kind"), ViewKind::Masks);
        for (number, (floor, kind)) in
            [([0, 0, 0], ViewKind::Masks), ([0, 0, 9], ViewKind::Video)].into_iter().enumerate()
        {
            let path = folder.path().join(format!("{number}.png"));
            let colour = |x: u32, y: u32| match (x, y) {
                (30..50, 20..100) => [128, 0, 0],
                (_, 110..) => floor,
                _ => [0, 0, 0],
            };
            image::RgbImage::from_fn(90, 120, |x, y| image::Rgb(colour(x, y))).save(&path).expect("written");
            assert_eq!(ViewKind::guess(&path).expect("a kind"), kind);
            if kind == ViewKind::Masks {
                let refused = Frames::open(&View { path, kind }).err().map(|error| error.to_string());
                assert!(refused.as_ref().is_some_and(|error| error.contains("[128, 0, 0]")), "{refused:?}");
            }
        }
    }

    #[test]
    fn dark_pictures_of_many_levels_are_a_video() {
        let folder = tempfile::tempdir().expect("a folder");
        let dark = Array2::from_shape_fn((60, 80), |(row, column)| ((row * 7 + column * 3) % 30) as u8);
        std::fs::write(folder.path().join("a.png"), encoded(&dark, |level| *level).expect("a picture"))
            .expect("written");
        assert_eq!(ViewKind::guess(folder.path()).expect("a kind"), ViewKind::Video);
    }
}

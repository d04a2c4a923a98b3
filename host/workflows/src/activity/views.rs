//! Where the masks of a view come from: a folder of them, or a video.

use std::path::{Path, PathBuf};

use farnear_files::{
    masks::{self, MaskError},
    video::{Pixels, Video, VideoFrame, pictures},
};
use farnear_silhouettes::mask::{
    Mask,
    centre::SIDE_PX,
    extractor::{Extractor, ExtractorSettings},
    subject::{Flag, SubjectChooser, SubjectSettings},
};

use crate::{error::Result, silhouettes::frame_of};

/// What a view is given as.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum ViewKind {
    /// Masks: pictures of black and white.
    Masks,
    /// A video, from which masks are made first.
    Video,
}

impl ViewKind {
    /// What a path most likely holds: masks are folders of pictures (or one picture) with hardly anything but black and white.
    ///
    /// # Errors
    /// Folders without pictures, pictures that cannot be read.
    pub fn guess(path: &Path) -> Result<Self> {
        let first = if path.is_dir() { pictures::list(path)?.swap_remove(0) } else { path.to_path_buf() };
        let ending = first.extension().unwrap_or_default().to_string_lossy().to_lowercase();
        if !pictures::EXTENSIONS.contains(&ending.as_str()) {
            return Ok(Self::Video);
        }
        let two_levels = match pictures::read(&first)? {
            Pixels::Grey(levels) => nearly_two_levels(levels.iter().copied()),
            Pixels::Rgb(rgb) => {
                let grey = rgb.lanes(ndarray::Axis(2)).into_iter().all(|p| p[0] == p[1] && p[1] == p[2]);
                grey && nearly_two_levels(rgb.iter().copied())
            }
        };
        Ok(if two_levels { Self::Masks } else { Self::Video })
    }
}

/// Whether a picture is black and white but for the ringing that JPEG leaves about edges: less than 2 % of it lies between.
fn nearly_two_levels(levels: impl ExactSizeIterator<Item = u8>) -> bool {
    let all = levels.len();
    let between = levels.filter(|level| (40..=215).contains(level)).count();
    50 * between <= all
}

/// A view: where it lies, and what it is.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct View {
    /// A folder, a picture or a video.
    pub path: PathBuf,
    pub kind: ViewKind,
}

impl View {
    /// Whether it holds silhouettes that are cut out at 100x100.
    ///
    /// # Errors
    /// Masks that cannot be read.
    pub(super) fn is_cut_out(&self) -> Result<bool> {
        if self.kind == ViewKind::Video {
            return Ok(false);
        }
        let first = masks::listed(&self.path)?.into_iter().next();
        Ok(first
            .map(|file| masks::read(&file))
            .transpose()?
            .is_some_and(|mask| mask.dim() == (SIDE_PX, SIDE_PX)))
    }
}

/// A frame's mask and what is doubtful about it.
pub(super) struct Seen {
    pub name: String,
    pub mask: Mask,
    pub flags: Vec<Flag>,
    /// The video's frame; `None` for masks.
    pub picture: Option<Pixels>,
}

/// All that moves in a frame, whoever it is.
pub(super) struct Moved {
    pub name: String,
    /// Or why there is no mask.
    pub mask: std::result::Result<Mask, Flag>,
    /// The video's frame; `None` for masks.
    pub picture: Option<Pixels>,
}

pub(super) fn size(picture: &Pixels) -> (usize, usize) {
    match picture {
        Pixels::Grey(grey) => grey.dim(),
        Pixels::Rgb(rgb) => (rgb.dim().0, rgb.dim().1),
    }
}

/// The frames of a view, one by one.
pub(super) enum Frames {
    Masks { files: std::vec::IntoIter<PathBuf>, first: Option<First> },
    Video { video: Box<Video>, extractor: Option<Box<Extractor>> },
}

/// What the first mask of a view fixes for the others.
pub(super) struct First {
    name: String,
    size: (usize, usize),
    chooser: SubjectChooser,
}

impl Frames {
    pub fn open(view: &View) -> Result<Self> {
        Ok(match view.kind {
            ViewKind::Masks => Self::Masks { files: masks::listed(&view.path)?.into_iter(), first: None },
            ViewKind::Video => Self::Video { video: Box::new(Video::open(&view.path)?), extractor: None },
        })
    }

    /// The next frame; `None` at the end.
    pub fn next(&mut self) -> Result<Option<Seen>> {
        match self {
            Self::Masks { files, first } => files.next().map(|file| seen_in_mask(&file, first)).transpose(),
            Self::Video { video, extractor } => {
                video.next().transpose()?.map(|frame| seen_in_frame(frame, extractor)).transpose()
            }
        }
    }
}

impl Frames {
    /// The next frame's mask of everybody; `None` at the end.
    pub fn next_moving(&mut self) -> Result<Option<Moved>> {
        match self {
            Self::Masks { files, first } => files
                .next()
                .map(|file| {
                    let (name, mask, _) = like_first(&file, first)?;
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

/// A mask of the size of the view's first.
fn like_first<'f>(file: &Path, first: &'f mut Option<First>) -> Result<(String, Mask, &'f mut First)> {
    let mask = masks::read(file)?;
    let (name, found) = (pictures::stem(file), mask.dim());
    let first = first.get_or_insert_with(|| First {
        name: name.clone(),
        size: found,
        chooser: SubjectChooser::new(SubjectSettings::for_size(found)),
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

fn seen_in_mask(file: &Path, first: &mut Option<First>) -> Result<Seen> {
    let (name, mask, first) = like_first(file, first)?;
    let found = mask.dim();
    let mut flags = first.chooser.choose(mask.view()).flags;
    // Cut-out silhouettes fill their picture, so touching its edge says nothing.
    flags.retain(|flag| found != (SIDE_PX, SIDE_PX) || *flag != Flag::CutByEdge);
    Ok(Seen { name, mask, flags, picture: None })
}

fn seen_in_frame(frame: VideoFrame, extractor: &mut Option<Box<Extractor>>) -> Result<Seen> {
    let VideoFrame { name, pixels } = frame;
    let found = extractor_for(&pixels, extractor)?.extract(frame_of(&pixels))?.subject;
    Ok(Seen { name, mask: found.mask, flags: found.flags, picture: Some(pixels) })
}

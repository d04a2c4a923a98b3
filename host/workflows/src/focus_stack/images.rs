//! The images of a stack in a temporary file in the result's folder, so that one at a time is in memory.

use std::{
    fs::File,
    io::{self, Read, Seek, SeekFrom, Write},
    ops::Range,
    path::PathBuf,
    sync::{Mutex, PoisonError},
};

use farnear_depth::{
    brightness::Trend,
    focus_stack::{Slices, StackError},
    mosaic::{self, is_mosaic},
    optics::Distortion,
    prepare::{
        erase_wild, straightened,
        warp::{Warp, resample},
    },
};
use farnear_files::{
    image_file::{Grey, ReadSettings, Samples, SharedWhiteLevel, relative},
    stack,
    staging::{Staging, StagingError},
};
use ndarray::{Array2, ArrayView2, CowArray, Ix2};

use super::{
    FocusStackRequest,
    black_border::{self, Borders},
    frames,
};
use crate::{
    context::Context,
    error::{About, Result, WorkflowError},
};

pub(super) struct Images<'a> {
    /// 32-bit floats by rows. It has no name: the system removes it when the program ends, whatever the reason.
    file: Mutex<File>,
    folder: PathBuf,
    /// Where each image begins in the file, bytes, with its height and width.
    images: Vec<(u64, (usize, usize))>,
    /// Pixels of each image without a value, which have the mean of their neighbours.
    specks: Vec<Vec<(usize, usize)>>,
    /// Whether each image has a black border.
    bordered: Vec<bool>,
    /// Brightness of each image, which is divided by it.
    gains: Vec<f32>,
    /// Pixels are divided by it.
    white_level: f32,
    /// Step between the codes of the coarsest image, before the division.
    code_step: f32,
    context: &'a Context<'a>,
}

/// Finite neighbours of 8 of a pixel in a speck; a straight border of pixels without values has 3. Outside the image the nearest pixel counts.
const AROUND_SPECK: usize = 5;
/// Least part of a speck in a moved pixel.
const SPECK: f32 = 0.05;

/// Fills single pixels and small groups without a value, or of floats with a wild one, by the mean of their neighbours; returns where
/// they are.
pub fn fill_specks(image: &mut Array2<f32>, are_floats: bool) -> Vec<(usize, usize)> {
    if are_floats {
        erase_wild(image);
    }
    if image.iter().all(|value| value.is_finite()) {
        return Vec::new();
    }
    let (height, width) = image.dim();
    let original = image.clone();
    let mut specks = Vec::new();
    for (at, value) in image.indexed_iter_mut().filter(|(_, value)| !value.is_finite()) {
        let [rows, columns] = [(at.0, height), (at.1, width)]
            .map(|(own, size)| [own.saturating_sub(1), own, (own + 1).min(size - 1)]);
        let around = rows.into_iter().flat_map(|y| columns.map(|x| original[(y, x)]));
        let known: Vec<f32> = around.filter(|value| value.is_finite()).collect();
        if known.len() >= AROUND_SPECK {
            *value = known.iter().sum::<f32>() / known.len() as f32;
            specks.push(at);
        }
    }
    specks
}

/// Adds an image's specks to the mask `unseen`, where the lens' distortion and the warp move them.
pub(super) fn mark_specks(
    unseen: &mut Option<Array2<bool>>,
    dim: (usize, usize),
    specks: &[(usize, usize)],
    distortion: Option<&Distortion>,
    warp: &Warp,
) {
    if specks.is_empty() {
        return;
    }
    let mut image = Array2::zeros(dim);
    specks.iter().for_each(|at| image[*at] = 1.0_f32);
    if let Some(distortion) = distortion {
        image = straightened(image.view(), distortion);
    }
    if *warp != Warp::IDENTITY {
        image = resample(image.view(), warp);
    }
    let unseen = unseen.get_or_insert_with(|| Array2::from_elem(image.dim(), false));
    if unseen.dim() == image.dim() {
        unseen.zip_mut_with(&image, |unseen, speck| *unseen |= speck.abs() > SPECK);
    }
}

const PIXEL: usize = size_of::<f32>();

impl<'a> Images<'a> {
    pub fn read(
        paths: &[PathBuf],
        request: &FocusStackRequest,
        warnings: &mut Vec<String>,
        staging: &Staging,
        context: &'a Context<'a>,
    ) -> Result<Self> {
        let folder = staging.path("");
        let file = tempfile::tempfile_in(&folder).map_err(StagingError::at(&request.out))?;
        let mut read = Self {
            file: Mutex::new(file),
            folder: request.out.clone(),
            images: Vec::with_capacity(paths.len()),
            specks: Vec::with_capacity(paths.len()),
            bordered: Vec::with_capacity(paths.len()),
            gains: vec![1.0; paths.len()],
            white_level: 1.0,
            code_step: 0.0,
            context,
        };
        let (mut end, mut colour, mut white) = (0, false, SharedWhiteLevel::default());
        let (mut without_value, mut black) = (0, Vec::with_capacity(paths.len()));
        let settings = ReadSettings { grey: request.grey, white_level: request.white_level };
        context.cancel.check("reading the stack")?;
        stack::read(paths, &settings, |index, mut image| -> Result<()> {
            context.cancel.check("reading the stack")?;
            context.progress.advance("images", index + 1, Some(paths.len()));
            let (height, width) = image.pixels.dim();
            if let Some((_, of)) = read.images.first().copied().filter(|(_, of)| *of != (height, width)) {
                let error = StackError::Size { number: index + 1, width, height, of };
                return Err::<(), _>(error).about(|| paths[index].display().to_string());
            }
            colour |= image.colour;
            if index == 0 && is_mosaic(image.pixels.view()) {
                warnings.push(mosaic::WORDS.into());
            }
            white.add(&image);
            let code_step = match image.samples {
                Samples::Integer(bits) => 1.0 / (2_f32.powi(bits.into()) - 1.0),
                Samples::Float => 0.0,
            };
            read.code_step = read.code_step.max(code_step);
            black.push((black_border::of_image(&image.pixels, code_step), code_step));
            let specks = fill_specks(&mut image.pixels, image.samples == Samples::Float);
            without_value += specks.len() + image.pixels.iter().filter(|value| !value.is_finite()).count();
            read.specks.push(specks);
            read.images.push((end, image.pixels.dim()));
            read.write(index, image.pixels.view())?;
            end += (PIXEL * image.pixels.len()) as u64;
            Ok(())
        })?;
        if request.grey == Grey::Mean && colour {
            warnings.push("colour images: grey is the mean of red, green and blue (--grey)".into());
        }
        if without_value > 0 {
            warnings.push(format!(
                "{without_value} pixels of the images have no value (NaN, transparent, or 1000 times the usual one): the map has holes there"
            ));
        }
        read.erase_black(&black)?;
        read.white_level = white.get(request.white_level.is_some()).unwrap_or(1.0);
        Ok(read)
    }

    pub fn remove(&mut self, index: usize) {
        self.images.remove(index);
        self.specks.remove(index);
        self.bordered.remove(index);
        self.gains.remove(index);
    }

    /// Erases the black borders of images, from their sides and the steps of their codes.
    fn erase_black(&mut self, black: &[(Borders, f32)]) -> Result<()> {
        let borders: Vec<Borders> = black.iter().map(|(borders, _)| *borders).collect();
        let erased = black_border::of_registration(&borders);
        for (index, (borders, code_step)) in black.iter().enumerate() {
            let sides = std::array::from_fn(|side| borders[side].is_some() && erased[side]);
            let mut bordered = false;
            if sides.contains(&true) {
                let mut image = self.stored(index, 0..self.dim(index).0)?;
                bordered = black_border::erase(&mut image, *code_step, sides);
                self.write(index, image.view())?;
            }
            self.bordered.push(bordered);
        }
        Ok(())
    }

    /// A remark on the images with a black border, if there are any.
    pub fn bordered(&self) -> Option<String> {
        let images = match self.bordered.iter().filter(|bordered| **bordered).count() {
            0 => return None,
            1 => "1 image has".into(),
            count => format!("{count} images have"),
        };
        Some(format!("{images} a black border, which counts as not seen: the map may have holes there"))
    }

    pub fn divide_by(&mut self, gains: &[f64]) {
        self.gains = gains.iter().map(|gain| *gain as f32).collect();
    }

    /// Divides out vignetting that changes over the stack, after the images' brightness; returns its largest change as a logarithm.
    pub fn even_vignetting(&self, positions: &[f64]) -> Result<Option<f64>> {
        let Some(trend) = Trend::of(&frames::blocks(self)?, positions) else { return Ok(None) };
        for (index, position) in positions.iter().enumerate() {
            self.context.cancel.check("evening out the stack")?;
            let mut image = self.stored(index, 0..self.dim(index).0)?;
            trend.divide(&mut image, *position);
            self.write(index, image.view())?;
        }
        Ok(Some(trend.change))
    }

    /// Removes the lens' distortion from all images and moves each by its warp, NaN where it does not show the scene. Where the
    /// lens showed nothing, which is the same in all, images keep their own pixels, and the mask returned marks these, and pixels
    /// that an image has no value for.
    pub fn prepare(&self, distortion: Option<Distortion>, warps: &[Warp]) -> Result<Option<Array2<bool>>> {
        let mut unseen = None;
        for (index, warp) in warps.iter().enumerate() {
            mark_specks(&mut unseen, self.dim(index), &self.specks[index], distortion.as_ref(), warp);
        }
        for (index, warp) in warps.iter().enumerate() {
            if distortion.is_none() && *warp == Warp::IDENTITY {
                continue;
            }
            self.context.cancel.check("aligning the stack")?;
            let mut image = self.stored(index, 0..self.dim(index).0)?;
            if let Some(distortion) = &distortion {
                let straight = straightened(image.view(), distortion);
                let unseen = unseen.get_or_insert_with(|| Array2::from_elem(straight.dim(), false));
                unseen.zip_mut_with(&straight, |unseen, value| *unseen |= !value.is_finite());
                image.zip_mut_with(&straight, |own, straight| {
                    if straight.is_finite() {
                        *own = *straight;
                    }
                });
            }
            if *warp != Warp::IDENTITY {
                image = resample(image.view(), warp);
            }
            self.write(index, image.view())?;
        }
        Ok(unseen)
    }

    fn write(&self, index: usize, image: ArrayView2<f32>) -> Result<()> {
        let bytes: Vec<u8> = image.iter().flat_map(|value| value.to_le_bytes()).collect();
        self.at(index, 0, |file| file.write_all(&bytes))
    }

    /// Rows as they were written.
    fn stored(&self, index: usize, rows: Range<usize>) -> Result<Array2<f32>> {
        let shape = (rows.len(), self.dim(index).1);
        let mut bytes = vec![0; PIXEL * shape.0 * shape.1];
        self.at(index, rows.start, |file| file.read_exact(&mut bytes))?;
        let (values, _) = bytes.as_chunks::<PIXEL>();
        let values = values.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect();
        Ok(Array2::from_shape_vec(shape, values).unwrap_or_else(|_| unreachable!("one value for each pixel")))
    }

    fn at(&self, index: usize, row: usize, work: impl FnOnce(&mut File) -> io::Result<()>) -> Result<()> {
        let (begin, (_, width)) = self.images[index];
        let mut file = self.file.lock().unwrap_or_else(PoisonError::into_inner);
        let done =
            file.seek(SeekFrom::Start(begin + (PIXEL * row * width) as u64)).and_then(|_| work(&mut file));
        Ok(done.map_err(StagingError::at(&self.folder))?)
    }
}

/// Evens out an image of a relative brightness. Where a dark one of integers has more than white, the others are clipped.
pub(super) fn even(image: &mut Array2<f32>, gain: f32, are_integers: bool) {
    if gain != 1.0 {
        let white = if are_integers { 1.0 } else { f32::INFINITY };
        image.mapv_inplace(|value| if value / gain > white { white } else { value / gain });
    }
}

/// The least of the relative brightnesses, at most 1. Evened out, such an image has so much larger steps of its codes.
pub(super) fn darkest(gains: impl Iterator<Item = f32>) -> f32 {
    gains.fold(1.0, f32::min)
}

impl Slices for Images<'_> {
    type Error = WorkflowError;

    fn count(&self) -> usize {
        self.images.len()
    }

    fn dim(&self, index: usize) -> (usize, usize) {
        self.images[index].1
    }

    fn rows(&self, index: usize, rows: Range<usize>) -> Result<CowArray<'_, f32, Ix2>> {
        let mut image = self.stored(index, rows)?;
        if self.white_level != 1.0 {
            image.mapv_inplace(|value| relative(value, self.white_level));
        }
        even(&mut image, self.gains[index], self.code_step > 0.0);
        Ok(image.into())
    }

    fn code_step(&self) -> f32 {
        self.code_step / (self.white_level * darkest(self.gains.iter().copied()))
    }

    fn measured(&self, rows: usize, of: usize) -> Result<()> {
        self.context.progress.advance("rows", rows, Some(of));
        self.context.cancel.check("measuring the stack")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn single_pixels_without_a_value_are_filled_and_borders_are_not() {
        let mut image = Array2::from_elem((9, 9), 0.5);
        image[(4, 4)] = f32::NAN;
        image[(6, 6)] = f32::INFINITY;
        image[(8, 8)] = f32::NAN;
        image[(7, 0)] = f32::NAN;
        image.row_mut(0).fill(f32::NAN);
        let specks = [(4, 4), (6, 6), (7, 0), (8, 8)];
        assert_eq!(fill_specks(&mut image, false), specks);
        assert_eq!(specks.map(|at| image[at]), [0.5; 4]);
        assert!(image.row(0).iter().all(|value| value.is_nan()));
        assert_eq!(fill_specks(&mut Array2::from_elem((3, 3), 1.0), false), []);
        let mut wild = Array2::from_elem((9, 9), 0.5);
        wild[(4, 4)] = 1e30;
        assert_eq!(fill_specks(&mut wild.clone(), false), []);
        assert_eq!((fill_specks(&mut wild, true), wild[(4, 4)]), (vec![(4, 4)], 0.5));
    }

    #[test]
    fn a_dark_image_of_integers_is_white_at_most_and_has_larger_steps() {
        let image = ndarray::array![[0.1_f32, 0.8, f32::NAN]];
        for (are_integers, brightest) in [(true, 1.0), (false, 4.0)] {
            let mut evened = image.clone();
            even(&mut evened, 0.2, are_integers);
            assert_eq!((evened[(0, 0)], evened[(0, 1)]), (0.5, brightest));
            assert!(evened[(0, 2)].is_nan());
        }
        assert_eq!(darkest([1.0, 0.2, 3.0].into_iter()), 0.2);
        assert_eq!(darkest([1.5, 3.0].into_iter()), 1.0);
    }
}

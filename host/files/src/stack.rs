//! Focus stacks: files of a folder, or pages of a TIFF with positions. Positions come from the ImageJ description
//! (`spacing`, `unit`), OME-XML (`PositionZ` of each plane, else `PhysicalSizeZ`) or Micro-Manager's page tag
//! (`ZPositionUm`), for files with one plane each from the OME-XML of the first; the size of square pixels from OME-XML
//! (`PhysicalSizeX`, `PhysicalSizeY`), an ImageJ file's resolution or ImageJ2's `scales`.

mod folder;
mod names;
mod positions;

use std::{
    collections::HashMap,
    hash::{DefaultHasher, Hash, Hasher},
    path::{Path, PathBuf},
};

use ndarray::Array2;

use crate::{
    image_file::{self, Decoded, GreyImage, ImageError, Pages, ReadSettings},
    order,
    video::VideoError,
};
pub use names::positions_in_names;

#[derive(Debug, Clone, Default)]
pub struct Stack {
    /// Pages are `file.tif#3`.
    pub images: Vec<PathBuf>,
    pub positions_um: Option<Vec<f64>>,
    /// Side of a pixel at the object, from metadata.
    pub object_pixel_um: Option<f64>,
    /// Notices to the user about the order.
    pub remarks: Vec<String>,
}

#[derive(Debug, thiserror::Error)]
pub enum StackError {
    #[error(transparent)]
    Image(#[from] ImageError),
    #[error(transparent)]
    Folder(#[from] VideoError),
    #[error("{}: no such folder or file", path.display())]
    Missing { path: PathBuf },
    #[error("{} holds {found}: the images of a stack have one format; move the others away", path.display())]
    Mixed { path: PathBuf, found: String },
    #[error("{} and {} have the same number: move one of them away, or rename it", first.display(), second.display())]
    SameNumber { first: PathBuf, second: PathBuf },
    #[error("{} and {} hold the same image; move one of them away", first.display(), second.display())]
    Twice { first: PathBuf, second: PathBuf },
    #[error("{}: {reason}", path.display())]
    Series { path: PathBuf, reason: String },
    #[error("{}: {reason}", path.display())]
    Planes { path: PathBuf, reason: String },
}

/// Lists a folder with images of one format, or a multi-page TIFF.
pub fn list(path: &Path) -> Result<Stack, StackError> {
    if path.is_dir() { folder(path) } else { file(path) }
}

fn folder(path: &Path) -> Result<Stack, StackError> {
    let names::Series { images, remarks, .. } = folder::images(path)?;
    if let [only] = images.as_slice() {
        return file(only).map(|stack| Stack { remarks: [remarks, stack.remarks].concat(), ..stack });
    }
    let names: Vec<String> = images.iter().map(|image| order::file_name(image)).collect();
    let Some(Pages { pages, .. }) = Pages::open(&images[0])? else {
        return Ok(Stack { remarks, images, ..Stack::default() });
    };
    let of_files = positions::of_files(&pages, &names);
    let Some(planes) = of_files.map_err(|reason| StackError::Planes { path: path.into(), reason })? else {
        return Ok(Stack { remarks, images, ..Stack::default() });
    };
    let (object_pixel_um, of_pixel) = positions::object_pixel_um(&pages);
    Ok(Stack {
        images: planes.pages.into_iter().map(|index| images[index].clone()).collect(),
        positions_um: planes.positions_um,
        object_pixel_um,
        remarks: [remarks, planes.remarks, Vec::from_iter(of_pixel)].concat(),
    })
}

fn file(path: &Path) -> Result<Stack, StackError> {
    if !path.is_file() {
        return Err(StackError::Missing { path: path.into() });
    }
    let Some(Pages { pages, .. }) = Pages::open(path)? else {
        return Ok(Stack { images: vec![path.into()], ..Stack::default() });
    };
    let positions::Planes { pages: order, positions_um, mut remarks } =
        positions::of(&pages).map_err(|reason| StackError::Planes { path: path.into(), reason })?;
    let page = |index: usize| {
        let mut page = path.as_os_str().to_owned();
        page.push(format!("#{}", index + 1));
        PathBuf::from(page)
    };
    let images = order.into_iter().map(page).collect();
    let (object_pixel_um, of_pixel) = positions::object_pixel_um(&pages);
    remarks.extend(of_pixel);
    Ok(Stack { images, positions_um, object_pixel_um, remarks })
}

/// Reads the images in order, one at a time; `each` takes each with its index and may stop. Two equal images are an error, unless
/// they are empty: all pixels alike.
pub fn read<E: From<StackError>>(
    images: &[PathBuf],
    settings: &ReadSettings,
    mut each: impl FnMut(usize, GreyImage) -> Result<(), E>,
) -> Result<(), E> {
    let mut seen: HashMap<u64, usize> = HashMap::with_capacity(images.len());
    let mut open: Option<(PathBuf, Pages)> = None;
    for (index, path) in images.iter().enumerate() {
        let image = match page(path, &mut open).map_err(StackError::from)? {
            Some(decoded) => {
                decoded.grey(settings).map_err(|reason| ImageError::Setting { path: path.clone(), reason })
            }
            None => image_file::read_grey_with(path, settings),
        };
        let image = image.map_err(StackError::from)?;
        let first = image.pixels.first().map(|value| value.to_bits());
        let is_empty = image.pixels.iter().all(|value| Some(value.to_bits()) == first);
        if let Some(twin) = seen.insert(hash(&image.pixels), index).filter(|_| !is_empty) {
            return Err(StackError::Twice { first: images[twin].clone(), second: path.clone() }.into());
        }
        each(index, image)?;
    }
    Ok(())
}

/// The page of a TIFF file that stays open for the next one; `None` for a file with one image.
fn page(path: &Path, open: &mut Option<(PathBuf, Pages)>) -> Result<Option<Decoded>, ImageError> {
    let (file, Some(number)) = image_file::file_and_page(path) else { return Ok(None) };
    if open.as_ref().is_none_or(|(of, _)| *of != file) {
        *open = Pages::open(&file)?.map(|pages| (file, pages));
    }
    open.as_ref().map(|(_, pages)| pages.decode(number)).transpose()
}

/// Of 64 bits: two different images of a stack have one hash with a probability below 1e-12.
fn hash(pixels: &Array2<f32>) -> u64 {
    let mut hasher = DefaultHasher::new();
    pixels.dim().hash(&mut hasher);
    pixels.iter().for_each(|value| hasher.write_u32(value.to_bits()));
    hasher.finish()
}

#[cfg(test)]
#[cfg(target_os = "linux")]
mod tests {
    use std::{ffi::OsStr, fs, os::unix::ffi::OsStrExt};

    use super::*;
    use crate::image_file::encode_tiff;

    #[test]
    fn a_name_need_not_be_utf_8() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(OsStr::from_bytes(b"Prob\xe4.tif"));
        fs::write(&path, encode_tiff(Array2::from_elem((3, 4), 51).view(), 8).unwrap()).unwrap();
        let Stack { images, .. } = list(&path).unwrap();
        assert_eq!(image_file::file_and_page(&images[0]), (path, Some(1)));
        let mut levels = Vec::new();
        let settings = ReadSettings::default();
        read(&images, &settings, |_, image| -> Result<(), StackError> {
            levels.push(image.pixels[(0, 0)]);
            Ok(())
        })
        .unwrap();
        assert_eq!(levels, [0.2]);
    }

    #[test]
    fn images_may_be_empty_twice_and_other_images_once() {
        let folder = tempfile::tempdir().unwrap();
        let path = |number: usize| folder.path().join(format!("{number}.tif"));
        let read = |images: [[u16; 3]; 3]| {
            for (number, pixels) in images.iter().enumerate() {
                let bytes = encode_tiff(Array2::from_shape_fn((2, 3), |(_, x)| pixels[x]).view(), 8).unwrap();
                fs::write(path(number), bytes).unwrap();
            }
            let mut count = 0;
            let each = |_, _| -> Result<(), StackError> {
                count += 1;
                Ok(())
            };
            super::read(&[0, 1, 2].map(path), &ReadSettings::default(), each).map(|()| count)
        };
        assert_eq!(read([[7, 7, 7], [1, 2, 3], [7, 7, 7]]).unwrap(), 3);
        let error = read([[7, 7, 8], [1, 2, 3], [7, 7, 8]]).unwrap_err().to_string();
        assert!(error.contains("0.tif and ") && error.contains("the same image"), "{error}");
    }
}

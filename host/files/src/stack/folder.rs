//! Focus stacks in folders.

use std::{
    collections::{BTreeMap, HashSet},
    fs,
    path::{Path, PathBuf},
};

use super::{StackError, names::Series};
use crate::{
    image_file, order,
    video::{VideoError, pictures},
};

/// Format by the ending of a name.
fn format(path: &Path) -> Option<&'static str> {
    Some(match path.extension()?.to_string_lossy().to_lowercase().as_str() {
        "tif" | "tiff" => "TIFF",
        "jpg" | "jpeg" | "jfif" | "jpe" => "JPEG",
        "png" => "PNG",
        "bmp" | "dib" => "BMP",
        "pgm" | "ppm" | "pnm" | "pam" => "PGM",
        _ => return None,
    })
}

/// The images of a folder that form one focus series. Fails for several series or formats, and if an image of the series
/// has a format that is not read.
pub(super) fn images(path: &Path) -> Result<Series, StackError> {
    let files = files(path).map_err(|source| VideoError::Io { path: path.into(), source })?;
    if let Some(path) = files.iter().find(|path| format(path).is_some() && !path.is_file()) {
        return Err(VideoError::NotAFile { path: path.clone() }.into());
    }
    let (mut images, others): (Vec<PathBuf>, Vec<PathBuf>) =
        files.into_iter().partition(|file| format(file).is_some());
    if images.is_empty() {
        let known = others.iter().find_map(|file| image_file::unread(file));
        return Err(
            known.map_or_else(|| VideoError::NoPictures { path: path.into() }.into(), StackError::from)
        );
    }
    order::sort(&mut images);
    let stems: HashSet<String> = images.iter().map(|image| order::stem(image)).collect();
    let in_formats = mixed(path, &images);
    let mut series = Series::of(images)
        .map_err(|reason| in_formats.unwrap_or(StackError::Series { path: path.into(), reason }))?;
    // Without the images left out, numbers may be decimals.
    order::sort(&mut series.images);
    if let Some([first, second]) = order::same_stem(&series.images) {
        return Err(VideoError::SameStem { first, second }.into());
    }
    if let Some([first, second]) = order::same_number(&series.images) {
        return Err(StackError::SameNumber { first: first.clone(), second: second.clone() });
    }
    series.remarks.extend(order::ambiguity(&series.images));
    // A camera's raw file has the name of its JPEG.
    let missing = |file: &&PathBuf| !stems.contains(&order::stem(file)) && series.would_hold(file);
    if let Some(unread) = others.iter().filter(missing).find_map(|file| image_file::unread(file)) {
        return Err(unread.into());
    }
    if let Some(mixed) = mixed(path, &series.images) {
        return Err(mixed);
    }
    if let Some([before, after]) = order::counter_started_again(&series.images) {
        let (after, before) = (order::file_name(after), order::file_name(before));
        series.remarks.push(format!("the camera's counter started again: {after} follows {before}"));
    }
    Ok(series)
}

fn mixed(path: &Path, images: &[PathBuf]) -> Option<StackError> {
    let mut formats: BTreeMap<&str, usize> = BTreeMap::new();
    images.iter().filter_map(|image| format(image)).for_each(|f| *formats.entry(f).or_default() += 1);
    let found = formats.iter().map(|(format, count)| format!("{count} {format}")).collect::<Vec<_>>();
    let found = format!("{} files", found.join(" and "));
    (formats.len() > 1).then(|| StackError::Mixed { path: path.into(), found })
}

/// Everything but folders and hidden files, in order of the names.
fn files(folder: &Path) -> std::io::Result<Vec<PathBuf>> {
    let entries = fs::read_dir(folder)?.collect::<Result<Vec<_>, _>>()?;
    let mut files: Vec<PathBuf> = entries.iter().map(fs::DirEntry::path).collect();
    files.retain(|path| !pictures::hidden(path) && !path.is_dir());
    files.sort();
    Ok(files)
}

#[cfg(test)]
mod tests {
    use super::super::list;
    use super::*;
    use crate::image_file::encode_png;
    use ndarray::array;

    fn folder(files: &[(&str, &[u8])]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        files.iter().for_each(|(name, bytes)| fs::write(folder.path().join(name), bytes).unwrap());
        folder
    }

    #[test]
    fn an_image_of_the_series_that_is_not_read_is_refused() {
        let png = encode_png(array![[7]].view(), 16).unwrap();
        let heic = b"\0\0\0\x18ftypheic\0\0\0\0".as_slice();
        let webp = b"RIFF\x10\0\0\0WEBPVP8L".as_slice();
        let raw = b"FUJIFILMCCD-RAW ".as_slice();
        for (name, bytes, phrase) in [
            ("i02.HEIC", heic, "HEIC"),
            ("i02.webp", webp, "WebP"),
            ("i02.RAF", raw, "raw file"),
            ("i02.dat", &png, "rename it"),
        ] {
            let mixed = folder(&[("i01.png", &png), ("i03.png", &png), (name, bytes)]);
            let error = list(mixed.path()).unwrap_err().to_string();
            assert!(error.contains(name) && error.contains(phrase), "{error}");
        }
        let ole = b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1".as_slice();
        for other in [("a.txt", b"notes".as_slice()), ("Thumbs.db", ole), ("THUMBS.DB", ole)] {
            let only = folder(&[("i1.webp", webp), other]);
            assert!(list(only.path()).unwrap_err().to_string().contains("WebP"), "{other:?}");
        }
        let (note, other) = (b"note".as_slice(), ("other.webp", webp));
        let twins = folder(&[("i1.png", &png), ("i2.png", &png), ("i2.RAF", raw), ("i3.txt", note), other]);
        assert_eq!(list(twins.path()).unwrap().images.len(), 2);
    }

    #[cfg(unix)]
    #[test]
    fn a_link_to_a_missing_image_is_an_error() {
        let linked = folder(&[("i1.png", b""), ("i3.png", b"")]);
        std::os::unix::fs::symlink("absent.png", linked.path().join("i2.png")).unwrap();
        let error = list(linked.path()).unwrap_err().to_string();
        assert!(error.contains("i2.png: a link to a file that does not exist"), "{error}");
        std::os::unix::fs::symlink("absent", linked.path().join("notes")).unwrap();
        fs::remove_file(linked.path().join("i2.png")).unwrap();
        assert_eq!(list(linked.path()).unwrap().images.len(), 2);
    }

    #[test]
    fn endings_of_one_format_are_one_format() {
        for names in [["1.pgm", "2.pnm", "3.ppm", "4.pam"], ["1.bmp", "2.dib", "3.BMP", "4.DIB"]] {
            let stack = folder(&names.map(|name| (name, b"P5".as_slice())));
            assert_eq!(list(stack.path()).unwrap().images.len(), 4, "{names:?}");
        }
        let known = |ending: &str| format(Path::new(&format!("a.{ending}"))).is_some();
        assert!(pictures::EXTENSIONS.into_iter().all(known));
    }

    #[test]
    fn masks_next_to_the_images_are_no_images() {
        let png = encode_png(array![[7]].view(), 16).unwrap();
        let mask = b"P4 1 1\n\x80".as_slice();
        let folder =
            folder(&[("1.png", &png), ("1.pbm", mask), ("2.png", &png), ("2.pbm", mask), ("3.pbm", mask)]);
        assert_eq!(list(folder.path()).unwrap().images.len(), 2);
        assert_eq!(pictures::list(folder.path()).unwrap().len(), 2);
    }

    #[test]
    fn jfif_is_jpeg() {
        let mixed = folder(&[("i1.jpg", b"\xff\xd8"), ("i2.jfif", b"\xff\xd8"), ("i3.JPE", b"\xff\xd8")]);
        assert_eq!(list(mixed.path()).unwrap().images.len(), 3);
    }

    #[test]
    fn a_number_that_is_written_twice_is_refused_and_a_doubtful_one_is_stated() {
        let twice = folder(&["z01.png", "z1.png", "z2.png"].map(|name| (name, b"".as_slice())));
        let error = list(twice.path()).unwrap_err().to_string();
        assert!(error.contains("z01.png and ") && error.contains("the same number"), "{error}");
        let grid = ["t1,1.png", "t1,2.png", "t2,1.png", "t2,2.png"];
        let grid = folder(&grid.map(|name| (name, b"".as_slice())));
        assert!(list(grid.path()).unwrap().remarks[0].contains("a grid"));
    }

    #[test]
    fn several_series_are_refused_with_the_folder() {
        let names = ["z1_c1.png", "z1_c2.png", "z2_c1.png", "z2_c2.png"];
        let mixed = folder(&names.map(|name| (name, b"".as_slice())));
        let error = list(mixed.path()).unwrap_err().to_string();
        let path = mixed.path().display().to_string();
        assert!(error.starts_with(&path) && error.contains("c (1, 2)"), "{error}");
    }
}

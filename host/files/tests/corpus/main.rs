//! Test images of other decoders: nothing crashes, and pixels equal Pillow's. `FARNEAR_IMAGE_CORPUS` names folders
//! (separated as in PATH), such as `Tests/images` of Pillow's source archive; `FARNEAR_PYTHON` a Python with Pillow and
//! numpy (`python3` by default). Images that both reject, or only one reads, are counted.

use std::{
    collections::BTreeMap,
    env, fs,
    panic::catch_unwind,
    path::{Path, PathBuf},
    process::Command,
};

use farnear_files::image_file::read_grey;
use ndarray::Array2;

/// Writes each image that Pillow reads as height, width (u32) and grey values (f32, full scale = 1), a line per file.
const REFERENCE: &str = include_str!("reference.py");
const ENDINGS: [&str; 9] = ["png", "tif", "tiff", "jpg", "jpeg", "bmp", "pgm", "ppm", "pnm"];
/// Largest and mean difference: JPEG decoders round differently, others do not.
const EXACT: [f32; 2] = [1.1 / 255.0, 0.6 / 255.0]; // Pillow reduces 16-bit colour to 8 bits
/// Fewer pixels do not average the rounding of a JPEG.
const TINY: usize = 256;
/// Files that both read differently, with the reason.
const KNOWN: [(&str, &str); 2] = [
    ("mmap_error.bmp", "the pixels begin within the palette, which is broken"),
    ("flower-rgb-planar-16.tif", "Pillow mixes up the planes; tifffile agrees with farnear"),
];
const JPEG: [f32; 2] = [24.0 / 255.0, 1.0 / 255.0];

#[test]
#[cfg_attr(
    not(image_corpus),
    ignore = "needs images: FARNEAR_IMAGE_CORPUS names folders of decoders' test images"
)]
fn nothing_crashes_and_pixels_agree_with_a_second_decoder() {
    let folders = env::var_os("FARNEAR_IMAGE_CORPUS").expect("the build script has seen it");
    let mut files = Vec::new();
    env::split_paths(&folders).for_each(|folder| collect(&folder, &mut files));
    files.sort();
    let references = references(&files);
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    let mut wrong = Vec::new();
    for (file, reference) in files.iter().zip(&references) {
        let Ok(read) = catch_unwind(|| read_grey(file)) else {
            wrong.push(format!("{}: panic", file.display()));
            continue;
        };
        let outcome = match (read, reference) {
            (Ok(image), Some(reference)) => match difference(&image.pixels, reference, file) {
                None => "same pixels",
                Some(how) => match known(file) {
                    Some(reason) => {
                        println!("{}: {how}: {reason}", file.display());
                        "known differences"
                    }
                    None => {
                        wrong.push(format!("{}: {how}", file.display()));
                        "other pixels"
                    }
                },
            },
            (Ok(_), None) => "not compared",
            (Err(error), reference) => {
                println!("refused: {error}");
                if reference.is_some() { "refused, Pillow reads it" } else { "refused by both" }
            }
        };
        *counts.entry(outcome).or_default() += 1;
    }
    println!("{} files: {counts:?}", files.len());
    assert!(files.len() >= 300, "{} files: expected at least 300", files.len());
    assert!(counts.get("same pixels").is_some_and(|same| *same >= 150), "{counts:?}");
    assert!(wrong.is_empty(), "{counts:?}\n{}", wrong.join("\n"));
}

fn known(file: &Path) -> Option<&'static str> {
    let name = file.file_name()?.to_str()?;
    KNOWN.iter().find(|(ending, _)| name.ends_with(ending)).map(|(_, reason)| *reason)
}

fn collect(folder: &Path, into: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let path = entry.path();
        let ending = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
        if path.is_dir() {
            collect(&path, into);
        } else if ENDINGS.contains(&ending.as_str()) {
            into.push(path);
        }
    }
}

fn references(files: &[PathBuf]) -> Vec<Option<Array2<f32>>> {
    let folder = tempfile::tempdir().expect("a folder");
    let [script, list] = ["reference.py", "list.txt"].map(|name| folder.path().join(name));
    fs::write(&script, REFERENCE).expect("a writable folder");
    let names: Vec<String> = files.iter().map(|file| file.display().to_string()).collect();
    fs::write(&list, names.join("\n")).expect("a writable folder");
    let python = env::var_os("FARNEAR_PYTHON").unwrap_or_else(|| "python3".into());
    let status =
        Command::new(python).arg(&script).arg(&list).arg(folder.path()).status().expect("Python starts");
    assert!(
        status.success(),
        "the reference needs Pillow and numpy: FARNEAR_PYTHON names a Python with them"
    );
    let read = |index: usize| -> Option<Array2<f32>> {
        let bytes = fs::read(folder.path().join(format!("{index}.raw"))).ok()?;
        let words = bytes.chunks_exact(4).map(|word| [word[0], word[1], word[2], word[3]]);
        let mut words = words;
        let [height, width] = [words.next()?, words.next()?].map(|word| u32::from_le_bytes(word) as usize);
        Array2::from_shape_vec((height, width), words.map(f32::from_le_bytes).collect()).ok()
    };
    (0..files.len()).map(read).collect()
}

fn difference(found: &Array2<f32>, reference: &Array2<f32>, file: &Path) -> Option<String> {
    if found.dim() != reference.dim() {
        return Some(format!("{:?} instead of {:?} rows and columns", found.dim(), reference.dim()));
    }
    let bytes = fs::read(file).unwrap_or_default();
    let [most, mut mean] = if bytes.starts_with(&[0xff, 0xd8]) { JPEG } else { EXACT };
    if found.len() < TINY {
        mean = most;
    }
    let differences: Vec<f32> = found.iter().zip(reference).map(|(a, b)| (a - b).abs()).collect();
    let largest = differences.iter().copied().fold(0.0, f32::max);
    let average = differences.iter().sum::<f32>() / differences.len() as f32;
    (largest > most || average > mean || largest.is_nan()).then(|| {
        format!("differs by {:.2} at most and {:.3} on average (of 255)", 255.0 * largest, 255.0 * average)
    })
}

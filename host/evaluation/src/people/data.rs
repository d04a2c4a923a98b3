//! Real data, where this computer has it.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use image::{DynamicImage, ImageReader};

/// The folder may not exist.
pub struct Data(pub PathBuf);

impl Data {
    pub fn path(&self, name: &str) -> Option<PathBuf> {
        Some(self.0.join(name)).filter(|path| path.exists())
    }

    pub fn bytes(&self, name: &str) -> Result<Option<Vec<u8>>> {
        let read =
            |path: &Path| std::fs::read(path).with_context(|| format!("cannot read {}", path.display()));
        self.path(name).map(|path| read(&path)).transpose()
    }

    pub fn text(&self, name: &str) -> Result<Option<String>> {
        self.bytes(name)?
            .map(|bytes| String::from_utf8(bytes).with_context(|| format!("{name} is not text")))
            .transpose()
    }
}

pub fn numbered_files(folder: &Path) -> Result<Vec<(u64, PathBuf)>> {
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).with_context(|| format!("cannot read {}", folder.display()))? {
        let path = entry?.path();
        let stem = path.file_stem().and_then(|stem| stem.to_str()).unwrap_or_default();
        let digits: String = stem.chars().filter(char::is_ascii_digit).collect();
        if let Ok(number) = digits.parse() {
            files.push((number, path));
        }
    }
    files.sort();
    Ok(files)
}

/// Some files have another format's extension.
pub fn picture(path: &Path) -> Result<DynamicImage> {
    let reader = ImageReader::open(path).with_context(|| format!("cannot read {}", path.display()))?;
    reader.with_guessed_format()?.decode().with_context(|| format!("cannot decode {}", path.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_come_in_the_order_of_their_numbers_and_others_not_at_all() {
        let folder = std::env::temp_dir().join(format!("farnear-numbered-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        for name in ["in_10.jpg", "in_9.jpg", "readme.txt"] {
            std::fs::write(folder.join(name), name).unwrap();
        }
        let found: Vec<u64> =
            numbered_files(&folder).unwrap().into_iter().map(|(number, _)| number).collect();
        assert_eq!(found, [9, 10]);
        let data = Data(folder.clone());
        assert_eq!(data.text("readme.txt").unwrap().as_deref(), Some("readme.txt"));
        assert!(data.bytes("nothing.mat").unwrap().is_none());
        std::fs::remove_dir_all(folder).unwrap();
    }
}

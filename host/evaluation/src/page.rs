use std::{
    fs,
    path::{Path, PathBuf},
};

use anyhow::{Context, Result};

pub struct Page {
    images: PathBuf,
    text: String,
}

impl Page {
    /// Pictures go to the folder `images`.
    pub fn new(images: &Path, introduction: &str) -> Self {
        Self { images: images.to_path_buf(), text: format!("{}\n", introduction.trim_end()) }
    }

    pub fn text(&self) -> &str {
        &self.text
    }

    pub fn heading(&mut self, heading: &str) {
        self.text.push_str(&format!("\n## {heading}\n"));
    }

    pub fn subheading(&mut self, heading: &str) {
        self.text.push_str(&format!("\n### {heading}\n"));
    }

    pub fn block(&mut self, markdown: &str) {
        self.text.push_str(&format!("\n{}\n", markdown.trim_end()));
    }

    pub fn paragraph(&mut self, text: &str) {
        self.text.push_str(&format!("\n{}\n", text.trim()));
    }

    /// All columns but the first `left` are numbers, aligned to the right.
    pub fn table<H: AsRef<str>>(&mut self, left: usize, head: &[H], rows: &[Vec<String>]) {
        let line = |cells: &mut dyn Iterator<Item = &str>| {
            let cells: Vec<&str> = cells.collect();
            format!("| {} |\n", cells.join(" | "))
        };
        self.text.push('\n');
        self.text.push_str(&line(&mut head.iter().map(AsRef::as_ref)));
        let rule: Vec<&str> = (0..head.len()).map(|i| if i < left { "---" } else { "--:" }).collect();
        self.text.push_str(&format!("|{}|\n", rule.join("|")));
        for row in rows {
            self.text.push_str(&line(&mut row.iter().map(String::as_str)));
        }
    }

    pub fn picture(&mut self, name: &str, png: &[u8], caption: &str) -> Result<()> {
        let path = self.images.join(name);
        fs::write(&path, png).with_context(|| format!("cannot write {}", path.display()))?;
        self.text.push_str(&format!("\n![{caption}](images/{name})\n"));
        Ok(())
    }

    pub fn write(self, path: &Path) -> Result<()> {
        let aside = path.with_extension("md.part");
        let about = || format!("cannot write {}", path.display());
        fs::write(&aside, &self.text).with_context(about)?;
        fs::rename(&aside, path).with_context(about)?;
        eprintln!("wrote {}", path.display());
        Ok(())
    }
}

/// Three decimals, or a dash for a missing value.
pub fn mm(value: f64) -> String {
    if value.is_finite() { format!("{value:.3}") } else { "-".into() }
}

/// The upper one of two middle values; NaN without values.
pub fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_align_numbers_to_the_right() {
        let mut page = Page::new(Path::new("."), "# Title\n\n");
        page.table(1, &["what", "mm"], &[vec!["a".into(), mm(1.0)], vec!["b".into(), mm(f64::NAN)]]);
        assert_eq!(page.text(), "# Title\n\n| what | mm |\n|---|--:|\n| a | 1.000 |\n| b | - |\n");
    }
}

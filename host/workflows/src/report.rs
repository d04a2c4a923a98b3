//! Report of a capture or a result as a self-contained page.

mod kinds;
mod page;
mod pictures;
mod style;

use std::path::{Path, PathBuf};

use farnear_capture::record::CAPTURE_FILE;
use farnear_files::{
    image_file::{self, encode_png},
    map,
    staging::write_file,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{
    context::Context,
    error::{Result, WorkflowError},
    measure::{Measured, region},
    quantile,
    request::{PathKind, Request},
    result_folder::{DEPTH_RECORD, STACK_RECORD},
};
use page::Page;
use pictures::{colours, decimals, histogram};

/// Write a self-contained HTML page about a capture or a result: pictures, figures and what made them.
///
/// Takes the folders of `rig capture`, `depth`, `focus-stack`, `silhouettes`, `shadow`, `activity` and of batch jobs.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[cfg_attr(feature = "clap", derive(clap::Args))]
#[cfg_attr(feature = "clap", command(after_help = "Example: farnear report pair1/ --out pair1.html"))]
#[serde(default)]
pub struct ReportRequest {
    /// The folder of a capture or a result.
    pub folder: PathBuf,
    /// The page.
    #[cfg_attr(feature = "clap", arg(long, value_name = "FILE.html"))]
    pub out: PathBuf,
}

impl Request for ReportRequest {
    const NAME: &'static str = "report";
    const REQUIRED: &'static [&'static str] = &["folder", "out"];
    const PATHS: &'static [(&'static str, PathKind)] =
        &[("folder", PathKind::Input), ("out", PathKind::OutputFile)];
    type Figures = ReportFigures;

    fn run(&self, _: &Context<'_>) -> Result<ReportFigures> {
        write(self)
    }
}

#[derive(Clone, PartialEq, Eq, Debug, Serialize)]
pub struct ReportFigures {
    pub pictures: usize,
    pub bytes: usize,
}

pub fn write(request: &ReportRequest) -> Result<ReportFigures> {
    let is_page = request.out.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("html"));
    if request.out.exists() && !is_page {
        let expected = "it exists and does not end with .html: name another file";
        return Err(WorkflowError::parameter("out", request.out.display(), expected));
    }
    let page = html(&request.folder)?;
    write_file(&request.out, page.as_bytes())?;
    Ok(ReportFigures { pictures: page.matches("<figure").count(), bytes: page.len() })
}

/// Fails for a folder without files of farnear.
pub fn html(folder: &Path) -> Result<String> {
    if folder.is_file() {
        let expected = "the folder of a capture or a result, in which this file is";
        return Err(WorkflowError::parameter("folder", folder.display(), expected));
    }
    let has = |name: &str| folder.join(name).is_file();
    if has(CAPTURE_FILE) {
        kinds::capture(folder)
    } else if has(DEPTH_RECORD) || has(STACK_RECORD) {
        kinds::depth_result(folder)
    } else {
        kinds::other(folder)
    }
}

fn depth(page: &mut Page, folder: &Path) -> Result<()> {
    let measured = Measured::read(folder)?;
    let unit = measured.unit;
    page.0.push_str("<section><h2>Depth</h2><div class=row>");
    match std::fs::read(folder.join("view.png")) {
        Ok(bytes) => page.picture(&bytes, &format!("depth in {unit}; pale where confidence is low")),
        Err(_) => {
            let ends = [0.005, 0.995].map(|part| quantile::of_map(measured.depth.view(), part));
            if let [Some(low), Some(high)] = ends {
                let decimals = decimals(high - low, 2);
                let caption = format!("depth, dark = {low:.decimals$} to bright = {high:.decimals$} {unit}");
                page.picture(&colours(measured.depth.view(), [low, high])?, &caption);
            }
        }
    }
    if let Ok(confidence) = map::read(&folder.join("confidence.npy")) {
        page.picture(&colours(confidence.view(), [0.0, 1.0])?, "confidence, dark = 0 to bright = 1");
    }
    if let Some(deviation) = &measured.deviation {
        let largest = quantile::of_map(deviation.view(), 0.98).unwrap_or(1.0);
        let decimals = decimals(largest, 2);
        let caption = format!("standard deviation, dark = 0 to bright = {largest:.decimals$} {unit}");
        page.picture(&colours(deviation.view(), [0.0, largest])?, &caption);
    }
    if let Ok(image) = image_file::read_grey(&folder.join("all-in-focus.png")) {
        let codes = image.pixels.mapv(|value| (255.0 * value.clamp(0.0, 1.0)).round() as u16);
        page.picture(&encode_png(codes.view(), 8)?, "sharp everywhere");
    }
    page.0.push_str("</div>");
    let found = region(&measured, measured.all())?;
    page.figures(&found);
    page.0.push_str("<figure class=plot>");
    page.0.push_str(&histogram(measured.depth.view(), &unit.to_string()));
    page.0.push_str("<figcaption>distribution of the depths</figcaption></figure></section>");
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::fs;

    use farnear_files::npy;
    use ndarray::Array2;

    use super::*;
    use crate::sessions::{Note, write_note};

    #[test]
    fn a_page_needs_nothing_else_and_escapes_what_people_write() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, bytes: &[u8]| fs::write(folder.path().join(name), bytes).unwrap();
        write("capture.toml", include_bytes!("sessions/capture.toml"));
        let image = encode_png(Array2::<u16>::from_elem((20, 30), 9).view(), 8).unwrap();
        write("far.png", &image);
        write("near.png", &image);
        let depth =
            Array2::from_shape_fn((20, 30), |(y, x)| if y == 0 { f32::NAN } else { 900.0 + x as f32 });
        write("depth.npy", &npy::write(depth.view()));
        write("uncertainty.npy", &npy::write(depth.mapv(|_| 0.7).view()));
        let text = "<script>alert('x')</script> & \"more\"".into();
        write_note(folder.path(), &Note { rating: 3, text }).unwrap();
        let out = folder.path().join("report.html");
        let found = super::write(&ReportRequest { folder: folder.path().into(), out: out.clone() }).unwrap();
        let page = fs::read_to_string(&out).unwrap();
        assert_eq!((found.pictures, found.bytes), (5, page.len()));
        assert!(
            page.contains("★★★</b> &lt;script&gt;alert(&#39;x&#39;)") && !page.contains("<script"),
            "{page}"
        );
        assert!(!page.contains("http:") && !page.contains("https:"), "nothing is fetched");
        assert!(page.contains("<td>95.00 %</td>") && page.contains("<td>0.700 mm</td>"));
        assert!(page.contains("scene = &quot;staircase&quot;"));
        let far = folder.path().join("far.png");
        let error =
            super::write(&ReportRequest { folder: folder.path().into(), out: far.clone() }).unwrap_err();
        assert!(error.is_usage() && fs::read(far).unwrap() == image, "{error}");
    }

    #[test]
    fn a_folder_without_a_result_leaves_no_page() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("report.html");
        let settings = ReportRequest { folder: folder.path().join("absent"), out: out.clone() };
        assert!(write(&settings).is_err() && !out.exists());
        // A folder without farnear's files.
        fs::write(folder.path().join("notes.md"), "mine").unwrap();
        let settings = ReportRequest { folder: folder.path().into(), ..settings };
        assert!(write(&settings).unwrap_err().to_string().contains("result") && !out.exists());
    }

    #[test]
    fn every_kind_of_result_becomes_a_page() {
        let root = tempfile::tempdir().unwrap();
        let page = |name: &str, files: &[(&str, &[u8])]| {
            let folder = root.path().join(name);
            fs::create_dir(&folder).unwrap();
            files.iter().for_each(|(file, bytes)| fs::write(folder.join(file), bytes).unwrap());
            html(&folder).unwrap()
        };
        let map = npy::write(Array2::from_shape_fn((20, 30), |(_, x)| x as f32 - 5.0).view());
        let picture = encode_png(Array2::<u16>::from_elem((20, 30), 9).view(), 8).unwrap();
        let record = b"made_by = \"farnear 0\"\nunit = \"um\"\n".as_slice();
        let stack =
            page("stack", &[("stack.toml", record), ("depth.npy", &map), ("all-in-focus.png", &picture)]);
        assert!(stack.contains("<td>9.500 um</td>") && stack.contains("sharp everywhere"), "{stack}");
        assert!(!stack.contains(" mm<"), "a map in um has no mm");
        let evaluation = b"accuracy = 0.75\nmode = \"ordered\"\n".as_slice();
        let people = page("people", &[("evaluation.toml", evaluation), ("confusion.png", &picture)]);
        assert!(people.contains("accuracy = 0.75") && people.contains("confusion.png"), "{people}");
        let masks = page("masks", &[("silhouettes.toml", b"format = 1\n"), ("a_000001.png", &picture)]);
        assert!(masks.contains("a_000001.png"), "{masks}");
        let answers = page("answers", &[("recognition.json", b"{\"walk\": 0.9}"), ("answers.jsonl", b"{}")]);
        assert!(answers.contains("walk"), "{answers}");
    }
}

//! A capture as one page that needs nothing else: pictures, figures and what made them, for a notebook or a printer.
//!
//! The pictures stand in the page as data, its style is in it, and nothing is fetched from anywhere.

mod pictures;
mod style;

use std::{
    fmt::Write as _,
    fs,
    path::{Path, PathBuf},
};

use base64::{Engine as _, engine::general_purpose::STANDARD};
use farnear_files::{map, staging::write_file};
use serde::Serialize;

use crate::{
    MADE_BY,
    error::{Result, WorkflowError},
    measure::{Measured, Rectangle, RegionFigures, region},
    sessions::{self, Capture},
};
use pictures::{colours, histogram};
use style::STYLE;

/// What is reported, and where to.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct ReportSettings {
    /// The capture's folder.
    pub capture: PathBuf,
    pub out: PathBuf,
}

/// What there is to say of a report.
#[derive(Clone, PartialEq, Eq, Debug, Serialize)]
pub struct ReportFigures {
    /// Pictures in the page.
    pub pictures: usize,
    pub bytes: usize,
}

/// Writes the page; it is there whole or not at all.
///
/// # Errors
/// [`WorkflowError::Read`] where the folder is no capture, [`WorkflowError::Map`], [`WorkflowError::Staging`].
pub fn write(settings: &ReportSettings) -> Result<ReportFigures> {
    let page = html(&settings.capture)?;
    write_file(&settings.out, page.as_bytes())?;
    Ok(ReportFigures { pictures: page.matches("<figure").count(), bytes: page.len() })
}

/// The page of a capture. Reads all of its pictures and maps.
///
/// # Errors
/// As [`write()`], without writing.
pub fn html(folder: &Path) -> Result<String> {
    let capture = sessions::read(folder)?;
    let mut page = Page::begin(&format!("{} · farnear", capture.name));
    let title = escaped(&capture.name);
    let _ = write!(page.0, "<header><h1>{title}</h1><p>{}</p></header>", escaped(&subtitle(&capture)));
    if !capture.note.text.is_empty() || capture.note.rating > 0 {
        let stars = "★".repeat(capture.note.rating.into());
        let _ =
            write!(page.0, "<section class=note><b>{stars}</b> {}</section>", escaped(&capture.note.text));
    }
    if capture.has_depth {
        depth(&mut page, folder)?;
    }
    page.0.push_str("<section><h2>Images</h2><div class=row>");
    for image in &capture.images {
        let path = folder.join(image);
        let bytes = fs::read(&path).map_err(WorkflowError::read("the image", &path))?;
        page.picture(&bytes, image);
    }
    page.0.push_str("</div></section>");
    for (heading, file) in [("How it was captured", "capture.toml"), ("How depth was computed", "depth.toml")]
    {
        if let Ok(text) = fs::read_to_string(folder.join(file)) {
            let _ = write!(page.0, "<section><h2>{heading}</h2><pre>{}</pre></section>", escaped(&text));
        }
    }
    Ok(page.end())
}

/// Maps and their figures.
fn depth(page: &mut Page, folder: &Path) -> Result<()> {
    let measured = Measured::read(folder)?;
    let (height, width) = measured.depth_mm.dim();
    page.0.push_str("<section><h2>Depth</h2><div class=row>");
    if let Ok(bytes) = fs::read(folder.join("view.png")) {
        page.picture(&bytes, "depth in mm; pale where confidence is low");
    }
    if let Ok(confidence) = map::read(&folder.join("confidence.npy")) {
        page.picture(&colours(confidence.view(), [0.0, 1.0])?, "confidence, dark = 0 to bright = 1");
    }
    if let Some(deviation) = &measured.deviation_mm {
        let largest = pictures::quantile(deviation.view(), 0.98).unwrap_or(1.0);
        let caption = format!("standard deviation, dark = 0 to bright = {largest:.2} mm");
        page.picture(&colours(deviation.view(), [0.0, largest])?, &caption);
    }
    page.0.push_str("</div>");
    let found = region(&measured, Rectangle { x: 0, y: 0, width, height })?;
    page.figures(&found);
    page.0.push_str("<figure class=plot>");
    page.0.push_str(&histogram(measured.depth_mm.view()));
    page.0.push_str("<figcaption>distribution of the depths</figcaption></figure></section>");
    Ok(())
}

fn subtitle(capture: &Capture) -> String {
    let mut parts =
        vec![format!("{} of {} x {} px, {} bit", capture.kind, capture.width, capture.height, capture.bits)];
    parts.push(format!("{} us exposure", capture.exposure_us));
    parts.extend(capture.time.clone());
    parts.extend(
        capture.scene.as_ref().map(|scene| format!("emulated scene {scene}: no hardware was involved")),
    );
    parts.join(" · ")
}

/// A page that grows.
struct Page(String);

impl Page {
    fn begin(title: &str) -> Self {
        let title = escaped(title);
        Self(format!(
            "<!doctype html><html lang=en><head><meta charset=utf-8><title>{title}</title>\
             <meta name=viewport content=\"width=device-width,initial-scale=1\"><style>{STYLE}</style></head><body><main>"
        ))
    }

    fn picture(&mut self, png: &[u8], caption: &str) {
        let (data, caption) = (STANDARD.encode(png), escaped(caption));
        let _ = write!(
            self.0,
            "<figure><img src=\"data:image/png;base64,{data}\" alt=\"{caption}\"><figcaption>{caption}</figcaption></figure>"
        );
    }

    fn figures(&mut self, found: &RegionFigures) {
        let mm = |value: Option<f64>| value.map_or_else(|| "-".into(), |value| format!("{value:.3} mm"));
        let mut rows = vec![
            ("fill rate", format!("{:.2} %", 100.0 * found.fill_rate)),
            ("mean depth", mm(found.mean_mm)),
            ("standard deviation", mm(found.standard_deviation_mm)),
            ("predicted deviation (RMS)", mm(found.predicted_deviation_mm)),
        ];
        if let Some([low, high]) = found.range_mm {
            rows.push(("range", format!("{low:.2} to {high:.2} mm")));
        }
        if let Some(plane) = &found.plane {
            rows.push(("plane fit: RMS", mm(Some(plane.rms_mm))));
            rows.push(("plane fit: tilt", format!("{:.3}°", plane.tilt_deg)));
        }
        self.0.push_str("<table>");
        for (name, value) in rows {
            let _ = write!(self.0, "<tr><th>{name}</th><td>{value}</td></tr>");
        }
        self.0.push_str("</table>");
    }

    fn end(mut self) -> String {
        let _ = write!(self.0, "<footer>{MADE_BY}</footer></main></body></html>");
        self.0
    }
}

/// A text as it may stand in a page, also inside quotes.
fn escaped(text: &str) -> String {
    text.chars().fold(String::with_capacity(text.len()), |mut escaped, letter| {
        match letter {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            '\'' => escaped.push_str("&#39;"),
            letter => escaped.push(letter),
        }
        escaped
    })
}

#[cfg(test)]
mod tests {
    use farnear_files::{image_file::encode_png, npy};
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
        let settings = ReportSettings { capture: folder.path().into(), out: out.clone() };
        let found = write_page(&settings);
        let page = fs::read_to_string(&out).unwrap();
        assert_eq!((found.pictures, found.bytes), (4, page.len()));
        assert!(
            page.contains("★★★</b> &lt;script&gt;alert(&#39;x&#39;)") && !page.contains("<script"),
            "{page}"
        );
        assert!(!page.contains("http:") && !page.contains("https:"), "nothing is fetched");
        assert!(page.contains("<td>95.00 %</td>") && page.contains("<td>0.700 mm</td>"));
        assert!(page.contains("scene = &quot;staircase&quot;"));
    }

    fn write_page(settings: &ReportSettings) -> ReportFigures {
        write(settings).unwrap()
    }

    #[test]
    fn what_is_no_capture_leaves_no_page() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("report.html");
        let settings = ReportSettings { capture: folder.path().join("absent"), out: out.clone() };
        assert!(write(&settings).is_err() && !out.exists());
    }
}

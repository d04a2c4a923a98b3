//! Pictures of each cut: silhouette, axis, expected shadow, explanation by body and shadow, and result.

use std::{io::Cursor, path::Path};

use farnear_files::{EncodeError, staging::Staging, text::Writer};
use farnear_shadow::cast::explain;
use farnear_shadow::envelope::Outline;
use farnear_shadow::uncertainty::Uncertainty;
use farnear_shadow::{CameraFile, CutReport, Light, Method};
use farnear_silhouettes::mask::{BoundingBox, Mask};
use image::{ImageFormat, Rgb, RgbImage, imageops};

use crate::error::Result;

const DARK: Rgb<u8> = Rgb([24, 24, 24]);
const INK: Rgb<u8> = Rgb([235, 235, 235]);
const SEEN: Rgb<u8> = Rgb([120, 120, 120]);
const KEPT: Rgb<u8> = Rgb([235, 235, 235]);
const GONE: Rgb<u8> = Rgb([200, 60, 60]);
const THROWN: Rgb<u8> = Rgb([230, 150, 40]);
/// Expected shadow without observed pixels.
const UNSEEN: Rgb<u8> = Rgb([95, 62, 20]);
const LOWER_EDGE: Rgb<u8> = Rgb([255, 170, 0]);
const EDGE: Rgb<u8> = Rgb([90, 170, 255]);
const BOUND: Rgb<u8> = Rgb([140, 200, 140]);

const TEXT_PX: f32 = 15.0;
const GAP_PX: u32 = 8;
/// Stages are enlarged by whole numbers to at least this height, for the caption.
const LEAST_HEIGHT_PX: usize = 240;
const LEAST_WIDTH_PX: u32 = 210;
const MARGIN_PX: usize = 12;

#[derive(Clone, Copy)]
pub(super) struct Stage<'a> {
    pub mask: &'a Mask,
    pub clean: &'a Mask,
    pub camera: &'a CameraFile,
    pub light: Light,
    pub method: Method,
    pub report: &'a CutReport,
    /// Standard deviation of the angle; `None` if unknown.
    pub sure: Option<&'a Uncertainty>,
}

/// Removed when dropped before [`Self::finish`].
pub(super) struct Stages {
    out: Staging,
    writer: Writer,
}

impl Stages {
    pub fn begin(folder: &Path) -> Result<Self> {
        Ok(Self { out: Staging::new_folder(folder)?, writer: Writer::new(TEXT_PX)? })
    }

    pub fn finish(self) -> Result<()> {
        Ok(self.out.finish()?)
    }

    pub fn unchanged(&mut self, file: &str, mask: &Mask, reason: &str) -> Result<()> {
        let frame = Frame::of([0, 0, mask.nrows(), mask.ncols()]);
        let panel = frame.panel(|y, x| if mask[[y, x]] { SEEN } else { DARK });
        self.write(file, &[(vec![format!("mask: {reason}")], panel)])
    }

    pub fn draw(&mut self, file: &str, stage: Stage<'_>) -> Result<()> {
        let explained = match stage.method {
            Method::Thesis => None,
            Method::Hybrid => explain(stage.mask, stage.camera, stage.light)?,
        };
        let frame = Frame::about(stage);
        let report = stage.report;
        let mut panels = vec![(vec!["mask".into()], frame.panel(|y, x| stage.seen(y, x)))];
        panels.push((
            vec!["lower edge, turned".into(), format!("beta {:.1} deg", report.beta_rad.to_degrees())],
            axis(stage, &frame),
        ));
        panels.push((
            vec![
                "shadow expected".into(),
                format!("{:.1} deg{}", report.shadow.eta_rad.to_degrees(), how_sure(stage)),
            ],
            expected(stage, &frame),
        ));
        if let Some(found) = explained {
            let caption = format!("{:.1} % unexplained", 100.0 * found.unexplained);
            let colour = |y, x| match (stage.mask[[y, x]], found.body[[y, x]], found.thrown[[y, x]]) {
                (_, true, _) => KEPT,
                (true, _, true) => THROWN,
                (true, ..) => GONE,
                (.., true) => UNSEEN,
                _ => DARK,
            };
            panels.push((vec!["body and its shadow".into(), caption], frame.panel(colour)));
        }
        let cut = |y, x| match (stage.mask[[y, x]], stage.clean[[y, x]]) {
            (_, true) => KEPT,
            (true, _) => GONE,
            _ => DARK,
        };
        let caption = format!("{:.1} % removed", 100.0 * report.removed_fraction);
        panels.push((vec!["cut".into(), caption], frame.panel(cut)));
        self.write(file, &panels)
    }

    fn write(&mut self, file: &str, panels: &[(Vec<String>, RgbImage)]) -> Result<()> {
        let line = self.writer.height();
        let lines = panels.iter().map(|(caption, _)| caption.len()).max().unwrap_or(0) as u32;
        let top = GAP_PX + lines * line + GAP_PX;
        let cell = |panel: &RgbImage| panel.width().max(LEAST_WIDTH_PX);
        let width = panels.iter().map(|(_, panel)| cell(panel) + GAP_PX).sum::<u32>() + GAP_PX;
        let height = top + panels.iter().map(|(_, panel)| panel.height()).max().unwrap_or(0) + GAP_PX;
        let mut page = RgbImage::from_pixel(width, height, Rgb([60, 60, 60]));
        let mut left = GAP_PX;
        for (caption, panel) in panels {
            for (row, text) in (0_u32..).zip(caption) {
                self.writer.write(&mut page, left, GAP_PX + row * line, text, INK);
            }
            imageops::overlay(&mut page, panel, i64::from(left), i64::from(top));
            left += cell(panel) + GAP_PX;
        }
        let mut png = Cursor::new(Vec::new());
        page.write_to(&mut png, ImageFormat::Png).map_err(EncodeError::of("the stages of a cut"))?;
        Ok(self.out.write(file, &png.into_inner())?)
    }
}

impl Stage<'_> {
    fn seen(self, y: usize, x: usize) -> Rgb<u8> {
        if self.mask[[y, x]] { SEEN } else { DARK }
    }

    /// Standard deviation by first-order propagation: `beta = 3 pi / 4 - eta / 2` (8.20), so eta's is twice beta's.
    fn eta_sd_rad(self) -> Option<f64> {
        self.sure.filter(|sure| sure.first_order_holds).map(|sure| 2.0 * sure.beta_rad)
    }
}

fn how_sure(stage: Stage<'_>) -> String {
    match (stage.sure, stage.eta_sd_rad()) {
        (_, Some(sd_rad)) => format!(" ± {:.1}", sd_rad.to_degrees()),
        (Some(_), None) => ", unsure".into(),
        (None, None) => String::new(),
    }
}

/// The lower edge of the rotated silhouette, and the straight edge used for the cut.
fn axis(stage: Stage<'_>, frame: &Frame) -> RgbImage {
    let mut panel = frame.panel(|y, x| stage.seen(y, x));
    let report = stage.report;
    let width = stage.mask.ncols() as f64;
    let mirrored = report.shadow.mirrored;
    let (sin, cos) = report.beta_rad.sin_cos();
    // Inverse of eq. 8.38: back from the rotated picture.
    let back = |x: f64, y: f64| {
        let at = [x * cos + y * sin, y * cos - x * sin];
        if mirrored { [width - 1.0 - at[0], at[1]] } else { at }
    };
    if let Some(outline) = Outline::new(stage.mask) {
        let lower = outline.lower_edge(report.beta_rad as f32, mirrored.then_some(width as f32));
        for (column, y) in lower.edge.iter().enumerate() {
            let at = back(f64::from(lower.origin) + column as f64 + 0.5, f64::from(*y));
            frame.dot(&mut panel, at, LOWER_EDGE);
        }
    }
    if let Some(limit) = report.edge_px {
        let reach = stage.mask.nrows() as f64 + width;
        frame.line(&mut panel, [back(limit, -reach), back(limit, reach)], EDGE);
    }
    panel
}

/// From the feet to the expected shadow of the head, with one standard deviation to either side.
fn expected(stage: Stage<'_>, frame: &Frame) -> RgbImage {
    let mut panel = frame.panel(|y, x| stage.seen(y, x));
    let shadow = stage.report.shadow;
    let [x, y] = shadow.foot_px;
    let length = shadow.m_px[0].hypot(shadow.m_px[1]);
    let towards = |eta_rad: f64| [x + length * eta_rad.cos(), y + length * eta_rad.sin()];
    if let Some(sd_rad) = stage.eta_sd_rad() {
        for eta_rad in [shadow.eta_rad - sd_rad, shadow.eta_rad + sd_rad] {
            frame.line(&mut panel, [shadow.foot_px, towards(eta_rad)], BOUND);
        }
    }
    frame.line(&mut panel, [shadow.foot_px, shadow.tip_px], THROWN);
    for [dx, dy] in [[3.0, 3.0], [3.0, -3.0]] {
        frame.line(&mut panel, [[x - dx, y - dy], [x + dx, y + dy]], EDGE);
    }
    panel
}

struct Frame {
    top: usize,
    left: usize,
    rows: usize,
    columns: usize,
    times: usize,
}

impl Frame {
    fn about(stage: Stage<'_>) -> Self {
        let (rows, columns) = stage.mask.dim();
        let mut spans = [0, 0, rows, columns];
        if let Some(bounds) = BoundingBox::of(stage.mask.view()) {
            // A tip outside the picture is moved to its edge.
            let inside = |at: f64, most: usize| at.clamp(0.0, most as f64) as usize;
            let [x, y] = stage.report.shadow.tip_px;
            let (x, y) = (inside(x, columns), inside(y, rows));
            spans = [
                bounds.top.min(y).saturating_sub(MARGIN_PX),
                bounds.left.min(x).saturating_sub(MARGIN_PX),
                (bounds.bottom.max(y) + MARGIN_PX).min(rows),
                (bounds.right.max(x) + MARGIN_PX).min(columns),
            ];
        }
        Self::of(spans)
    }

    /// First row and column, one past the last row and column.
    fn of([top, left, bottom, right]: [usize; 4]) -> Self {
        let (rows, columns) = (bottom - top, right - left);
        let times = LEAST_HEIGHT_PX.div_ceil(rows.max(1)).clamp(1, 8);
        Self { top, left, rows, columns, times }
    }

    fn panel(&self, colour: impl Fn(usize, usize) -> Rgb<u8>) -> RgbImage {
        let (width, height) = (self.columns * self.times, self.rows * self.times);
        RgbImage::from_fn(width as u32, height as u32, |x, y| {
            colour(self.top + y as usize / self.times, self.left + x as usize / self.times)
        })
    }

    fn dot(&self, panel: &mut RgbImage, [x, y]: [f64; 2], colour: Rgb<u8>) {
        let times = self.times as f64;
        let place = |at: f64, first: usize| ((at.round() - first as f64) * times) as i64;
        let (left, top) = (place(x, self.left), place(y, self.top));
        let side = 0..self.times as i64;
        for (dx, dy) in side.clone().flat_map(|dx| side.clone().map(move |dy| (dx, dy))) {
            put(panel, left + dx, top + dy, colour);
        }
    }

    /// A line between two positions in the mask, two panel pixels wide.
    fn line(&self, panel: &mut RgbImage, ends: [[f64; 2]; 2], colour: Rgb<u8>) {
        let times = self.times as f64;
        let [[x0, y0], [x1, y1]] =
            ends.map(|[x, y]| [(x + 0.5 - self.left as f64) * times, (y + 0.5 - self.top as f64) * times]);
        // Limit, as a shadow's tip may be arbitrarily far away or NaN.
        const MOST_STEPS: f64 = 1e5;
        let steps = (x1 - x0).abs().max((y1 - y0).abs()).min(MOST_STEPS).ceil().max(1.0);
        for i in 0..=steps as u32 {
            let share = f64::from(i) / steps;
            let (x, y) = ((x0 + share * (x1 - x0)) as i64, (y0 + share * (y1 - y0)) as i64);
            for (dx, dy) in [(0, 0), (1, 0), (0, 1)] {
                put(panel, x + dx, y + dy, colour);
            }
        }
    }
}

fn put(panel: &mut RgbImage, x: i64, y: i64, colour: Rgb<u8>) {
    let (Ok(x), Ok(y)) = (u32::try_from(x), u32::try_from(y)) else { return };
    if let Some(pixel) = panel.get_pixel_mut_checked(x, y) {
        *pixel = colour;
    }
}

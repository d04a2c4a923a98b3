//! One disturbance at a time.

use anyhow::Result;
use farnear_depth::{operators::Operators, prepare::CameraFrames};
use farnear_scene::View;
use ndarray::Array2;
use rayon::prelude::*;

use super::disturb::{Disturbance, PSF, WAYS, take};
use crate::{
    page::{Page, mm},
    rig,
};

const SEED: u64 = 900;
const SIZE: (usize, usize) = (640, 480);

/// Name, disturbance, whether the camera was calibrated, and an error of the optics file.
struct Row {
    name: &'static str,
    disturbance: Disturbance,
    calibrated: bool,
    stated: Option<(&'static str, f64)>,
}

fn rows() -> Vec<Row> {
    let none = Disturbance::default;
    let row = |name, disturbance| Row { name, disturbance, calibrated: false, stated: None };
    let gain = |gain| Disturbance { gain, ..none() };
    let shift = |x: f64| Disturbance { view: View { shift_px: [x, -0.5 * x], ..View::default() }, ..none() };
    let grown = |magnification| Disturbance { view: View { magnification, ..View::default() }, ..none() };
    let turned = |rotation_deg| Disturbance { view: View { rotation_deg, ..View::default() }, ..none() };
    let together = View { shift_px: [8.0, -4.0], magnification: 1.03, rotation_deg: 1.0 };
    let all = Disturbance { gain: 1.5, vignetting: 0.5, view: together, ..none() };
    let response = Disturbance { response: 0.03, ..none() };
    let stated = |name, what, value| Row { stated: Some((what, value)), ..row(name, none()) };
    vec![
        row("nothing", none()),
        row("brightness x 1.02", gain(1.02)),
        row("brightness x 1.05", gain(1.05)),
        row("brightness x 1.2", gain(1.2)),
        row("brightness x 1.5", gain(1.5)),
        row("vignetting 30 %", Disturbance { vignetting: 0.3, ..none() }),
        row("vignetting 50 %", Disturbance { vignetting: 0.5, ..none() }),
        row("shift (0.25, -0.125) px", shift(0.25)),
        row("shift (1, -0.5) px", shift(1.0)),
        row("shift (8, -4) px", shift(8.0)),
        row("magnification 0.1 %", grown(1.001)),
        row("magnification 1 %", grown(1.01)),
        row("magnification 3 %", grown(1.03)),
        row("rotation 0.5 degrees", turned(0.5)),
        row("rotation 1 degree", turned(1.0)),
        row("all at once: x 1.5, 50 %, 8 px, 3 %, 1 degree", all),
        row("lens not telecentric, not told", Disturbance { telecentric: false, ..none() }),
        row("object moved by 3 px", Disturbance { moved_px: 3.0, ..none() }),
        row("pixel response 3 %", response.clone()),
        Row { calibrated: true, ..row("pixel response 3 %, camera calibrated", response) },
        row("JPEG 90", Disturbance { jpeg: Some(90), ..none() }),
        row("JPEG 75", Disturbance { jpeg: Some(75), ..none() }),
        row("JPEG 50", Disturbance { jpeg: Some(50), ..none() }),
        row("300 isolated saturated pixels", Disturbance { hot: 300, ..none() }),
        row("exposure x 1.8", Disturbance { exposure: 1.8, ..none() }),
        row("another scene as second image", Disturbance { unrelated: true, ..none() }),
        row("images exchanged", Disturbance { exchanged: true, ..none() }),
        row(
            "images exchanged, lens not telecentric",
            Disturbance { exchanged: true, telecentric: false, ..none() },
        ),
        stated("k told 10 % too wide", "k", 0.5036),
        stated("blur told twice as wide", "max_blur_px", 5.406),
        stated("f/2.8 told for f/3.9", "blur", 1.39),
    ]
}

pub fn measure(page: &mut Page) -> Result<()> {
    page.heading("One disturbance at a time");
    page.paragraph(
        "The staircase, 640 x 480. Messages are those of the second method; `farnear depth --help` explains them.",
    );
    let measured = rows().par_iter().map(one).collect::<Result<Vec<_>>>()?;
    let head: Vec<String> = ["disturbance".to_owned(), "before".to_owned()]
        .into_iter()
        .chain(WAYS.iter().flat_map(|(name, _)| [(*name).to_owned(), "valid".to_owned()]))
        .chain(["said".to_owned()])
        .collect();
    page.table(1, &head, &measured);
    Ok(())
}

fn one(row: &Row) -> Result<Vec<String>> {
    let taken = take(&"staircase".parse()?, SIZE, &row.disturbance, SEED)?;
    let mut optics = rig::optics(PSF)?;
    let mut text = toml::Table::try_from(optics)?;
    let mut put = |section: &str, key: &str, value: f64| {
        if let Some(table) = text.get_mut(section).and_then(toml::Value::as_table_mut) {
            table.insert(key.to_owned(), value.into());
        }
    };
    match row.stated {
        Some(("k", value)) => put("psf", "k", value),
        Some(("max_blur_px", value)) => put("focus", "max_blur_px", value),
        // With the near focus unchanged a wider aperture means more blur.
        Some((_, factor)) => {
            put("focus", "max_blur_px", optics.max_blur_px() * factor);
            put("lens", "f_number", optics.f_number() / factor);
        }
        None => {}
    }
    if row.stated.is_some() {
        optics = text.try_into()?;
    }
    let operators = Operators::for_optics(&optics)?;
    let camera = match (&taken.response, row.calibrated) {
        (Some(response), true) => {
            // Sixteen even exposures have a noise of 0.3 %.
            Some(CameraFrames::learn(&[Array2::zeros(response.dim())], &[response.mapv(|r| 0.5 * r)])?)
        }
        _ => None,
    };
    let mut cells = vec![row.name.to_owned(), mm(taken.plain(&operators, &optics))];
    let mut messages = Vec::new();
    for way in 0..WAYS.len() {
        let outcome = taken.measure(way, &operators, &optics, camera.as_ref());
        cells.extend([mm(outcome.error_mm), format!("{:.1} %", 100.0 * outcome.valid)]);
        messages = outcome.messages;
    }
    cells.push(messages.join("; "));
    Ok(cells)
}

//! Planes from before to beyond the working range: pixels out of range must be flagged.

use anyhow::Result;
use farnear_depth::operators::Operators;
use rayon::prelude::*;

use super::disturb::{Disturbance, PSF, WAYS, take};
use crate::{
    page::{Page, mm},
    rig,
};

const SEED: u64 = 1000;
const SIZE: (usize, usize) = (320, 240);
const DEPTHS_MM: [f64; 26] = [
    300.0, 400.0, 500.0, 600.0, 700.0, 800.0, 830.0, 850.0, 870.0, 880.0, 884.0, 887.0, 900.0, 910.0, 920.0,
    932.5, 936.0, 940.0, 950.0, 970.0, 1000.0, 1100.0, 1300.0, 1500.0, 3000.0, 5000.0,
];
const CONFIDENT: f32 = 0.5;

pub fn measure(page: &mut Page) -> Result<()> {
    page.heading("Planes from 300 to 5000 mm");
    page.paragraph(
        "The working range ends at 886.81 and 933 mm. *Wrong* is the part of all pixels whose depth is off by more than three of its standard deviations \
         (and 1.5 mm) at a confidence of at least 0.5; *mean confidence* is that of the pixels with a depth.",
    );
    let optics = rig::optics(PSF)?;
    let operators = Operators::for_optics(&optics)?;
    let rows = DEPTHS_MM
        .par_iter()
        .enumerate()
        .map(|(index, depth_mm)| {
            let taken = take(&rig::plane(*depth_mm)?, SIZE, &Disturbance::default(), SEED + index as u64)?;
            let mut cells = vec![format!("{depth_mm}")];
            let mut messages = Vec::new();
            for way in 0..WAYS.len() {
                let outcome = taken.measure(way, &operators, &optics, None);
                let [mut wrong, mut sure, mut valid, mut all] = [0.0_f64; 4];
                if let Some(found) = &outcome.found {
                    for at in taken.counted() {
                        all += 1.0;
                        let error = (found.map.depth_mm[at] - taken.truth[at]).abs();
                        if error.is_finite() {
                            valid += 1.0;
                            sure += f64::from(found.map.confidence[at]);
                            let far_off = error > 3.0 * found.validity.deviation_mm[at] && error > 1.5;
                            wrong += f64::from(u8::from(far_off && found.map.confidence[at] >= CONFIDENT));
                        }
                    }
                }
                cells.extend([
                    mm(outcome.error_mm),
                    format!("{:.1} %", 100.0 * outcome.valid),
                    format!("{:.2} %", 100.0 * wrong / all.max(1.0)),
                    if valid > 0.0 { format!("{:.2}", sure / valid) } else { "-".into() },
                ]);
                messages = outcome.messages;
            }
            cells.push(messages.join("; "));
            Ok(cells)
        })
        .collect::<Result<Vec<_>>>()?;
    let head: Vec<String> = std::iter::once("plane at".to_owned())
        .chain(WAYS.iter().flat_map(|(name, _)| {
            [(*name).to_owned(), "valid".to_owned(), "wrong".to_owned(), "mean confidence".to_owned()]
        }))
        .chain(["said".to_owned()])
        .collect();
    page.table(0, &head, &rows);
    Ok(())
}

//! Random combinations of disturbances.

use anyhow::Result;
use farnear_depth::{operators::Operators, optics::Optics};
use farnear_scene::View;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::disturb::{Disturbance, PSF, WAYS, take};
use crate::{
    page::{Page, median, mm},
    rig,
};

const COMBINATIONS: u64 = 1000;
const SEED: u64 = 5000;
const SIZE: (usize, usize) = (256, 192);
/// Errors above this must be flagged.
const SILENT_MM: f64 = 1.5;

struct Case {
    seed: u64,
    text: String,
    before_mm: f64,
    error_mm: f64,
    valid: f64,
    messages: Vec<String>,
    refused: bool,
}

impl Case {
    /// Wrong without a flag.
    fn silent(&self) -> bool {
        self.error_mm > SILENT_MM && self.messages.is_empty()
    }
}

/// Each kind with a probability of a third.
fn draw(seed: u64) -> (Disturbance, String) {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut parts = Vec::new();
    let mut disturbance = Disturbance::default();
    let sometimes = |random: &mut ChaCha8Rng| random.random_range(0..3) == 0;
    let between = |random: &mut ChaCha8Rng, low: f64, high: f64| low + (high - low) * random.random::<f64>();
    if sometimes(&mut random) {
        disturbance.gain = between(&mut random, 0.67, 1.5);
        parts.push(format!("gain {:.2}", disturbance.gain));
    }
    if sometimes(&mut random) {
        disturbance.vignetting = between(&mut random, 0.0, 0.5);
        parts.push(format!("vignetting {:.2}", disturbance.vignetting));
    }
    if sometimes(&mut random) {
        let shift_px = [between(&mut random, -8.0, 8.0), between(&mut random, -8.0, 8.0)];
        disturbance.view = View { shift_px, ..disturbance.view };
        parts.push(format!("shift {:.1}, {:.1}", shift_px[0], shift_px[1]));
    }
    if sometimes(&mut random) {
        disturbance.view.magnification = between(&mut random, 0.97, 1.03);
        parts.push(format!("magnification {:.3}", disturbance.view.magnification));
    }
    if sometimes(&mut random) {
        disturbance.view.rotation_deg = between(&mut random, -1.0, 1.0);
        parts.push(format!("rotation {:.2}", disturbance.view.rotation_deg));
    }
    if sometimes(&mut random) {
        disturbance.moved_px = between(&mut random, 2.0, 6.0);
        parts.push(format!("object moved {:.1}", disturbance.moved_px));
    }
    if sometimes(&mut random) {
        disturbance.hot = random.random_range(1..60);
        parts.push(format!("{} hot pixels", disturbance.hot));
    }
    if sometimes(&mut random) {
        let quality = random.random_range(80..=98);
        disturbance.jpeg = Some(quality);
        parts.push(format!("JPEG {quality}"));
    }
    if sometimes(&mut random) {
        disturbance.response = between(&mut random, 0.0, 0.03);
        parts.push(format!("response {:.3}", disturbance.response));
    }
    (disturbance, parts.join(", "))
}

pub fn measure(page: &mut Page) -> Result<()> {
    page.heading("Combinations by chance");
    let optics = rig::optics(PSF)?;
    let operators = Operators::for_optics(&optics)?;
    let cases = (SEED..SEED + COMBINATIONS)
        .into_par_iter()
        .map(|seed| case(seed, &operators, &optics))
        .collect::<Result<Vec<_>>>()?;
    let part = |wanted: &dyn Fn(&Case) -> bool| cases.iter().filter(|case| wanted(case)).count();
    let middle =
        |of: fn(&Case) -> f64| median(cases.iter().map(of).filter(|value| value.is_finite()).collect());
    let silent: Vec<&Case> = cases.iter().filter(|case| case.silent()).collect();
    page.paragraph(&format!(
        "{COMBINATIONS} pairs of {} x {} px (staircase, slant, cone or a plane), each disturbance with a probability of a third, from the seeds {SEED} on. By the \
         second way {} have an error below 0.75 mm, {} one above {SILENT_MM} mm, of which {} are silent; {} are refused. The median of the error falls from \
         {} to {} mm. The silent ones, and the ten worst:",
        SIZE.0,
        SIZE.1,
        part(&|case| case.error_mm < 0.75),
        part(&|case| case.error_mm > SILENT_MM),
        silent.len(),
        part(&|case| case.refused),
        mm(middle(|case| case.before_mm)),
        mm(middle(|case| case.error_mm)),
    ));
    let mut worst: Vec<&Case> = cases.iter().filter(|case| case.error_mm.is_finite()).collect();
    worst.sort_by(|a, b| b.error_mm.total_cmp(&a.error_mm));
    let listed = silent.iter().copied().chain(worst.into_iter().filter(|case| !case.silent()).take(10));
    let rows: Vec<Vec<String>> = listed
        .map(|case| {
            vec![
                case.seed.to_string(),
                case.text.clone(),
                mm(case.before_mm),
                mm(case.error_mm),
                format!("{:.0} %", 100.0 * case.valid),
                case.messages.join("; "),
            ]
        })
        .collect();
    page.table(2, &["seed", "disturbances", "before", "after", "valid", "said"], &rows);
    Ok(())
}

fn case(seed: u64, operators: &Operators, optics: &Optics) -> Result<Case> {
    let (disturbance, text) = draw(seed);
    let scene = match seed % 4 {
        0 => "staircase".parse()?,
        1 => "slant".parse()?,
        2 => "cone".parse()?,
        _ => rig::plane(890.0 + (seed % 41) as f64)?,
    };
    let taken = take(&scene, SIZE, &disturbance, seed)?;
    let outcome = taken.measure(WAYS.len() - 1, operators, optics, None);
    Ok(Case {
        seed,
        text,
        before_mm: taken.plain(operators, optics),
        error_mm: outcome.error_mm,
        valid: outcome.valid,
        messages: outcome.messages,
        refused: outcome.found.is_none(),
    })
}

use std::collections::HashMap;

use farnear_files::{masks, staging::Staging};
use farnear_silhouettes::mask::{
    Mask,
    centre::{SIDE_PX, centred},
    regions::{Connectivity, regions},
};
use farnear_silhouettes::silhouette::{
    capsule::Point3,
    parts,
    redundant::remove_redundant,
    template::Template,
    view::{Canvas, View},
};
use rayon::prelude::*;

use super::{
    super::{SilhouettesError, cut_out},
    MarkersRequest,
};
use crate::{context::Context, counter::Counter, error::Result};

const MARGIN_PX: usize = 2;
/// Gaps closed in the thesis, and with thick parts.
const CLOSED_MM: f64 = 126.0;
const CLOSED_BETWEEN_THICK_PARTS_MM: f64 = 40.0;
const UNIT: &str = "masks";
const DURING: &str = "drawing silhouettes";
/// Largest number of silhouettes of which every two are compared: their differences need 1.8 GB.
const MOST_COMPARED: usize = 30_000;

pub struct Job<'a> {
    pub settings: &'a MarkersRequest,
    pub views: usize,
    pub template: &'a Template,
    pub frames: &'a [HashMap<&'a str, Point3>],
    /// Frame names, by their numbers in the recording.
    pub names: &'a [String],
    pub context: &'a Context<'a>,
}

impl Job<'_> {
    /// Draws a folder of masks per view.
    pub fn sequences(&self, views: &[View], out: &Staging) -> Result<Drawn> {
        let counter = Counter::new(self.context, UNIT);
        let drawn: Result<Vec<Drawn>> = views
            .par_iter()
            .enumerate()
            .map(|(index, view)| self.sequence(view, &format!("view{}", index + 1), out, &counter))
            .collect();
        let add = |sum: Drawn, next: Drawn| Drawn {
            silhouettes: sum.silhouettes + next.silhouettes,
            in_pieces: sum.in_pieces + next.in_pieces,
        };
        Ok(drawn?.into_iter().fold(Drawn::default(), add))
    }

    fn sequence(&self, view: &View, folder: &str, out: &Staging, counter: &Counter<'_>) -> Result<Drawn> {
        let canvas = self.canvas(view)?;
        out.make_folder(folder)?;
        let mut drawn = Drawn::default();
        for (frame, name) in self.frames.iter().zip(self.names) {
            counter.check(DURING)?;
            let mask = self.mask(frame, view, &canvas);
            drawn.silhouettes += usize::from(mask.iter().any(|&set| set));
            drawn.in_pieces += usize::from(is_in_pieces(&mask));
            let mask = if self.settings.centred { cut_out(&mask) } else { mask };
            out.write(&format!("{folder}/{name}.png"), &masks::png(&mask)?)?;
            counter.one(Some(self.views * self.frames.len()));
        }
        Ok(drawn)
    }

    /// Draws the `keep` least similar silhouettes of all views into one folder; returns their number.
    pub fn gallery(&self, views: &[View], keep: usize, out: &Staging) -> Result<usize> {
        check_compared(self.frames.len(), self.views, self.settings.every)?;
        let counter = Counter::new(self.context, UNIT);
        let all: Result<Vec<Vec<(String, Mask)>>> = views
            .par_iter()
            .enumerate()
            .map(|(index, view)| self.cut_outs(view, &format!("view{}", index + 1), &counter))
            .collect();
        let (names, pictures): (Vec<String>, Vec<Mask>) = all?.into_iter().flatten().unzip();
        let kept = remove_redundant(&pictures, keep);
        for &index in &kept {
            out.write(&names[index], &masks::png(&pictures[index])?)?;
        }
        Ok(kept.len())
    }

    fn cut_outs(&self, view: &View, prefix: &str, counter: &Counter<'_>) -> Result<Vec<(String, Mask)>> {
        let canvas = self.canvas(view)?;
        let mut named = Vec::new();
        for (frame, name) in self.frames.iter().zip(self.names) {
            counter.check(DURING)?;
            if let Some(mask) = centred(self.mask(frame, view, &canvas).view(), SIDE_PX) {
                named.push((format!("{prefix}_{name}.png"), mask));
            }
            counter.one(Some(self.views * self.frames.len()));
        }
        Ok(named)
    }

    fn mask(&self, frame: &HashMap<&str, Point3>, view: &View, canvas: &Canvas) -> Mask {
        let drawn = parts::draw(frame, self.template, view, canvas, self.settings.fill);
        let thick = self.template.parts.iter().any(|part| part.thickness_mm > 0.0);
        let usual_mm = if thick { CLOSED_BETWEEN_THICK_PARTS_MM } else { CLOSED_MM };
        let gap_px = (self.settings.close_mm.unwrap_or(usual_mm) / self.settings.mm_per_px).round() as usize;
        parts::close(&drawn.mask, gap_px)
    }

    fn canvas(&self, view: &View) -> Result<Canvas> {
        let reach = parts::extent(self.frames, self.template, view);
        let mm_per_px = self.settings.mm_per_px;
        let canvas = Canvas::fitting(&reach, mm_per_px, MARGIN_PX);
        Ok(canvas.ok_or_else(|| SilhouettesError::too_large("the recording", &reach, mm_per_px))?)
    }
}

/// Masks with a person, and those of them whose person is in several pieces.
#[derive(Clone, Copy, Default)]
pub struct Drawn {
    pub silhouettes: usize,
    pub in_pieces: usize,
}

fn is_in_pieces(mask: &Mask) -> bool {
    /// A finger's end is smaller.
    const LEAST_SHARE: f64 = 0.005;
    let pieces = regions(mask.view(), true, Connectivity::Eight);
    let least = LEAST_SHARE * pieces.iter().map(|piece| piece.area).sum::<usize>() as f64;
    pieces.iter().filter(|piece| piece.area as f64 >= least).count() > 1
}

/// Refuses more silhouettes than can be compared, with a step between frames that fits.
fn check_compared(frames: usize, views: usize, every: usize) -> Result<(), SilhouettesError> {
    let (count, limit) = (frames * views, MOST_COMPARED);
    if count <= limit {
        return Ok(());
    }
    let every = every * frames.div_ceil((limit / views).max(1));
    Err(SilhouettesError::TooMany { count, limit, every })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_person_of_separate_parts_is_in_pieces() {
        let mask = |gap: std::ops::Range<usize>| {
            Mask::from_shape_fn((100, 20), |(row, _)| (10..90).contains(&row) && !gap.contains(&row))
        };
        assert!(!is_in_pieces(&mask(0..100)) && !is_in_pieces(&mask(0..0)));
        assert!(is_in_pieces(&mask(40..60)));
        let mut fingertip = mask(0..0);
        fingertip[[95, 3]] = true;
        assert!(!is_in_pieces(&fingertip));
    }

    #[test]
    fn more_silhouettes_than_can_be_compared_are_refused_with_a_step_that_fits() {
        assert!(check_compared(3750, 8, 1).is_ok());
        let error = check_compared(20_000, 8, 2).expect_err("too many").to_string();
        assert!(error.starts_with("160000 silhouettes") && error.contains("30000"), "{error}");
        assert!(error.contains("--every 12"), "{error}");
        assert!(check_compared(20_000_usize.div_ceil(6), 8, 12).is_ok());
    }
}

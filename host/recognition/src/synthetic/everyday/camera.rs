//! Camera effects: perspective, image border, segmentation.

use crate::clip::Track;
use crate::embedding::descriptor::Scaling;
use farnear_silhouettes::mask::{BoundingBox, Mask};
use farnear_silhouettes::silhouette::{
    capsule::{Capsule, Point3},
    parts::{self, Fill},
    raster::Point,
    template::Template,
    view::{Canvas, View, draw, extent},
};
use farnear_silhouettes::synthetic::damage::{Damage, damaged};
use ndarray::s;
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use std::collections::HashMap;

#[derive(Clone, Copy, Debug)]
pub struct Camera {
    view: View,
    distance_mm: f64,
    target_mm: f64,
    person_px: f64,
    segmentation: Segmentation,
    /// Parts of the standing person cut off by the image border: below, and at a side.
    cut: [f64; 2],
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Segmentation {
    Clean,
    Ragged,
    Broken,
    Both,
}

impl Camera {
    /// Random camera: 2.5 to 12 m away, 0.5 to 3 m high, level to 35 deg down.
    pub fn drawn(rng: &mut ChaCha8Rng) -> Self {
        let distance_mm = rng.random_range(2.5_f64.ln()..12.0_f64.ln()).exp() * 1000.0;
        // Half of the cameras are near eye level, the others at any height.
        let height_mm = if rng.random_bool(0.5) {
            rng.random_range(900.0..1700.0)
        } else {
            rng.random_range(500.0..3000.0)
        };
        let target_mm = 900.0;
        let elevation = ((height_mm - target_mm) / distance_mm).atan().to_degrees();
        let segmentation = match rng.random_range(0..10) {
            0..5 => Segmentation::Clean,
            5..7 => Segmentation::Ragged,
            7..9 => Segmentation::Broken,
            _ => Segmentation::Both,
        };
        let below = if rng.random_bool(0.2) { rng.random_range(0.05..0.45) } else { 0.0 };
        let beside = if rng.random_bool(0.12) { rng.random_range(0.05..0.3) } else { 0.0 };
        Self {
            view: View {
                alpha_deg: elevation,
                beta_deg: rng.random_range(-2.5..2.5),
                gamma_deg: rng.random_range(0.0..360.0),
            },
            distance_mm,
            target_mm,
            person_px: rng.random_range(36.0_f64.ln()..120.0_f64.ln()).exp(),
            segmentation,
            cut: [below, beside],
        }
    }

    /// The same camera moved around to this side.
    #[must_use]
    pub fn seen_from(self, gamma_deg: f64) -> Self {
        Self { view: View { gamma_deg, ..self.view }, ..self }
    }

    /// Image of a point in the target plane, and its magnification.
    fn seen(&self, matrix: &[[f64; 3]; 3], p: Point3) -> (Point3, f64) {
        let p = [p[0], p[1], p[2] - self.target_mm];
        let [x, depth, z] =
            std::array::from_fn(|i| matrix[i][0] * p[0] + matrix[i][1] * p[1] + matrix[i][2] * p[2]);
        // A person comes no nearer than a third of the way.
        let scale = self.distance_mm / (self.distance_mm + depth).max(0.33 * self.distance_mm);
        ([scale * x, 0.0, scale * z], scale)
    }

    fn image(&self, body: &[Capsule]) -> Vec<Capsule> {
        let matrix = self.view.matrix();
        body.iter()
            .map(|capsule| {
                let ((from, a), (to, b)) = (self.seen(&matrix, capsule.from), self.seen(&matrix, capsule.to));
                Capsule::new(from, to, 0.5 * (a + b) * capsule.radius_mm)
            })
            .collect()
    }

    /// Segmented clip in whole frames, so that the box's motion is kept.
    pub fn track(
        &self,
        bodies: &[Vec<Capsule>],
        stature_mm: f64,
        scaling: Scaling,
        rng: &mut ChaCha8Rng,
    ) -> Track {
        let images: Vec<Vec<Capsule>> = bodies.iter().map(|body| self.image(body)).collect();
        let level = View::default();
        let reach: Vec<Point> = images.iter().flat_map(|image| extent(image, &level)).collect();
        let drawn = |canvas: &Canvas| images.iter().map(|image| draw(image, &level, canvas)).collect();
        self.filmed(&reach, stature_mm, drawn, scaling, rng)
    }

    /// [`Self::track`] for the parts of a suit; closes gaps between parts up to `gap_mm`.
    pub fn track_of_parts(
        &self,
        frames: &[HashMap<&str, Point3>],
        (template, gap_mm): (&Template, f64),
        stature_mm: f64,
        scaling: Scaling,
        rng: &mut ChaCha8Rng,
    ) -> Track {
        let (matrix, level) = (self.view.matrix(), View::default());
        let image = |frame: &HashMap<&'_ str, Point3>| -> HashMap<String, Point3> {
            frame.iter().map(|(name, p)| ((*name).to_owned(), self.seen(&matrix, *p).0)).collect()
        };
        let owned: Vec<HashMap<String, Point3>> = frames.iter().map(image).collect();
        let images: Vec<HashMap<&str, Point3>> =
            owned.iter().map(|frame| frame.iter().map(|(name, p)| (name.as_str(), *p)).collect()).collect();
        let reach = parts::extent(&images, template, &level);
        let drawn = |canvas: &Canvas| {
            let gap_px = (gap_mm / canvas.mm_per_px).round() as usize;
            let one =
                |image| parts::close(&parts::draw(image, template, &level, canvas, Fill::Hull).mask, gap_px);
            images.iter().map(one).collect()
        };
        self.filmed(&reach, stature_mm, drawn, scaling, rng)
    }

    fn filmed(
        &self,
        reach: &[Point],
        stature_mm: f64,
        drawn: impl FnOnce(&Canvas) -> Vec<Mask>,
        scaling: Scaling,
        rng: &mut ChaCha8Rng,
    ) -> Track {
        let Some(canvas) = Canvas::fitting(reach, stature_mm / self.person_px, 2) else {
            return Track::from_masks(&[], scaling, true);
        };
        let below = canvas.height_px.saturating_sub((self.cut[0] * self.person_px) as usize);
        let beside = (self.cut[1] * canvas.width_px as f64) as usize;
        let masks: Vec<Mask> = drawn(&canvas)
            .into_iter()
            .map(|whole| {
                let framed = whole.slice(s![..below.max(8).min(canvas.height_px), beside..]).to_owned();
                self.segmented(framed, rng)
            })
            .filter(|mask| large_enough(mask, self.person_px))
            .collect();
        Track::from_masks(&masks, scaling, true)
    }

    fn segmented(&self, mask: Mask, rng: &mut ChaCha8Rng) -> Mask {
        let mut mask = mask;
        if matches!(self.segmentation, Segmentation::Broken | Segmentation::Both) {
            mask = damaged(&mask, Damage::Broken, rng.random());
        }
        if matches!(self.segmentation, Segmentation::Ragged | Segmentation::Both) && self.person_px > 60.0 {
            mask = damaged(&mask, Damage::Ragged, rng.random());
        }
        mask
    }
}

fn large_enough(mask: &Mask, person_px: f64) -> bool {
    BoundingBox::of(mask.view())
        .is_some_and(|bounds| bounds.height().max(bounds.width()) as f64 > 0.3 * person_px)
}

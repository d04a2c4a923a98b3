//! Removes the shadow from a silhouette: `thesis` (Li 2014, section 8.2.4) and `hybrid`, the default.
//! - `thesis`: run-point cut at angles within beta plus or minus its standard deviation, at most 10 degrees
//!   apart; the longest run wins. Shadows straight down are cut by length. Removes a good part of the person
//!   if legs break the run.
//! - `hybrid`: with a known light position the silhouette is split into body and cast shadow
//!   ([`super::cast`]); for sideways shadows a run-point cut over +-3 degrees removes the rest. Otherwise
//!   sideways shadows (|sin eta| < 0.45) get this cut, or a half-plane through the feet if it would remove
//!   more than 60 %; others get the half-plane, whose edge is the bisector of body and shadow. For a shadow
//!   pointing away only a person-wide strip of ground is cut. Frames with shadows behind the person are
//!   flagged: they need colour.
//!
//! Angles are evaluated on the outline ([`super::envelope`]): a fraction of a millisecond for 640 x 480.

use super::camera::CameraFile;
use super::cast;
use super::envelope::{Outline, clear_left_of, row_extent};
use super::light::Light;
use super::projection::{self, ImageShadow, ShadowError, Subject};
use farnear_silhouettes::mask::Mask;
use serde::{Deserialize, Serialize};
use std::f64::consts::{FRAC_PI_2, PI};

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Method {
    /// Body and cast shadow, else by angles.
    #[default]
    Hybrid,
    Thesis,
}

farnear_silhouettes::named!(Method, "shadow method", "hybrid" => Hybrid, "thesis" => Thesis);

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct CutReport {
    pub beta_rad: f64,
    /// Share of the silhouette, 0 to 1.
    pub removed_fraction: f64,
    /// Half-plane through the feet instead of the run point.
    pub half_plane: bool,
    /// Pixels with `x cos beta - y sin beta` below it were cut, px, x from the right in mirrored pictures.
    pub edge_px: Option<f64>,
    /// Share not explained by body and shadow, 0 to 1; `None` for a cut by angles.
    pub unexplained: Option<f64>,
    /// Share of the visible cast shadow outside the silhouette, 0 to 1; `None` for a cut by angles.
    pub missing: Option<f64>,
    pub shadow: ImageShadow,
    pub subject: Subject,
    /// False if more than 60 % was removed, or if the shadow points away or is shortened: check the frame.
    pub trustworthy: bool,
}

struct Edge {
    beta_rad: f64,
    limit: Option<f32>,
    half_plane: bool,
}

/// Largest |sin eta| of a sideways shadow.
pub const SIDEWAYS: f64 = 0.45;
/// Smoothing window of the lower edge's gradient, columns.
const GRADIENT_WINDOW: usize = 9;

/// Distance and offset of the subject, from its head's width and row.
pub fn subject_of(mask: &Mask, file: &CameraFile) -> Result<Subject, ShadowError> {
    let outline = checked_outline(mask, file)?;
    Ok(estimate_subject(mask, &outline, file))
}

fn checked_outline(mask: &Mask, file: &CameraFile) -> Result<Outline, ShadowError> {
    let (mask_height, mask_width) = mask.dim();
    let (camera_height, camera_width) = (file.camera.height_px, file.camera.width_px);
    if (mask_height, mask_width) != (camera_height, camera_width) {
        return Err(ShadowError::Shape { mask_height, mask_width, camera_height, camera_width });
    }
    Outline::new(mask).ok_or(ShadowError::EmptyMask)
}

/// Removes the shadow of the single subject in `mask`. `beta_sd_rad` is the standard deviation of the cutting
/// angle ([`super::uncertainty`]), used by `thesis` only. Fails for an empty mask or another shape, a sun
/// below [`projection::LOWEST_SUN_DEG`], or a lamp below the head.
pub fn remove(
    mask: &Mask,
    file: &CameraFile,
    light: impl Into<Light>,
    beta_sd_rad: f64,
    method: Method,
) -> Result<(Mask, CutReport), ShadowError> {
    let camera = &file.camera;
    let outline = checked_outline(mask, file)?;
    let light = light.into();
    let explained = match method {
        Method::Thesis => None,
        Method::Hybrid => cast::explain(mask, file, light)?,
    };
    let subject = match &explained {
        Some(found) => found.subject,
        None => estimate_subject(mask, &outline, file),
    };
    let reach_px = |foot_px, eta_rad| reach_px(mask, &outline, foot_px, eta_rad);
    let shadow = light.shadow_of(subject, camera, reach_px)?;
    let mut out = mask.clone();
    let edge = match (method, &explained) {
        (Method::Thesis, _) => thesis(mask, &mut out, &outline, &shadow, beta_sd_rad),
        (Method::Hybrid, None) => hybrid(mask, &mut out, &outline, &shadow),
        (Method::Hybrid, Some(found)) => explained_cut(mask, &mut out, &outline, &shadow, found),
    };
    let left = farnear_silhouettes::mask::area(out.view());
    let removed_fraction = 1.0 - left as f64 / outline.area as f64;
    let away = shadow.eta_rad.sin() < -SIDEWAYS;
    Ok((
        out,
        CutReport {
            beta_rad: edge.beta_rad,
            removed_fraction,
            half_plane: edge.half_plane,
            edge_px: edge.limit.map(f64::from),
            unexplained: explained.as_ref().map(|found| found.unexplained),
            missing: explained.map(|found| found.missing),
            shadow,
            subject,
            trustworthy: removed_fraction <= 0.6 && !away && !shadow.shortened,
        },
    ))
}

/// Extent of the silhouette from the feet in the measured direction: the largest shadow length, px.
fn reach_px(mask: &Mask, outline: &Outline, foot_px: [f64; 2], eta_rad: f64) -> f64 {
    let (sin, cos) = eta_rad.sin_cos();
    let (top, bottom, left, right) = outline.bounds;
    let set = (top..=bottom).flat_map(|y| (left..=right).map(move |x| [y, x])).filter(|place| mask[*place]);
    set.map(|[y, x]| (x as f64 - foot_px[0]) * cos + (y as f64 - foot_px[1]) * sin).fold(0.0, f64::max)
}

/// Distance and offset from the head's width (8.17) and row, weighted by their precision.
fn estimate_subject(mask: &Mask, outline: &Outline, file: &CameraFile) -> Subject {
    let (top, bottom, _, _) = outline.bounds;
    // The head is about the top seventh; the widest row of the top tenth is its width, or less with thin
    // hair.
    let rows = ((bottom - top) / 12).max(2);
    let (mut widest, mut centre) = (1.0_f64, outline.bounds.2 as f64);
    for y in top..=(top + rows).min(bottom) {
        let row = mask.row(y);
        let Some((first, last)) = row.as_slice().and_then(row_extent) else {
            continue;
        };
        let width = (last - first + 1) as f64;
        if width > widest {
            (widest, centre) = (width, 0.5 * (first + last) as f64);
        }
    }
    let sd = &file.standard_deviations;
    let by_width = projection::distance_from_head_m(file, widest);
    let width_weight =
        (sd.head_width_m / file.subject.head_width_m).hypot((sd.head_width_px + 1.0) / widest).powi(-2);
    let (mut sum, mut weights) = (width_weight / by_width, width_weight);
    if let Some(by_row) = projection::distance_from_head_row_m(file, top as f64 - 0.5) {
        let above = (file.subject.height_m - file.camera.height_m).abs();
        let weight = (sd.subject_height_m.hypot(sd.camera_height_m) / above).powi(-2);
        sum += weight / by_row;
        weights += weight;
    }
    let distance_m = file.subject.distance_m.unwrap_or(weights / sum);
    let slope = (centre - file.camera.principal_point()[0]) / file.camera.focal_px();
    Subject { distance_m, offset_m: slope * distance_m, height_m: file.subject.height_m }
}

fn thesis(mask: &Mask, out: &mut Mask, outline: &Outline, shadow: &ImageShadow, sd_rad: f64) -> Edge {
    /// Largest step within beta's range.
    const STEP_RAD: f64 = 10.0 * PI / 180.0;
    /// "Close to 90 degrees": cut by length.
    const VERTICAL_RAD: f64 = 10.0 * PI / 180.0;
    if (shadow.eta_rad - FRAC_PI_2).abs() < VERTICAL_RAD {
        let bottom = outline.bounds.1 as f64;
        let limit = -(bottom - shadow.m_px[1].max(0.0)) as f32;
        clear_left_of(out, FRAC_PI_2 as f32, limit, false);
        return Edge { beta_rad: FRAC_PI_2, limit: Some(limit), half_plane: true };
    }
    let flip = shadow.mirrored.then_some(mask.ncols() as f32);
    let sd_rad = sd_rad.abs().min(FRAC_PI_2);
    // Also for a step above the range: its middle and both ends.
    let steps = (sd_rad / STEP_RAD).ceil().max(1.0) as i32;
    let angles = (-steps..=steps).map(|i| shadow.beta_rad + sd_rad * f64::from(i) / f64::from(steps));
    let Some((beta_rad, limit)) = longest_run(outline, flip, angles) else {
        return Edge { beta_rad: shadow.beta_rad, limit: None, half_plane: false };
    };
    clear_left_of(out, beta_rad as f32, limit, shadow.mirrored);
    Edge { beta_rad, limit: Some(limit), half_plane: false }
}

/// Angle of the longest run of negative slope, and its end. Beta is in [pi/2, pi] (8.20).
fn longest_run(
    outline: &Outline,
    flip: Option<f32>,
    angles: impl Iterator<Item = f64>,
) -> Option<(f64, f32)> {
    let clamped = angles.map(|beta| beta.clamp(FRAC_PI_2, PI));
    let found: Vec<(f64, (usize, f32))> = clamped
        .map(|beta| (beta, outline.lower_edge(beta as f32, flip).rotation_point(GRADIENT_WINDOW)))
        .collect();
    let middle = found.len() / 2;
    let from_middle =
        found.iter().enumerate().max_by_key(|(i, (_, (run, _)))| (*run, usize::MAX - i.abs_diff(middle)));
    from_middle.map(|(_, &(beta, (_, limit)))| (beta, limit))
}

fn degrees_about(beta_rad: f64) -> impl Iterator<Item = f64> {
    (-3..=3).map(move |i| beta_rad + f64::from(i).to_radians())
}

/// Clears pixels beyond the run point of a sideways shadow; `None` for others, or if more than 60 % would go.
fn clear_sideways(mask: &Mask, out: &mut Mask, outline: &Outline, shadow: &ImageShadow) -> Option<Edge> {
    if shadow.eta_rad.sin().abs() >= SIDEWAYS {
        return None;
    }
    let flip = shadow.mirrored.then_some(mask.ncols() as f32);
    let (beta_rad, limit) = longest_run(outline, flip, degrees_about(shadow.beta_rad))?;
    let gone = clear_left_of(out, beta_rad as f32, limit, shadow.mirrored);
    if gone as f64 > 0.6 * outline.area as f64 {
        out.assign(mask);
        return None;
    }
    Some(Edge { beta_rad, limit: Some(limit), half_plane: false })
}

/// Removes all but the body; near the feet of a sideways shadow also beyond the run point.
fn explained_cut(
    mask: &Mask,
    out: &mut Mask,
    outline: &Outline,
    shadow: &ImageShadow,
    found: &cast::Explanation,
) -> Edge {
    let no_edge = Edge { beta_rad: shadow.beta_rad, limit: None, half_plane: false };
    let edge = clear_sideways(mask, out, outline, shadow).unwrap_or(no_edge);
    out.zip_mut_with(&found.body, |left, &body| *left &= body);
    edge
}

fn hybrid(mask: &Mask, out: &mut Mask, outline: &Outline, shadow: &ImageShadow) -> Edge {
    if let Some(edge) = clear_sideways(mask, out, outline, shadow) {
        return edge;
    }
    let edge = half_plane(mask, out, shadow);
    if shadow.eta_rad.sin() < -SIDEWAYS {
        give_back_the_body(mask, out, outline, shadow);
    }
    edge
}

/// Restores pixels outside the strip from feet to tip: the half-plane also removes part of the upper body.
fn give_back_the_body(mask: &Mask, out: &mut Mask, outline: &Outline, shadow: &ImageShadow) {
    /// Of the stature: a person with arms and stride.
    const HALF_WIDTH: f64 = 0.17;
    /// Of the stature: the head is round, its shadow extends beyond that of its top.
    const BEYOND: f64 = 0.04;
    let half_width = HALF_WIDTH * shadow.height_px;
    let (sin, cos) = shadow.eta_rad.sin_cos();
    let length = shadow.m_px[0].hypot(shadow.m_px[1]) + BEYOND * shadow.height_px;
    let (top, bottom, left, right) = outline.bounds;
    for y in top..=bottom {
        for x in left..=right {
            if !mask[[y, x]] || out[[y, x]] {
                continue;
            }
            let (dx, dy) = (x as f64 - shadow.foot_px[0], y as f64 - shadow.foot_px[1]);
            let (along, across) = (dx * cos + dy * sin, dy * cos - dx * sin);
            out[[y, x]] = across.abs() > half_width || along > length;
        }
    }
}

fn half_plane(mask: &Mask, out: &mut Mask, shadow: &ImageShadow) -> Edge {
    let (sin, cos) = shadow.beta_rad.sin_cos();
    let x = if shadow.mirrored { mask.ncols() as f64 - 1.0 - shadow.foot_px[0] } else { shadow.foot_px[0] };
    let limit = (x * cos - shadow.foot_px[1] * sin) as f32;
    clear_left_of(out, shadow.beta_rad as f32, limit, shadow.mirrored);
    Edge { beta_rad: shadow.beta_rad, limit: Some(limit), half_plane: true }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FOOT: [f64; 2] = [60.0, 90.0];
    const LENGTH_PX: f64 = 40.0;

    fn shadow_at(eta_rad: f64) -> ImageShadow {
        let (sin, cos) = eta_rad.sin_cos();
        let m_px = [LENGTH_PX * cos, LENGTH_PX * sin];
        ImageShadow {
            foot_px: FOOT,
            tip_px: [FOOT[0] + m_px[0], FOOT[1] + m_px[1]],
            m_px,
            eta_rad,
            beta_rad: 0.75 * PI - 0.5 * eta_rad,
            mirrored: false,
            height_px: 60.0,
            shortened: false,
        }
    }

    fn cut_of_shadow_at(eta_rad: f64) -> Edge {
        let (sin, cos) = eta_rad.sin_cos();
        let mask = Mask::from_shape_fn((140, 160), |(y, x)| {
            let body = (50..70).contains(&x) && (30..90).contains(&y);
            let (dx, dy) = (x as f64 - FOOT[0], y as f64 - FOOT[1]);
            let (along, across) = (dx * cos + dy * sin, dy * cos - dx * sin);
            body || (along > 0.0 && along < LENGTH_PX && across.abs() < 5.0)
        });
        let outline = Outline::new(&mask).expect("not empty");
        hybrid(&mask, &mut mask.clone(), &outline, &shadow_at(eta_rad))
    }

    #[test]
    fn a_shadow_is_cut_sideways_up_to_its_limit_and_by_the_half_plane_beyond_it() {
        for side in [1.0, -1.0] {
            assert!(!cut_of_shadow_at(side * 0.44_f64.asin()).half_plane, "{side}");
            assert!(cut_of_shadow_at(side * 0.46_f64.asin()).half_plane, "{side}");
        }
    }

    /// The pixels of a full picture that `cut` leaves, compared with `stays`; `None` is too close to an edge to tell.
    fn assert_left(
        cut: impl Fn(&Mask, &mut Mask, &Outline) -> Edge,
        stays: impl Fn(f64, f64) -> Option<bool>,
    ) -> Edge {
        let full = Mask::from_elem((140, 160), true);
        let mut out = full.clone();
        let edge = cut(&full, &mut out, &Outline::new(&full).expect("not empty"));
        for ((y, x), left) in out.indexed_iter() {
            if let Some(stays) = stays(x as f64, y as f64) {
                assert_eq!(*left, stays, "column {x}, row {y}");
            }
        }
        edge
    }

    /// Whether a value is above 0; `None` within half a pixel of it.
    fn above(value: f64) -> Option<bool> {
        (value.abs() > 0.5).then_some(value > 0.0)
    }

    #[test]
    fn the_half_plane_ends_at_the_feet_in_either_direction() {
        for mirrored in [false, true] {
            for beta_rad in [1.7, 2.2, 3.0] {
                let shadow = ImageShadow { mirrored, beta_rad, ..shadow_at(0.0) };
                let (sin, cos) = beta_rad.sin_cos();
                let edge = assert_left(
                    |mask, out, _| half_plane(mask, out, &shadow),
                    |x, y| {
                        let across = if mirrored { FOOT[0] - x } else { x - FOOT[0] };
                        above(across * cos - (y - FOOT[1]) * sin)
                    },
                );
                assert!(edge.half_plane);
            }
        }
    }

    #[test]
    fn only_a_shadow_that_points_away_leaves_what_is_beside_it_and_beyond_it() {
        // Towards the camera, all below the feet goes.
        let towards = shadow_at(FRAC_PI_2);
        assert_left(|mask, out, outline| hybrid(mask, out, outline, &towards), |_, y| above(FOOT[1] - y));
        // 0.17 and 0.04 of the height of 60 px are the strip's.
        for turned_deg in [-25.0_f64, 0.0, 25.0] {
            let away = shadow_at(turned_deg.to_radians() - FRAC_PI_2);
            let ((sin, cos), (sin_b, cos_b)) = (away.eta_rad.sin_cos(), away.beta_rad.sin_cos());
            assert_left(
                |mask, out, outline| hybrid(mask, out, outline, &away),
                |x, y| {
                    let (dx, dy) = (x - FOOT[0], y - FOOT[1]);
                    let kept = above(dx * cos_b - dy * sin_b)?;
                    let beside = above((dy * cos - dx * sin).abs() - 10.2)?;
                    let beyond = above(dx * cos + dy * sin - 42.4)?;
                    Some(kept || beside || beyond)
                },
            );
        }
    }

    #[test]
    fn of_equal_runs_that_of_the_middle_angle_counts() {
        let mask = Mask::from_shape_fn((9, 9), |place| place == (4, 5));
        let outline = Outline::new(&mask).expect("not empty");
        let (beta_rad, _) = longest_run(&outline, None, [1.7, 1.8, 1.9].into_iter()).expect("angles");
        assert_eq!(beta_rad, 1.8);
    }

    #[test]
    fn the_silhouette_reaches_to_its_farthest_pixel_in_the_direction_of_the_shadow() {
        let mask = Mask::from_shape_fn((40, 50), |(y, x)| (10..=30).contains(&y) && (20..=45).contains(&x));
        let outline = Outline::new(&mask).expect("not empty");
        for (eta_rad, reach) in [(0.0, 20.0), (FRAC_PI_2, 12.0), (PI, 5.0), (-FRAC_PI_2, 8.0)] {
            assert!((reach_px(&mask, &outline, [25.0, 18.0], eta_rad) - reach).abs() < 1e-9, "{eta_rad}");
        }
        let diagonal = reach_px(&mask, &outline, [25.0, 18.0], 0.25 * PI);
        assert!((diagonal - 32.0 / 2.0_f64.sqrt()).abs() < 1e-9, "{diagonal}");
        assert_eq!(reach_px(&mask, &outline, [60.0, 18.0], 0.0), 0.0, "nothing lies there");
    }

    #[test]
    fn a_cut_is_doubtful_if_the_shadow_points_away_or_much_is_removed() {
        let text = "[camera]\nheight_m = 1.2\nazimuth_deg = 0.0\nfocal_length_mm = 4.0\npixel_um = 6.0\n";
        let mut file = CameraFile::parse(text).expect("valid");
        // The feet are in row 400.
        file.subject.distance_m = Some(1.2 * file.camera.focal_px() / (400.0 - 239.5));
        // A person of 200 px, with something at the feet's right or left, or a wide thing below the feet.
        let report = |eta_rad, ground: fn(usize, usize) -> bool| {
            let mask = Mask::from_shape_fn((480, 640), |(y, x)| {
                ((200..400).contains(&y) && (300..340).contains(&x)) || ground(y, x)
            });
            remove(&mask, &file, Light::Direction { eta_rad }, 0.0, Method::Hybrid).expect("a cut").1
        };
        let sideways = report(0.3, |y, x| (390..400).contains(&y) && (340..400).contains(&x));
        assert!(sideways.trustworthy && sideways.removed_fraction < 0.6, "{sideways:?}");
        let away = report(-FRAC_PI_2, |_, _| false);
        assert!(!away.trustworthy && away.removed_fraction < 0.6, "{away:?}");
        let wide = report(FRAC_PI_2, |y, x| (400..470).contains(&y) && (200..600).contains(&x));
        assert!(!wide.trustworthy && wide.removed_fraction > 0.6, "{wide:?}");
    }

    #[test]
    fn the_distance_is_weighted_between_the_heads_width_and_its_row() {
        let text = "[camera]\nheight_m = 0.8\nazimuth_deg = 0.0\nfocal_length_mm = 4.0\npixel_um = 6.0\n";
        let mut file = CameraFile::parse(text).expect("valid");
        // A head 20 px wide from row 100, a body below it.
        let mask = Mask::from_shape_fn((480, 640), |(y, x)| {
            (100..130).contains(&y) && (400..420).contains(&x)
                || (130..430).contains(&y) && (380..440).contains(&x)
        });
        let by_width = projection::distance_from_head_m(&file, 20.0);
        let by_row = projection::distance_from_head_row_m(&file, 99.5).expect("not at eye height");
        let sd = &file.standard_deviations;
        let of_width = (sd.head_width_m / file.subject.head_width_m).hypot((sd.head_width_px + 1.0) / 20.0);
        file.standard_deviations.camera_height_m = 0.0;
        // The row's relative deviation is that of the 0.95 m from the lens to the head.
        for (of_row, expected) in [
            (1e-6, by_row),
            (1e6, by_width),
            (of_width, 2.0 / (1.0 / by_width + 1.0 / by_row)),
            (0.5 * of_width, 5.0 / (1.0 / by_width + 4.0 / by_row)),
        ] {
            file.standard_deviations.subject_height_m = 0.95 * of_row;
            let found = subject_of(&mask, &file).expect("a subject");
            assert!((found.distance_m / expected - 1.0).abs() < 1e-9, "{of_row}: {found:?} {expected}");
            let slope = (409.5 - 319.5) / file.camera.focal_px();
            assert!((found.offset_m - slope * found.distance_m).abs() < 1e-9, "{found:?}");
        }
        file.subject.distance_m = Some(4.5);
        assert_eq!(subject_of(&mask, &file).expect("a subject").distance_m, 4.5);
    }

    #[test]
    fn the_thesis_method_cuts_a_shadow_straight_down_by_its_length() {
        for turned_deg in [-9.0_f64, 0.0, 9.0] {
            let shadow = shadow_at(FRAC_PI_2 + turned_deg.to_radians());
            // The last row is 139.
            let edge = assert_left(
                |mask, out, outline| thesis(mask, out, outline, &shadow, 0.0),
                |_, y| above(139.0 - shadow.m_px[1] - y),
            );
            assert!(edge.half_plane);
        }
        let sideways = shadow_at(FRAC_PI_2 + 11.0_f64.to_radians());
        let full = Mask::from_elem((140, 160), true);
        let outline = Outline::new(&full).expect("not empty");
        assert!(!thesis(&full, &mut full.clone(), &outline, &sideways, 0.0).half_plane);
    }
}

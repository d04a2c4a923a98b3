//! What a pair with given optics can measure, and optics for a given distance, range and error.

use std::path::PathBuf;

use farnear_depth::{
    optics::{FocusSection, LensSection, Optics, OpticsFile, SensorSection},
    psf::Psf,
    validity::LARGEST_ALPHA,
};
use farnear_files::staging::write_file;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{
    GivenOptics,
    advice::{AIRY_UM, BEST_BLUR_PX, USABLE_BLUR_PX, advice},
    expected::expected_error,
};
use crate::{
    context::Context,
    error::{Result, WorkflowError},
    figures::{rounded, rounded_for},
    measure::NO_SCALE,
    request::{PathKind, Request},
};

const FOCAL_LENGTHS_MM: [f64; 14] =
    [8.0, 12.0, 16.0, 25.0, 35.0, 50.0, 75.0, 85.0, 100.0, 135.0, 150.0, 180.0, 200.0, 300.0];
const STOPS: [f64; 6] = [1.4, 2.0, 2.8, 4.0, 5.6, 8.0];
const BINNINGS: [usize; 4] = [1, 2, 4, 8];
/// Closest focus of these lenses, in focal lengths.
const NEAREST_FOCUS: f64 = 3.0;
const AVERAGED_MAX: f64 = 64.0;

/// Print what a pair can measure: working range, blur, expected error, and what to change; or propose optics.
///
/// With --optics: the working range, the largest blur, the limits within which depths are accepted, and the error that noise causes.
/// With --distance-mm, --range-mm and --error-mm: focal length, aperture, focus pair and pixel binning for these;
/// --out writes them as an optics file.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize, JsonSchema)]
#[cfg_attr(feature = "clap", derive(clap::Args))]
#[cfg_attr(
    feature = "clap",
    command(after_help = "Example: farnear optics --optics optics.toml --json\n\
                          \x20        farnear optics --distance-mm 300 --range-mm 40 --error-mm 0.2 --out optics.toml")
)]
#[serde(default)]
pub struct OpticsRequest {
    /// The optics file.
    #[cfg_attr(feature = "clap", arg(long, value_name = "FILE"))]
    pub optics: Option<PathBuf>,
    /// Distance from the lens to the middle of the range, in mm, instead of an optics file.
    #[cfg_attr(feature = "clap", arg(long, value_name = "MM", conflicts_with = "optics"))]
    pub distance_mm: Option<f64>,
    /// Depth range to be measured, in mm.
    #[cfg_attr(feature = "clap", arg(long, value_name = "MM", requires = "distance_mm"))]
    pub range_mm: Option<f64>,
    /// Largest accepted root-mean-square error, in mm.
    #[cfg_attr(feature = "clap", arg(long, value_name = "MM", requires = "distance_mm"))]
    pub error_mm: Option<f64>,
    /// Pixel pitch of the sensor, in um.
    #[cfg_attr(feature = "clap", arg(long, value_name = "UM", default_value_t = Self::default().pixel_um))]
    pub pixel_um: f64,
    /// Focal length of the lens at hand, in mm [default: chosen].
    #[cfg_attr(feature = "clap", arg(long, value_name = "MM", requires = "distance_mm"))]
    pub focal_length_mm: Option<f64>,
    /// Standard deviation of the object's texture, as a part of its mean brightness.
    #[cfg_attr(feature = "clap", arg(long, value_name = "C", default_value_t = Self::default().contrast))]
    pub contrast: f64,
    /// Write the proposed optics to this file.
    #[cfg_attr(feature = "clap", arg(long, value_name = "FILE", requires = "distance_mm"))]
    pub out: Option<PathBuf>,
}

impl Default for OpticsRequest {
    fn default() -> Self {
        Self {
            optics: None,
            distance_mm: None,
            range_mm: None,
            error_mm: None,
            pixel_um: 3.45,
            focal_length_mm: None,
            contrast: 0.2,
            out: None,
        }
    }
}

impl Request for OpticsRequest {
    const NAME: &'static str = "optics";
    const REQUIRED: &'static [&'static str] = &[];
    const PATHS: &'static [(&'static str, PathKind)] =
        &[("optics", PathKind::Input), ("out", PathKind::OutputFile)];
    type Figures = OpticsFigures;

    fn check(&self) -> Result<()> {
        let positive = [
            ("distance-mm", self.distance_mm),
            ("range-mm", self.range_mm),
            ("error-mm", self.error_mm),
            ("pixel-um", Some(self.pixel_um)),
            ("focal-length-mm", self.focal_length_mm),
            ("contrast", Some(self.contrast)),
        ];
        for (name, value) in positive {
            if let Some(wrong) = value.filter(|value| !(value.is_finite() && *value > 0.0)) {
                return Err(WorkflowError::parameter(name, wrong, "a number above 0"));
            }
        }
        if self.contrast > 1.0 {
            let expected = "a part of the mean brightness, at most 1: 0.2 is 20 %";
            return Err(WorkflowError::parameter("contrast", self.contrast, expected));
        }
        let of_proposal = [
            ("range-mm", self.range_mm.is_some()),
            ("error-mm", self.error_mm.is_some()),
            ("focal-length-mm", self.focal_length_mm.is_some()),
            ("out", self.out.is_some()),
        ];
        let useless = of_proposal.into_iter().find(|(_, given)| self.optics.is_some() && *given);
        if let Some((name, _)) = useless {
            let expected = "it belongs to a proposal: expected distance-mm instead of optics";
            return Err(WorkflowError::parameter(name, "(given)", expected));
        }
        match (&self.optics, self.distance_mm, self.range_mm) {
            (Some(_), None, _) => Ok(()),
            (None, Some(distance), Some(range)) if range < distance => Ok(()),
            (None, Some(distance), Some(range)) => {
                let expected = format!("less than the distance of {distance} mm");
                Err(WorkflowError::parameter("range-mm", range, expected))
            }
            (None, Some(_), None) => {
                Err(WorkflowError::parameter("range-mm", "(none)", "the depth to be measured, in mm"))
            }
            (optics, ..) => {
                let value = optics.as_ref().map_or("(none)".into(), |file| file.display().to_string());
                let expected = "an optics file, or --distance-mm and --range-mm";
                Err(WorkflowError::parameter("optics", value, expected))
            }
        }
    }

    fn run(&self, context: &Context<'_>) -> Result<OpticsFigures> {
        self.check()?;
        if let Some(path) = &self.optics {
            let (optics, doubts) = GivenOptics::read(path)?.with_doubts();
            let binning = optics.stage().map_or(1, |stage| stage.bin);
            let mut found = figures(&optics, binning, self.contrast, None);
            found.advice.extend(doubts.iter().map(ToString::to_string));
            return Ok(found);
        }
        let (optics, found) = propose(self)?;
        if let Some(out) = &self.out {
            write_file(out, toml::to_string(&OpticsFile::from(optics))?.as_bytes())?;
            context.info(&format!("wrote {}", out.display()));
        }
        Ok(found)
    }
}

/// A lens of `calibrate stack` without the size of a pixel at the target has no figures of sensor and aperture.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct OpticsFigures {
    pub far_mm: f64,
    pub near_mm: f64,
    /// Lens to sensor for the far-focused image.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sensor_far_mm: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sensor_near_mm: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sensor_travel_mm: Option<f64>,
    /// Object distance between both focus distances in the sensor's travel.
    pub alpha0_mm: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub focal_length_mm: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub f_number: Option<f64>,
    /// Of the image, with binning.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pixel_um: Option<f64>,
    /// Sensor pixels per side of an image pixel.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub binning: Option<usize>,
    /// Exposures to average for the accepted error.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub averaged_exposures: Option<usize>,
    pub max_blur_px: f64,
    /// Absent where it is infinite.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub farthest_usable_mm: Option<f64>,
    pub nearest_usable_mm: f64,
    /// Side of a pixel at the object at mid-range.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pixel_at_object_mm: Option<f64>,
    pub advice: Vec<String>,
    /// From noise, root mean square; absent where it exceeds the range.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub expected_error_ro_mm: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub expected_error_whitened_mm: Option<f64>,
}

fn has_scale(optics: &Optics) -> bool {
    optics.stage().is_none_or(|stage| stage.scale_known)
}

fn figures(optics: &Optics, binning: usize, contrast: f64, accepted_mm: Option<f64>) -> OpticsFigures {
    let range = optics.working_range();
    let error = expected_error(optics, contrast, binning);
    let span_mm = range.far_mm - range.near_mm;
    let estimate = |mm: f64| Some(rounded_for(mm, mm, 4)).filter(|mm| *mm < span_mm);
    let [farthest_mm, nearest_mm] = optics.range_mm(LARGEST_ALPHA).map(|mm| rounded_for(span_mm, mm, 3));
    let pixel_mm = optics.pixel_at_object_mm(range.alpha0_mm);
    let mut advice = advice(optics);
    let averaged = accepted_mm.map(|accepted| (error.whitened_mm / accepted).powi(2).ceil().max(1.0));
    if let Some(needed) = averaged.filter(|needed| *needed > 1.0) {
        advice.push(format!(
            "the error with one exposure per focus is {} mm: average {needed} exposures, measure a smaller range, or give the object \
             more texture (a projected pattern)",
            rounded_for(error.whitened_mm, error.whitened_mm, 3)
        ));
    }
    let scaled = |value: f64| has_scale(optics).then_some(value);
    if !has_scale(optics) {
        advice.push(NO_SCALE.into());
    }
    OpticsFigures {
        far_mm: range.far_mm,
        near_mm: range.near_mm,
        sensor_far_mm: scaled(range.sensor_far_mm),
        sensor_near_mm: scaled(range.sensor_near_mm),
        sensor_travel_mm: scaled(range.sensor_travel_mm),
        alpha0_mm: range.alpha0_mm,
        focal_length_mm: scaled(optics.focal_length_mm()),
        f_number: scaled(rounded(optics.f_number(), 3)),
        pixel_um: scaled(optics.pixel_um()),
        binning: accepted_mm.map(|_| binning),
        averaged_exposures: averaged.map(|count| count as usize),
        max_blur_px: rounded(optics.max_blur_px(), 3),
        farthest_usable_mm: farthest_mm.is_finite().then_some(farthest_mm),
        nearest_usable_mm: nearest_mm,
        pixel_at_object_mm: scaled(rounded_for(pixel_mm, pixel_mm, 4)),
        advice,
        expected_error_ro_mm: estimate(error.ro_mm),
        expected_error_whitened_mm: estimate(error.whitened_mm),
    }
}

fn propose(request: &OpticsRequest) -> Result<(Optics, OpticsFigures)> {
    let (distance, range) = (request.distance_mm.unwrap_or(f64::NAN), request.range_mm.unwrap_or(f64::NAN));
    let accepted = request.error_mm.unwrap_or(f64::INFINITY);
    let own = request.focal_length_mm.map(|own| vec![own]);
    let lenses = own.clone().unwrap_or_else(|| FOCAL_LENGTHS_MM.to_vec());
    let mut best: Option<([f64; 4], Optics, usize)> = None;
    for focal_length_mm in lenses {
        if own.is_none() && distance - range / 2.0 < NEAREST_FOCUS * focal_length_mm {
            continue;
        }
        for (binning, f_number) in BINNINGS.iter().flat_map(|binning| STOPS.map(|stop| (*binning, stop))) {
            let file = OpticsFile {
                lens: LensSection {
                    focal_length_mm,
                    aperture_mm: None,
                    f_number: Some(f_number),
                    telecentric: None,
                },
                sensor: SensorSection { pixel_um: request.pixel_um * binning as f64 },
                focus: FocusSection {
                    far_mm: distance + range / 2.0,
                    max_blur_px: None,
                    near_mm: Some(distance - range / 2.0),
                },
                psf: Psf::default(),
                distortion: None,
                stage: None,
                light: None,
            };
            let Ok(optics) = file.check() else { continue };
            let blur = optics.max_blur_px();
            let airy_px = AIRY_UM * f_number / optics.pixel_um();
            if !(USABLE_BLUR_PX[0]..=USABLE_BLUR_PX[1]).contains(&blur) || airy_px > 0.5 * blur {
                continue;
            }
            let error = expected_error(&optics, request.contrast, binning).whitened_mm;
            let averaged = (error / accepted).powi(2).ceil().max(1.0);
            // Prefer one exposure, then fine pixels, then a common aperture, then the best blur.
            let rank = [averaged, binning as f64, (f_number / 4.0).ln().abs(), (blur - BEST_BLUR_PX).abs()];
            if best
                .as_ref()
                .is_none_or(|(found, ..)| rank.partial_cmp(found) == Some(std::cmp::Ordering::Less))
            {
                best = Some((rank, optics, binning));
            }
        }
    }
    let Some((rank, optics, binning)) = best else {
        let expected = format!(
            "no lens of {} with f/1.4 to f/8 and pixels of {} um gives a blur of {} to {} px over {range} mm: change the range, the distance or \
             the pixels",
            own.map_or("8 to 300 mm".into(), |own| format!("{} mm", own[0])),
            request.pixel_um,
            USABLE_BLUR_PX[0],
            USABLE_BLUR_PX[1]
        );
        return Err(WorkflowError::parameter("distance-mm", distance, expected));
    };
    if rank[0] > AVERAGED_MAX {
        let error = expected_error(&optics, request.contrast, binning).whitened_mm;
        let expected = format!(
            "noise alone causes {} mm over {range} mm at best; expected at least {} mm (64 exposures averaged), or a smaller range",
            rounded_for(error, error, 3),
            rounded_for(error, error / AVERAGED_MAX.sqrt(), 4)
        );
        return Err(WorkflowError::parameter("error-mm", accepted, expected));
    }
    let mut found = figures(&optics, binning, request.contrast, Some(accepted));
    if binning > 1 {
        found.advice.push(format!(
            "the optics are of averages of {binning} x {binning} pixels: let the camera average them; for whole images set pixel_um = {} and \
             max_blur_px = {:.4}, and give depth --bin {binning}",
            request.pixel_um,
            optics.max_blur_px() * binning as f64
        ));
    }
    Ok((optics, found))
}

#[cfg(test)]
mod tests {
    use farnear_depth::optics::Stage;

    use super::*;

    fn rig(blur: f64) -> Optics {
        let text = format!(
            "[lens]\nfocal_length_mm = 50.0\naperture_mm = 12.8\n[sensor]\npixel_um = 7.4\n[focus]\nfar_mm = 933.0\n\
             max_blur_px = {blur}\n[psf]\nmodel = \"gaussian\"\nk = 0.4578\n"
        );
        toml::from_str::<OpticsFile>(&text).unwrap().check().unwrap()
    }

    #[test]
    fn the_expected_error_is_that_of_rendered_planes() {
        // From independent renders of slants, contrast 0.2, 8 bit: 0.621 mm with a window of 7 on planes,
        // 0.204 to 0.245 mm on planes and slants with adaptive windows.
        let found = expected_error(&rig(2.703), 0.2, 1);
        assert!((0.6..0.85).contains(&found.ro_mm), "{found:?}");
        assert!((0.2..0.33).contains(&found.whitened_mm), "{found:?}");
        let half = expected_error(&rig(2.703), 0.4, 1);
        assert!((half.ro_mm / found.ro_mm - 0.5).abs() < 1e-9);
    }

    #[test]
    fn a_contrast_in_percent_is_refused() {
        let request = |contrast| OpticsRequest {
            contrast,
            distance_mm: Some(300.0),
            range_mm: Some(40.0),
            ..OpticsRequest::default()
        };
        assert!(request(1.0).check().is_ok());
        let error = request(20.0).check().unwrap_err();
        assert!(error.is_usage() && error.to_string().starts_with("contrast 20: a part of"), "{error}");
    }

    #[test]
    fn a_distant_focus_has_no_farthest_depth() {
        let text = "[lens]\nfocal_length_mm = 8.0\nf_number = 1.6\n[sensor]\npixel_um = 5.0\n\
                    [focus]\nfar_mm = 30000.0\nnear_mm = 1000.0\n";
        let optics = toml::from_str::<OpticsFile>(text).unwrap().check().unwrap();
        let found = figures(&optics, 1, 0.2, None);
        assert_eq!((found.farthest_usable_mm, found.nearest_usable_mm), (None, 954.3), "{found:?}");
        assert!(figures(&rig(2.703), 1, 0.2, None).farthest_usable_mm.is_some());
    }

    #[test]
    fn parameters_of_a_proposal_are_refused_with_an_optics_file() {
        let request = OpticsRequest { optics: Some("optics.toml".into()), ..OpticsRequest::default() };
        assert!(request.check().is_ok());
        let error = OpticsRequest { out: Some("new.toml".into()), ..request }.check().unwrap_err();
        assert!(error.is_usage() && error.to_string().contains("distance-mm"), "{error}");
    }

    #[test]
    fn states_no_error_where_the_blur_leaves_no_depth() {
        let found = figures(&rig(133.0), 1, 0.2, None);
        assert_eq!((found.expected_error_ro_mm, found.expected_error_whitened_mm), (None, None));
        assert!(!found.advice.is_empty());
    }

    /// A microscope's range of 0.6 um.
    #[test]
    fn a_small_range_keeps_its_digits() {
        let text = "[lens]\nfocal_length_mm = 6.5\nf_number = 119.0\ntelecentric = true\n[sensor]\npixel_um = 5.0\n\
                    [focus]\nfar_mm = 6.5845\nnear_mm = 6.5839\n";
        let optics: Optics = toml::from_str::<OpticsFile>(text).unwrap().check().unwrap();
        let found = figures(&optics, 1, 0.2, None);
        assert!(found.farthest_usable_mm.unwrap() > 6.5845 && found.nearest_usable_mm < 6.5839, "{found:?}");
        assert!((found.pixel_at_object_mm.unwrap() - 6.48e-5).abs() < 1e-7, "{found:?}");
        let error = expected_error(&optics, 0.2, 1).whitened_mm;
        assert!((found.expected_error_whitened_mm.unwrap() / error - 1.0).abs() < 1e-3, "{found:?} {error}");
    }

    #[test]
    fn a_lens_without_a_scale_has_no_figures_of_sensor_and_aperture() {
        let mut file = OpticsFile::from(rig(2.703));
        file.lens.f_number = Some(60.0);
        let optics = file.check().unwrap();
        let figures = |scale_known| {
            let optics = optics.with_stage(Stage { scale_known, ..Stage::identity(2, 1) });
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join("lens.toml");
            std::fs::write(&path, toml::to_string(&optics).unwrap()).unwrap();
            let request = OpticsRequest { optics: Some(path), ..OpticsRequest::default() };
            request.run(&Context::unattended()).unwrap()
        };
        let (known, unknown) = (figures(true), figures(false));
        assert!(known.f_number == Some(60.0) && known.pixel_at_object_mm.is_some(), "{known:?}");
        let text = serde_json::to_string(&unknown).unwrap();
        for name in ["sensor", "focal_length", "f_number", "pixel_um", "pixel_at_object"] {
            assert!(!text.contains(name), "{name}: {text}");
        }
        // The aperture of a learned lens is assumed, with or without a scale.
        assert!(advice(&optics).join("; ").contains("diffraction"), "{:?}", advice(&optics));
        assert_eq!(known.advice, [""; 0]);
        assert!(!text.contains("diffraction") && text.contains("--object-pixel-um"), "{text}");
        // The noise of averaged pixels.
        let of_pixels = expected_error(&optics, 0.2, 1).whitened_mm;
        let error = unknown.expected_error_whitened_mm.unwrap();
        assert!((2.0 * error / of_pixels - 1.0).abs() < 1e-3, "{error} {of_pixels}");
    }

    #[test]
    fn a_proposal_keeps_distance_range_blur_and_error() {
        for (distance, range, error) in
            [(300.0, 40.0, 0.2), (1000.0, 100.0, 0.5), (100.0, 5.0, 0.05), (2000.0, 400.0, 3.0)]
        {
            let request = OpticsRequest {
                distance_mm: Some(distance),
                range_mm: Some(range),
                error_mm: Some(error),
                ..OpticsRequest::default()
            };
            let (optics, found) = propose(&request).unwrap();
            let of = optics.working_range();
            assert!((of.far_mm - of.near_mm - range).abs() < 1e-6, "{found:?}");
            assert!((2.0..=4.0).contains(&found.max_blur_px), "{found:?}");
            let exposures = found.averaged_exposures.unwrap() as f64;
            assert!(
                found.expected_error_whitened_mm.unwrap() / exposures.sqrt() <= 1.001 * error,
                "{found:?}"
            );
        }
        let request = OpticsRequest {
            distance_mm: Some(300.0),
            range_mm: Some(40.0),
            error_mm: Some(1e-4),
            ..OpticsRequest::default()
        };
        assert!(propose(&request).unwrap_err().to_string().contains("noise alone"));
        assert!(OpticsRequest::default().check().unwrap_err().is_usage());
    }
}

//! Flat targets for a depth correction: a pair and depth map at each distance, and their list.

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
};

use farnear_capture::record::{CaptureRecord, begin_folder, finish_folder, read_record};
use farnear_depth::{
    operators::Operators,
    optics::Optics,
    pipeline::{Settings, depth_from_pair},
    validity::LARGEST_ALPHA,
};
use farnear_files::{npy, staging};
use farnear_protocol::message::LightLevels;
use ndarray::Array2;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{
    RigAddress,
    camera::{CameraSettings, EquippedRig},
    pair,
};
use crate::{
    context::Context,
    error::{Result, WorkflowError},
    figures::{rounded, rounded_for},
    operators,
    optics::GivenOptics,
    request::{PathKind, Request},
    text_file,
};

const LIST: &str = "PATTERNS.toml";
const USUAL_TARGETS: usize = 24;

/// Capture a flat target at known distances, compute the depth maps, and list them for `farnear calibrate correction`.
///
/// Asks for the target to be placed at each distance. An interrupted series continues if it is started again with the same folder. The
/// emulated rig places its target automatically.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[cfg_attr(feature = "clap", derive(clap::Args))]
#[cfg_attr(
    feature = "clap",
    command(
        after_help = "Example: farnear rig calibrate targets --port sim --optics optics.toml --distances 890,900,910,920,930 --out series/"
    )
)]
#[serde(default)]
pub struct TargetSeriesRequest {
    #[serde(skip)]
    #[cfg_attr(feature = "clap", arg(skip))]
    pub rig: RigAddress,
    #[serde(skip)]
    #[cfg_attr(feature = "clap", arg(skip))]
    pub camera: CameraSettings,
    /// The optics file.
    #[cfg_attr(feature = "clap", arg(long, value_name = "FILE"))]
    pub optics: PathBuf,
    /// Distances of the target from the lens in mm [default: 24 through the working range].
    #[cfg_attr(feature = "clap", arg(long, value_name = "MM,...", value_delimiter = ','))]
    pub distances: Vec<f64>,
    /// Do not wait for Enter: the target moves automatically, or the distances do not matter.
    #[cfg_attr(feature = "clap", arg(long))]
    pub no_prompt: bool,
    /// Folder of the series.
    #[cfg_attr(feature = "clap", arg(long, value_name = "DIR"))]
    pub out: PathBuf,
}

impl Request for TargetSeriesRequest {
    const NAME: &'static str = "rig calibrate targets";
    const REQUIRED: &'static [&'static str] = &["optics", "out"];
    const PATHS: &'static [(&'static str, PathKind)] =
        &[("optics", PathKind::Input), ("out", PathKind::OutputFolder)];
    type Figures = TargetFigures;

    fn run(&self, context: &Context<'_>) -> Result<TargetFigures> {
        capture(self, context)
    }
}

crate::request::camera_request!(TargetSeriesRequest);

#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct TargetFigures {
    pub targets: usize,
    pub captured: usize,
    /// Root-mean-square error before correction, of the maps captured in this run; `None` without a depth.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rmse_mm: Option<f64>,
    pub patterns: String,
}

#[derive(Serialize, Deserialize, Default)]
struct List {
    #[serde(default)]
    pattern: Vec<Entry>,
}

#[derive(Serialize, Deserialize)]
struct Entry {
    depth: PathBuf,
    true_mm: f64,
}

/// With three decimals, or as many as the distance has: those before a microscope differ by less than a micrometre.
fn name(true_mm: f64) -> String {
    let usual = format!("{true_mm:.3}");
    let digits = if usual.parse::<f64>().ok() == Some(true_mm) { usual } else { true_mm.to_string() };
    format!("target-{digits}")
}

impl List {
    /// Whether the target is listed and its map was not removed.
    fn has(&self, out: &Path, true_mm: f64) -> bool {
        let mut same = self.pattern.iter().filter(|entry| name(entry.true_mm) == name(true_mm));
        same.any(|entry| out.join(&entry.depth).is_file())
    }

    fn add(&mut self, out: &Path, true_mm: f64) -> Result<()> {
        self.pattern.retain(|entry| name(entry.true_mm) != name(true_mm));
        self.pattern.push(Entry { depth: Path::new(&name(true_mm)).join("depth.npy"), true_mm });
        self.pattern.sort_by(|a, b| a.true_mm.total_cmp(&b.true_mm));
        Ok(staging::write_file(&out.join(LIST), toml::to_string(self)?.as_bytes())?)
    }

    /// Adds targets that were captured when a run ended before it listed them.
    fn add_complete(&mut self, out: &Path, distances_mm: &[f64]) -> Result<()> {
        for true_mm in distances_mm.iter().copied() {
            if !self.has(out, true_mm) && out.join(name(true_mm)).join("depth.npy").is_file() {
                self.add(out, true_mm)?;
            }
        }
        Ok(())
    }
}

/// Computes and lists the depth maps. The same folder resumes an interrupted series. A real rig stays
/// connected; an emulated one restarts per target. Checks everything before any motion.
pub fn capture(settings: &TargetSeriesRequest, context: &Context<'_>) -> Result<TargetFigures> {
    let optics = GivenOptics::read(&settings.optics)?;
    let operators = operators::find(None, &optics.optics)?;
    let distances_mm = distances(&settings.distances, &optics.optics)?;
    let early = settings.camera.open_early(&settings.rig, context)?;
    fs::create_dir_all(&settings.out)
        .map_err(|source| WorkflowError::Folder { folder: settings.out.clone(), source })?;
    let mut list = read_list(&settings.out.join(LIST))?;
    list.add_complete(&settings.out, &distances_mm)?;
    check_alike(&list, &optics, settings, early.kind())?;
    let series = Series { settings, optics: &optics, operators: &operators, context };
    let mut standing = match settings.rig.is_emulated() {
        true => None,
        false => Some(early.connect(&settings.rig, Some(&optics), context)?),
    };
    let (mut captured, mut error) = (0, MeanSquare::default());
    for (number, true_mm) in distances_mm.iter().copied().enumerate() {
        if list.has(&settings.out, true_mm) {
            context.info(&format!("target {} at {true_mm} mm is there already", number + 1));
            continue;
        }
        let name = name(true_mm);
        let depth_mm = match &mut standing {
            Some(rig) => {
                series.place(number, distances_mm.len(), true_mm)?;
                series.capture(rig, &name)?
            }
            None => series.capture(&mut series.emulated_before(true_mm)?, &name)?,
        };
        error.add(&depth_mm, true_mm);
        captured += 1;
        list.add(&settings.out, true_mm)?;
        context.info(&format!("target {} of {} at {true_mm} mm is captured", number + 1, distances_mm.len()));
    }
    Ok(TargetFigures {
        targets: list.pattern.len(),
        captured,
        rmse_mm: error.root().map(|mm| rounded_for(mm, mm, 4)),
        patterns: settings.out.join(LIST).display().to_string(),
    })
}

struct Series<'a> {
    settings: &'a TargetSeriesRequest,
    optics: &'a GivenOptics,
    operators: &'a Operators,
    context: &'a Context<'a>,
}

impl Series<'_> {
    fn emulated_before(&self, true_mm: f64) -> Result<EquippedRig> {
        let address = self.settings.rig.with_scene(format!("plane:{true_mm}"))?;
        self.settings.camera.connect(&address, Some(self.optics), self.context)
    }

    fn place(&self, number: usize, count: usize, true_mm: f64) -> Result<()> {
        let place = format!(
            "place the flat target {true_mm} mm before the lens ({} of {count}), square to it",
            number + 1
        );
        if self.settings.no_prompt {
            self.context.info(&place);
            return Ok(());
        }
        let question = format!("{place}, and press Enter: ");
        self.context.questions.ask(&question, &self.context.cancel).map(|_| ())
    }

    /// Captures a pair into its own folder and computes its depth, mm.
    fn capture(&self, rig: &mut EquippedRig, name: &str) -> Result<Array2<f32>> {
        let folder = begin_folder(&self.settings.out.join(name))?;
        let (pair, record) = pair::take(rig, self.optics, &self.settings.camera, self.context)?;
        let [far, near] = [&pair.far, &pair.near].map(|taken| taken.image.pixels.mapv(f32::from));
        let (optics, settings) = (&self.optics.optics, Settings::default());
        let depth = depth_from_pair(far.view(), near.view(), self.operators, optics, &settings)?;
        for warning in &depth.warnings {
            self.context.progress.warn(&warning.to_string());
        }
        folder.write("depth.npy", &npy::write(depth.depth_mm.view()))?;
        finish_folder(folder, &pair, &record)?;
        Ok(depth.depth_mm)
    }
}

#[derive(Default)]
struct MeanSquare {
    sum: f64,
    pixels: f64,
}

impl MeanSquare {
    fn add(&mut self, depth_mm: &Array2<f32>, true_mm: f64) {
        for value in depth_mm.iter().filter(|value| value.is_finite()) {
            self.sum += (f64::from(*value) - true_mm).powi(2);
            self.pixels += 1.0;
        }
    }

    fn root(&self) -> Option<f64> {
        (self.pixels > 0.0).then(|| (self.sum / self.pixels).sqrt())
    }
}

fn distances(asked_mm: &[f64], optics: &Optics) -> Result<Vec<f64>> {
    let range = optics.working_range();
    let usable = |mm: f64| mm.is_finite() && optics.alpha(mm).abs() <= LARGEST_ALPHA;
    if let Some(bad) = asked_mm.iter().find(|mm| !usable(**mm)) {
        let [farthest, nearest] = optics.range_mm(LARGEST_ALPHA);
        // Inwards, to three digits of the range.
        let span = if farthest.is_finite() { farthest - nearest } else { nearest };
        let scale = 10_f64.powf(2.0 - span.log10().floor());
        let [nearest, farthest] = [(scale * nearest).ceil() / scale, (scale * farthest).floor() / scale];
        let wanted = if farthest.is_finite() {
            format!("{nearest} to {farthest} mm")
        } else {
            format!("at least {nearest} mm")
        };
        let expected = format!("expected {wanted}, the range of the optics");
        return Err(WorkflowError::parameter("distances", bad, expected));
    }
    if !asked_mm.is_empty() {
        return Ok(asked_mm.to_vec());
    }
    let step = (range.far_mm - range.near_mm) / (USUAL_TARGETS - 1) as f64;
    // Rounded to 0.1 mm, which can be set on a rail, and where targets are closer together to less than their interval.
    let decimals = (-step.log10()).ceil().max(1.0) as i32;
    Ok((0..USUAL_TARGETS).map(|i| rounded(range.near_mm + step * i as f64, decimals)).collect())
}

/// Fails if the series was begun in another way: the correction would learn the difference.
fn check_alike(list: &List, optics: &GivenOptics, request: &TargetSeriesRequest, kind: &str) -> Result<()> {
    for entry in &list.pattern {
        let folder = entry.depth.parent().unwrap_or(Path::new(""));
        let Some(record) = read_record(&request.out.join(folder))? else { continue };
        if let Some((name, value, was)) = difference(&record, optics, request, kind) {
            let expected = format!(
                "the target at {} mm in {} was captured with {was}: take the same, or another folder",
                entry.true_mm,
                request.out.display()
            );
            return Err(WorkflowError::parameter(name, value, expected));
        }
    }
    Ok(())
}

/// Name and value of the first setting that differs from the record's, and that of the record.
fn difference(
    record: &CaptureRecord,
    optics: &GivenOptics,
    request: &TargetSeriesRequest,
    kind: &str,
) -> Option<(&'static str, String, String)> {
    let (was, exposure_us) = (&record.camera, request.camera.exposure.0);
    if record.optics != optics.table {
        return Some(("optics", request.optics.display().to_string(), "other optics".into()));
    }
    if was.kind != kind {
        return Some(("camera", kind.into(), format!("a camera of the kind `{}`", was.kind)));
    }
    if let Some(other) = record.exposure.iter().find(|exposure| exposure.exposure_us != exposure_us) {
        return Some(("exposure_us", exposure_us.to_string(), format!("{} us", other.exposure_us)));
    }
    let light = request.camera.light_with(Some(optics)).map(LightLevels::percent);
    if was.light_percent != light {
        let percent = |light: Option<[f64; 2]>| light.map_or(String::from("0"), |[a, b]| format!("{a},{b}"));
        return Some(("light", percent(light), format!("light {}", percent(was.light_percent))));
    }
    let settings = request.camera.recorded_settings();
    let text = |settings: &BTreeMap<String, String>| {
        let each: Vec<String> = settings.iter().map(|(name, value)| format!("{name}={value}")).collect();
        if each.is_empty() { String::from("nothing") } else { each.join(" ") }
    };
    let (now, before) = (text(&settings), text(&was.settings));
    (was.settings != settings).then(|| ("set", now, format!("{before} set")))
}

fn read_list(path: &Path) -> Result<List> {
    match text_file::read(path) {
        Ok(text) => toml::from_str(&text).map_err(WorkflowError::file(path, "a list of targets")),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(List::default()),
        Err(error) => Err(WorkflowError::read("the list of targets", path)(error)),
    }
}

#[cfg(test)]
mod tests {
    use farnear_protocol::{Micros, message::LIGHT_LEVEL_MAX};

    use super::*;

    #[test]
    fn distances_outside_the_range_of_the_optics_are_refused() {
        let optics = "[lens]\nfocal_length_mm = 50.0\naperture_mm = 12.8\n[sensor]\npixel_um = 7.4\n[focus]\nfar_mm = 933.0\nmax_blur_px = 2.703\n";
        let optics = GivenOptics::parse(optics, Path::new("optics.toml")).unwrap().optics;
        assert_eq!(distances(&[885.5, 935.0], &optics).unwrap(), [885.5, 935.0]);
        for wrong in [40.0, 880.0, 2000.0, f64::NAN, f64::INFINITY] {
            let error = distances(&[900.0, wrong], &optics).unwrap_err();
            assert!(error.is_usage());
            let error = error.to_string();
            assert!(error.starts_with(&format!("distances {wrong}: expected 884.7 to 935.4 mm")), "{error}");
        }
        let distant = "[lens]\nfocal_length_mm = 8.0\nf_number = 1.6\n[sensor]\npixel_um = 5.0\n[focus]\nfar_mm = 30000.0\nnear_mm = 1000.0\n";
        let optics = GivenOptics::parse(distant, Path::new("optics.toml")).unwrap().optics;
        let error = distances(&[900.0], &optics).unwrap_err().to_string();
        assert!(error.contains("expected at least 955 mm"), "{error}");
    }

    /// Sensor distances of 50 mm: object and image are of one size, and the range is 69 um; of 52.8 mm: 14 um.
    #[test]
    fn the_targets_of_a_macro_lens_differ() {
        for (f_number, pixel_um, far_mm) in [(4.0, 3.45, 50.0), (1.4, 2.4, 47.5)] {
            let text = format!(
                "[lens]\nfocal_length_mm = 25.0\nf_number = {f_number}\n[sensor]\npixel_um = {pixel_um}\n[focus]\n\
                 far_mm = {far_mm}\nmax_blur_px = 2.5\n"
            );
            let optics = GivenOptics::parse(&text, Path::new("optics.toml")).unwrap().optics;
            let chosen = distances(&[], &optics).unwrap();
            assert_eq!(distances(&chosen, &optics).unwrap(), chosen, "all lie within the range");
            let mut names: Vec<String> = chosen.into_iter().map(name).collect();
            names.dedup();
            assert_eq!(names.len(), USUAL_TARGETS, "{names:?}");
        }
        assert_eq!(name(900.0), "target-900.000");
    }

    fn captured(out: &Path, true_mm: f64) {
        fs::create_dir(out.join(name(true_mm))).unwrap();
        fs::write(out.join(name(true_mm)).join("depth.npy"), "a map").unwrap();
    }

    #[test]
    fn a_target_that_was_not_listed_before_the_end_of_a_run_is_listed() {
        let out = tempfile::tempdir().unwrap();
        captured(out.path(), 890.0);
        captured(out.path(), 900.0);
        fs::create_dir(out.path().join("target-910.000")).unwrap();
        let mut list = List::default();
        list.add(out.path(), 890.0).unwrap();
        list.add_complete(out.path(), &[890.0, 900.0, 910.0]).unwrap();
        let listed = read_list(&out.path().join(LIST)).unwrap();
        assert_eq!(listed.pattern.iter().map(|entry| entry.true_mm).collect::<Vec<_>>(), [890.0, 900.0]);
        assert_eq!(listed.pattern[1].depth, Path::new("target-900.000/depth.npy"));
    }

    #[test]
    fn a_target_whose_folder_was_removed_is_captured_again() {
        let out = tempfile::tempdir().unwrap();
        captured(out.path(), 900.0);
        let mut list = List::default();
        list.add(out.path(), 900.0).unwrap();
        assert!(list.has(out.path(), 900.0) && !list.has(out.path(), 900.0001));
        fs::remove_dir_all(out.path().join("target-900.000")).unwrap();
        assert!(!list.has(out.path(), 900.0));
        list.add(out.path(), 900.0).unwrap();
        assert_eq!(list.pattern.len(), 1);
    }

    #[test]
    fn without_a_depth_there_is_no_error_of_depth() {
        let mut error = MeanSquare::default();
        error.add(&Array2::from_elem((2, 2), f32::NAN), 900.0);
        assert_eq!(error.root(), None);
        error.add(&ndarray::array![[903.0, f32::NAN], [896.0, f32::NAN]], 900.0);
        assert_eq!(error.root(), Some(12.5_f64.sqrt()));
    }

    #[test]
    fn a_series_continues_only_with_the_settings_of_its_beginning() {
        let out = tempfile::tempdir().unwrap();
        let text = "[lens]\nfocal_length_mm = 50.0\naperture_mm = 12.8\n[sensor]\npixel_um = 7.4\n[focus]\nfar_mm = 933.0\nmax_blur_px = 2.703\n";
        let optics = GivenOptics::parse(text, Path::new("optics.toml")).unwrap();
        captured(out.path(), 900.0);
        let mut list = List::default();
        list.add(out.path(), 900.0).unwrap();
        let record = format!("{RECORD}{}", text.replace('[', "[optics."));
        fs::write(out.path().join("target-900.000/capture.toml"), record).unwrap();
        let request = |camera: CameraSettings| TargetSeriesRequest {
            camera,
            optics: "optics.toml".into(),
            out: out.path().into(),
            ..TargetSeriesRequest::default()
        };
        let usual = CameraSettings { settings: vec!["gain=2".parse().unwrap()], ..CameraSettings::default() };
        let check = |camera: CameraSettings, kind| {
            check_alike(&list, &optics, &request(camera), kind).map_err(|error| error.to_string())
        };
        assert_eq!(check(usual.clone(), "sim"), Ok(()));
        let error = check(usual.clone(), "folder").unwrap_err();
        assert!(error.starts_with("camera folder:") && error.contains("900 mm"), "{error}");
        let other = [
            (CameraSettings { exposure: Micros(1000), ..usual.clone() }, "exposure_us 1000:", "with 5000 us"),
            (CameraSettings { settings: Vec::new(), ..usual.clone() }, "set nothing:", "with gain=2 set"),
            (CameraSettings { light: Some(LIT), ..usual }, "light 100,0:", "with light 0"),
        ];
        for (camera, name, was) in other {
            let error = check(camera, "sim").unwrap_err();
            assert!(error.starts_with(name) && error.contains(was), "{error}");
        }
    }

    const LIT: LightLevels = LightLevels { first: LIGHT_LEVEL_MAX, second: 0 };
    const RECORD: &str = r#"format = 2
made_by = "farnear"
[stage]
datum_mm = 47.0
coarse_measured_um = 5800.0
[[exposure]]
image = "far.png"
sensor_measured_mm = 52.8
fine_measured_um = 21.9
coarse_measured_um = 5800.0
settle_us = 14590
exposure_us = 5000
trigger_number = 0
trigger_us = 1
strobe_start_us = 2
strobe_end_us = 5002
[camera]
kind = "sim"
width = 640
height = 480
bits = 8
settings = { gain = "2" }
[board]
name = "nucleo-f429zi"
firmware = "0.2.0"
protocol = 3
schema_key = "0"
unique_id = "0"
boot = 1
reset_cause = "power on"
emulated = true
"#;
}

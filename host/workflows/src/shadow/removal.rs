//! Removes a person's shadow from masks, given the camera's pose and the light or shadow direction.

mod doubts;

use std::{
    fs,
    path::{Path, PathBuf},
    time::Instant,
};

use chrono::TimeDelta;
use farnear_files::{masks, staging::Staging};
use farnear_shadow::projection::{LOWEST_SUN_DEG, ShadowError};
use farnear_shadow::sun::{Model, position};
use farnear_shadow::uncertainty::{Uncertainty, UncertaintyError, propagate};
use farnear_shadow::{CameraFile, CutReport, Lamp, Light, Method, remove, subject_of};
use farnear_silhouettes::mask::{
    Mask,
    subject::{Flag, SubjectChooser, SubjectSettings},
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::stages::{Stage, Stages};
use crate::{
    context::Context,
    counter::Counter,
    error::{About, Result, WorkflowError},
    figures::rounded,
    parameters::within,
    request::{PathKind, Request, outputs},
    sun::Moment,
};
use doubts::{POOR_FIT, doubts};

pub const CAMERA_FILE: &str = "the camera file";
/// Pitch from which ray-cast people are split badly: a body is far from the upright plane that it is taken for.
const STEEP_DEG: f64 = 50.0;

/// Remove a person's shadow from masks, from the pose of the camera and the place of the sun, of a lamp, or a measured direction.
///
/// The camera file has the pose in a table `camera`: height_m (lens above the ground), azimuth_deg (viewing direction,
/// anticlockwise from north), pitch_deg (downwards positive), focal_length_mm, pixel_um, width_px and height_px. Tables `subject`
/// (height_m = 1.75, head_width_m = 0.17; optionally distance_m) and `standard_deviations` change the defaults (docs/people.md).
///
/// `shadow.toml` next to the masks flags doubtful frames: no person or several, the shadow behind the person or cut off by the
/// lower edge of the picture, much removed, an uncertain angle, a shadow that is not where the light casts it. After the first
/// mask a sun that is too low and a person who is too near are flagged, too, and the mask is written unchanged.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize, JsonSchema)]
#[cfg_attr(feature = "clap", derive(clap::Args))]
#[cfg_attr(
    feature = "clap",
    command(
        after_help = "Example: farnear shadow remove masks/ --camera camera.toml --time 2014-06-23T11:30:00Z --lat 52.38 \
                      --lon -1.56 --out clean/"
    )
)]
#[serde(default)]
pub struct ShadowRemoveRequest {
    /// Masks of a person with their shadow: a folder of pictures or one picture, full frames.
    pub masks: PathBuf,
    /// Pose of the camera, TOML.
    #[cfg_attr(feature = "clap", arg(long, value_name = "FILE"))]
    pub camera: PathBuf,
    /// Latitude in degrees, north positive; with --lon and --time the light is the sun.
    #[cfg_attr(feature = "clap", arg(long, value_name = "DEG"))]
    pub lat: Option<f64>,
    /// Longitude in degrees, east positive.
    #[cfg_attr(feature = "clap", arg(long, value_name = "DEG"))]
    pub lon: Option<f64>,
    /// Time with its zone (RFC 3339), such as 2014-06-23T12:30:00+01:00.
    #[cfg_attr(feature = "clap", arg(long, value_name = "RFC3339"))]
    pub time: Option<String>,
    /// A lamp instead of the sun: its place in metres to the right, ahead and up from the ground below the lens.
    #[cfg_attr(feature = "clap", arg(long, value_name = "RIGHT,AHEAD,UP", allow_hyphen_values = true))]
    pub lamp: Option<String>,
    /// Direction of the shadow measured in the picture instead, in degrees from right (0) towards down (90).
    #[cfg_attr(feature = "clap", arg(long, value_name = "DEG"))]
    pub shadow_direction: Option<f64>,
    /// Masks per second: `--time` is that of the first mask, and the sun moves.
    #[cfg_attr(feature = "clap", arg(long, value_name = "HZ"))]
    pub rate_hz: Option<f64>,
    /// hybrid, or thesis (as printed in Li 2014).
    #[cfg_attr(feature = "clap", arg(long, default_value_t = Self::default().method))]
    #[schemars(with = "String")]
    pub method: Method,
    /// Folder for the masks without shadow; must not exist or be empty.
    #[cfg_attr(feature = "clap", arg(long))]
    pub out: PathBuf,
    /// Folder for a picture of each cut: the mask, its lower edge along the turned axis, the expected shadow and its
    /// uncertainty, body and shadow, and the removed part; must not exist or be empty.
    #[cfg_attr(feature = "clap", arg(long, value_name = "DIR"))]
    pub stages: Option<PathBuf>,
}

impl Default for ShadowRemoveRequest {
    fn default() -> Self {
        Self {
            masks: PathBuf::new(),
            camera: PathBuf::new(),
            lat: None,
            lon: None,
            time: None,
            lamp: None,
            shadow_direction: None,
            rate_hz: None,
            method: Method::default(),
            out: PathBuf::new(),
            stages: None,
        }
    }
}

impl Request for ShadowRemoveRequest {
    const NAME: &'static str = "shadow remove";
    const REQUIRED: &'static [&'static str] = &["masks", "camera", "out"];
    const PATHS: &'static [(&'static str, PathKind)] = &[
        ("masks", PathKind::Input),
        ("camera", PathKind::Input),
        ("out", PathKind::OutputFolder),
        ("stages", PathKind::OutputFolder),
    ];
    type Figures = RemovalFigures;

    fn check(&self) -> Result<()> {
        self.light()?.check()
    }

    fn run(&self, context: &Context<'_>) -> Result<RemovalFigures> {
        remove_from_masks(self, context)
    }
}

#[derive(Clone, Copy, PartialEq, Debug)]
enum LightSource {
    Sun {
        moment: Moment,
        /// Masks per second, 0.001 to 1e6; without it all masks have the same time.
        rate_hz: Option<f64>,
    },
    Lamp(Lamp),
    /// Measured shadow direction in the picture, clockwise from the right, -180 to 180.
    Direction {
        degrees: f64,
    },
}

#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct RemovalFigures {
    pub frames: usize,
    pub cut: usize,
    pub flagged: usize,
    pub empty: usize,
    /// Masks of a person that are written unchanged: the sun is too low or the person too near.
    pub unchanged: usize,
    /// At the first mask. This and the next two are for the sun only.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sun_elevation_deg: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sun_azimuth_deg: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sun_in_view: Option<bool>,
    /// Mean over the cut silhouettes.
    pub removed_percent: Option<f64>,
    pub cut_ms_per_frame: f64,
    pub seconds: f64,
}

#[derive(Serialize)]
struct Index {
    #[serde(skip_serializing_if = "Option::is_none")]
    sun: Option<Sun>,
    frame: Vec<Entry>,
}

#[derive(Clone, Copy, Serialize)]
struct Sun {
    elevation_deg: f64,
    azimuth_deg: f64,
    in_view: bool,
}

#[derive(Serialize)]
struct Entry {
    file: String,
    flags: Vec<String>,
    #[serde(flatten)]
    cut: Option<Cut>,
}

#[derive(Serialize)]
struct Cut {
    /// In the picture, clockwise from the right.
    shadow_direction_deg: f64,
    /// Rotation angle of the cut (Li 2014, eq. 8.20) and its standard deviation (first order, if valid).
    beta_deg: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    beta_sd_deg: Option<f64>,
    distance_m: f64,
    removed_percent: f64,
    /// Pixels explained by neither body nor shadow. Missing if the cut used angles only.
    #[serde(skip_serializing_if = "Option::is_none")]
    unexplained_percent: Option<f64>,
    /// Expected shadow that the mask does not have. Missing as above.
    #[serde(skip_serializing_if = "Option::is_none")]
    missing_shadow_percent: Option<f64>,
}

/// Also writes `shadow.toml`, which flags doubtful masks. Writes nothing on failure.
pub fn remove_from_masks(request: &ShadowRemoveRequest, context: &Context<'_>) -> Result<RemovalFigures> {
    let start = Instant::now();
    outputs::check(request)?;
    let camera = camera(&request.camera)?;
    let source = request.light()?;
    let (light, _) = source.at(0)?;
    // Fail without a usable light before reading any mask.
    light.check(camera.subject.height_m, &camera.camera)?;
    let sun = sun_of(light, &camera);
    if let Some(Sun { elevation_deg, in_view: true, .. }) = sun {
        context.info(&format!(
            "the camera looks into the sun (elevation {elevation_deg:.1} deg): expect glare in the masks and shadows that come straight at it"
        ));
    }
    let pitch_deg = camera.camera.pitch_deg;
    if pitch_deg > STEEP_DEG {
        context.progress.warn(&format!(
            "{}: the camera looks down by {pitch_deg} deg: above {STEEP_DEG} deg much of a person is taken for shadow, or shadow for the \
             person, often without a flag; check the masks",
            request.camera.display()
        ));
    }
    let masks = masks::Sequence::open(&request.masks)?;
    masks.levels.check_people(&request.masks)?;
    if let Some(remark) = &masks.levels.remark {
        context.progress.warn(&format!("{}: {remark}", request.masks.display()));
    }
    let out = Staging::new_folder(&request.out)?;
    let stages = request.stages.as_deref().map(Stages::begin).transpose()?;
    let mut work = Work {
        light: source,
        method: request.method,
        camera: &camera,
        chooser: None,
        stages,
        cut_seconds: 0.0,
        uncut: [0; 2],
    };
    let frames = masks.files.len();
    let mut index = Index { sun, frame: Vec::with_capacity(frames) };
    let counter = Counter::new(context, "masks");
    for (number, named) in masks.named().enumerate() {
        counter.check("cutting shadow off")?;
        let named = named?;
        let file = format!("{}.png", named.name);
        let (mask, entry) = work.frame(number, &named.mask, file).about(|| named.name.clone())?;
        out.write(&entry.file, &masks::png(&mask)?)?;
        index.frame.push(entry);
        counter.one(Some(frames));
    }
    out.write("shadow.toml", toml::to_string(&index)?.as_bytes())?;
    out.finish()?;
    context.info(&format!("wrote {}", request.out.display()));
    let [low, near] = work.uncut;
    if low + near > 0 {
        context.progress.warn(&format!(
            "{}: {} of {frames} masks are unchanged: {low} with a sun below {LOWEST_SUN_DEG} deg (low-sun), {near} of a person \
             who is too near (no-distance)",
            request.masks.display(),
            low + near
        ));
    }
    if let (Some(stages), Some(folder)) = (work.stages.take(), &request.stages) {
        stages.finish()?;
        context.info(&format!("wrote {}", folder.display()));
    }
    let removed: Vec<f64> =
        index.frame.iter().filter_map(|entry| Some(entry.cut.as_ref()?.removed_percent)).collect();
    let poor = index.frame.iter().filter(|entry| entry.flags.iter().any(|flag| flag == POOR_FIT)).count();
    if 2 * poor > removed.len() {
        context.progress.warn(&source.of_poor_fits(poor, removed.len(), &request.masks));
    }
    let mean = removed.iter().sum::<f64>() / removed.len().max(1) as f64;
    Ok(RemovalFigures {
        frames,
        cut: removed.len(),
        flagged: index.frame.iter().filter(|entry| !entry.flags.is_empty()).count(),
        empty: frames - removed.len() - low - near,
        unchanged: low + near,
        sun_elevation_deg: index.sun.map(|sun| sun.elevation_deg),
        sun_azimuth_deg: index.sun.map(|sun| sun.azimuth_deg),
        sun_in_view: index.sun.map(|sun| sun.in_view),
        removed_percent: (!removed.is_empty()).then(|| rounded(mean, 2)),
        cut_ms_per_frame: rounded(1e3 * work.cut_seconds / removed.len().max(1) as f64, 3),
        seconds: rounded(start.elapsed().as_secs_f64(), 3),
    })
}

/// Parses `RIGHT,AHEAD,UP` in metres from the ground below the lens.
fn parse_lamp(text: &str) -> Result<Lamp, String> {
    let numbers: Vec<f64> = text.split(',').filter_map(|part| part.trim().parse().ok()).collect();
    let [right_m, ahead_m, up_m] = numbers[..] else {
        return Err(
            "expected RIGHT,AHEAD,UP in metres from the ground below the lens, such as -1.5,6,3".into()
        );
    };
    Ok(Lamp { right_m, ahead_m, up_m })
}

fn sun_of(light: Light, camera: &CameraFile) -> Option<Sun> {
    let Light::Sun(sun) = light else { return None };
    Some(Sun {
        elevation_deg: rounded(sun.elevation_deg, 4),
        azimuth_deg: rounded(sun.azimuth_deg, 4),
        in_view: camera.camera.sees_sun(sun),
    })
}

impl ShadowRemoveRequest {
    fn light(&self) -> Result<LightSource> {
        let given = [
            ("lat, lon and time", self.lat.is_some() || self.lon.is_some() || self.time.is_some()),
            ("lamp", self.lamp.is_some()),
            ("shadow_direction", self.shadow_direction.is_some()),
        ];
        let names: Vec<&str> = given.iter().filter_map(|(name, given)| given.then_some(*name)).collect();
        let expected = "expected one of: lat, lon and time (the sun), lamp, shadow_direction";
        let wrong = |names: &str| WorkflowError::parameter("light", names, expected);
        if let (Some(rate_hz), false) = (self.rate_hz, names == ["lat, lon and time"]) {
            let expected = "it moves the sun: expected lat, lon and time";
            return Err(WorkflowError::parameter("rate_hz", rate_hz, expected));
        }
        match (names.as_slice(), self.lat, self.lon, &self.time, &self.lamp, self.shadow_direction) {
            ([_], Some(lat), Some(lon), Some(time), ..) => {
                Ok(LightSource::Sun { moment: Moment::new(lat, lon, time)?, rate_hz: self.rate_hz })
            }
            ([_], .., Some(lamp), _) => parse_lamp(lamp)
                .map(LightSource::Lamp)
                .map_err(|expected| WorkflowError::parameter("lamp", lamp, expected)),
            ([_], .., Some(degrees)) => Ok(LightSource::Direction { degrees }),
            (["lat, lon and time"], ..) => {
                let parts =
                    [("lat", self.lat.is_some()), ("lon", self.lon.is_some()), ("time", self.time.is_some())];
                let missing: Vec<&str> =
                    parts.iter().filter_map(|(name, given)| (!given).then_some(*name)).collect();
                let missing = format!("{} missing", missing.join(" and "));
                Err(WorkflowError::parameter("sun", missing, "expected lat, lon and time"))
            }
            ([], ..) => Err(wrong("none")),
            (names, ..) => Err(wrong(&names.join(" and "))),
        }
    }
}

impl LightSource {
    fn check(&self) -> Result<()> {
        match self {
            Self::Sun { rate_hz: Some(rate_hz), .. } => {
                within("masks per second", *rate_hz, &(1e-3..=1e6), "").map(drop)
            }
            Self::Sun { .. } => Ok(()),
            Self::Lamp(Lamp { right_m, ahead_m, up_m }) => {
                [("lamp to the right", right_m), ("lamp ahead", ahead_m), ("lamp above the ground", up_m)]
                    .into_iter()
                    .try_for_each(|(name, value)| within(name, *value, &(-1e3..=1e3), "m").map(drop))
            }
            Self::Direction { degrees } => {
                within("shadow's direction", *degrees, &(-180.0..=180.0), "deg").map(drop)
            }
        }
    }

    /// Light for a mask, with the moment if the light is the sun.
    fn at(&self, number: usize) -> Result<(Light, Option<Moment>)> {
        Ok(match *self {
            Self::Sun { moment, rate_hz } => {
                let passed_s = rate_hz.map_or(0.0, |rate| number as f64 / rate);
                let time = moment.time + TimeDelta::microseconds((1e6 * passed_s) as i64);
                let sun = position(time, moment.place, Model::Psa)?;
                (Light::Sun(sun), Some(Moment { time, ..moment }))
            }
            Self::Lamp(lamp) => (Light::Lamp(lamp), None),
            Self::Direction { degrees } => (Light::Direction { eta_rad: degrees.to_radians() }, None),
        })
    }
}

fn camera(path: &Path) -> Result<CameraFile> {
    let text = fs::read_to_string(path).map_err(WorkflowError::read(CAMERA_FILE, path))?;
    CameraFile::parse(&text).about(|| path.display().to_string())
}

struct Work<'a> {
    light: LightSource,
    method: Method,
    camera: &'a CameraFile,
    chooser: Option<SubjectChooser>,
    stages: Option<Stages>,
    cut_seconds: f64,
    /// Masks with a sun that is too low, and of a person without a usable distance.
    uncut: [usize; 2],
}

impl Work<'_> {
    fn frame(&mut self, number: usize, mask: &Mask, file: String) -> Result<(Mask, Entry)> {
        let chooser =
            self.chooser.get_or_insert_with(|| SubjectChooser::new(SubjectSettings::for_size(mask.dim())));
        let chosen = chooser.choose(mask.view());
        let mut flags: Vec<String> = chosen.flags.iter().map(Flag::to_string).collect();
        let several = chosen.flags.iter().any(|flag| matches!(flag, Flag::SeveralPeople { .. }));
        // With several people, a cut for one would also cut the others.
        let mask = if several { &chosen.mask } else { mask };
        let (light, moment) = self.light.at(number)?;
        let start = Instant::now();
        let (clean, cut, sure) = match self.cut(mask, light, moment) {
            Ok(cut) => cut,
            Err(UncertaintyError::Shadow(error)) => {
                let Some(reason) = self.left_out(&error, number) else { return Err(error.into()) };
                if reason != Flag::Empty.to_string() || flags.is_empty() {
                    flags.push(reason.clone());
                }
                if let Some(stages) = &mut self.stages {
                    stages.unchanged(&file, mask, &reason)?;
                }
                return Ok((mask.clone(), Entry { file, flags, cut: None }));
            }
            Err(error) => return Err(error.into()),
        };
        self.cut_seconds += start.elapsed().as_secs_f64();
        if let Some(stages) = &mut self.stages {
            let (camera, method) = (self.camera, self.method);
            let stage =
                Stage { mask, clean: &clean, camera, light, method, report: &cut, sure: sure.as_ref() };
            stages.draw(&file, stage)?;
        }
        flags.extend(doubts(&cut, light, self.method).into_iter().map(str::to_owned));
        if sure.is_some_and(|sure| !sure.first_order_holds) {
            flags.push("angle-unsure".into());
        }
        let cut = Some(Cut {
            shadow_direction_deg: rounded(cut.shadow.eta_rad.to_degrees(), 2),
            beta_deg: rounded(cut.beta_rad.to_degrees(), 2),
            beta_sd_deg: sure
                .filter(|sure| sure.first_order_holds)
                .map(|sure| rounded(sure.beta_rad.to_degrees(), 3)),
            distance_m: rounded(cut.subject.distance_m, 2),
            removed_percent: rounded(100.0 * cut.removed_fraction, 2),
            unexplained_percent: cut.unexplained.map(|share| rounded(100.0 * share, 2)),
            missing_shadow_percent: cut.missing.map(|share| rounded(100.0 * share, 2)),
        });
        Ok((clean, Entry { file, flags, cut }))
    }

    /// The angle's uncertainty follows from the sun's time and place; it is unknown for lamps and measurements.
    fn cut(
        &self,
        mask: &Mask,
        light: Light,
        moment: Option<Moment>,
    ) -> Result<(Mask, CutReport, Option<Uncertainty>), UncertaintyError> {
        let sure = |subject| {
            moment.map(|Moment { place, time }| propagate(self.camera, time, place, Model::Psa, subject))
        };
        // Only the thesis' method searches about the angle; its subject is not fitted.
        let sd_rad = match self.method {
            Method::Thesis => {
                sure(subject_of(mask, self.camera)?).transpose()?.map_or(0.0, |sure| sure.beta_rad)
            }
            Method::Hybrid => 0.0,
        };
        let (clean, report) = remove(mask, self.camera, light, sd_rad, self.method)?;
        let sure = sure(report.subject).transpose()?;
        Ok((clean, report, sure))
    }

    /// Flag of a mask that is written unchanged; counts it. `None` if the error ends the work: an unusable light or camera shows
    /// at the first mask.
    fn left_out(&mut self, error: &ShadowError, number: usize) -> Option<String> {
        let (flag, kind) = match error {
            ShadowError::EmptyMask => return Some(Flag::Empty.to_string()),
            ShadowError::SunTooLow { .. } => ("low-sun", 0),
            ShadowError::Distance { .. } => ("no-distance", 1),
            ShadowError::LampTooLow { .. } | ShadowError::Shape { .. } => return None,
        };
        if number == 0 {
            return None;
        }
        self.uncut[kind] += 1;
        Some(flag.into())
    }
}

#[cfg(test)]
mod tests;

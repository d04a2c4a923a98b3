//! Taking a person's shadow off masks by where the sun stands and how the camera does.

use std::{
    fs,
    path::{Path, PathBuf},
    time::Instant,
};

use chrono::TimeDelta;
use farnear_activity::{
    mask::{
        Mask,
        subject::{Flag, SubjectChooser, SubjectSettings},
    },
    shadow::{
        CameraFile, CutReport, Method,
        cut::SIDEWAYS,
        projection::{ShadowError, on_ground},
        remove, subject_of,
        uncertainty::propagate,
    },
    sun::{Model, SunPosition, position},
};
use farnear_files::{masks, staging::Staging};
use serde::Serialize;

use crate::{
    context::Context,
    counter::Counter,
    error::{About, Result, WorkflowError},
    figures::rounded,
    parameters::within,
    sun::Moment,
};

/// What the file is called that says how a camera stands.
pub const CAMERA_FILE: &str = "the camera file";

/// Above this share of a silhouette removed the cut is doubted, 0 to 1.
const MUCH: f64 = 0.6;

/// What shadow is taken off, and where to.
#[derive(Clone, PartialEq, Debug)]
pub struct RemovalSettings {
    /// Masks of a person with their shadow: a folder of pictures or one picture, full frames.
    pub masks: PathBuf,
    /// How the camera stands, TOML.
    pub camera: PathBuf,
    /// Where the camera stands, and the first mask's time.
    pub moment: Moment,
    /// Masks per second, 0.001 to a million; without it all have one time.
    pub rate_hz: Option<f64>,
    /// How shadow is cut off.
    pub method: Method,
    /// The new folder for the masks without shadow.
    pub out: PathBuf,
}

/// What was cut.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct RemovalFigures {
    /// Masks.
    pub frames: usize,
    /// Masks that were cut.
    pub cut: usize,
    /// Masks with something doubtful.
    pub flagged: usize,
    /// Masks without a subject.
    pub empty: usize,
    /// The sun above the horizon at the first mask.
    pub sun_elevation_deg: f64,
    /// The sun clockwise from north.
    pub sun_azimuth_deg: f64,
    /// Whether the camera looks into the sun.
    pub sun_in_view: bool,
    /// Mean share of the silhouettes that were cut off, of those that were cut.
    pub removed_percent: Option<f64>,
    /// Time for one cut.
    pub cut_ms_per_frame: f64,
    /// Time for all.
    pub seconds: f64,
}

/// `shadow.toml`.
#[derive(Serialize)]
struct Index {
    sun: Sun,
    frame: Vec<Entry>,
}

#[derive(Serialize)]
struct Sun {
    elevation_deg: f64,
    azimuth_deg: f64,
    /// The camera looks into the sun.
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
    /// Direction of the shadow in the picture, degrees from right towards down.
    shadow_direction_deg: f64,
    /// Rotation angle of the cut (Li 2014, eq. 8.20) and its standard deviation; the latter only where first order holds.
    beta_deg: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    beta_sd_deg: Option<f64>,
    distance_m: f64,
    removed_percent: f64,
}

/// Cuts the shadow off all masks and writes them with `shadow.toml`, which flags the doubtful ones.
///
/// # Errors
/// Missing or wrong camera files and masks, a sun too low for shadows, masks that cannot be written; then the new folder is
/// not there.
pub fn remove_from_masks(settings: &RemovalSettings, context: &Context<'_>) -> Result<RemovalFigures> {
    let start = Instant::now();
    if let Some(rate_hz) = settings.rate_hz {
        within("masks per second", rate_hz, &(1e-3..=1e6), "")?;
    }
    let camera = camera(&settings.camera)?;
    let sun = position(settings.moment.time, settings.moment.place, Model::Psa)?;
    // Before any mask is read: without a usable sun there is nothing to do.
    on_ground(sun, camera.subject.height_m, &camera.camera)?;
    let in_view = camera.camera.sees_sun(sun);
    if in_view {
        context.say(&format!(
            "the camera looks into the sun (elevation {:.1} deg): expect glare in the masks and shadows that come straight at it",
            sun.elevation_deg
        ));
    }
    let all = masks::read_all(&settings.masks)?;
    let out = Staging::new_folder(&settings.out)?;
    let mut work = Work { settings, camera: &camera, chooser: None, cut_seconds: 0.0 };
    let (elevation_deg, azimuth_deg) = (rounded(sun.elevation_deg, 4), rounded(sun.azimuth_deg, 4));
    let sun = Sun { elevation_deg, azimuth_deg, in_view };
    let mut index = Index { sun, frame: Vec::with_capacity(all.len()) };
    let counter = Counter::new(context, "masks");
    for (number, named) in all.iter().enumerate() {
        counter.check("cutting shadow off")?;
        let file = format!("{}.png", named.name);
        let (mask, entry) = work.frame(number, &named.mask, file).about(|| named.name.clone())?;
        out.write(&entry.file, &masks::png(&mask)?)?;
        index.frame.push(entry);
        counter.one(Some(all.len()));
    }
    out.write("shadow.toml", toml::to_string(&index)?.as_bytes())?;
    out.finish()?;
    context.say(&format!("wrote {}", settings.out.display()));
    let removed: Vec<f64> =
        index.frame.iter().filter_map(|entry| Some(entry.cut.as_ref()?.removed_percent)).collect();
    let mean = removed.iter().sum::<f64>() / removed.len().max(1) as f64;
    Ok(RemovalFigures {
        frames: all.len(),
        cut: removed.len(),
        flagged: index.frame.iter().filter(|entry| !entry.flags.is_empty()).count(),
        empty: all.len() - removed.len(),
        sun_elevation_deg: elevation_deg,
        sun_azimuth_deg: azimuth_deg,
        sun_in_view: in_view,
        removed_percent: (!removed.is_empty()).then(|| rounded(mean, 2)),
        cut_ms_per_frame: rounded(1e3 * work.cut_seconds / removed.len().max(1) as f64, 3),
        seconds: rounded(start.elapsed().as_secs_f64(), 3),
    })
}

fn camera(path: &Path) -> Result<CameraFile> {
    let text = fs::read_to_string(path).map_err(WorkflowError::read(CAMERA_FILE, path))?;
    CameraFile::parse(&text).about(|| path.display().to_string())
}

/// What goes on from frame to frame.
struct Work<'a> {
    settings: &'a RemovalSettings,
    camera: &'a CameraFile,
    chooser: Option<SubjectChooser>,
    cut_seconds: f64,
}

impl Work<'_> {
    /// Cuts one mask.
    fn frame(&mut self, number: usize, mask: &Mask, file: String) -> Result<(Mask, Entry)> {
        let chooser =
            self.chooser.get_or_insert_with(|| SubjectChooser::new(SubjectSettings::for_size(mask.dim())));
        let chosen = chooser.choose(mask.view());
        let mut flags: Vec<String> = chosen.flags.iter().map(Flag::to_string).collect();
        let several = chosen.flags.iter().any(|flag| matches!(flag, Flag::SeveralPeople { .. }));
        // With several people in it, what is cut for one would be cut off the others.
        let mask = if several { &chosen.mask } else { mask };
        let passed_s = self.settings.rate_hz.map_or(0.0, |rate| number as f64 / rate);
        let Moment { place, time } = self.settings.moment;
        let time = time + TimeDelta::microseconds((1e6 * passed_s) as i64);
        let sun = position(time, place, Model::Psa)?;
        let start = Instant::now();
        let subject = match subject_of(mask, self.camera) {
            Ok(subject) => subject,
            Err(ShadowError::EmptyMask) => {
                if flags.is_empty() {
                    flags.push(Flag::Empty.to_string());
                }
                return Ok((mask.clone(), Entry { file, flags, cut: None }));
            }
            Err(error) => return Err(error.into()),
        };
        let sure = propagate(self.camera, time, place, Model::Psa, subject)?;
        let (clean, cut) = remove(mask, self.camera, sun, sure.beta_rad, self.settings.method)?;
        self.cut_seconds += start.elapsed().as_secs_f64();
        flags.extend(doubts(&cut, sun).into_iter().map(str::to_owned));
        if !sure.first_order_holds {
            flags.push("angle-unsure".into());
        }
        let cut = Some(Cut {
            shadow_direction_deg: rounded(cut.shadow.eta_rad.to_degrees(), 2),
            beta_deg: rounded(cut.beta_rad.to_degrees(), 2),
            beta_sd_deg: sure.first_order_holds.then(|| rounded(sure.beta_rad.to_degrees(), 3)),
            distance_m: rounded(cut.subject.distance_m, 2),
            removed_percent: rounded(100.0 * cut.removed_fraction, 2),
        });
        Ok((clean, Entry { file, flags, cut }))
    }
}

/// What is doubtful about a cut.
fn doubts(cut: &CutReport, sun: SunPosition) -> Vec<&'static str> {
    /// Below this the shadow is so long that its direction in the picture hangs on small errors.
    const LOW_DEG: f64 = 8.0;
    let found = [
        (cut.shadow.eta_rad.sin() < -SIDEWAYS, "shadow-behind"),
        (cut.shadow.shortened, "shadow-leaves-picture"),
        (cut.removed_fraction > MUCH, "much-removed"),
        (sun.elevation_deg < LOW_DEG, "low-sun"),
    ];
    found.into_iter().filter_map(|(holds, name)| holds.then_some(name)).collect()
}

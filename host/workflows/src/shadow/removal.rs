//! `farnear shadow remove`: takes a person's shadow off masks by where the sun stands and how the camera does.

use std::{fs, path::PathBuf, time::Instant};

use anyhow::{Context, Result, bail};
use chrono::TimeDelta;
use clap::Args;
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
use farnear_capture::aside::Aside;
use serde::Serialize;

use crate::{commands::sun::Moment, masks, report};

/// Above this share of a silhouette removed the cut is doubted, 0 to 1.
const MUCH: f64 = 0.6;

/// Takes a person's shadow off masks: the sun's place and the camera's tell where the shadow falls.
///
/// The camera file says how the camera stands:
///
///     [camera]
///     height_m = 0.8              # lens above the ground
///     azimuth_deg = 140.0         # viewing direction, anticlockwise from north
///     pitch_deg = 0.0             # downwards positive
///     focal_length_mm = 4.0
///     pixel_um = 6.0
///     width_px = 640
///     height_px = 480
///
/// and, in tables `subject` (height_m = 1.75, head_width_m = 0.17) and `standard_deviations`, what differs from the usual. Frames whose cut is doubtful (nobody or several people in it, the shadow behind the person or cut off by the picture's
/// lower edge, much removed, an angle too unsure) are flagged in `shadow.toml` beside the masks.
#[derive(Args)]
#[command(
    verbatim_doc_comment,
    after_help = "Example: farnear shadow remove masks/ --camera camera.toml --time 2014-06-23T11:30:00Z --lat 52.38 \
                  --lon -1.56 --out clean/"
)]
pub struct Arguments {
    /// Masks of a person with their shadow: a folder of pictures or one picture, full frames.
    masks: PathBuf,
    /// How the camera stands, TOML.
    #[arg(long, value_name = "FILE")]
    camera: PathBuf,
    #[command(flatten)]
    moment: Moment,
    /// Masks per second: with it `--time` is the first mask's and the sun moves on.
    #[arg(long, value_name = "HZ", value_parser = rate)]
    rate_hz: Option<f64>,
    /// hybrid, or thesis (as printed in Li 2014).
    #[arg(long, default_value = "hybrid")]
    method: Method,
    /// Folder for the masks without shadow; must not exist or be empty.
    #[arg(long)]
    out: PathBuf,
    /// Print figures as JSON.
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Figures {
    frames: usize,
    cut: usize,
    flagged: usize,
    empty: usize,
    sun_elevation_deg: f64,
    sun_azimuth_deg: f64,
    sun_in_view: bool,
    removed_percent: Option<f64>,
    cut_ms_per_frame: f64,
    seconds: f64,
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

/// Runs the command.
///
/// # Errors
/// Missing or wrong camera files and masks, a sun too low for shadows, masks that cannot be written; then `--out` is left as it was.
pub fn run(arguments: &Arguments) -> Result<()> {
    let start = Instant::now();
    let shown = arguments.camera.display();
    let text = fs::read_to_string(&arguments.camera)
        .with_context(|| format!("cannot read the camera file {shown} (see farnear shadow remove --help)"))?;
    let camera = CameraFile::parse(&text).with_context(|| format!("{shown}"))?;
    let sun = position(arguments.moment.time, arguments.moment.place(), Model::Psa)?;
    // Before any mask is read: without a usable sun there is nothing to do.
    on_ground(sun, camera.subject.height_m, &camera.camera)?;
    let in_view = camera.camera.sees_sun(sun);
    if in_view {
        eprintln!(
            "the camera looks into the sun (elevation {:.1} deg): expect glare in the masks and shadows that come straight at it",
            sun.elevation_deg
        );
    }
    let all = masks::read_all(&arguments.masks)?;
    let out = Aside::new_folder(&arguments.out)?;
    let mut work = Work { arguments, camera: &camera, chooser: None, cut_seconds: 0.0 };
    let mut index = Index {
        sun: Sun {
            elevation_deg: report::rounded(sun.elevation_deg, 4),
            azimuth_deg: report::rounded(sun.azimuth_deg, 4),
            in_view,
        },
        frame: Vec::with_capacity(all.len()),
    };
    for (number, named) in all.iter().enumerate() {
        let file = format!("{}.png", named.name);
        let (mask, entry) = work.frame(number, &named.mask, file).with_context(|| named.name.clone())?;
        out.write(&entry.file, &masks::png(&mask)?)?;
        index.frame.push(entry);
    }
    out.write("shadow.toml", toml::to_string(&index)?.as_bytes())?;
    out.finish()?;
    eprintln!("wrote {}", arguments.out.display());
    let removed: Vec<f64> =
        index.frame.iter().filter_map(|entry| Some(entry.cut.as_ref()?.removed_percent)).collect();
    let mean = removed.iter().sum::<f64>() / removed.len().max(1) as f64;
    let figures = Figures {
        frames: all.len(),
        cut: removed.len(),
        flagged: index.frame.iter().filter(|entry| !entry.flags.is_empty()).count(),
        empty: all.len() - removed.len(),
        sun_elevation_deg: index.sun.elevation_deg,
        sun_azimuth_deg: index.sun.azimuth_deg,
        sun_in_view: in_view,
        removed_percent: (!removed.is_empty()).then(|| report::rounded(mean, 2)),
        cut_ms_per_frame: report::rounded(1e3 * work.cut_seconds / removed.len().max(1) as f64, 3),
        seconds: report::rounded(start.elapsed().as_secs_f64(), 3),
    };
    report::print(&figures, arguments.json)
}

/// What goes on from frame to frame.
struct Work<'a> {
    arguments: &'a Arguments,
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
        let passed_s = self.arguments.rate_hz.map_or(0.0, |rate| number as f64 / rate);
        let time = self.arguments.moment.time + TimeDelta::microseconds((1e6 * passed_s) as i64);
        let place = self.arguments.moment.place();
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
            Err(error) => bail!(error),
        };
        let sure = propagate(self.camera, time, place, Model::Psa, subject)?;
        let (clean, cut) = remove(mask, self.camera, sun, sure.beta_rad, self.arguments.method)?;
        self.cut_seconds += start.elapsed().as_secs_f64();
        flags.extend(doubts(&cut, sun).into_iter().map(str::to_owned));
        if !sure.first_order_holds {
            flags.push("angle-unsure".into());
        }
        let entry = Entry {
            file,
            flags,
            cut: Some(Cut {
                shadow_direction_deg: report::rounded(cut.shadow.eta_rad.to_degrees(), 2),
                beta_deg: report::rounded(cut.beta_rad.to_degrees(), 2),
                beta_sd_deg: sure.first_order_holds.then(|| report::rounded(sure.beta_rad.to_degrees(), 3)),
                distance_m: report::rounded(cut.subject.distance_m, 2),
                removed_percent: report::rounded(100.0 * cut.removed_fraction, 2),
            }),
        };
        Ok((clean, entry))
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

fn rate(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(value) if (1e-3..=1e6).contains(&value) => Ok(value),
        _ => Err("expected masks per second, above 0.001".into()),
    }
}

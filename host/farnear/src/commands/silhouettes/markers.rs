//! `farnear silhouettes markers`: silhouettes of a motion-capture recording from views all round.

use std::{
    collections::HashMap,
    fs,
    path::{Path, PathBuf},
    time::Instant,
};

use anyhow::{Context, Result, bail, ensure};
use clap::{Args, ValueEnum};
use farnear_activity::{
    mask::{
        Mask,
        centre::{SIDE_PX, centred},
    },
    readers::{
        self,
        recording::{Choices, Recording, Unit, Up},
    },
    silhouette::{
        capsule::Point3,
        parts::{self, Fill},
        redundant::remove_redundant,
        template::Template,
        view::{Canvas, View, views_round},
    },
};
use farnear_capture::aside::Aside;
use rayon::prelude::*;
use serde::Serialize;

use crate::{masks, report};

/// Pixels kept free round the subject.
const MARGIN_PX: usize = 2;

/// Silhouettes of a motion-capture recording (C3D, TRC, CSV or BVH) from views at equal steps round the subject.
///
/// A template says which markers make which part of the body; parts are filled and the gaps between them closed. Every view
/// gets a folder `view1`, `view2`, ... of masks, one PNG per frame, all on one canvas so that the subject moves in it as in a
/// camera's picture. `silhouettes.toml` flags frames in which a part had no visible marker.
#[derive(Args)]
#[command(
    after_help = "Example: farnear silhouettes markers walk.c3d --template plug-in-gait --views 8 --out masks/"
)]
pub struct Arguments {
    /// The recording: .c3d, .trc, .bvh, or .csv with columns NAME_x, NAME_y, NAME_z in mm.
    file: PathBuf,
    /// plug-in-gait (also CMU's 41 markers), vicon-53, opencap, thesis, bvh, or a TOML file of `[[part]] name, markers, thickness_mm`.
    #[arg(long, value_name = "NAME|FILE")]
    template: String,
    /// Folder for the masks; must not exist or be empty.
    #[arg(long)]
    out: PathBuf,
    /// Views at equal steps round the subject.
    #[arg(long, default_value_t = 8, value_parser = clap::value_parser!(u8).range(1..=72))]
    views: u8,
    /// Direction of the first view, degrees round the vertical.
    #[arg(long, default_value_t = 0.0, allow_negative_numbers = true)]
    first_view_deg: f64,
    /// From how high the views look down, degrees.
    #[arg(long, default_value_t = 0.0, allow_negative_numbers = true, value_parser = elevation)]
    elevation_deg: f64,
    /// Millimetres per pixel (6 is the thesis' 167 pixels per metre).
    #[arg(long, default_value_t = 6.0, value_parser = positive)]
    mm_per_px: f64,
    /// Gaps at joints up to this width are closed, millimetres [default: 126 as in the thesis, 40 where the template's parts have a
    /// thickness, which fills joints by itself].
    #[arg(long, value_name = "MM", value_parser = not_negative)]
    close_mm: Option<f64>,
    /// Fill a part's convex hull, or all triplets of its markers as in the thesis (the same picture, slower).
    #[arg(long, default_value = "hull")]
    fill: FillChoice,
    /// Take every so-many-th frame.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    every: u32,
    /// Which axis of the file points up (x, y or z); by default y in TRC files, what the body says in BVH files, z in others.
    #[arg(long)]
    up: Option<Up>,
    /// The file's unit of length (mm, cm, m, in, cmu or a number of millimetres), where it states none or another.
    #[arg(long)]
    unit: Option<Unit>,
    /// Write masks of 100x100 pixels with the subject centred, instead of full frames.
    #[arg(long)]
    centred: bool,
    /// Keep only the so many least alike silhouettes of all views (Li 2014, eq. 7.3): a gallery, no longer a sequence. The
    /// masks are 100x100 then.
    #[arg(long, value_name = "COUNT", value_parser = clap::value_parser!(u32).range(1..))]
    keep: Option<u32>,
    /// Print figures as JSON.
    #[arg(long)]
    json: bool,
}

#[derive(Clone, Copy, ValueEnum)]
enum FillChoice {
    Hull,
    Triplets,
}

#[derive(Serialize)]
struct Figures {
    views: usize,
    frames: usize,
    silhouettes: usize,
    flagged_frames: usize,
    empty_frames: usize,
    markers: usize,
    hidden_markers_percent: f64,
    seconds: f64,
}

/// `silhouettes.toml`: what was drawn, and one entry per doubtful frame.
#[derive(Serialize)]
struct Index {
    template: String,
    rate_hz: f64,
    mm_per_px: f64,
    elevation_deg: f64,
    view_directions_deg: Vec<f64>,
    /// Parts of the template of which the recording has no marker at all.
    parts_not_recorded: Vec<String>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    flagged: Vec<Flagged>,
}

#[derive(Serialize)]
struct Flagged {
    frame: String,
    /// `empty`, or `missing:PART` where all markers of a part were hidden.
    flags: Vec<String>,
}

/// Runs the command.
///
/// # Errors
/// Files that cannot be read or do not fit the template, a subject larger than a picture may be, masks that cannot be written; then
/// `--out` is left as it was.
pub fn run(arguments: &Arguments) -> Result<()> {
    let start = Instant::now();
    let template = template(&arguments.template)?;
    let choices = Choices { unit: arguments.unit, up: arguments.up };
    let recording = recording(&arguments.file, choices)?;
    let shown = arguments.file.display();
    if let Err(error) = template.check(&recording.names) {
        let fits = |name: &&'static str| {
            Template::named(name).is_ok_and(|template| template.check(&recording.names).is_ok())
        };
        let hint = Template::names().find(|name| fits(name));
        let hint = hint.map_or(String::new(), |name| format!("; the built-in template `{name}` fits it"));
        bail!("{shown}: {error}{hint}");
    }
    let out = Aside::new_folder(&arguments.out)?;
    let numbers: Vec<usize> = (0..recording.frames.len()).step_by(arguments.every as usize).collect();
    let frames: Vec<HashMap<&str, Point3>> = numbers.iter().map(|&n| recording.by_name(n)).collect();
    let missing = missing_parts(&template, &recording, &frames);
    ensure!(
        frames.iter().any(|frame| !frame.is_empty()),
        "{shown}: no frame has a visible marker, so there is nothing to draw"
    );
    let names: Vec<String> = numbers.iter().map(|n| format!("frame_{:06}", n + 1)).collect();
    let mut views = views_round(usize::from(arguments.views), arguments.elevation_deg);
    views.iter_mut().for_each(|view| view.gamma_deg += arguments.first_view_deg);
    let job = Job { arguments, template: &template, frames: &frames, names: &names };
    let silhouettes = match arguments.keep {
        Some(keep) => job.gallery(&views, keep as usize, &out)?,
        None => {
            let drawn: Result<Vec<usize>> = views
                .par_iter()
                .enumerate()
                .map(|(index, view)| job.sequence(view, &format!("view{}", index + 1), &out))
                .collect();
            drawn?.iter().sum()
        }
    };
    let empty_frames = frames.iter().filter(|frame| frame.is_empty()).count();
    let flagged: Vec<Flagged> = names
        .iter()
        .zip(&missing.per_frame)
        .filter(|(_, flags)| !flags.is_empty())
        .map(|(frame, flags)| Flagged { frame: frame.clone(), flags: flags.clone() })
        .collect();
    let flagged_frames = flagged.len();
    for part in &missing.always {
        eprintln!("{shown}: no marker of `{part}` was recorded; it is not drawn");
    }
    let all: usize = recording.frames.iter().map(Vec::len).sum();
    let hidden = recording.frames.iter().flatten().filter(|point| point.is_none()).count();
    let index = Index {
        template: template.name.clone(),
        rate_hz: recording.rate_hz / f64::from(arguments.every),
        mm_per_px: arguments.mm_per_px,
        elevation_deg: arguments.elevation_deg,
        view_directions_deg: views.iter().map(|view| view.gamma_deg).collect(),
        parts_not_recorded: missing.always,
        flagged,
    };
    out.write("silhouettes.toml", toml::to_string(&index)?.as_bytes())?;
    out.finish()?;
    eprintln!("wrote {}", arguments.out.display());
    let figures = Figures {
        views: views.len(),
        frames: frames.len(),
        silhouettes,
        flagged_frames,
        empty_frames,
        markers: recording.names.len(),
        hidden_markers_percent: report::rounded(100.0 * hidden as f64 / all.max(1) as f64, 2),
        seconds: report::rounded(start.elapsed().as_secs_f64(), 3),
    };
    report::print(&figures, arguments.json)
}

/// What all views share.
struct Job<'a> {
    arguments: &'a Arguments,
    template: &'a Template,
    frames: &'a [HashMap<&'a str, Point3>],
    names: &'a [String],
}

impl Job<'_> {
    /// Draws a frame of a view.
    fn mask(&self, frame: &HashMap<&str, Point3>, view: &View, canvas: &Canvas) -> Mask {
        let fill = match self.arguments.fill {
            FillChoice::Hull => Fill::Hull,
            FillChoice::Triplets => Fill::Triplets,
        };
        let drawn = parts::draw(frame, self.template, view, canvas, fill);
        let thick = self.template.parts.iter().any(|part| part.thickness_mm > 0.0);
        let close_mm = self.arguments.close_mm.unwrap_or(if thick { 40.0 } else { 126.0 });
        let gap_px = (close_mm / self.arguments.mm_per_px).round() as usize;
        parts::close(&drawn.mask, gap_px)
    }

    fn canvas(&self, view: &View) -> Result<Canvas> {
        let reach = parts::extent(self.frames, self.template, view);
        let canvas = Canvas::fitting(&reach, self.arguments.mm_per_px, MARGIN_PX);
        canvas.with_context(|| {
            let [low, high] = [f64::min, f64::max].map(|pick: fn(f64, f64) -> f64| {
                reach.iter().flatten().copied().filter(|v| v.is_finite()).reduce(pick).unwrap_or(0.0)
            });
            format!(
                "the markers reach from {low:.0} to {high:.0} mm, which is no picture at {} mm per pixel; is the file's unit right? \
                 A larger --mm-per-px makes the picture smaller",
                self.arguments.mm_per_px
            )
        })
    }

    /// All frames of a view as a folder of masks; gives how many hold somebody.
    fn sequence(&self, view: &View, folder: &str, out: &Aside) -> Result<usize> {
        let canvas = self.canvas(view)?;
        let path = out.path(folder);
        fs::create_dir(&path).with_context(|| format!("cannot make the folder {folder}"))?;
        let mut silhouettes = 0;
        for (frame, name) in self.frames.iter().zip(self.names) {
            let mask = self.mask(frame, view, &canvas);
            silhouettes += usize::from(mask.iter().any(|&set| set));
            let mask = if self.arguments.centred { small(&mask) } else { mask };
            out.write(&format!("{folder}/{name}.png"), &masks::png(&mask)?)?;
        }
        Ok(silhouettes)
    }

    /// The `keep` least alike silhouettes of all views, in one folder.
    fn gallery(&self, views: &[View], keep: usize, out: &Aside) -> Result<usize> {
        let all: Result<Vec<Vec<(String, Mask)>>> = views
            .par_iter()
            .enumerate()
            .map(|(index, view)| {
                let canvas = self.canvas(view)?;
                let named = self.frames.iter().zip(self.names).filter_map(|(frame, name)| {
                    let mask = centred(self.mask(frame, view, &canvas).view(), SIDE_PX)?;
                    Some((format!("view{}_{name}.png", index + 1), mask))
                });
                Ok(named.collect())
            })
            .collect();
        let (names, pictures): (Vec<String>, Vec<Mask>) = all?.into_iter().flatten().unzip();
        let kept = remove_redundant(&pictures, keep);
        for &index in &kept {
            out.write(&names[index], &masks::png(&pictures[index])?)?;
        }
        Ok(kept.len())
    }
}

/// The subject in 100x100 pixels; an empty mask stays empty.
fn small(mask: &Mask) -> Mask {
    centred(mask.view(), SIDE_PX).unwrap_or_else(|| Mask::from_elem((SIDE_PX, SIDE_PX), false))
}

/// Parts that cannot be drawn.
struct Missing {
    always: Vec<String>,
    per_frame: Vec<Vec<String>>,
}

fn missing_parts(template: &Template, recording: &Recording, frames: &[HashMap<&str, Point3>]) -> Missing {
    let short = |name: &str| name.rsplit_once(':').map_or(name, |(_, short)| short).to_owned();
    let recorded =
        |marker: &String| recording.names.iter().any(|name| name == marker || short(name) == *marker);
    let (drawn, never): (Vec<_>, Vec<_>) =
        template.parts.iter().partition(|part| part.markers.iter().any(recorded));
    let flags = |frame: &HashMap<&str, Point3>| {
        if frame.is_empty() {
            return vec!["empty".to_owned()];
        }
        let hidden = drawn.iter().filter(|part| !part.markers.iter().any(|m| frame.contains_key(m.as_str())));
        hidden.map(|part| format!("missing:{}", part.name)).collect()
    };
    Missing {
        always: never.into_iter().map(|part| part.name.clone()).collect(),
        per_frame: frames.iter().map(flags).collect(),
    }
}

fn template(name: &str) -> Result<Template> {
    let path = Path::new(name);
    if Template::names().any(|known| known == name) || !path.is_file() {
        return Ok(Template::named(name)?);
    }
    let text = fs::read_to_string(path).with_context(|| format!("cannot read {name}"))?;
    Template::parse(&text).with_context(|| name.to_owned())
}

fn recording(path: &Path, choices: Choices) -> Result<Recording> {
    let shown = path.display();
    let bytes = fs::read(path).with_context(|| format!("cannot read {shown}"))?;
    let ending = path.extension().unwrap_or_default().to_string_lossy();
    let read = readers::read(&bytes, &ending, choices).with_context(|| format!("{shown}"))?;
    for remark in read.remarks() {
        eprintln!("{shown}: {remark} (--unit and --up name others)");
    }
    ensure!(!read.frames.is_empty(), "{shown}: the recording holds no frame");
    Ok(read)
}

/// A size that a picture can have a pixel for.
pub(super) fn positive(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(value) if (0.1..=1000.0).contains(&value) => Ok(value),
        _ => Err("expected a number from 0.1 to 1000".into()),
    }
}

fn not_negative(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(value) if (0.0..=1000.0).contains(&value) => Ok(value),
        _ => Err("expected a number from 0 to 1000".into()),
    }
}

fn elevation(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(value) if (-90.0..=90.0).contains(&value) => Ok(value),
        _ => Err("expected degrees from -90 to 90".into()),
    }
}

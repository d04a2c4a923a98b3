//! Silhouettes of motion-capture recordings (named markers or joints) in views from all sides. A template assigns
//! points to body parts. Parts are filled and the gaps between them closed.

mod drawing;
mod missing;

use std::{
    collections::HashMap,
    fs,
    path::{Path, PathBuf},
    time::Instant,
};

use farnear_files::staging::Staging;
use farnear_recognition::clip::Track;
use farnear_silhouettes::mask::Mask;
use farnear_silhouettes::readers::{
    self,
    keypoints::aspect::Aspect,
    recording::{Choices, Recording, Unit, Up},
};
use farnear_silhouettes::silhouette::{
    capsule::Point3,
    parts::{self, Fill},
    template::Template,
    view::{Canvas, View, views_round},
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_with::{DisplayFromStr, serde_as};

use self::{
    drawing::{Drawn, Job},
    missing::MissingParts,
};
use super::{MM_PER_PX, SilhouettesError, VIEWS, performances::samples_entry};
use crate::{
    activity::samples::SCALING,
    context::Context,
    error::{Result, WorkflowError},
    figures::rounded,
    parameters::{at_least, within},
    request::{PathKind, Request},
};

/// Silhouettes of a motion-capture recording (C3D, TRC, CSV, BVH, NTU or Kinect joints, keypoints) from views at equal steps round
/// the subject.
///
/// A template says which markers make which part of the body; parts are filled and the gaps between them closed. Every view
/// gets a folder `view1`, `view2`, ... of masks, one PNG per frame, all on one canvas so that the subject moves in it as in a
/// camera's picture. `silhouettes.toml` flags frames in which a part had no visible marker.
#[serde_as]
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize, JsonSchema)]
#[cfg_attr(feature = "clap", derive(clap::Args))]
#[cfg_attr(
    feature = "clap",
    command(
        after_help = "Example: farnear silhouettes markers walk.c3d --template plug-in-gait --views 8 --out masks/"
    )
)]
#[serde(default)]
pub struct MarkersRequest {
    /// The recording: .c3d, .trc, .bvh, .skeleton (NTU RGB+D), .txt (20 or 25 Kinect joints a line), .csv with columns NAME_x,
    /// NAME_y, NAME_z in mm or of the Kinect SDK, Vicon Nexus or OptiTrack Motive, .tsv of Qualisys, .npz with joint positions of
    /// an SMPL body, or keypoints: .json of OpenPose, COCO, HALPE, MMPose or MediaPipe, or a folder of such files, a frame each.
    /// 2-D keypoints have one view.
    pub file: PathBuf,
    /// plug-in-gait (also CMU's 41 markers), vicon-53, opencap, thesis, bvh, kinect, keypoints, or a TOML file of `[[part]] name,
    /// markers, thickness_mm` [default: the one of these that fits best, which is reported].
    #[cfg_attr(feature = "clap", arg(long, value_name = "NAME|FILE"))]
    pub template: Option<String>,
    /// Folder for the masks; must not exist or be empty.
    #[cfg_attr(feature = "clap", arg(long))]
    pub out: PathBuf,
    /// Views at equal steps round the subject, 1 to 72.
    #[cfg_attr(feature = "clap", arg(long, default_value_t = Self::default().views))]
    pub views: usize,
    /// Direction of the first view, degrees round the vertical.
    #[cfg_attr(
        feature = "clap",
        arg(long, default_value_t = Self::default().first_view_deg)
    )]
    pub first_view_deg: f64,
    /// Angle from which the views look down, -90 to 90 degrees.
    #[cfg_attr(
        feature = "clap",
        arg(long, default_value_t = Self::default().elevation_deg)
    )]
    pub elevation_deg: f64,
    /// Millimetres per pixel, 0.1 to 1000 (6 is the thesis' 167 pixels per metre).
    #[cfg_attr(feature = "clap", arg(long, default_value_t = Self::default().mm_per_px))]
    pub mm_per_px: f64,
    /// Close gaps at joints up to this width, 0 to 1000 millimetres [default: 126 as in the thesis, 40 where the parts of the
    /// template have a thickness, which fills joints].
    #[cfg_attr(feature = "clap", arg(long, value_name = "MM"))]
    pub close_mm: Option<f64>,
    /// Fill the convex hull of a part (hull), or all triplets of its markers as in the thesis (triplets: the same picture, slower).
    #[cfg_attr(feature = "clap", arg(long, default_value_t = Self::default().fill))]
    #[schemars(with = "String")]
    pub fill: Fill,
    /// Use every nth frame.
    #[cfg_attr(feature = "clap", arg(long, default_value_t = Self::default().every))]
    pub every: usize,
    /// Axis of the file that points up: x, y, z, -x, -y or -z (y in a TRC file, -y in a picture) [default: as the file or its format
    /// states, or from the body].
    #[cfg_attr(feature = "clap", arg(long, value_name = "AXIS", allow_hyphen_values = true))]
    #[serde_as(as = "Option<DisplayFromStr>")]
    pub up: Option<Up>,
    /// Unit of length: mm, cm, m, in, cmu (56.444 mm) or a number of millimetres, where the file states none (BVH) or a wrong one.
    #[cfg_attr(feature = "clap", arg(long, value_name = "UNIT"))]
    #[serde_as(as = "Option<DisplayFromStr>")]
    pub units: Option<Unit>,
    /// Person in a file with several, from 1 [default: the one who moves or is visible most, or whose markers are first].
    #[cfg_attr(feature = "clap", arg(long, value_name = "NUMBER"))]
    pub person: Option<usize>,
    /// Width and height of the picture, such as 9:16 or 1080x1920, for keypoints with coordinates from 0 to 1 [default: as the file
    /// states, or 16:9].
    #[cfg_attr(feature = "clap", arg(long, value_name = "WIDTH:HEIGHT"))]
    #[serde_as(as = "Option<DisplayFromStr>")]
    pub aspect: Option<Aspect>,
    /// Write masks of 100x100 pixels with the subject centred, instead of full frames.
    #[cfg_attr(feature = "clap", arg(long))]
    pub centred: bool,
    /// Keep only this many silhouettes, the least alike of all views (Li 2014, eq. 7.3), at 100x100 pixels: a gallery without order.
    #[cfg_attr(feature = "clap", arg(long, value_name = "COUNT"))]
    pub keep: Option<usize>,
    /// Also write samples.toml for `farnear activity`, with this activity.
    #[cfg_attr(feature = "clap", arg(long, value_name = "ACTIVITY"))]
    pub samples: Option<String>,
    /// Name of the person in samples.toml [default: the name of the file].
    #[cfg_attr(feature = "clap", arg(long, value_name = "NAME"))]
    pub subject: Option<String>,
}

impl Default for MarkersRequest {
    fn default() -> Self {
        Self {
            file: PathBuf::new(),
            template: None,
            out: PathBuf::new(),
            views: 8,
            first_view_deg: 0.0,
            elevation_deg: 0.0,
            mm_per_px: 6.0,
            close_mm: None,
            fill: Fill::default(),
            every: 1,
            up: None,
            units: None,
            person: None,
            aspect: None,
            centred: false,
            keep: None,
            samples: None,
            subject: None,
        }
    }
}

impl Request for MarkersRequest {
    const NAME: &'static str = "silhouettes markers";
    const REQUIRED: &'static [&'static str] = &["file", "out"];
    const PATHS: &'static [(&'static str, PathKind)] =
        &[("file", PathKind::Input), ("template", PathKind::InputOrName), ("out", PathKind::OutputFolder)];
    type Figures = MarkersFigures;

    fn check(&self) -> Result<()> {
        within("views", self.views, &VIEWS, "")?;
        within("elevation", self.elevation_deg, &(-90.0..=90.0), "deg")?;
        within("pixel size", self.mm_per_px, &MM_PER_PX, "mm")?;
        if let Some(close_mm) = self.close_mm {
            within("closed gap", close_mm, &(0.0..=1000.0), "mm")?;
        }
        at_least("kept silhouettes", self.keep.unwrap_or(1), 1, "pictures")?;
        if let (Some(keep), Some(_)) = (self.keep, &self.samples) {
            let expected = "a gallery has no order: expected no samples with it";
            return Err(WorkflowError::parameter("kept silhouettes", keep, expected));
        }
        if let (Some(subject), None) = (&self.subject, &self.samples) {
            let expected = "it is written to samples.toml: expected samples with it";
            return Err(WorkflowError::parameter("subject", subject, expected));
        }
        at_least("step between frames", self.every, 1, "frames")
    }

    fn run(&self, context: &Context<'_>) -> Result<MarkersFigures> {
        draw(self, context)
    }
}

#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Performer {
    pub subject: String,
    pub activity: String,
}

impl MarkersRequest {
    fn choices(&self) -> Choices {
        Choices { unit: self.units, up: self.up, person: self.person, aspect: self.aspect }
    }

    fn performer(&self) -> Option<Performer> {
        let stem = || self.file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let subject = self.subject.clone().unwrap_or_else(stem);
        self.samples.clone().map(|activity| Performer { activity, subject })
    }

    /// A recording from one side has a single view.
    fn views(&self, planar: bool) -> Vec<View> {
        if planar {
            return vec![View::default()];
        }
        let mut views = views_round(self.views, self.elevation_deg);
        views.iter_mut().for_each(|view| view.gamma_deg += self.first_view_deg);
        views
    }
}

#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct MarkersFigures {
    pub views: usize,
    pub frames: usize,
    pub silhouettes: usize,
    pub flagged_frames: usize,
    pub empty_frames: usize,
    pub markers: usize,
    /// Over all points and frames.
    pub hidden_markers_percent: f64,
    pub seconds: f64,
    /// Assumptions about the recording.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub warnings: Vec<String>,
}

#[derive(Serialize)]
struct Index<'a> {
    template: &'a str,
    #[serde(skip_serializing_if = "Option::is_none")]
    rate_hz: Option<f64>,
    mm_per_px: f64,
    elevation_deg: f64,
    view_directions_deg: Vec<f64>,
    parts_not_recorded: &'a [String],
    #[serde(skip_serializing_if = "<[String]>::is_empty")]
    guessed: &'a [String],
    #[serde(skip_serializing_if = "Vec::is_empty")]
    flagged: Vec<Flagged<'a>>,
}

#[derive(Serialize)]
struct Flagged<'a> {
    frame: &'a str,
    /// `empty`, or `missing:PART` if all markers of a part were hidden.
    flags: &'a [String],
}

/// Draws `view1`, `view2`, ... with a mask per frame, and `silhouettes.toml`. A view's masks share one
/// canvas, so the subject moves as in a camera's picture. Writes nothing on failure.
pub fn draw(settings: &MarkersRequest, context: &Context<'_>) -> Result<MarkersFigures> {
    settings.check()?;
    let start = Instant::now();
    let recording = recording(&settings.file, settings.choices())?;
    // Store the name only, so that records do not depend on the folder.
    let name = settings.file.file_name().unwrap_or_default().display();
    let template = match &settings.template {
        Some(name) => template(name)?,
        None => best_template(&recording, &settings.file)?,
    };
    check_fit(&template, &recording, &settings.file)?;
    if settings.template.is_none() {
        context.info(&format!("{name}: the template `{}` fits best", template.name));
    }
    let warnings: Vec<String> =
        recording.remarks().into_iter().map(|remark| format!("{name}: {remark}")).collect();
    warnings.iter().for_each(|warning| context.progress.warn(warning));
    if recording.unit.source.is_guess() || recording.up.source.is_guess() {
        context.info("--units and --up set the unit and the axis where a guess is wrong");
    }
    let out = Staging::new_folder(&settings.out)?;
    let numbers = || (0..recording.frames.len()).step_by(settings.every);
    let frames: Vec<HashMap<&str, Point3>> = numbers().map(|n| recording.by_name(n)).collect();
    let names: Vec<String> = numbers().map(|n| format!("frame_{:06}", n + 1)).collect();
    if frames.iter().all(HashMap::is_empty) {
        return Err(SilhouettesError::NothingVisible { path: settings.file.clone() }.into());
    }
    let missing = MissingParts::of(&template, &recording, &frames);
    let views = settings.views(recording.planar);
    if recording.planar {
        context.info(&format!("{name}: one view is drawn, as the camera saw it"));
    }
    let job =
        Job { settings, views: views.len(), template: &template, frames: &frames, names: &names, context };
    let drawn = match settings.keep {
        Some(keep) => Drawn { silhouettes: job.gallery(&views, keep, &out)?, in_pieces: 0 },
        None => job.sequences(&views, &out)?,
    };
    let Drawn { silhouettes, in_pieces } = drawn;
    let apart = (2 * in_pieces > silhouettes).then(|| {
        format!(
            "{name}: {in_pieces} of {silhouettes} silhouettes are in several pieces: points between them are missing, or names mean \
             other points than those of the template `{}` (--template)",
            template.name
        )
    });
    if let Some(apart) = &apart {
        context.progress.warn(apart);
    }
    for part in &missing.always {
        context.info(&format!("{name}: no marker of `{part}` was recorded; it is not drawn"));
    }
    let index = Index {
        template: &template.name,
        rate_hz: (recording.rate_hz > 0.0).then(|| recording.rate_hz / settings.every as f64),
        mm_per_px: settings.mm_per_px,
        elevation_deg: settings.elevation_deg,
        view_directions_deg: views.iter().map(|view| view.gamma_deg).collect(),
        parts_not_recorded: &missing.always,
        guessed: &warnings,
        flagged: missing.flagged(&names),
    };
    out.write("silhouettes.toml", toml::to_string(&index)?.as_bytes())?;
    if let Some(performer) = &settings.performer() {
        let clip = settings.file.file_stem().unwrap_or_default().to_string_lossy();
        let rows =
            (1..=views.len()).map(|view| samples_entry(&format!("view{view}"), performer, view, &clip));
        out.write("samples.toml", rows.collect::<String>().as_bytes())?;
    }
    out.finish()?;
    context.info(&format!("wrote {}", settings.out.display()));
    Ok(MarkersFigures {
        views: views.len(),
        frames: frames.len(),
        silhouettes,
        flagged_frames: index.flagged.len(),
        empty_frames: frames.iter().filter(|frame| frame.is_empty()).count(),
        markers: recording.names.len(),
        hidden_markers_percent: rounded(hidden_percent(&recording), 2),
        seconds: rounded(start.elapsed().as_secs_f64(), 3),
        warnings: warnings.iter().cloned().chain(apart).collect(),
    })
}

/// The single view of a recording from one side, described; empty if it is too large for a picture.
pub(crate) fn one_view(recording: &Recording, template: &Template) -> Vec<Track> {
    /// Coarse enough for any training, fine enough for hands.
    const MM_PER_PX: f64 = 10.0;
    const MARGIN_PX: usize = 2;
    const GAP_PX: usize = 4;
    let frames: Vec<HashMap<&str, Point3>> =
        (0..recording.frames.len()).map(|n| recording.by_name(n)).collect();
    let view = View::default();
    let reach = parts::extent(&frames, template, &view);
    let Some(canvas) = Canvas::fitting(&reach, MM_PER_PX, MARGIN_PX) else { return Vec::new() };
    let mask = |frame: &HashMap<&str, Point3>| {
        parts::close(&parts::draw(frame, template, &view, &canvas, Fill::Hull).mask, GAP_PX)
    };
    let masks: Vec<Mask> = frames.iter().map(mask).collect();
    let track = Track::from_masks(&masks, SCALING, true);
    if track.frames() == 0 { Vec::new() } else { vec![track] }
}

/// Over all points and frames.
fn hidden_percent(recording: &Recording) -> f64 {
    let all: usize = recording.frames.iter().map(Vec::len).sum();
    let hidden = recording.frames.iter().flatten().filter(|point| point.is_none()).count();
    100.0 * hidden as f64 / all.max(1) as f64
}

pub(crate) fn template(name: &str) -> Result<Template> {
    let path = Path::new(name);
    let wrong = |source| SilhouettesError::Template { name: name.into(), source };
    if Template::names().any(|known| known == name) || !path.is_file() {
        return Ok(Template::named(name).map_err(wrong)?);
    }
    let text = fs::read_to_string(path).map_err(WorkflowError::read("the template", path))?;
    Ok(Template::parse(&text).map_err(wrong)?)
}

pub(crate) fn recording(path: &Path, choices: Choices) -> Result<Recording> {
    let read_file = |path: &Path| fs::read(path).map_err(WorkflowError::read("the recording", path));
    let read = if path.is_dir() {
        let files = keypoint_files(path)?;
        let contents = files.iter().map(|file| read_file(file)).collect::<Result<Vec<Vec<u8>>>>()?;
        let name = |file: &PathBuf| file.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let names: Vec<String> = files.iter().map(name).collect();
        let named = names.iter().map(String::as_str).zip(contents.iter().map(Vec::as_slice));
        readers::read_keypoint_files(named, choices)
    } else {
        let ending = path.extension().unwrap_or_default().to_string_lossy();
        readers::read(&read_file(path)?, &ending, choices)
    };
    let recording = read.map_err(|source| SilhouettesError::Recording { path: path.into(), source })?;
    if recording.frames.is_empty() {
        return Err(SilhouettesError::NoFrames { path: path.into() }.into());
    }
    Ok(recording)
}

/// JSON files of a folder (one per frame in OpenPose), in the order of their numbers.
fn keypoint_files(folder: &Path) -> Result<Vec<PathBuf>> {
    let entries = fs::read_dir(folder).map_err(WorkflowError::read("the recording", folder))?;
    let mut files = Vec::new();
    for entry in entries {
        let path = entry.map_err(WorkflowError::read("the recording", folder))?.path();
        let is_json = path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("json"));
        if is_json && !farnear_files::video::pictures::hidden(&path) {
            files.push(path);
        }
    }
    farnear_files::order::sort(&mut files);
    match files.is_empty() {
        true => Err(SilhouettesError::NoKeypointFiles { path: folder.into() }.into()),
        false => Ok(files),
    }
}

/// Prefers the largest share of its markers in the recording, then more markers. Fails below one half.
pub(crate) fn best_template(recording: &Recording, path: &Path) -> Result<Template> {
    let mut ranked: Vec<(f64, usize, Template)> = Template::names()
        .filter_map(|name| Template::named(name).ok())
        .map(|template| {
            let (present, of) = template.coverage(&recording.known_names());
            (present as f64 / of.max(1) as f64, present, template)
        })
        .collect();
    ranked.sort_by(|a, b| b.0.total_cmp(&a.0).then(b.1.cmp(&a.1)));
    let Some((_, _, best)) = ranked.into_iter().next() else {
        return Err(SilhouettesError::NoFrames { path: path.into() }.into());
    };
    best.check(&recording.known_names()).map_err(|source| {
        WorkflowError::from(SilhouettesError::Unfit { path: path.into(), source, fits: None })
    })?;
    Ok(best)
}

/// Fails if the template's names do not fit the recording, with the best fitting built-in template.
pub(crate) fn check_fit(template: &Template, recording: &Recording, path: &Path) -> Result<()> {
    template.check(&recording.known_names()).map_err(|source| {
        let best = best_template(recording, path).ok();
        let fits = best.and_then(|best| Template::names().find(|name| *name == best.name));
        SilhouettesError::Unfit { path: path.into(), source, fits }.into()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_macos_writes_next_to_a_frame_is_not_one() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["._frame_1.json", "frame_1.json", ".frame_2.json"] {
            fs::write(folder.path().join(name), "{}").unwrap();
        }
        assert_eq!(keypoint_files(folder.path()).unwrap(), [folder.path().join("frame_1.json")]);
    }
}

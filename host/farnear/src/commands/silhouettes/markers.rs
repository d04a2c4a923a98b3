//! `farnear silhouettes markers`: silhouettes of a motion-capture recording from views all round.

use std::path::PathBuf;

use anyhow::Result;
use clap::{Args, ValueEnum};
use farnear_silhouettes::readers::recording::{Choices, Unit, Up};
use farnear_silhouettes::silhouette::parts::Fill;
use farnear_workflows::silhouettes::markers::{self, MarkersSettings, Performer};

use crate::{report, terminal};

/// Silhouettes of a motion-capture recording (C3D, TRC, CSV, BVH, NTU or Kinect joints, keypoints) from views at equal steps round the subject.
///
/// A template says which markers make which part of the body; parts are filled and the gaps between them closed. Every view
/// gets a folder `view1`, `view2`, ... of masks, one PNG per frame, all on one canvas so that the subject moves in it as in a
/// camera's picture. `silhouettes.toml` flags frames in which a part had no visible marker.
#[derive(Args)]
#[command(
    after_help = "Example: farnear silhouettes markers walk.c3d --template plug-in-gait --views 8 --out masks/"
)]
pub struct Arguments {
    /// The recording: .c3d, .trc, .bvh, .skeleton (NTU RGB+D), .txt (20 or 25 Kinect joints a line), .csv with columns NAME_x,
    /// NAME_y, NAME_z in mm, .npz with joint positions of an SMPL body, or 2-D keypoints: .json of OpenPose, COCO, HALPE or MediaPipe, or a folder
    /// of such files, a frame each. Keypoints have one view.
    file: PathBuf,
    /// plug-in-gait (also CMU's 41 markers), vicon-53, opencap, thesis, bvh, kinect, keypoints, or a TOML file of `[[part]] name, markers,
    /// thickness_mm` [default: the one of these that fits best, which is reported].
    #[arg(long, value_name = "NAME|FILE")]
    template: Option<String>,
    /// Folder for the masks; must not exist or be empty.
    #[arg(long)]
    out: PathBuf,
    /// Views at equal steps round the subject.
    #[arg(long, default_value_t = 8)]
    views: usize,
    /// Direction of the first view, degrees round the vertical.
    #[arg(long, default_value_t = 0.0, allow_negative_numbers = true)]
    first_view_deg: f64,
    /// From how high the views look down, degrees.
    #[arg(long, default_value_t = 0.0, allow_negative_numbers = true)]
    elevation_deg: f64,
    /// Millimetres per pixel (6 is the thesis' 167 pixels per metre).
    #[arg(long, default_value_t = 6.0)]
    mm_per_px: f64,
    /// Gaps at joints up to this width are closed, millimetres [default: 126 as in the thesis, 40 where the template's parts have a
    /// thickness, which fills joints by itself].
    #[arg(long, value_name = "MM")]
    close_mm: Option<f64>,
    /// Fill a part's convex hull, or all triplets of its markers as in the thesis (the same picture, slower).
    #[arg(long, default_value = "hull")]
    fill: FillChoice,
    /// Take every so-many-th frame.
    #[arg(long, default_value_t = 1)]
    every: usize,
    /// Which axis of the file points up; by default y in TRC files, what the body says in BVH files, and z in others.
    #[arg(long)]
    up: Option<UpAxis>,
    /// The file's unit of length: mm, cm, m, in, cmu (56.444 mm) or a number of millimetres, where it states none (BVH) or a
    /// wrong one.
    #[arg(long, value_name = "UNIT")]
    units: Option<Unit>,
    /// Which of several people in the file, from 1 [default: the one who moves or is seen most].
    #[arg(long, value_name = "NUMBER")]
    person: Option<usize>,
    /// Write masks of 100x100 pixels with the subject centred, instead of full frames.
    #[arg(long)]
    centred: bool,
    /// Keep only this many silhouettes, the least alike of all views (Li 2014, eq. 7.3): a gallery, no longer a sequence. The
    /// masks are 100x100 then.
    #[arg(long, value_name = "COUNT")]
    keep: Option<usize>,
    /// Write samples.toml for `farnear activity` too: this activity is done in the recording.
    #[arg(long, value_name = "ACTIVITY", conflicts_with = "keep")]
    samples: Option<String>,
    /// Who does it [default: the file's name].
    #[arg(long, value_name = "NAME", requires = "samples")]
    subject: Option<String>,
    /// Print figures as JSON.
    #[arg(long)]
    json: bool,
}

#[derive(Clone, Copy, ValueEnum)]
enum FillChoice {
    Hull,
    Triplets,
}

#[derive(Clone, Copy, ValueEnum)]
enum UpAxis {
    X,
    Y,
    Z,
}

/// Runs the command.
///
/// # Errors
/// See [`markers::draw`].
pub fn run(arguments: Arguments) -> Result<()> {
    let json = arguments.json;
    let up = arguments.up.map(|up| match up {
        UpAxis::X => Up::X,
        UpAxis::Y => Up::Y,
        UpAxis::Z => Up::Z,
    });
    let stem = || arguments.file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let samples = arguments
        .samples
        .map(|activity| Performer { activity, subject: arguments.subject.unwrap_or_else(stem) });
    let settings = MarkersSettings {
        samples,
        file: arguments.file,
        choices: Choices { unit: arguments.units, up, person: arguments.person },
        template: arguments.template,
        out: arguments.out,
        views: arguments.views,
        first_view_deg: arguments.first_view_deg,
        elevation_deg: arguments.elevation_deg,
        mm_per_px: arguments.mm_per_px,
        close_mm: arguments.close_mm,
        fill: match arguments.fill {
            FillChoice::Hull => Fill::Hull,
            FillChoice::Triplets => Fill::Triplets,
        },
        every: arguments.every,
        centred: arguments.centred,
        keep: arguments.keep,
    };
    let figures = markers::draw(&settings, &terminal::counting(json)?)?;
    if !figures.warnings.is_empty() {
        eprintln!("--units and --up name the unit and the axis where a guess is wrong");
    }
    report::print(&figures, json)
}

//! `farnear rig calibrate targets`: the series of flat targets that teaches a correction.

use std::{
    fs,
    path::{Path, PathBuf},
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
};

use anyhow::{Context, Result, bail};
use clap::Args;
use farnear_capture::{
    aside::{self, Aside},
    pair::{Exposures, Pair, capture_pair},
    plan::SensorPair,
    record::{begin_folder, finish_folder, record_of},
};
use farnear_depth::{
    operators::Operators,
    optics::Optics,
    pipeline::{Settings, depth_from_pair},
};
use serde::{Deserialize, Serialize};

use crate::{
    commands::rig::{
        Connected, Target,
        camera::{self, CameraArguments},
        listen_for_interruption,
    },
    files::{self, map},
    prompt,
    report::{self, Usage},
};

/// Name of the list in the series' folder.
const LIST: &str = "PATTERNS.toml";
/// Targets of a series where none are named.
const USUAL_TARGETS: usize = 24;

/// Capture a flat target at known distances, compute the depth maps, and list them for `farnear calibrate correction`.
///
/// Asks for the target to be placed at each distance. A series that was broken off goes on where it stood when it is
/// started again with the same folder. On the emulated rig the target places itself.
#[derive(Args)]
#[command(
    after_help = "Example: farnear rig calibrate targets --port sim --optics optics.toml --distances 890,900,910,920,930 --out series/"
)]
pub struct Arguments {
    #[command(flatten)]
    target: Target,
    #[command(flatten)]
    camera: CameraArguments,
    /// The optics file.
    #[arg(long, value_name = "FILE")]
    optics: PathBuf,
    /// Distances of the target from the lens; asks for nothing then but the target's place [default: 24 through the
    /// working range].
    #[arg(long, value_name = "MM,...", value_delimiter = ',')]
    distances: Vec<f64>,
    /// Do not wait for Enter: the target moves by itself, or the distances do not matter.
    #[arg(long)]
    no_prompt: bool,
    /// Folder of the series.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// The list, as `farnear calibrate correction` reads it.
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

#[derive(Serialize)]
struct Figures {
    targets: usize,
    captured: usize,
    /// Root mean square of the maps' error before any correction, mm.
    rmse_mm: f64,
    patterns: String,
}

/// Runs the command.
pub fn run(arguments: Arguments) -> Result<()> {
    let optics = files::optics::read(&arguments.optics)?;
    let operators = files::operators::find(None, &optics)?;
    let distances = distances(&arguments.distances, &optics)?;
    let early = arguments.camera.open_early(&arguments.target)?;
    fs::create_dir_all(&arguments.out)
        .with_context(|| format!("cannot make the folder {}", arguments.out.display()))?;
    let mut list = read_list(&arguments.out.join(LIST))?;
    let interrupted = listen_for_interruption()?;

    // A real rig stays connected; an emulated one is started before each target.
    let mut series = Series { arguments: &arguments, optics: &optics, operators: &operators, interrupted };
    let mut standing = match arguments.target.is_emulated() {
        true => None,
        false => {
            let rig = series.connect(&arguments.target)?;
            let camera = camera::of_rig(early, &rig)?;
            Some((rig, camera))
        }
    };
    let (mut captured, mut squares, mut pixels) = (0, 0.0, 0.0);
    for (number, true_mm) in distances.iter().copied().enumerate() {
        let known = |entry: &Entry| (entry.true_mm - true_mm).abs() < 1e-6;
        if list.pattern.iter().any(known) {
            eprintln!("target {} at {true_mm} mm is there already", number + 1);
            continue;
        }
        let name = format!("target-{:.3}", true_mm);
        let depth = if let Some((rig, camera)) = &mut standing {
            series.prompt(number, distances.len(), true_mm)?;
            series.capture(rig, &arguments.target, camera.as_mut(), &name)?
        } else {
            let target = arguments.target.with_scene(format!("plane:{true_mm}"));
            let rig = series.connect(&target)?;
            let mut camera = camera::of_rig(None, &rig)?;
            series.capture(&rig, &target, camera.as_mut(), &name)?
        };
        for value in depth.iter().filter(|value| value.is_finite()) {
            squares += (f64::from(*value) - true_mm).powi(2);
            pixels += 1.0;
        }
        captured += 1;
        list.pattern.push(Entry { depth: Path::new(&name).join("depth.npy"), true_mm });
        list.pattern.sort_by(|a, b| a.true_mm.total_cmp(&b.true_mm));
        aside::write_file(&arguments.out.join(LIST), toml::to_string(&list)?.as_bytes())?;
        eprintln!("target {} of {} at {true_mm} mm is captured", number + 1, distances.len());
    }
    let figures = Figures {
        targets: list.pattern.len(),
        captured,
        rmse_mm: report::rounded((squares / f64::max(pixels, 1.0)).sqrt(), 4),
        patterns: arguments.out.join(LIST).display().to_string(),
    };
    report::print(&figures, arguments.json)
}

struct Series<'a> {
    arguments: &'a Arguments,
    optics: &'a Optics,
    operators: &'a Operators,
    interrupted: Arc<AtomicBool>,
}

impl Series<'_> {
    fn connect(&self, target: &Target) -> Result<Connected> {
        let mut rig = target.connect_uninterrupted(Some((&self.arguments.optics, self.optics.psf())))?;
        rig.client.interrupt_by(Arc::clone(&self.interrupted));
        Ok(rig)
    }

    fn prompt(&self, number: usize, count: usize, true_mm: f64) -> Result<()> {
        let place = format!(
            "place the flat target {true_mm} mm before the lens ({} of {count}), square to it",
            number + 1
        );
        if self.arguments.no_prompt {
            eprintln!("{place}");
            return Ok(());
        }
        let nobody = "use --no-prompt if the target moves by itself";
        let interrupted = || self.interrupted.load(Ordering::Relaxed);
        prompt::ask(&format!("{place}, and press Enter: "), nobody, interrupted).map(|_| ())
    }

    /// Captures a pair and computes its depth into a folder of its own.
    fn capture(
        &mut self,
        rig: &Connected,
        target: &Target,
        camera: &mut dyn farnear_capture::camera::Camera,
        name: &str,
    ) -> Result<ndarray::Array2<f32>> {
        let (optics, arguments) = (self.optics, self.arguments);
        let folder: Aside = begin_folder(&arguments.out.join(name))?;
        let range = optics.working_range();
        let sensor = SensorPair { far_mm: range.sensor_far_mm, near_mm: range.sensor_near_mm };
        let exposures = Exposures {
            exposure: arguments.camera.exposure(),
            image_wait: arguments.camera.image_wait(),
            ..Exposures::default()
        };
        let pair: Pair =
            capture_pair(&rig.client, camera, &sensor, &exposures, &mut |what| eprintln!("{what}"))?;
        let [far, near] = [&pair.far, &pair.near].map(|taken| taken.image.pixels.mapv(f32::from));
        let depth = depth_from_pair(far.view(), near.view(), self.operators, optics, &Settings::default())?;
        for warning in &depth.warnings {
            eprintln!("warning: {warning}");
        }
        let table: toml::Table = files::optics::text(&arguments.optics)?.parse()?;
        let circumstances = camera::circumstances(rig, target, camera, optics.psf(), table);
        let record = record_of(&pair, &rig.client, circumstances);
        folder.write("depth.npy", &map::npy(depth.depth_mm.view())?)?;
        finish_folder(folder, &pair, &record)?;
        Ok(depth.depth_mm)
    }
}

fn distances(asked: &[f64], optics: &Optics) -> Result<Vec<f64>> {
    if let Some(bad) = asked.iter().find(|mm| !(mm.is_finite() && **mm > optics.focal_length_mm())) {
        bail!(Usage(format!("--distances {bad}: expected millimetres beyond the focal length")));
    }
    if !asked.is_empty() {
        return Ok(asked.to_vec());
    }
    let range = optics.working_range();
    let step = (range.far_mm - range.near_mm) / (USUAL_TARGETS - 1) as f64;
    // To a tenth of a millimetre, which can be set on a rail.
    Ok((0..USUAL_TARGETS).map(|i| report::rounded(range.near_mm + step * i as f64, 1)).collect())
}

fn read_list(path: &Path) -> Result<List> {
    match fs::read_to_string(path) {
        Ok(text) => {
            toml::from_str(&text).with_context(|| format!("{} is no list of targets", path.display()))
        }
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(List::default()),
        Err(error) => Err(error).with_context(|| format!("cannot read {}", path.display())),
    }
}

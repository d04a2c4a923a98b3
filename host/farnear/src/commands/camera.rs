use std::{io::Write, path::PathBuf, time::Duration};

use anyhow::Result;
use clap::{Args, Subcommand, ValueEnum};
use farnear_capture::camera::Setting;
use farnear_depth::focus_measure::FocusMeasure;
use farnear_workflows::camera::{
    self, CameraChoice,
    grab::{self, GrabSettings, PictureFormat},
    live::{self, LiveFigures, LiveSettings},
};

use crate::{report, terminal};

#[derive(Subcommand)]
pub enum Job {
    List(ListArguments),
    Show(ShowArguments),
    Grab(GrabArguments),
    Live(LiveArguments),
}

/// List the cameras that are found, and the kinds that there can be.
#[derive(Args)]
#[command(after_help = "Example: farnear camera list --json")]
pub struct ListArguments {
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

#[derive(Args)]
struct Choice {
    /// Camera: HOST:PORT of a farnear-sim, folder:DIR, command:"PROGRAM ...", v4l:/dev/videoN or genicam:ID.
    #[arg(long, value_name = "CAMERA")]
    camera: String,
    /// Set something first, e.g. gain=3, exposure_us=5000, black_level=8, pixel_format=Mono12, region=0,0,640,480,
    /// trigger_source=Line1; may be repeated.
    #[arg(long, value_name = "NAME=VALUE")]
    set: Vec<Setting>,
}

impl Choice {
    fn parsed(&self) -> Result<CameraChoice> {
        Ok(CameraChoice { address: self.camera.parse()?, settings: self.set.clone() })
    }
}

/// Show what can be set at a camera, its value and its range. What --set sets stays set where the camera keeps it.
#[derive(Args)]
#[command(after_help = "Example: farnear camera show --camera genicam:Aravis-Fake-GV01 --set gain=3")]
pub struct ShowArguments {
    #[command(flatten)]
    choice: Choice,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

#[derive(Clone, Copy, ValueEnum)]
enum Format {
    /// Values of more than 8 bits are shifted up to 16.
    Png,
    /// Values stay as the camera gave them.
    Tiff,
}

/// Keep pictures of a camera that runs freely. The folder appears when everything is in it.
#[derive(Args)]
#[command(after_help = "Example: farnear camera grab --camera v4l:/dev/video0 --frames 10 --out pictures/")]
pub struct GrabArguments {
    #[command(flatten)]
    choice: Choice,
    /// How many pictures.
    #[arg(long, default_value_t = 1)]
    frames: usize,
    /// How they are written.
    #[arg(long, value_enum, default_value = "png")]
    format: Format,
    /// Longest wait for a picture in seconds.
    #[arg(long, value_name = "S", default_value_t = 10)]
    image_wait_s: u64,
    /// The new folder.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// Look through a camera: frame rate, focus, brightness and saturation, a line a second, until interrupted.
#[derive(Args)]
#[command(
    after_help = "Example: farnear camera live --camera \"command:ffmpeg -v error -re -f lavfi -i testsrc -pix_fmt gray -f yuv4mpegpipe -\""
)]
pub struct LiveArguments {
    #[command(flatten)]
    choice: Choice,
    /// Focus value: fft-sum, tenengrad or modified-laplacian.
    #[arg(long, default_value = "tenengrad")]
    measure: FocusMeasure,
    /// From one line to the next, in milliseconds.
    #[arg(long, value_name = "MS", default_value_t = 1000)]
    every_ms: u64,
    /// End after this time [default: when interrupted].
    #[arg(long, value_name = "S")]
    seconds: Option<f64>,
    /// Print a JSON object a line.
    #[arg(long)]
    json: bool,
}

pub fn run(job: Job) -> Result<()> {
    match job {
        Job::List(arguments) => report::print(&camera::list(), arguments.json),
        Job::Show(arguments) => report::print(&camera::show(&arguments.choice.parsed()?)?, arguments.json),
        Job::Grab(arguments) => grab(&arguments),
        Job::Live(arguments) => live(&arguments),
    }
}

fn grab(arguments: &GrabArguments) -> Result<()> {
    let settings = GrabSettings {
        camera: arguments.choice.parsed()?,
        frames: arguments.frames,
        format: match arguments.format {
            Format::Png => PictureFormat::Png,
            Format::Tiff => PictureFormat::Tiff,
        },
        wait: Duration::from_secs(arguments.image_wait_s),
        out: arguments.out.clone(),
    };
    report::print(&grab::grab(&settings, &terminal::counting(arguments.json)?)?, arguments.json)
}

fn live(arguments: &LiveArguments) -> Result<()> {
    let settings = LiveSettings {
        camera: arguments.choice.parsed()?,
        measure: arguments.measure,
        every: Duration::from_millis(arguments.every_ms),
        seconds: arguments.seconds,
    };
    let mut print = |seen: &LiveFigures| {
        let text = if arguments.json { serde_json::to_string(seen)? } else { words(seen) };
        let mut stdout = std::io::stdout().lock();
        writeln!(stdout, "{text}").and_then(|()| stdout.flush())
    };
    live::live(&settings, &mut print, &terminal::context()?)?;
    Ok(())
}

fn words(seen: &LiveFigures) -> String {
    let LiveFigures { frames_per_s, focus, mean_percent, saturated_percent, width, height, bits } = seen;
    let focus = focus.map_or_else(|| "-".into(), |focus| focus.to_string());
    format!(
        "{frames_per_s:6.2} frames/s  focus {focus:>10}  mean {mean_percent:5.2} %  saturated {saturated_percent:6.3} %  \
         {width}x{height} px, {bits} bits"
    )
}

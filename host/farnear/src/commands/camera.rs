use std::time::Duration;

use anyhow::Result;
use clap::{Args, Subcommand};
use farnear_depth::focus_measure::FocusMeasure;
use farnear_workflows::camera::{
    self, CameraChoice, ShowRequest,
    grab::GrabRequest,
    live::{self, LiveFigures, LiveSettings},
};

use crate::{report, run::Run, terminal};

#[derive(Subcommand)]
pub enum Job {
    List(ListArguments),
    Show(Run<ShowRequest>),
    Grab(Run<GrabRequest>),
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

/// Look through a camera: frame rate, focus, brightness and saturation, a line a second, until interrupted.
#[derive(Args)]
#[command(
    after_help = "Example: farnear camera live --camera \"command:ffmpeg -v error -re -f lavfi -i testsrc -pix_fmt gray -f yuv4mpegpipe -\""
)]
pub struct LiveArguments {
    #[command(flatten)]
    camera: CameraChoice,
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
        Job::Show(task) => task.run(),
        Job::Grab(task) => task.run(),
        Job::Live(arguments) => live(&arguments),
    }
}

fn live(arguments: &LiveArguments) -> Result<()> {
    let settings = LiveSettings {
        camera: arguments.camera.clone(),
        measure: arguments.measure,
        every: Duration::from_millis(arguments.every_ms),
        seconds: arguments.seconds,
    };
    let mut print = |seen: &LiveFigures| match arguments.json {
        true => report::line(seen),
        false => report::to_stdout(&format!("{}\n", words(seen))),
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

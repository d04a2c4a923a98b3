//! `farnear shadow remove`: takes a person's shadow off masks by where the sun or a lamp is and how the camera stands.

use std::path::PathBuf;

use anyhow::{Result, bail};
use chrono::{DateTime, Utc};
use clap::Args;
use farnear_shadow::sun::{Place, parse_time};
use farnear_shadow::{Lamp, Method};
use farnear_workflows::{
    shadow::removal::{self, LightSource, RemovalSettings},
    sun::Moment,
};

use crate::{
    commands::sun,
    report::{self, Usage},
    terminal,
};

/// Takes a person's shadow off masks: where it falls tell the camera's place and the sun's, or a lamp's, or it was measured in the picture.
///
/// The camera file has the camera's pose:
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
/// and, in tables `subject` (height_m = 1.75, head_width_m = 0.17; optionally distance_m) and `standard_deviations`, values other than the defaults. Frames whose cut is doubtful (no person or several, the shadow behind the person or cut off by the picture's
/// lower edge, much removed, an angle too unsure) are flagged in `shadow.toml` next to the masks.
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
    /// Latitude in degrees, north positive.
    #[arg(long, value_name = "DEG", allow_negative_numbers = true, value_parser = sun::latitude, requires_all = ["lon", "time"],
          required_unless_present_any = ["lamp", "shadow_direction"])]
    lat: Option<f64>,
    /// Longitude in degrees, east positive.
    #[arg(long, value_name = "DEG", allow_negative_numbers = true, value_parser = sun::longitude, requires = "lat")]
    lon: Option<f64>,
    /// Time with its zone (RFC 3339), such as 2014-06-23T12:30:00+01:00.
    #[arg(long, value_name = "RFC3339", value_parser = parse_time, requires = "lat")]
    time: Option<DateTime<Utc>>,
    /// A lamp instead of the sun: where it hangs, in metres to the right, ahead and up from the ground below the lens.
    #[arg(long, value_name = "RIGHT,AHEAD,UP", allow_hyphen_values = true, value_parser = removal::parse_lamp, conflicts_with_all = ["lat", "shadow_direction", "rate_hz"])]
    lamp: Option<Lamp>,
    /// The shadow's direction measured in the picture instead, in degrees from right (0) towards down (90).
    #[arg(long, value_name = "DEG", allow_negative_numbers = true, conflicts_with_all = ["lat", "rate_hz"])]
    shadow_direction: Option<f64>,
    /// Masks per second: with it `--time` is the first mask's and the sun moves on.
    #[arg(long, value_name = "HZ")]
    rate_hz: Option<f64>,
    /// hybrid, or thesis (as printed in Li 2014).
    #[arg(long, default_value = "hybrid")]
    method: Method,
    /// Folder for the masks without shadow; must not exist or be empty.
    #[arg(long)]
    out: PathBuf,
    /// Folder for a picture per mask of how it was cut: the mask, its lower edge along the turned axis, where the shadow is expected and how sure that is, the body
    /// and shadow that explain it, what went; must not exist or be empty.
    #[arg(long, value_name = "DIR")]
    stages: Option<PathBuf>,
    /// Print figures as JSON.
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub fn run(arguments: Arguments) -> Result<()> {
    let json = arguments.json;
    let sun = arguments.lat.zip(arguments.lon).zip(arguments.time);
    let light = match (sun, arguments.lamp, arguments.shadow_direction) {
        (Some(((latitude_deg, longitude_deg), time)), ..) => {
            let moment = Moment { place: Place { latitude_deg, longitude_deg }, time };
            LightSource::Sun { moment, rate_hz: arguments.rate_hz }
        }
        (None, Some(lamp), _) => LightSource::Lamp(lamp),
        (None, None, Some(degrees)) => LightSource::Direction { degrees },
        (None, None, None) => {
            bail!(Usage("expected --lat, --lon and --time, --lamp or --shadow-direction".into()))
        }
    };
    let settings = RemovalSettings {
        masks: arguments.masks,
        camera: arguments.camera,
        light,
        method: arguments.method,
        out: arguments.out,
        stages: arguments.stages,
    };
    report::print(&removal::remove_from_masks(&settings, &terminal::counting(json)?)?, json)
}

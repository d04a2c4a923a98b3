//! Cameras without a rig: list, controls, images to store ([`grab`]) and to view ([`live`]).

pub mod grab;
pub mod live;

use farnear_capture::camera::{Camera, Setting, v4l};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_with::{DisplayFromStr, serde_as};

use crate::{
    context::Context,
    error::{Result, WorkflowError},
    request::{PathKind, Request},
    rig::camera::CameraAddress,
};

#[derive(Clone, PartialEq, Eq, Debug, Serialize)]
pub struct Kind {
    pub kind: &'static str,
    /// Format of its address.
    pub address: &'static str,
    pub about: &'static str,
    pub built_in: bool,
}

pub const KINDS: [Kind; 5] = [
    Kind {
        kind: "sim",
        address: "sim, or HOST:PORT",
        about: "the emulated rig's own; HOST:PORT of a farnear-sim that runs already",
        built_in: true,
    },
    Kind {
        kind: "folder",
        address: "folder:DIR",
        about: "each image file that appears in a folder",
        built_in: true,
    },
    Kind {
        kind: "command",
        address: "command:\"PROGRAM ...\", or command:\"WIDTHxHEIGHT:FORMAT:PROGRAM ...\"",
        about: "a program that writes Y4M, or raw frames of a size and format, to its standard output",
        built_in: true,
    },
    Kind {
        kind: "v4l",
        address: "v4l:/dev/videoN",
        about: "Video4Linux: webcams, and sensors with a driver",
        built_in: cfg!(all(feature = "v4l2", target_os = "linux")),
    },
    Kind {
        kind: "genicam",
        address: "genicam:ID",
        about: "GigE Vision and USB3 Vision",
        built_in: cfg!(feature = "genicam"),
    },
];

#[derive(Clone, PartialEq, Eq, Debug, Serialize)]
pub struct Found {
    pub address: String,
    pub about: String,
}

#[derive(Clone, PartialEq, Eq, Debug, Serialize)]
pub struct ListFigures {
    pub found: Vec<Found>,
    pub kinds: Vec<Kind>,
}

/// Searches for cameras. GenICam takes about a second.
pub fn list() -> ListFigures {
    let video = |device: v4l::FoundDevice| Found {
        address: format!("v4l:{}", device.path.display()),
        about: device.name,
    };
    let mut found: Vec<Found> = v4l::devices().into_iter().map(video).collect();
    found.extend(genicam());
    ListFigures { found, kinds: KINDS.to_vec() }
}

#[cfg(feature = "genicam")]
fn genicam() -> Vec<Found> {
    let found = farnear_capture::camera::genicam::devices();
    found
        .into_iter()
        .map(|camera| Found { address: format!("genicam:{}", camera.id), about: camera.about })
        .collect()
}

#[cfg(not(feature = "genicam"))]
fn genicam() -> Vec<Found> {
    Vec::new()
}

/// A camera without a rig.
#[serde_as]
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[cfg_attr(feature = "clap", derive(clap::Args))]
#[serde(default)]
pub struct CameraChoice {
    /// Camera: HOST:PORT of a farnear-sim, folder:DIR, command:"PROGRAM ...", v4l:/dev/videoN or genicam:ID.
    #[cfg_attr(feature = "clap", arg(long, value_name = "CAMERA"))]
    pub camera: String,
    /// Set something first, e.g. gain=3, exposure_us=5000, black_level=8, pixel_format=Mono12, region=0,0,640,480,
    /// trigger_source=Line1; may be repeated.
    #[cfg_attr(feature = "clap", arg(long, value_name = "NAME=VALUE"))]
    #[serde_as(as = "Vec<DisplayFromStr>")]
    pub set: Vec<Setting>,
}

impl CameraChoice {
    pub fn open(&self) -> Result<Box<dyn Camera>> {
        open(&self.camera.parse()?, &self.set)
    }
}

/// Opens a camera without a rig and applies the settings.
pub fn open(address: &CameraAddress, settings: &[Setting]) -> Result<Box<dyn Camera>> {
    let Some(mut camera) = address.open()? else {
        let expected =
            "the emulated rig's camera comes with the rig; start farnear-sim and name its HOST:PORT";
        return Err(WorkflowError::parameter("camera", "sim", expected));
    };
    for setting in settings {
        camera.set(setting)?;
    }
    Ok(camera)
}

#[derive(Clone, PartialEq, Eq, Debug, Serialize)]
pub struct ControlFigures {
    pub name: String,
    pub value: String,
    /// Allowed values; `fixed` if read-only.
    pub range: String,
}

#[derive(Clone, PartialEq, Eq, Debug, Serialize)]
pub struct ShowFigures {
    pub kind: &'static str,
    /// Empty for kinds with external controls.
    pub controls: Vec<ControlFigures>,
}

/// Show what can be set at a camera, its value and its range. What --set sets stays set where the camera keeps it.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[cfg_attr(feature = "clap", derive(clap::Args))]
#[cfg_attr(
    feature = "clap",
    command(after_help = "Example: farnear camera show --camera genicam:Aravis-Fake-GV01 --set gain=3")
)]
#[serde(default)]
pub struct ShowRequest {
    #[cfg_attr(feature = "clap", command(flatten))]
    #[serde(flatten)]
    pub camera: CameraChoice,
}

impl Request for ShowRequest {
    const NAME: &'static str = "camera show";
    const REQUIRED: &'static [&'static str] = &["camera"];
    const PATHS: &'static [(&'static str, PathKind)] = &[];
    type Figures = ShowFigures;

    fn run(&self, _: &Context<'_>) -> Result<ShowFigures> {
        show(self.camera.open()?.as_mut())
    }
}

pub fn show(camera: &mut dyn Camera) -> Result<ShowFigures> {
    Ok(ShowFigures { kind: camera.kind(), controls: controls_of(camera)? })
}

fn controls_of(camera: &mut dyn Camera) -> Result<Vec<ControlFigures>> {
    let figures = |control: farnear_capture::camera::Control| ControlFigures {
        name: control.name,
        value: control.value,
        range: control.range.to_string(),
    };
    Ok(camera.controls()?.into_iter().map(figures).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_emulated_rigs_camera_and_bad_addresses_are_refused() {
        let open = |text: &str| CameraChoice { camera: text.into(), set: Vec::new() }.open().map(|_| ());
        for (text, phrase) in [
            ("sim", "HOST:PORT"),
            ("nothing", "genicam:ID"),
            ("command:a 'b", "quotes"),
            ("command:", "expected a program"),
            ("v4l:/dev/video4711", "no such device"),
        ] {
            let error = open(text).unwrap_err().to_string();
            assert!(error.contains(phrase), "{text}: {error}");
        }
    }

    #[test]
    #[cfg(not(feature = "genicam"))]
    fn a_kind_that_was_not_built_in_says_how_to_build_it() {
        let address: CameraAddress = "genicam:Aravis-Fake-GV01".parse().unwrap();
        let error = address.open().err().unwrap();
        assert!(error.is_usage() && error.to_string().contains("feature `genicam`"), "{error}");
    }
}

use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_with::{DisplayFromStr, serde_as};

use super::{
    DifferenceFigures, Measured, PlaneFigures, ProfileFigures, Rectangle, RegionFigures, difference, profile,
    region,
};
use crate::{
    context::Context,
    error::{Result, WorkflowError},
    request::{PathKind, Request},
};

fn read(map: &Path, context: &Context<'_>) -> Result<Measured> {
    let map = Measured::read(map)?;
    map.remarks.iter().for_each(|remark| context.progress.warn(remark));
    Ok(map)
}

/// Measure a region of a depth map: mean, deviation, fill rate, and the plane through it.
///
/// Figures are in the unit of the map (mm, um or numbers of images), which ends their names.
#[serde_as]
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[cfg_attr(feature = "clap", derive(clap::Args))]
#[cfg_attr(
    feature = "clap",
    command(after_help = "Example: farnear measure region pair1/ --region 100,80,200,150 --json")
)]
#[serde(default)]
pub struct MeasureRegionRequest {
    /// The folder of a capture or a result, or a map: .npy, float .tiff, or the depth.png of a result.
    pub map: PathBuf,
    /// Column, row, width and height in pixels [default: the whole map].
    #[cfg_attr(feature = "clap", arg(long, value_name = "X,Y,W,H"))]
    #[serde_as(as = "Option<DisplayFromStr>")]
    pub region: Option<Rectangle>,
}

impl Request for MeasureRegionRequest {
    const NAME: &'static str = "measure region";
    const REQUIRED: &'static [&'static str] = &["map"];
    const PATHS: &'static [(&'static str, PathKind)] = &[("map", PathKind::Input)];
    type Figures = RegionFigures;

    fn run(&self, context: &Context<'_>) -> Result<RegionFigures> {
        let map = read(&self.map, context)?;
        region(&map, self.region.unwrap_or_else(|| map.all()))
    }
}

/// Fit a plane to a region of a depth map: flatness and tilt.
#[serde_as]
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[cfg_attr(feature = "clap", derive(clap::Args))]
#[cfg_attr(
    feature = "clap",
    command(after_help = "Example: farnear measure plane depth/depth.npy --region 100,80,200,150 --json")
)]
#[serde(default)]
pub struct MeasurePlaneRequest {
    /// The folder of a capture or a result, or a map: .npy, float .tiff, or the depth.png of a result.
    pub map: PathBuf,
    /// Column, row, width and height in pixels [default: the whole map].
    #[cfg_attr(feature = "clap", arg(long, value_name = "X,Y,W,H"))]
    #[serde_as(as = "Option<DisplayFromStr>")]
    pub region: Option<Rectangle>,
}

impl Request for MeasurePlaneRequest {
    const NAME: &'static str = "measure plane";
    const REQUIRED: &'static [&'static str] = &["map"];
    const PATHS: &'static [(&'static str, PathKind)] = &[("map", PathKind::Input)];
    type Figures = PlaneFigures;

    fn run(&self, context: &Context<'_>) -> Result<PlaneFigures> {
        let Self { map, region } = self.clone();
        let found = MeasureRegionRequest { map, region }.run(context)?;
        found.plane.ok_or_else(|| {
            let value = format!("{} pixels with a depth", found.pixels);
            WorkflowError::parameter("region", value, "expected some in several rows and columns")
        })
    }
}

/// List the depths along a line.
#[serde_as]
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[cfg_attr(feature = "clap", derive(clap::Args))]
#[cfg_attr(
    feature = "clap",
    command(after_help = "Example: farnear measure profile pair1/ --from 0,240 --to 639,240 --json")
)]
#[serde(default)]
pub struct MeasureProfileRequest {
    /// The folder of a capture or a result, or a map: .npy, float .tiff, or the depth.png of a result.
    pub map: PathBuf,
    /// Column and row of the begin.
    #[cfg_attr(feature = "clap", arg(long, value_name = "X,Y"))]
    #[serde_as(as = "DisplayFromStr")]
    pub from: Pixel,
    /// Column and row of the end.
    #[cfg_attr(feature = "clap", arg(long, value_name = "X,Y"))]
    #[serde_as(as = "DisplayFromStr")]
    pub to: Pixel,
}

impl Request for MeasureProfileRequest {
    const NAME: &'static str = "measure profile";
    const REQUIRED: &'static [&'static str] = &["map", "from", "to"];
    const PATHS: &'static [(&'static str, PathKind)] = &[("map", PathKind::Input)];
    type Figures = ProfileFigures;

    fn run(&self, context: &Context<'_>) -> Result<ProfileFigures> {
        profile(&read(&self.map, context)?, self.from.0, self.to.0)
    }
}

/// Subtract the first depth map from the second.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[cfg_attr(feature = "clap", derive(clap::Args))]
#[cfg_attr(
    feature = "clap",
    command(after_help = "Example: farnear measure difference pair1/ pair2/ --json")
)]
#[serde(default)]
pub struct MeasureDifferenceRequest {
    /// The folder of the first capture or result, or its map.
    pub first: PathBuf,
    /// The second one.
    pub second: PathBuf,
}

impl Request for MeasureDifferenceRequest {
    const NAME: &'static str = "measure difference";
    const REQUIRED: &'static [&'static str] = &["first", "second"];
    const PATHS: &'static [(&'static str, PathKind)] =
        &[("first", PathKind::Input), ("second", PathKind::Input)];
    type Figures = DifferenceFigures;

    fn run(&self, context: &Context<'_>) -> Result<DifferenceFigures> {
        difference(&self.first, &self.second, context).map(|(_, figures)| figures)
    }
}

/// Column and row, written as `x,y`.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Pixel(pub [usize; 2]);

impl std::fmt::Display for Pixel {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let [x, y] = self.0;
        write!(f, "{x},{y}")
    }
}

impl std::str::FromStr for Pixel {
    type Err = &'static str;

    fn from_str(text: &str) -> std::result::Result<Self, Self::Err> {
        let number = |part: &str| part.trim().parse().ok();
        let pixel = text.split_once(',').and_then(|(x, y)| Some([number(x)?, number(y)?]));
        pixel.map(Self).ok_or("expected a column and a row such as 10,20")
    }
}

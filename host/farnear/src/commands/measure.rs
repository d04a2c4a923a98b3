//! `farnear measure`: figures of a depth map, with their deviation.

use std::path::PathBuf;

use anyhow::Result;
use clap::{Args, Subcommand};
use farnear_files::map;
use farnear_workflows::{
    WorkflowError,
    measure::{self, Measured, Rectangle},
};

use crate::report;

/// Measure in a depth map: a region, the plane through it, a profile, the difference to another.
#[derive(Args)]
#[command(after_help = "Example: farnear measure region pair1/ --region 100,80,60,40 --json\n\
                        \x20        farnear measure profile pair1/ --from 0,240 --to 639,240 --json")]
pub struct Arguments {
    #[command(subcommand)]
    what: What,
}

#[derive(Subcommand)]
enum What {
    /// Mean, deviation and fill rate of a region, and the plane through it.
    #[command(after_help = "Example: farnear measure region pair1/ --region 100,80,200,150 --json")]
    Region(Region),
    /// The plane through a region: flatness and tilt.
    #[command(after_help = "Example: farnear measure plane depth/depth.npy --region 100,80,200,150 --json")]
    Plane(Region),
    /// Depths along a line.
    #[command(after_help = "Example: farnear measure profile pair1/ --from 0,240 --to 639,240 --json")]
    Profile {
        /// The capture's folder with depth.npy, or a map.
        capture: PathBuf,
        /// Column and row of the begin.
        #[arg(long, value_name = "X,Y", value_parser = numbers::<2>)]
        from: [usize; 2],
        /// Column and row of the end.
        #[arg(long, value_name = "X,Y", value_parser = numbers::<2>)]
        to: [usize; 2],
        /// Print one JSON object.
        #[arg(long)]
        json: bool,
    },
    /// The second capture's depth minus the first one's.
    #[command(after_help = "Example: farnear measure difference pair1/ pair2/ --json")]
    Difference {
        /// The first capture's folder.
        first: PathBuf,
        /// The second one's.
        second: PathBuf,
        /// Print one JSON object.
        #[arg(long)]
        json: bool,
    },
}

#[derive(Args)]
struct Region {
    /// The capture's folder with depth.npy, or a map.
    capture: PathBuf,
    /// Column, row, width and height in pixels [default: the whole map].
    #[arg(long, value_name = "X,Y,W,H", value_parser = numbers::<4>)]
    region: Option<[usize; 4]>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

impl Region {
    fn figures(&self) -> Result<measure::RegionFigures> {
        let map = Measured::read(&self.capture)?;
        let (rows, columns) = map.depth_mm.dim();
        let [x, y, width, height] = self.region.unwrap_or([0, 0, columns, rows]);
        Ok(measure::region(&map, Rectangle { x, y, width, height })?)
    }
}

/// So many whole numbers with commas between them.
fn numbers<const N: usize>(text: &str) -> Result<[usize; N], String> {
    let found: Result<Vec<usize>, _> = text.split(',').map(|part| part.trim().parse()).collect();
    let expected = || format!("expected {N} whole numbers such as {}", vec!["10"; N].join(","));
    found.map_err(|_| expected())?.try_into().map_err(|_| expected())
}

/// Runs the command.
pub fn run(arguments: Arguments) -> Result<()> {
    match arguments.what {
        What::Region(region) => report::print(&region.figures()?, region.json),
        What::Plane(region) => {
            let found = region.figures()?;
            let plane = found.plane.ok_or_else(|| {
                WorkflowError::parameter(
                    "region",
                    format!("{} pixels with a depth", found.pixels),
                    "too few for a plane",
                )
            })?;
            report::print(&plane, region.json)
        }
        What::Profile { capture, from, to, json } => {
            report::print(&measure::profile(&Measured::read(&capture)?, from, to)?, json)
        }
        What::Difference { first, second, json } => {
            let read = |folder: PathBuf| map::read(&folder.join("depth.npy")).map_err(WorkflowError::from);
            report::print(&measure::difference(&read(first)?, &read(second)?)?.1, json)
        }
    }
}

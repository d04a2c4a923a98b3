//! `farnear measure`: figures of a depth map.

use std::path::PathBuf;

use anyhow::Result;
use clap::{Args, Subcommand};
use farnear_workflows::measure::{self, ProfileSettings, Region};

use crate::{report, terminal};

/// Measure in a depth map: a region, the plane through it, a line, or the difference of two maps.
#[derive(Args)]
#[command(after_help = "Example: farnear measure plane depth/depth.npy --region 100,80,200,150 --json")]
pub struct Arguments {
    #[command(subcommand)]
    what: What,
}

#[derive(Subcommand)]
enum What {
    /// Mean, median, deviation and extremes of a region, with the mean's standard error.
    #[command(after_help = "Example: farnear measure region depth/depth.npy --region 100,80,200,150 --json")]
    Region(OfMap),
    /// The plane through a region: depth, slopes and how far depths lie from it.
    #[command(after_help = "Example: farnear measure plane depth/depth.npy --region 100,80,200,150 --json")]
    Plane(OfMap),
    /// Depth along a line, pixel by pixel.
    #[command(
        after_help = "Example: farnear measure profile depth/depth.npy --from 0,240 --to 639,240 --out profile.csv"
    )]
    Profile(Profile),
    /// One map less another.
    #[command(after_help = "Example: farnear measure difference a/depth.npy b/depth.npy --json")]
    Difference(Difference),
}

#[derive(Args)]
struct OfMap {
    /// The map: depth.npy or depth.tiff.
    depth: PathBuf,
    /// Only this part of it; without it all.
    #[arg(long, value_name = "LEFT,TOP,WIDTH,HEIGHT")]
    region: Option<Region>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

#[derive(Args)]
struct Profile {
    /// The map: depth.npy or depth.tiff.
    depth: PathBuf,
    /// The line's first place.
    #[arg(long, value_name = "X,Y", value_parser = place)]
    from: [usize; 2],
    /// The line's last place.
    #[arg(long, value_name = "X,Y", value_parser = place)]
    to: [usize; 2],
    /// Where the values go, as CSV.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

#[derive(Args)]
struct Difference {
    /// The map.
    depth: PathBuf,
    /// The map that is taken off.
    other: PathBuf,
    /// Only this part of them; without it all.
    #[arg(long, value_name = "LEFT,TOP,WIDTH,HEIGHT")]
    region: Option<Region>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

fn place(text: &str) -> Result<[usize; 2], String> {
    let numbers =
        text.split_once(',').and_then(|(x, y)| Some([x.trim().parse().ok()?, y.trim().parse().ok()?]));
    numbers.ok_or_else(|| "a place is a column and a row in pixels, such as 320,240".into())
}

/// Runs the command.
pub fn run(arguments: Arguments) -> Result<()> {
    match arguments.what {
        What::Region(OfMap { depth, region, json }) => report::print(&measure::region(&depth, region)?, json),
        What::Plane(OfMap { depth, region, json }) => report::print(&measure::plane(&depth, region)?, json),
        What::Difference(Difference { depth, other, region, json }) => {
            report::print(&measure::difference(&depth, &other, region)?, json)
        }
        What::Profile(Profile { depth, from, to, out, json }) => {
            let settings = ProfileSettings { depth, from, to, out };
            report::print(&measure::profile(&settings, &terminal::context()?)?, json)
        }
    }
}

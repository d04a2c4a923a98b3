use anyhow::Result;
use clap::Args;
use farnear_workflows::activity::shipped;
use serde::Serialize;

use crate::report;

/// Lists the recognisers that come with the program; each can stand after `recognise --model`.
#[derive(Args)]
#[command(after_help = "Example: farnear activity models --sheet")]
pub struct Arguments {
    /// Print the data sheet: what they were trained and tested on, and where they fail.
    #[arg(long)]
    sheet: bool,
    /// Print figures as JSON.
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct List {
    model: Vec<shipped::ModelFigures>,
}

pub fn run(arguments: Arguments) -> Result<()> {
    if arguments.sheet {
        return Ok(report::to_stdout(shipped::SHEET)?);
    }
    report::print(&List { model: shipped::list()? }, arguments.json)
}

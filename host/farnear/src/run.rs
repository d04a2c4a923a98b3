//! Runs a task from its request and prints its figures.

use anyhow::Result;
use clap::Args;
use farnear_workflows::request::Request;

use crate::{report, terminal};

// No doc comment: the help text of the command is that of the request.
#[allow(missing_docs)]
#[derive(Args)]
pub struct Run<R: Request + Args> {
    #[command(flatten)]
    request: R,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

impl<R: Request + Args> Run<R> {
    /// Checks and runs the request.
    pub fn run(self) -> Result<()> {
        self.request.check()?;
        report::print(&self.request.run(&terminal::counting(self.json)?)?, self.json)
    }
}

use anyhow::Result;
use clap::Args;
use farnear_workflows::{activity::evaluate::EvaluateRequest, request::Request};

use crate::{report, terminal};

// Not a doc comment: the help text is that of the request.
#[derive(Args)]
pub struct Evaluate {
    #[command(flatten)]
    request: EvaluateRequest,
    /// Print figures as JSON.
    #[arg(long)]
    json: bool,
}

impl Evaluate {
    /// For people the confusion is a table.
    pub fn run(self) -> Result<()> {
        let figures = self.request.run(&terminal::computing(self.json)?)?;
        report::print(&figures, self.json)?;
        match figures.confusion().filter(|_| !self.json) {
            Some(confusion) => Ok(report::to_stdout(&format!("\n{}", confusion.to_markdown()))?),
            None => Ok(()),
        }
    }
}

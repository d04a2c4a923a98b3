use anyhow::Result;
use clap::Args;
use farnear_workflows::activity::recognise::RecogniseRequest;

use crate::{report, terminal};

// No doc comment: the help text is that of the request.
#[derive(Args)]
pub struct Recognise {
    #[command(flatten)]
    request: RecogniseRequest,
    /// Print the last object only.
    #[arg(long)]
    json: bool,
}

impl Recognise {
    pub fn run(self) -> Result<()> {
        let Self { request, json } = self;
        let figures = request.answers(&terminal::context()?, &mut |answer| match json {
            true => Ok(()),
            false => report::line(answer),
        })?;
        report::print(&figures, true)
    }
}

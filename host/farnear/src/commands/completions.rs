use anyhow::Result;
use clap::{Args, CommandFactory};
use clap_complete::Shell;

use crate::report;

/// Print completions for a shell.
#[derive(Args)]
#[command(
    after_help = "Example: farnear completions bash > ~/.local/share/bash-completion/completions/farnear"
)]
pub struct Arguments {
    /// The shell.
    shell: Shell,
}

pub fn run<C: CommandFactory>(arguments: Arguments) -> Result<()> {
    let mut script = Vec::new();
    clap_complete::generate(arguments.shell, &mut C::command(), "farnear", &mut script);
    Ok(report::to_stdout(&String::from_utf8(script)?)?)
}

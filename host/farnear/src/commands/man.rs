use std::path::PathBuf;

use anyhow::Result;
use clap::{Args, Command, CommandFactory};
use clap_mangen::Man;
use farnear_files::staging::Staging;

/// Write the manual: a page for each command, for `man farnear-depth`.
#[derive(Args)]
#[command(after_help = "Example: farnear man --out ~/.local/share/man/man1")]
pub struct Arguments {
    /// Folder for the pages; other files in it stay.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

pub fn run<C: CommandFactory>(arguments: &Arguments) -> Result<()> {
    let mut command = C::command().disable_help_subcommand(true);
    command.build();
    let staged = Staging::into_folder(&arguments.out)?;
    write(&command, &staged)?;
    Ok(staged.finish()?)
}

fn write(command: &Command, staged: &Staging) -> Result<()> {
    let page = Man::new(command.clone());
    let mut text = Vec::new();
    page.render(&mut text)?;
    staged.write(&page.get_filename(), &text)?;
    command.get_subcommands().try_for_each(|below| write(below, staged))
}

//! Runs host/evaluation, which writes docs/accuracy.md and related pages.

use std::path::PathBuf;

use anyhow::Result;
use clap::Args;

use crate::run::{ROOT, cargo, finish, step};

#[derive(Args)]
pub struct Arguments {
    /// Folder with real pairs, focal stacks, skeletons and silhouettes; by default the folder next to the repository that tests use.
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    /// Print only these parts, such as `planes` or `corrections`, without writing pages.
    #[arg(long, value_name = "NAME")]
    only: Vec<String>,
    /// Write only these pages: `accuracy`, `robustness`, `activity`, `thesis` or `real`.
    #[arg(long, value_name = "NAME", conflicts_with = "only")]
    page: Vec<String>,
}

pub fn run(arguments: &Arguments) -> Result<()> {
    step("render, measure, write docs/accuracy.md and related pages");
    let mut command = cargo(["run", "--release", "--locked", "--package", "farnear-evaluation", "--"]);
    command.arg("--docs").arg(ROOT.join("docs"));
    if let Some(data) = &arguments.data {
        command.arg("--data").arg(std::path::absolute(data)?);
    }
    for part in &arguments.only {
        command.args(["--only", part]);
    }
    for page in &arguments.page {
        command.args(["--page", page]);
    }
    finish(&mut command)
}

//! Measures the accuracy of depth maps and writes `docs/accuracy.md`, `docs/accuracy-real.md` ([`depth`]),
//! `docs/activity.md` ([`people`]), `docs/robustness.md` ([`robust`]) and `docs/thesis.md` ([`thesis`]), with
//! their pictures. Everything is seeded; apart from the thesis' table of times, two runs on one kind of
//! processor write the same bytes. [`rig`] renders and compares, [`sweep`] does so for several operators,
//! [`page`] writes Markdown, [`chart`] and [`panels`] draw. Takes a few minutes on four cores; run it by
//! `cargo xtask evaluate`.

mod chart;
mod depth;
mod page;
mod panels;
mod people;
mod rig;
mod robust;
mod sweep;
mod thesis;

use std::{path::PathBuf, process::ExitCode};

use anyhow::{Context, Result, bail};
use clap::Parser;

use page::Page;

/// Measure the accuracy and write the accuracy pages.
#[derive(Parser)]
#[command(after_help = "Example: farnear-evaluation --docs docs/")]
struct Arguments {
    /// The folder of the pages; pictures go to images/ in it.
    #[arg(long, value_name = "DIR")]
    docs: PathBuf,
    /// The folder with real data; without it the one next to the repository.
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    /// Measure only these parts and print them; no page is written.
    #[arg(long, value_name = "NAME")]
    only: Vec<String>,
    /// Write only these pages, such as `thesis`.
    #[arg(long, value_name = "NAME", conflicts_with = "only")]
    page: Vec<String>,
}

/// Names of `--page`; `real` is the page of the part `real`.
const PAGES: [&str; 5] = ["accuracy", "robustness", "activity", "thesis", "real"];

fn main() -> ExitCode {
    match run(&Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("farnear-evaluation: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn run(arguments: &Arguments) -> Result<()> {
    chart::register_font()?;
    let images = arguments.docs.join("images");
    std::fs::create_dir_all(&images).with_context(|| format!("cannot make {}", images.display()))?;
    let of_people = people::PARTS.iter().map(|(name, _)| *name);
    let known = depth::RENDERED
        .iter()
        .chain(&robust::PARTS)
        .map(|(name, _)| *name)
        .chain(["real"])
        .chain(thesis::PARTS.iter().map(|(name, _)| *name))
        .chain(of_people)
        .collect::<Vec<_>>();
    if let Some(unknown) = arguments.only.iter().find(|name| !known.contains(&name.as_str())) {
        bail!("no part is called {unknown:?}, there are {}", known.join(", "));
    }
    if let Some(unknown) = arguments.page.iter().find(|name| !PAGES.contains(&name.as_str())) {
        bail!("no page is called {unknown:?}, there are {}", PAGES.join(", "));
    }
    let page_of = |name: &str| match name {
        "real" => "real",
        _ if depth::RENDERED.iter().any(|(part, _)| *part == name) => "accuracy",
        _ if robust::PARTS.iter().any(|(part, _)| *part == name) => "robustness",
        _ if thesis::PARTS.iter().any(|(part, _)| *part == name) => "thesis",
        _ => "activity",
    };
    let wanted = |name: &str| {
        let listed =
            |list: &[String], name: &str| list.is_empty() || list.iter().any(|wanted| wanted == name);
        listed(&arguments.only, name) && listed(&arguments.page, page_of(name))
    };

    if depth::RENDERED.iter().any(|(name, _)| wanted(name)) {
        let mut page = Page::new(&images, depth::INTRODUCTION);
        for (name, measure) in depth::RENDERED {
            if wanted(name) {
                eprintln!("{name}");
                measure(&mut page).with_context(|| format!("measuring {name}"))?;
            }
        }
        finish(page, arguments, "accuracy.md")?;
    }
    if robust::PARTS.iter().any(|(name, _)| wanted(name)) {
        let mut page = Page::new(&images, robust::INTRODUCTION);
        for (name, measure) in robust::PARTS {
            if wanted(name) {
                eprintln!("{name}");
                measure(&mut page).with_context(|| format!("measuring {name}"))?;
            }
        }
        finish(page, arguments, "robustness.md")?;
    }

    let beside = || PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data"));
    let data = arguments.data.clone().unwrap_or_else(beside);
    if people::PARTS.iter().any(|(name, _)| wanted(name)) {
        let mut page = Page::new(&images, people::INTRODUCTION);
        let data = people::data::Data(data.clone());
        for (name, measure) in people::PARTS {
            if wanted(name) {
                eprintln!("{name}");
                measure(&mut page, &data).with_context(|| format!("measuring {name}"))?;
            }
        }
        finish(page, arguments, "activity.md")?;
    }
    if thesis::PARTS.iter().any(|(name, _)| wanted(name)) {
        let mut page = Page::new(&images, thesis::INTRODUCTION);
        let data = people::data::Data(data.clone());
        for (name, measure) in thesis::PARTS {
            if wanted(name) {
                eprintln!("{name}");
                measure(&mut page, &data).with_context(|| format!("measuring {name}"))?;
            }
        }
        finish(page, arguments, "thesis.md")?;
    }
    if !wanted("real") {
        return Ok(());
    }
    if !data.is_dir() {
        eprintln!(
            "real: skipped, no real data ({} is not a folder); docs/accuracy-real.md stays",
            data.display()
        );
        return Ok(());
    }
    eprintln!("real");
    let mut page = Page::new(&images, depth::real::INTRODUCTION);
    depth::real::measure(&mut page, &data).context("measuring real scenes")?;
    finish(page, arguments, "accuracy-real.md")
}

fn finish(page: Page, arguments: &Arguments, name: &str) -> Result<()> {
    if !arguments.only.is_empty() {
        print!("{}", page.text());
        return Ok(());
    }
    page.write(&arguments.docs.join(name))
}

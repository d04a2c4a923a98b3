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
use people::data::Data;

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

fn main() -> ExitCode {
    match run(&Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("farnear-evaluation: {error:#}");
            ExitCode::FAILURE
        }
    }
}

type Measure<'a> = Box<dyn Fn(&mut Page) -> Result<()> + 'a>;
type OfData = fn(&mut Page, &Data) -> Result<()>;

struct Plan<'a> {
    /// Name of `--page`.
    name: &'static str,
    file: &'static str,
    introduction: &'static str,
    /// Names of `--only`, and what measures them.
    parts: Vec<(&'static str, Measure<'a>)>,
}

/// All pages in their order.
fn plans(data: &Data) -> [Plan<'_>; 5] {
    let alone = |(name, measure): (&'static str, fn(&mut Page) -> Result<()>)| {
        let measure: Measure<'_> = Box::new(measure);
        (name, measure)
    };
    let with_data = |(name, measure): (&'static str, OfData)| {
        let measure: Measure<'_> = Box::new(move |page: &mut Page| measure(page, data));
        (name, measure)
    };
    [
        Plan {
            name: "accuracy",
            file: "accuracy.md",
            introduction: depth::INTRODUCTION,
            parts: depth::RENDERED.map(alone).into(),
        },
        Plan {
            name: "robustness",
            file: "robustness.md",
            introduction: robust::INTRODUCTION,
            parts: robust::PARTS.map(alone).into(),
        },
        Plan {
            name: "activity",
            file: "activity.md",
            introduction: people::INTRODUCTION,
            parts: people::PARTS.map(with_data).into(),
        },
        Plan {
            name: "thesis",
            file: "thesis.md",
            introduction: thesis::INTRODUCTION,
            parts: thesis::PARTS.map(with_data).into(),
        },
        Plan {
            name: "real",
            file: "accuracy-real.md",
            introduction: depth::real::INTRODUCTION,
            parts: vec![with_data(("real", depth::real::measure))],
        },
    ]
}

fn check(what: &str, given: &[String], known: &[&str]) -> Result<()> {
    match given.iter().find(|name| !known.contains(&name.as_str())) {
        Some(unknown) => bail!("no {what} is called {unknown:?}, there are {}", known.join(", ")),
        None => Ok(()),
    }
}

fn run(arguments: &Arguments) -> Result<()> {
    chart::register_font()?;
    let images = arguments.docs.join("images");
    std::fs::create_dir_all(&images).with_context(|| format!("cannot make {}", images.display()))?;
    let beside = || PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data"));
    let data = Data(arguments.data.clone().unwrap_or_else(beside));
    let plans = plans(&data);
    let parts: Vec<&str> = plans.iter().flat_map(|plan| &plan.parts).map(|(part, _)| *part).collect();
    check("part", &arguments.only, &parts)?;
    check("page", &arguments.page, &plans.each_ref().map(|plan| plan.name))?;
    let listed = |list: &[String], name: &str| list.is_empty() || list.iter().any(|wanted| wanted == name);
    for Plan { name, file, introduction, parts } in &plans {
        let is_wanted = |part: &str| listed(&arguments.only, part) && listed(&arguments.page, name);
        let wanted: Vec<_> = parts.iter().filter(|(part, _)| is_wanted(part)).collect();
        if wanted.is_empty() {
            continue;
        }
        if *name == "real" && !data.0.is_dir() {
            let folder = data.0.display();
            eprintln!("real: skipped, no real data ({folder} is not a folder); docs/accuracy-real.md stays");
            continue;
        }
        let mut page = Page::new(&images, introduction);
        for (part, measure) in wanted {
            eprintln!("{part}");
            measure(&mut page).with_context(|| format!("measuring {part}"))?;
        }
        finish(page, arguments, file)?;
    }
    Ok(())
}

fn finish(page: Page, arguments: &Arguments, name: &str) -> Result<()> {
    if !arguments.only.is_empty() {
        print!("{}", page.text());
        return Ok(());
    }
    page.write(&arguments.docs.join(name))
}

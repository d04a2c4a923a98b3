//! The documents as a site: `docs/site/stage.py` lays out pages and help texts, a generator in a virtual env builds it.

use std::{fs, process::Command};

use anyhow::{Context, Result, bail};

use crate::{
    host, python,
    run::{ROOT, finish, step, target_folder},
};

const NEEDS: [&str; 2] = ["zensical==0.0.73", "latex2mathml>=3.77"];

pub fn run() -> Result<()> {
    let built = host::build()?;
    step("the site");
    let python = match python::environment(&target_folder().join("site"), &NEEDS) {
        Ok(python) => python,
        Err(missing) => bail!("the site cannot be built: {missing}"),
    };
    let (sources, out) = (ROOT.join("docs/site"), ROOT.join("out/site"));
    fs::create_dir_all(&out).with_context(|| format!("cannot make {}", out.display()))?;
    fs::copy(sources.join("zensical.toml"), out.join("zensical.toml")).context("cannot copy the settings")?;
    let stage = sources.join("stage.py");
    finish(Command::new(&python).arg(stage).arg(built.join("farnear")).arg(out.join("pages")))?;
    finish(Command::new(&python).args(["-m", "zensical", "build", "--strict"]).current_dir(&out))?;
    println!("{}", out.join("html/index.html").display());
    Ok(())
}

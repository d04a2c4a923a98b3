//! Release files, each tried in an empty root: static programs for two processors, Debian packages, Python wheel,
//! firmware, licences, checksums. Repeatable to the byte: archives carry the commit's time, programs no local path.

mod archive;
mod debian;
mod inventory;
mod programs;
mod trial;
mod wheel;

use std::{
    fs,
    path::{Path, PathBuf},
    process::Command,
};

use anyhow::{Context, Result};
use clap::Args;

use crate::{
    boards::BOARDS,
    firmware,
    run::{ROOT, finish, output, step},
};

#[derive(Args)]
pub struct Arguments {
    /// Output folder; its content is replaced.
    #[arg(long, value_name = "DIR", default_value = "out/release")]
    out: PathBuf,
}

struct Release {
    /// Version of all crates of the workspace.
    version: String,
    /// Commit time, seconds since 1970, of files in archives.
    epoch: String,
    out: PathBuf,
    work: PathBuf,
}

pub fn run(arguments: &Arguments) -> Result<()> {
    let out = ROOT.join(&arguments.out);
    let work = out.join("work");
    for folder in [&out, &work] {
        if folder.is_dir() {
            fs::remove_dir_all(folder).with_context(|| format!("cannot empty {}", folder.display()))?;
        }
        fs::create_dir_all(folder).with_context(|| format!("cannot create {}", folder.display()))?;
    }
    let git = |arguments: &[&str]| output(Command::new("git").args(arguments).current_dir(&*ROOT));
    let release = Release {
        version: env!("CARGO_PKG_VERSION").into(),
        epoch: git(&["log", "-1", "--format=%ct"])?.trim().into(),
        out,
        work,
    };
    if !git(&["status", "--porcelain"])?.is_empty() {
        eprintln!("note: there are uncommitted changes; the files carry the last commit's time");
    }

    firmware::build()?;
    let elves: Vec<PathBuf> = BOARDS
        .iter()
        .map(|board| crate::run::target_folder().join("release").join(format!("{}.elf", board.program())))
        .collect();
    for elf in &elves {
        copy(elf, &release.out)?;
    }

    step("contents");
    let notices = inventory::write(&release)?;

    let mut left_out = Vec::new();
    let mut made = Vec::new();
    for target in &programs::TARGETS {
        match programs::build(&release, target)? {
            Ok(built) => made.push((target, built)),
            Err(missing) => left_out.push(format!("programs for {}: {missing}", target.triple)),
        }
    }
    let native = made.iter().find(|(target, _)| target.runs_here()).map(|(_, built)| built.clone());
    let extras =
        native.as_deref().map(|programs| Extras::write(&release, programs, notices.clone())).transpose()?;
    if let Some(extras) = &extras {
        for (target, built) in &made {
            archive::write(&release, target, built, &elves, extras)?;
            trial::programs(&release, target, &mut left_out)?;
        }
        for (target, built) in &made {
            match debian::write(&release, target, built, &elves, extras)? {
                Ok(packages) => {
                    for package in packages {
                        trial::package(&release, target, &package, &mut left_out)?;
                    }
                }
                Err(missing) => left_out.push(format!("Debian package for {}: {missing}", target.debian)),
            }
        }
    }
    match wheel::write(&release, &notices)? {
        Ok(wheels) => trial::wheel(&release, &wheels, &mut left_out)?,
        Err(missing) => left_out.push(format!("wheel: {missing}")),
    }

    fs::remove_dir_all(&release.work).context("cannot remove the work folder")?;
    checksums(&release.out)?;
    for missing in &left_out {
        eprintln!("left out: {missing}");
    }
    Ok(())
}

struct Extras {
    man: PathBuf,
    /// `farnear.bash`, `farnear.zsh`, `farnear.fish`.
    completions: PathBuf,
    /// Licences of all contents.
    notices: PathBuf,
}

impl Extras {
    fn write(release: &Release, programs: &Path, notices: PathBuf) -> Result<Self> {
        let farnear = programs.join("farnear");
        let (man, completions) = (release.work.join("man"), release.work.join("completions"));
        finish(Command::new(&farnear).args(["man", "--out"]).arg(&man))?;
        fs::create_dir_all(&completions).context("cannot create the folder of completions")?;
        for shell in ["bash", "zsh", "fish"] {
            let text = output(Command::new(&farnear).args(["completions", shell]))?;
            fs::write(completions.join(format!("farnear.{shell}")), text)
                .context("cannot write completions")?;
        }
        Ok(Self { man, completions, notices })
    }
}

fn copy(file: &Path, folder: &Path) -> Result<()> {
    let name = file.file_name().with_context(|| format!("{} has no name", file.display()))?;
    fs::create_dir_all(folder).with_context(|| format!("cannot create {}", folder.display()))?;
    fs::copy(file, folder.join(name))
        .with_context(|| format!("cannot copy {} into {}", file.display(), folder.display()))?;
    Ok(())
}

fn lay_programs(programs: &Path, elves: &[PathBuf], folder: &Path) -> Result<()> {
    let built = crate::host::PROGRAMS.map(|name| programs.join(name));
    built.iter().chain(elves).try_for_each(|file| copy(file, folder))
}

/// Copies licences, README and the pages that it links to, in their folders.
fn lay_documents(folder: &Path) -> Result<()> {
    let mut git = Command::new("git");
    git.args([
        "ls-files",
        "--",
        "README.md",
        "CHANGELOG.md",
        "LICENSE-*",
        "docs/*.md",
        "docs/images",
        "examples",
    ]);
    for page in output(git.current_dir(&*ROOT))?.lines().map(Path::new) {
        copy(&ROOT.join(page), &folder.join(page.parent().unwrap_or(page)))?;
    }
    fs::copy(ROOT.join("examples/rig.toml"), folder.join("optics.toml")).context("cannot copy the optics")?;
    Ok(())
}

/// Writes `SHA256SUMS` for `sha256sum --check`; prints it with sizes.
fn checksums(out: &Path) -> Result<()> {
    let mut names = Vec::new();
    for entry in fs::read_dir(out).with_context(|| format!("cannot read {}", out.display()))? {
        let entry = entry?;
        names.push((entry.file_name(), entry.metadata()?.len()));
    }
    names.sort();
    let sums = output(Command::new("sha256sum").args(names.iter().map(|(name, _)| name)).current_dir(out))?;
    fs::write(out.join("SHA256SUMS"), &sums).context("cannot write SHA256SUMS")?;
    for (name, bytes) in names {
        println!("{bytes:>10}  {}", out.join(name).display());
    }
    Ok(())
}

//! The programs as one `.tar.gz`: unpack anywhere and run.

use std::{
    fs,
    path::{Path, PathBuf},
    process::Command,
};

use anyhow::{Context, Result};

use super::{Extras, Release, copy, lay_documents, lay_programs, programs::Target};
use crate::run::{ROOT, finish, step};

pub fn write(
    release: &Release,
    target: &Target,
    programs: &Path,
    elves: &[PathBuf],
    extras: &Extras,
) -> Result<()> {
    let name = name(release, target);
    step(&format!("{name}.tar.gz"));
    let folder = release.work.join(&name);
    lay_programs(programs, elves, &folder)?;
    lay_documents(&folder)?;
    copy(&extras.notices, &folder)?;
    copy(&ROOT.join("packaging/60-farnear.rules"), &folder)?;
    for (from, to) in [(&extras.man, "man"), (&extras.completions, "completions")] {
        for entry in fs::read_dir(from).with_context(|| format!("cannot read {}", from.display()))? {
            copy(&entry?.path(), &folder.join(to))?;
        }
    }
    let archive = release.out.join(format!("{name}.tar"));
    finish(
        Command::new("tar")
            .args(["--create", "--sort=name", "--owner=0", "--group=0", "--numeric-owner"])
            .args(["--mode=go=rX,u+rw,a-s", "--format=posix"])
            .arg("--pax-option=exthdr.name=%d/PaxHeaders/%f,delete=atime,delete=ctime")
            .arg(format!("--mtime=@{}", release.epoch))
            .arg("--file")
            .arg(&archive)
            .arg("--directory")
            .arg(&release.work)
            .arg(&name),
    )?;
    // Without name and time of the compressed file.
    finish(Command::new("gzip").args(["--best", "--no-name", "--force"]).arg(&archive))
}

/// Name of the archive without extension, and of its folder.
pub fn name(release: &Release, target: &Target) -> String {
    format!("farnear-{}-{}-linux", release.version, target.processor)
}

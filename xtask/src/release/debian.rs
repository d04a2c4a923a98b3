//! Debian packages, built by `dpkg-deb`. `farnear` has static programs and depends on nothing; `farnear-cameras`, for this
//! machine's processor, uses the system's libraries with all available cameras and depends on them.

use std::{
    fs,
    path::{Path, PathBuf},
    process::Command,
};

use anyhow::{Context, Result};

use super::{
    Extras, Release, copy, lay_documents, lay_programs,
    programs::{Target, without_paths},
};
use crate::run::{ROOT, cargo, finish, has, has_aravis, output, step, target_folder};

/// `/usr/bin` points here, because the emulated board expects its firmware next to it.
const PROGRAMS: &str = "usr/lib/farnear";

/// Package without dependencies.
const STATIC: &str = "farnear";
/// The same with cameras by libraries of the system; replaces the other.
const WITH_CAMERAS: &str = "farnear-cameras";

/// Returns the paths, or the missing tool.
pub fn write(
    release: &Release,
    target: &Target,
    programs: &Path,
    elves: &[PathBuf],
    extras: &Extras,
) -> Result<Result<Vec<PathBuf>, String>> {
    if !has("dpkg-deb") {
        return Ok(Err("dpkg-deb is missing; Debian's package is dpkg".into()));
    }
    let mut packages = vec![pack(release, target, STATIC, programs, "", elves, extras)?];
    let kinds = if target.runs_here() { cameras() } else { Vec::new() };
    if !kinds.is_empty() {
        let (programs, depends) = with_cameras(release, &kinds)?;
        packages.push(pack(release, target, WITH_CAMERAS, &programs, &depends, elves, extras)?);
    }
    Ok(Ok(packages))
}

fn pack(
    release: &Release,
    target: &Target,
    package: &str,
    programs: &Path,
    depends: &str,
    elves: &[PathBuf],
    extras: &Extras,
) -> Result<PathBuf> {
    let name = format!("{package}_{}_{}.deb", release.version, target.debian);
    step(&name);
    let root = release.work.join(format!("deb-{package}-{}", target.debian));
    lay_programs(programs, elves, &root.join(PROGRAMS))?;
    fs::create_dir_all(root.join("usr/bin")).context("cannot create usr/bin")?;
    for program in crate::host::PROGRAMS {
        let link = root.join("usr/bin").join(program);
        finish(Command::new("ln").arg("-s").arg(format!("../lib/farnear/{program}")).arg(link))?;
    }
    copy(&ROOT.join("packaging/60-farnear.rules"), &root.join("usr/lib/udev/rules.d"))?;
    let documents = root.join("usr/share/doc").join(package);
    lay_documents(&documents)?;
    let notices = fs::read_to_string(&extras.notices).context("cannot read the licences")?;
    let own = ["LICENSE-MIT", "LICENSE-APACHE"].map(|name| fs::read_to_string(ROOT.join(name)));
    let mut copyright = String::from("farnear is under MIT or Apache-2.0, as you choose.\n\n");
    for text in own {
        copyright += &text.context("cannot read a licence")?;
        copyright += "\n----\n\n";
    }
    fs::write(documents.join("copyright"), copyright + &notices).context("cannot write the copyright")?;
    for entry in fs::read_dir(&extras.man).context("cannot read the manual")? {
        copy(&entry?.path(), &root.join("usr/share/man/man1"))?;
    }
    finish(
        Command::new("gzip").args(["--best", "--no-name", "--recursive"]).arg(root.join("usr/share/man")),
    )?;
    for (shell, place) in [
        ("bash", "bash-completion/completions/farnear"),
        ("zsh", "zsh/vendor-completions/_farnear"),
        ("fish", "fish/vendor_completions.d/farnear.fish"),
    ] {
        let place = root.join("usr/share").join(place);
        fs::create_dir_all(place.parent().unwrap_or(&root))
            .context("cannot create a folder for completions")?;
        fs::copy(extras.completions.join(format!("farnear.{shell}")), place)
            .context("cannot copy completions")?;
    }

    let kilobytes = output(Command::new("du").args(["--summarize", "--apparent-size", "-k"]).arg(&root))?;
    let control = fs::read_to_string(ROOT.join("packaging/control.in"))
        .context("cannot read packaging/control.in")?
        .replace("{version}", &release.version)
        .replace("{architecture}", target.debian)
        .replace("{kilobytes}", kilobytes.split_whitespace().next().unwrap_or("0"))
        .replace("{depends}", depends)
        .replace("{package}", package)
        .replace("{other}", if package == STATIC { WITH_CAMERAS } else { STATIC });
    // A package without dependencies has no such line.
    let control = control.replace("Depends: \n", "");
    fs::create_dir_all(root.join("DEBIAN")).context("cannot create DEBIAN")?;
    fs::write(root.join("DEBIAN/control"), control).context("cannot write the control file")?;
    finish(Command::new("chmod").args(["-R", "u+rwX,go=rX"]).arg(&root))?;
    let package = release.out.join(name);
    finish(
        Command::new("dpkg-deb")
            .args(["--root-owner-group", "-Zxz", "--build"])
            .arg(&root)
            .arg(&package)
            .env("SOURCE_DATE_EPOCH", &release.epoch),
    )?;
    Ok(package)
}

fn cameras() -> Vec<&'static str> {
    let features = [(has_aravis(), "genicam", "libaravis-dev"), (has("clang"), "v4l2", "clang")];
    for (_, feature, package) in features.iter().filter(|(here, ..)| !here) {
        eprintln!("the Debian packages have no {feature} cameras: {package} is missing");
    }
    features.into_iter().filter(|(here, ..)| *here).map(|(_, feature, _)| feature).collect()
}

/// Folder of the programs, and the packages that they need.
fn with_cameras(release: &Release, kinds: &[&str]) -> Result<(PathBuf, String)> {
    step(&format!("programs with cameras: {}", kinds.join(", ")));
    let folder = target_folder().join("release-cameras");
    finish(
        cargo(["build", "--release", "--locked"])
            .args(crate::host::packages(&crate::host::PROGRAMS))
            .args(["--config", "profile.release.strip=true", "--features"])
            .arg(kinds.iter().map(|kind| format!("farnear/{kind}")).collect::<Vec<_>>().join(","))
            .arg("--target-dir")
            .arg(&folder)
            .env("SOURCE_DATE_EPOCH", &release.epoch)
            .env("CARGO_ENCODED_RUSTFLAGS", without_paths().join("\u{1f}")),
    )?;
    let programs = folder.join("release");
    let source = release.work.join("shlibdeps");
    fs::create_dir_all(source.join("debian")).context("cannot create a folder for dpkg-shlibdeps")?;
    fs::write(source.join("debian/control"), "Source: farnear\n\nPackage: farnear\nArchitecture: any\n")
        .context("cannot write a file for dpkg-shlibdeps")?;
    let depends = output(
        Command::new("dpkg-shlibdeps")
            .arg("-O")
            .args(crate::host::PROGRAMS.map(|name| programs.join(name)))
            .current_dir(&source),
    )?;
    Ok((programs, depends.trim().trim_start_matches("shlibs:Depends=").into()))
}

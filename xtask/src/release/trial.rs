//! Tries each file of a release in an empty root: renders a pair and compares its depth with the truth.

use std::{
    fs,
    path::{Path, PathBuf},
    process::Command,
};

use anyhow::{Context, Result, ensure};

use super::{Release, archive, programs::Target};
use crate::{
    python,
    run::{ROOT, finish, output, step},
};

/// Limit of the depth error, mm: the 8-bit staircase has 0.67.
const MOST_OFF_MM: f64 = 0.8;
const OPTICS: &str = "examples/rig.toml";

/// Unpacks an archive into an empty root and runs its programs.
pub fn programs(release: &Release, target: &Target, left_out: &mut Vec<String>) -> Result<()> {
    let runner = match target.runner() {
        Ok(runner) => runner,
        Err(missing) => {
            left_out.push(format!("trial of the {} programs: {missing}", target.processor));
            return Ok(());
        }
    };
    let name = archive::name(release, target);
    step(&format!("{name}.tar.gz, unpacked into an empty root"));
    let root = empty(release, &format!("root-{}", target.processor))?;
    let packed = release.out.join(format!("{name}.tar.gz"));
    finish(Command::new("tar").arg("--extract").arg("--file").arg(packed).arg("--directory").arg(&root))?;
    let folder = root.join(&name);
    let Some(runner) = runner else {
        // Empty root: no library, shell or /proc. The normal file system if chroot is not permitted.
        let inside = |program: &str| {
            let mut command = Command::new("unshare");
            command.args(["--map-root-user", "--root"]).arg(&root).arg(format!("/{name}/{program}"));
            command
        };
        if inside("farnear").arg("--version").status().is_ok_and(|status| status.success()) {
            let optics = PathBuf::from("/optics.toml");
            fs::copy(ROOT.join(OPTICS), root.join("optics.toml")).context("cannot copy the optics")?;
            depth(&|| inside("farnear"), &optics, Path::new("/pair"))?;
            // `doctor` reports everything as missing but must not fail.
            finish(inside("farnear").arg("doctor"))?;
            return finish(inside("farnear-sim").arg("--help"));
        }
        left_out.push("an empty root: this user may not create one (unshare --map-root-user --root)".into());
        depth(&|| Command::new(folder.join("farnear")), &ROOT.join(OPTICS), &root.join("pair"))?;
        return captures(&folder, &root.join("capture"));
    };
    depth(&|| farnear(Some(&runner), &folder), &ROOT.join(OPTICS), &root.join("pair"))
}

/// `farnear` of a folder, by the emulator of its processor if it needs one.
fn farnear(runner: Option<&String>, folder: &Path) -> Command {
    let program = folder.join("farnear");
    let Some(runner) = runner else { return Command::new(program) };
    let mut command = Command::new(runner);
    command.arg(program);
    command
}

/// Installs a Debian package into an empty root and runs its programs.
pub fn package(release: &Release, target: &Target, package: &Path, left_out: &mut Vec<String>) -> Result<()> {
    step(&format!("{}, installed into an empty root", package.display()));
    let stem = package.file_stem().unwrap_or_default().to_string_lossy();
    let root = empty(release, &format!("root-{stem}"))?;
    let database = root.join("var/lib/dpkg");
    fs::create_dir_all(database.join("info")).context("cannot create dpkg's folder")?;
    fs::write(database.join("status"), "").context("cannot write dpkg's status")?;
    // Dependencies are the system's; the run shows whether they are present.
    let mut install = Command::new("dpkg");
    install
        .arg(format!("--root={}", root.display()))
        .args(["--force-not-root", "--force-depends", "--force-architecture", "--force-script-chrootless"])
        .args(["--log=/dev/null", "--install"])
        .arg(package);
    finish(&mut install)?;
    let programs = root.join("usr/bin");
    let documents = Path::new("usr/share/doc").join(stem.split('_').next().unwrap_or_default());
    let pages =
        ["copyright", "README.md", "docs/getting-started.md", "optics.toml"].map(|page| documents.join(page));
    for page in pages.iter().map(PathBuf::as_path).chain([Path::new("usr/share/man/man1/farnear-depth.1.gz")])
    {
        ensure!(root.join(page).is_file(), "the package lacks {}", page.display());
    }
    let runner = match target.runner() {
        Ok(runner) => runner,
        Err(missing) => {
            left_out.push(format!("trial of {}: {missing}", package.display()));
            return Ok(());
        }
    };
    depth(&|| farnear(runner.as_ref(), &programs), &ROOT.join(OPTICS), &root.join("pair"))?;
    if target.runs_here() { captures(&programs, &root.join("capture")) } else { Ok(()) }
}

/// Checks the wheels' licences, and computes a depth map with the one for this processor.
pub fn wheel(release: &Release, wheels: &[PathBuf], left_out: &mut Vec<String>) -> Result<()> {
    for wheel in wheels {
        let files = output(Command::new("python3").args(["-m", "zipfile", "--list"]).arg(wheel))?;
        for licence in ["LICENSE-MIT", "LICENSE-APACHE", "THIRD-PARTY.txt"] {
            ensure!(files.contains(&format!("licenses/{licence}")), "{} lacks {licence}", wheel.display());
        }
    }
    let here =
        |wheel: &&PathBuf| wheel.to_string_lossy().ends_with(&format!("{}.whl", std::env::consts::ARCH));
    let Some(wheel) = wheels.iter().find(here) else {
        left_out.push("trial of the wheel: none is for this processor".into());
        return Ok(());
    };
    step(&format!("{}, installed into a fresh environment", wheel.display()));
    let needs = [wheel.to_string_lossy()];
    match python::environment(&release.work.join("wheel-root"), &needs.each_ref().map(AsRef::as_ref)) {
        Ok(python) => {
            let first = ROOT.join("packaging/first_depth.py");
            finish(Command::new(python).arg(first).current_dir(&release.work))
        }
        Err(missing) => {
            left_out.push(format!("trial of the wheel: {missing}"));
            Ok(())
        }
    }
}

fn depth(farnear: &dyn Fn() -> Command, optics: &Path, pair: &Path) -> Result<()> {
    let run = |arguments: &[&str], paths: &[&Path]| {
        let mut command = farnear();
        command.args(arguments).args(paths).arg("--optics").arg(optics);
        command
    };
    output(
        run(&["render", "--scene", "staircase", "--psf", "gaussian:k=0.4578", "--out"], &[pair])
            .arg("--json"),
    )?;
    let images = [pair.join("far.png"), pair.join("near.png")];
    let images: [&Path; 2] = images.each_ref().map(PathBuf::as_path);
    output(run(&["depth"], &images).arg("--out").arg(pair).arg("--json"))?;
    let mut compare = farnear();
    compare.arg("compare").args(["depth.npy", "truth.npy"].map(|map| pair.join(map)));
    let compared = output(compare.args(["--away-from-edges", "8", "--json"]))?;
    let off = crate::demo::figure(&compared, "rmse_mm")?;
    println!("depth of a rendered pair is off by {off} mm");
    ensure!(off.parse::<f64>()? <= MOST_OFF_MM, "depth is off by {off} mm, expected at most {MOST_OFF_MM}");
    Ok(())
}

fn captures(programs: &Path, out: &Path) -> Result<()> {
    let mut capture = Command::new(programs.join("farnear"));
    capture.args(["rig", "capture", "--port", "sim", "--scene", "staircase", "--json", "--optics"]);
    let report = output(capture.arg(ROOT.join(OPTICS)).arg("--out").arg(out))?;
    println!("a pair by the emulated rig in {} ms of its time", crate::demo::figure(&report, "pair_ms")?);
    Ok(())
}

fn empty(release: &Release, name: &str) -> Result<PathBuf> {
    let root = release.work.join(name);
    fs::create_dir_all(&root).with_context(|| format!("cannot create {}", root.display()))?;
    Ok(root)
}

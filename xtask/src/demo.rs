//! The whole rig without hardware: build, capture on the emulated board, compute and check depth.

use std::{fs, panic::resume_unwind, path::Path, process::Command, thread};

use anyhow::{Context, Result};

use crate::{
    firmware, host,
    run::{ROOT, output, step},
    thumb::Way,
};

/// The noisy 8-bit staircase under a Gaussian point spread function.
const SCENE: [&str; 8] =
    ["--scene", "staircase", "--psf", "gaussian:k=0.4578", "--noise", "8bit", "--seed", "1"];
/// Excluded distance from a depth step, where a window covers two depths.
const AWAY_FROM_EDGES_PX: &str = "8";

pub fn run() -> Result<()> {
    let way = Way::find()?;
    step("firmware and host programs, side by side (the first build takes some minutes)");
    // Neither uses all cores throughout.
    let (elf, programs) = thread::scope(|scope| {
        let firmware = scope.spawn(|| firmware::build_emulated(way));
        let programs = host::build_silently(&["farnear", "farnear-sim"]);
        (firmware.join().unwrap_or_else(|panic| resume_unwind(panic)), programs)
    });
    elf?;
    let programs = programs?;
    let farnear = |arguments: &[&str]| {
        let mut command = Command::new(programs.join("farnear"));
        command.args(arguments).current_dir(&*ROOT);
        command
    };
    let optics = "examples/rig.toml";
    let out = Path::new("out/demo");
    let whole = ROOT.join(out);
    if whole.exists() {
        fs::remove_dir_all(&whole).with_context(|| format!("cannot clear {}", whole.display()))?;
    }
    let path = |name: &str| out.join(name).to_string_lossy().into_owned();

    step("home the emulated stage and capture a far- and a near-focused image");
    let capture = ["rig", "capture", "--port", "sim", "--optics", optics, "--out", &path(""), "--json"];
    let captured = output(farnear(&capture).args(SCENE))?;

    step("depth from the pair");
    let (far, near) = (path("far.png"), path("near.png"));
    // A wider median than the default, for noisy 8-bit images.
    let depth = ["depth", &far, &near, "--optics", optics, "--median-px", "5", "--out", &path(""), "--json"];
    output(&mut farnear(&depth))?;

    step("compare with the true depth");
    let truth = path("truth");
    output(farnear(&["render", "--optics", optics, "--out", &truth]).args(SCENE))?;
    let (map, known) = (path("depth.npy"), format!("{truth}/truth.npy"));
    let compare = ["compare", &map, &known, "--away-from-edges", AWAY_FROM_EDGES_PX, "--json"];
    let compared = output(&mut farnear(&compare))?;

    eprintln!("\nlook at {}", path("view.png"));
    println!(
        "demo rmse_mm={} pair_ms={} out={}",
        figure(&compared, "rmse_mm")?,
        figure(&captured, "pair_ms")?,
        out.display()
    );
    Ok(())
}

pub fn figure<'a>(json: &'a str, key: &str) -> Result<&'a str> {
    let quoted = format!("\"{key}\":");
    let after = json.split_once(&quoted).with_context(|| format!("no {key} in {json}"))?.1;
    Ok(after.split([',', '}']).next().unwrap_or(after).trim())
}

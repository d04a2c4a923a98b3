//! Whole programs compared with a numpy + OpenCV script: CPU seconds, wall time and memory.

use std::{
    fmt::Write as _,
    fs,
    io::Write as _,
    path::{Path, PathBuf},
    process::{Command, Stdio},
};

use anyhow::{Context, Result, bail};
use serde_json::{Value, json};

use super::{modules, processor};
use crate::run::{ROOT, cargo, finish, step, target_folder};

const TIMER: &str = "host/depth/benches/time_programs.py";
const PEER: &str = "host/depth/benches/program_opencv.py";
/// 0.3, 2, 12 and 45 megapixels.
const SIZES: [[usize; 2]; 4] = [[640, 480], [1600, 1200], [4000, 3000], [8192, 5464]];
/// Larger images are mosaics of this one, mirrored at its edges, because rendering is slow.
const TILE: [usize; 2] = [1600, 1200];
/// Displacement of a shifted pair's near image.
const SHIFT: [usize; 2] = [3, 2];
const OPTICS: &str = "[lens]\nfocal_length_mm = 50.0\nf_number = 1.4\ntelecentric = true\n\n[sensor]\npixel_um = 7.4\n\n\
     [focus]\nfar_mm = 933.0\nmax_blur_px = 2.703\n\n[psf]\nmodel = \"gaussian\"\nk = 0.4578\n";

pub fn run(runs: usize) -> Result<String> {
    modules(&["numpy", "cv2"])?;
    step("farnear in release");
    finish(&mut cargo(["build", "--release", "--locked", "--package", "farnear"]))?;
    let farnear = target_folder().join("release/farnear");
    let folder = target_folder().join("bench-programs");
    fs::create_dir_all(&folder).with_context(|| format!("cannot create {}", folder.display()))?;
    let optics = folder.join("optics.toml");
    fs::write(&optics, OPTICS).with_context(|| format!("cannot write {}", optics.display()))?;
    step("rendering");
    let tile = folder.join("tile");
    let [width, height] = TILE.map(|side| side.to_string());
    let render =
        ["render", "--scene", "staircase", "--noise", "8bit", "--width", &width, "--height", &height];
    finish(Command::new(&farnear).args(render).arg("--optics").arg(&optics).arg("--out").arg(&tile))?;

    let results = folder.join("results");
    let text = |path: &Path| path.to_string_lossy().into_owned();
    let mut labels = Vec::new();
    let mut groups = Vec::new();
    for size in SIZES {
        for shift in [[0, 0], SHIFT] {
            let [far, near] = pair(&folder, &tile, size, shift)?;
            for npy_only in [true, false] {
                let ours = |threads: &str| {
                    let words =
                        [&text(&farnear), "depth", &text(&far), &text(&near), "--optics", &text(&optics)];
                    let mut words: Vec<String> = words.iter().map(ToString::to_string).collect();
                    let out = text(&results.join("ours"));
                    words.extend(["--threads", threads, "--out", &out].map(String::from));
                    words
                        .extend(npy_only.then(|| ["--write", "npy"].map(String::from)).into_iter().flatten());
                    words
                };
                let peer = [text(&ROOT.join(PEER)), text(&far), text(&near), text(&results.join("peer"))];
                let mut peer: Vec<String> = ["python3".into()].into_iter().chain(peer).collect();
                peer.extend(npy_only.then(|| "--npy-only".into()));
                labels.push((size, shift, npy_only));
                groups.push(json!([ours("1"), ours("2"), peer]));
            }
        }
    }
    step("programs in turn");
    let figures = timed(&groups, runs, &results)?;
    Ok(page(&labels, &figures, runs))
}

fn pair(folder: &Path, tile: &Path, size: [usize; 2], shift: [usize; 2]) -> Result<[PathBuf; 2]> {
    const SCRIPT: &str = "import sys, cv2, numpy as np\n\
        tile, far, near, width, height, x, y = sys.argv[1:]; width, height, x, y = map(int, (width, height, x, y))\n\
        for name, out, x, y in (('far', far, 0, 0), ('near', near, x, y)):\n\
        \x20   image = cv2.imread(f'{tile}/{name}.png', cv2.IMREAD_UNCHANGED); h, w = image.shape\n\
        \x20   image = np.pad(image, ((0, max(0, height + y - h)), (0, max(0, width + x - w))), 'symmetric')\n\
        \x20   cv2.imwrite(out, image[y:y + height, x:x + width])\n";
    let [width, height] = size;
    let name = |which: &str| folder.join(format!("{which}-{width}x{height}-{}.png", shift[0]));
    let files = [name("far"), name("near")];
    let numbers = [width, height, shift[0], shift[1]].map(|number| number.to_string());
    finish(Command::new("python3").args(["-c", SCRIPT]).arg(tile).args(&files).args(numbers))?;
    Ok(files)
}

fn timed(groups: &[Value], runs: usize, results: &Path) -> Result<Vec<Value>> {
    let mut timer = Command::new("python3")
        .arg(ROOT.join(TIMER))
        .arg(runs.to_string())
        .arg(results)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .context("cannot start python3")?;
    timer.stdin.take().context("no standard input")?.write_all(json!(groups).to_string().as_bytes())?;
    let output = timer.wait_with_output()?;
    if !output.status.success() {
        bail!("{TIMER} failed: {}", output.status);
    }
    let lines = String::from_utf8_lossy(&output.stdout);
    lines
        .lines()
        .map(|line| serde_json::from_str(line).with_context(|| format!("not JSON: {line}")))
        .collect()
}

type Label = ([usize; 2], [usize; 2], bool);

fn page(labels: &[Label], figures: &[Value], runs: usize) -> String {
    let mut text = format!(
        "# Speed of whole programs\n\nWritten by `cargo xtask bench --programs --write` on {}; medians of {runs} runs in turn, each into an empty folder. \
         `farnear depth` by its default method is compared with a numpy + OpenCV script that reads, registers, computes and \
         writes ([`program_opencv.py`](../host/depth/benches/program_opencv.py), one thread, a fixed window, no uncertainty). \
         The script writes depth and a coloured picture; `farnear depth` writes all its default outputs, or depth.npy only. A ratio \
         below 1 means that farnear uses less CPU time. A shifted pair needs registration; an aligned pair skips it. User time leaves out the kernel's, most of which \
         provides memory, and varies with the computer.\n\n\
         | pair | outputs | CPU s, 1 thread | CPU s, 2 threads | script, CPU s | ratio, 1 thread | ratio of user time | user ns per pixel | wall / CPU, 2 threads | memory MiB | script, memory MiB |\n\
         |---|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|\n",
        processor(),
    );
    for (([width, height], shift, npy_only), figures) in labels.iter().zip(figures) {
        let figure = |program: usize, name: &str| figures[program][name].as_f64().unwrap_or(f64::NAN);
        let _ = writeln!(
            text,
            "| {width}x{height}{} | {} | {:.3} | {:.3} | {:.3} | {:.2} | {:.2} | {:.0} | {:.2} | {:.0} | {:.0} |",
            if shift[0] == 0 { "" } else { ", shifted" },
            if *npy_only { "npy" } else { "all" },
            figure(0, "cpu_s"),
            figure(1, "cpu_s"),
            figure(2, "cpu_s"),
            figure(0, "cpu_s") / figure(2, "cpu_s"),
            figure(0, "user_s") / figure(2, "user_s"),
            figure(0, "user_s") * 1e9 / (width * height) as f64,
            figure(1, "wall_s") / figure(1, "cpu_s"),
            figure(0, "memory_mib"),
            figure(2, "memory_mib"),
        );
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ratio_is_ours_over_the_scripts() {
        let time =
            |cpu: f64| json!({"cpu_s": cpu, "user_s": cpu / 2.0, "wall_s": cpu / 4.0, "memory_mib": 100.0});
        let figures = [json!([time(1.0), time(1.2), time(2.0)])];
        let page = page(&[([640, 480], SHIFT, true)], &figures, 5);
        let row =
            "| 640x480, shifted | npy | 1.000 | 1.200 | 2.000 | 0.50 | 0.50 | 1628 | 0.25 | 100 | 100 |";
        assert!(page.contains(row), "{page}");
    }
}

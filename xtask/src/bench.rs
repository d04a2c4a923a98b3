//! Times of the mathematics in release, and ratios to OpenCV on the same machine. Peers are scripts of the
//! project or the user, run with the machine's `python3`; nothing is installed. A peer runs before and after
//! our benches and its better time counts, in case the machine slows down.

mod arm;
mod people;
mod programs;

use std::{
    fmt::Write as _,
    fs,
    path::{Path, PathBuf},
    process::Command,
};

use anyhow::{Context, Result, bail};
use clap::Args;
use serde_json::Value;

use crate::run::{ROOT, cargo, output, step, target_folder};

const PEER_SCRIPT: &str = "host/depth/benches/peer_opencv.py";
const SIZE: (usize, usize) = (640, 480);

#[derive(Args)]
pub struct Arguments {
    /// Run the same with numpy, OpenCV and scikit-learn, and print the ratios; needs python3 with them.
    #[arg(long)]
    peers: bool,
    /// Other peer scripts that print one JSON object. A script whose text names FEATURES is called as `python3 FILE
    /// FEATURES.npy` and gives `isomap_ms`, `rbf_training_ms` and `embedding_ms`; others as `python3 FILE far near` and give `chain_ms`.
    #[arg(long, value_name = "FILE")]
    peer_script: Vec<PathBuf>,
    /// Run only one half: depth or people.
    #[arg(long, value_name = "HALF", conflicts_with = "write")]
    only: Option<Half>,
    /// Count the instructions on 64-bit ARM; needs qemu-user, gcc-aarch64-linux-gnu and the target
    /// aarch64-unknown-linux-gnu. With --write, rewrite only that section.
    #[arg(long, conflicts_with_all = ["peers", "only"])]
    arm: bool,
    /// Time `farnear depth` as a whole program compared with a numpy and OpenCV script, 0.3 to 45 megapixels. With --write,
    /// rewrite docs/speed-programs.md.
    #[arg(long, conflicts_with_all = ["peers", "only", "arm"])]
    programs: bool,
    /// Number of runs of each program.
    #[arg(long, default_value_t = 5, requires = "programs")]
    runs: usize,
    /// Write the page docs/speed.md from the figures.
    #[arg(long)]
    write: bool,
}

/// One half of the host's mathematics.
#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Half {
    Depth,
    People,
}

struct Row {
    name: String,
    backend: String,
    threads: u64,
    min_ms: f64,
    median_ms: f64,
    /// Floating-point operations without sharing between a kernel's taps, and those executed.
    flop: Option<[f64; 2]>,
}

struct Peer {
    name: String,
    version: String,
    chain_ms: [f64; 2],
    convolution_ms: Option<[f64; 2]>,
}

pub fn run(arguments: &Arguments) -> Result<()> {
    if arguments.arm {
        return arm::renew(arguments.write);
    }
    if arguments.programs {
        let page = programs::run(arguments.runs)?;
        println!("\n{page}");
        return if arguments.write { write(&ROOT.join("docs/speed-programs.md"), &page) } else { Ok(()) };
    }
    let (mut with_features, mut with_pair) = (Vec::new(), Vec::new());
    for script in &arguments.peer_script {
        let text = fs::read_to_string(script).with_context(|| format!("cannot read {}", script.display()))?;
        if text.contains("FEATURES") { &mut with_features } else { &mut with_pair }.push(script.clone());
    }
    let mut page = String::new();
    if arguments.only != Some(Half::People) {
        page = depth(arguments.peers, with_pair)?;
        println!("\n{page}");
    }
    if arguments.only != Some(Half::Depth) {
        let section = people::run(arguments.peers, &with_features)?;
        println!("\n{section}");
        page = page + "\n" + &section;
    }
    if arguments.write {
        write(&page_file(), &(page_of(&page) + "\n" + &arm::kept()?))?;
    }
    Ok(())
}

fn page_file() -> PathBuf {
    ROOT.join("docs/speed.md")
}

fn write(file: &Path, text: &str) -> Result<()> {
    fs::write(file, text.trim_end().to_owned() + "\n")
        .with_context(|| format!("cannot write {}", file.display()))?;
    println!("wrote {}", file.display());
    Ok(())
}

fn depth(peers: bool, mut scripts: Vec<PathBuf>) -> Result<String> {
    if peers {
        scripts.insert(0, ROOT.join(PEER_SCRIPT));
    }
    if !scripts.is_empty() {
        modules(&["numpy", "cv2"])?;
    }
    let pair = if scripts.is_empty() { None } else { Some(random_pair()?) };
    let all = |when: &str| -> Result<Vec<Peer>> {
        let Some(pair) = &pair else { return Ok(Vec::new()) };
        step(&format!("peers, {when} our own benches"));
        scripts.iter().map(|script| time_peer(script, pair)).collect()
    };
    let before = all("before")?;
    step("host/depth");
    let bench = ["bench", "--locked", "--package", "farnear-depth", "--bench", "run_time"];
    let rows = rows(&output(cargo(bench).env("FARNEAR_JSON", "1"))?)?;
    if rows.is_empty() {
        bail!("the benches of host/depth printed no figures");
    }
    let peers: Vec<Peer> = before.into_iter().zip(all("after")?).map(|(a, b)| better(a, b)).collect();
    Ok(tables(&rows, &peers))
}

fn modules(names: &[&str]) -> Result<()> {
    let advice = "the peers need python3 with numpy, opencv-python-headless, scipy and scikit-learn; without them run \
                  `cargo xtask bench`";
    for module in ["sys"].iter().chain(names) {
        let found = Command::new("python3").args(["-c", &format!("import {module}")]).output();
        match found {
            Err(error) => bail!("cannot start python3 ({error}): {advice}"),
            Ok(found) if !found.status.success() && *module == "sys" => bail!("python3 fails: {advice}"),
            Ok(found) if !found.status.success() => bail!("python3 has no module {module}: {advice}"),
            Ok(_) => {}
        }
    }
    Ok(())
}

/// Far and near image of noise as PGM files, equal in each run.
fn random_pair() -> Result<[PathBuf; 2]> {
    let folder = target_folder().join("peers");
    fs::create_dir_all(&folder).with_context(|| format!("cannot make {}", folder.display()))?;
    let (width, height) = SIZE;
    let mut state = 0x9e37_79b9_7f4a_7c15_u64;
    let mut write = |name: &str| -> Result<PathBuf> {
        let mut bytes = format!("P5\n{width} {height}\n255\n").into_bytes();
        bytes.extend((0..width * height).map(|_| {
            // xorshift64 (Marsaglia 2003).
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            (state >> 32) as u8
        }));
        let path = folder.join(name);
        fs::write(&path, bytes).with_context(|| format!("cannot write {}", path.display()))?;
        Ok(path)
    };
    Ok([write("far.pgm")?, write("near.pgm")?])
}

fn time_peer(script: &Path, pair: &[PathBuf; 2]) -> Result<Peer> {
    let text = output(Command::new("python3").arg(script).args(pair))?;
    let name = script.file_name().unwrap_or_default().to_string_lossy().into_owned();
    peer(&name, &text).with_context(|| format!("{} printed no figures", script.display()))
}

fn peer(name: &str, text: &str) -> Result<Peer> {
    let line = text.lines().rev().find(|line| line.starts_with('{')).context("no line is a JSON object")?;
    let json: Value = serde_json::from_str(line).with_context(|| format!("not JSON: {line}"))?;
    let times = |key: &str| Some([json[key]["min"].as_f64()?, json[key]["median"].as_f64()?]);
    Ok(Peer {
        name: name.into(),
        version: json["opencv"].as_str().unwrap_or("?").into(),
        chain_ms: times("chain_ms").with_context(|| format!("no chain_ms.min and .median in {line}"))?,
        convolution_ms: times("filter2d_7x7_ms"),
    })
}

fn better(a: Peer, b: Peer) -> Peer {
    let least = |a: [f64; 2], b: [f64; 2]| [a[0].min(b[0]), a[1].min(b[1])];
    Peer {
        chain_ms: least(a.chain_ms, b.chain_ms),
        convolution_ms: a.convolution_ms.zip(b.convolution_ms).map(|(a, b)| least(a, b)),
        ..a
    }
}

fn rows(text: &str) -> Result<Vec<Row>> {
    text.lines().filter(|line| line.starts_with('{')).map(row).collect()
}

fn row(line: &str) -> Result<Row> {
    let json: Value = serde_json::from_str(line).with_context(|| format!("not JSON: {line}"))?;
    let read = || {
        Some(Row {
            name: json["name"].as_str()?.into(),
            backend: json["backend"].as_str()?.into(),
            threads: json["threads"].as_u64()?,
            min_ms: json["min_ms"].as_f64()?,
            median_ms: json["median_ms"].as_f64()?,
            flop: json["flop"].as_f64().zip(json["executed_flop"].as_f64()).map(<[f64; 2]>::from),
        })
    };
    read().with_context(|| format!("not a bench's line: {line}"))
}

fn tables(rows: &[Row], peers: &[Peer]) -> String {
    let mut text =
        String::from("| what | vector unit | threads | min ms | median ms |\n|---|---|--:|--:|--:|\n");
    for Row { name, backend, threads, min_ms, median_ms, .. } in rows {
        let _ = writeln!(text, "| {name} | {backend} | {threads} | {min_ms:.3} | {median_ms:.3} |");
    }
    text.push_str(&shares_of_peak(rows));
    if peers.is_empty() {
        return text;
    }
    text.push_str("\n| peer, one thread | chain min ms | chain median ms | 7x7 convolution min ms |\n|---|--:|--:|--:|\n");
    for Peer { name, version, chain_ms: [min, median], convolution_ms } in peers {
        let convolution = convolution_ms.map_or("-".into(), |[min, _]| format!("{min:.3}"));
        let _ = writeln!(text, "| {name}, OpenCV {version} | {min:.3} | {median:.3} | {convolution} |");
    }
    text.push_str("\n| ours | vector unit | threads | against | ratio of minima | ratio of medians |\n|---|---|--:|---|--:|--:|\n");
    for row in rows {
        for peer in peers {
            let theirs = match row.name.as_str() {
                "chain_640x480" => Some(peer.chain_ms),
                "convolution_7x7" => peer.convolution_ms,
                _ => None,
            };
            let Some([min, median]) = theirs else { continue };
            let Row { name, backend, threads, min_ms, median_ms, .. } = row;
            let (of_min, of_median) = (min / min_ms, median / median_ms);
            let against = &peer.name;
            let _ = writeln!(
                text,
                "| {name} | {backend} | {threads} | {against} | {of_min:.2} | {of_median:.2} |"
            );
        }
    }
    text
}

/// The core's peak and the shares of other rows with counted operations, by minima.
fn shares_of_peak(rows: &[Row]) -> String {
    let mut text = String::new();
    for row in rows {
        let peak = rows.iter().find(|peak| peak.name == "fma_peak" && peak.backend == row.backend);
        let (Some([plain, executed]), Some(peak)) = (row.flop, peak) else { continue };
        let Some([peak_flop, _]) = peak.flop else { continue };
        if text.is_empty() {
            text.push_str("\n| what | vector unit | GFLOP/s | of the peak | executed GFLOP/s | of the peak |\n|---|---|--:|--:|--:|--:|\n");
        }
        // 1e-6: operations per millisecond to GFLOP/s.
        let [plain, executed] = [plain, executed].map(|flop| 1e-6 * flop / row.min_ms);
        let [of_plain, of_executed] =
            [plain, executed].map(|rate| 100.0 * rate / (1e-6 * peak_flop / peak.min_ms));
        let Row { name, backend, .. } = row;
        let _ = writeln!(
            text,
            "| {name} | {backend} | {plain:.1} | {of_plain:.0} % | {executed:.1} | {of_executed:.0} % |"
        );
    }
    text
}

/// Model of the processor and its hardware threads.
fn processor() -> String {
    let cpu = fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = cpu.lines().find_map(|line| line.strip_prefix("model name")?.split_once(':'));
    let model = model.map_or("an unnamed processor", |(_, name)| name.trim());
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    format!("{model}, {threads} hardware threads")
}

fn page_of(tables: &str) -> String {
    let processor = processor();
    format!(
        "# Speed\n\nWritten by `cargo xtask bench --peers --write` on {processor}. Times are of this machine; \
         ratios travel better. A ratio above 1 means that ours is faster.\n\n\
         ## Depth\n\n`chain_640x480` is the whole run time: pre-filter, operators, smoothing of the coefficients, cubic, 3x3 median, depth in mm, \
         confidence. `chain_640x480_side_by_side` is the time per pair when four chains of one thread each run at once and share \
         nothing: its ratio to one thread is the scaling limit of this machine; other load lowers it. The peer ([`peer_opencv.py`](../host/depth/benches/peer_opencv.py)) does the same with numpy and OpenCV, all buffers \
         allocated beforehand, on one thread, once before and once after our benches; its better time counts.\n\n\
         `fma_peak` is a loop of independent multiply-adds in registers: the limit of one core. The 7x7 convolution is counted \
         twice: with 49 multiply-adds per pixel, as defined, and as executed: the kernels are eight-fold \
         symmetric, so 12 multiply-adds, 4 products and 10 sums suffice ([`convolve.rs`](../host/depth/src/simd/convolve.rs)). \
         It can therefore exceed the peak. Executed multiply-adds and sums have units of their own on many processors, so a share \
         below 100 % need not mean that the core waits.\n\n{tables}"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    const OURS: &str =
        r#"{"name": "chain_640x480", "backend": "avx2", "threads": 1, "min_ms": 2.0, "median_ms": 2.5}"#;
    const THEIRS: &str = r#"{"chain_ms": {"min": 6.0, "median": 7.0}, "filter2d_7x7_ms": {"min": 0.5, "median": 0.6}, "opencv": "5"}"#;

    #[test]
    fn ratios_are_theirs_over_ours() {
        let peer = peer("p.py", &format!("warming up\n{THEIRS}\n")).unwrap();
        let text = tables(&[row(OURS).unwrap()], &[peer]);
        assert!(text.contains("| chain_640x480 | avx2 | 1 | p.py | 3.00 | 2.80 |"), "{text}");
    }

    #[test]
    fn shares_are_of_the_peak_of_the_same_vector_unit() {
        let line = |name: &str, backend: &str, ms: f64, flop: f64, executed: f64| {
            let text = format!(
                r#"{{"name": "{name}", "backend": "{backend}", "threads": 1, "min_ms": {ms}, "median_ms": {ms}, "flop": {flop}, "executed_flop": {executed}}}"#
            );
            row(&text).unwrap()
        };
        let rows = [
            line("fma_peak", "avx512", 1.0, 100e6, 100e6),
            line("fma_peak", "avx2", 1.0, 50e6, 50e6),
            line("convolution_7x7", "avx2", 2.0, 80e6, 30e6),
            row(OURS).unwrap(),
        ];
        let text = tables(&rows, &[]);
        assert!(text.contains("| convolution_7x7 | avx2 | 40.0 | 80 % | 15.0 | 30 % |"), "{text}");
        assert!(text.contains("| fma_peak | avx512 | 100.0 | 100 % | 100.0 | 100 % |"), "{text}");
    }

    #[test]
    fn the_better_of_two_runs_counts() {
        let slow = peer("p.py", &THEIRS.replace("6.0", "9.0")).unwrap();
        let both = better(slow, peer("p.py", THEIRS).unwrap());
        assert_eq!(both.chain_ms, [6.0, 7.0]);
    }

    #[test]
    fn rejects_rows_without_figures() {
        assert!(row("{\"name\": \"x\"}").is_err_and(|e| e.to_string().contains("not a bench's line")));
        assert!(peer("p.py", "{\"chain\": 3}").is_err_and(|e| e.to_string().contains("chain_ms")));
        assert!(peer("p.py", "Traceback").is_err());
    }
}

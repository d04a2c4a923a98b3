//! Times of host/recognition up to embedded points; scikit-learn's Isomap and an RBF map on the same 1500 descriptors.

use std::{
    fmt::Write as _,
    path::{Path, PathBuf},
    process::Command,
};

use anyhow::{Context, Result, bail};
use serde_json::Value;

use super::{Row, modules, rows};
use crate::run::{ROOT, cargo, finish, output, step, target_folder};

const PEER_SCRIPT: &str = "host/recognition/benches/peer_isomap.py";
/// Names of a compared figure: ours and the peer's.
const COMPARED: [(&str, &str); 3] = [
    ("isomap_1500", "isomap_ms"),
    ("rbf_training_1500", "rbf_training_ms"),
    ("embedding_of_a_frame", "embedding_ms"),
];

/// Minimum and median, milliseconds, in the order of [`COMPARED`].
#[derive(Debug, PartialEq)]
struct Peer {
    name: String,
    version: String,
    times_ms: [[f64; 2]; 3],
}

pub fn run(peers: bool, more: &[PathBuf]) -> Result<String> {
    let mut scripts: Vec<PathBuf> = more.to_vec();
    if peers {
        match modules(&["numpy", "scipy", "sklearn"]) {
            Ok(()) => scripts.insert(0, ROOT.join(PEER_SCRIPT)),
            Err(error) => eprintln!("{PEER_SCRIPT} is left out: {error}"),
        }
    }
    let bench =
        |name: &'static str| ["bench", "--locked", "--package", "farnear-recognition", "--bench", name];
    let features = target_folder().join("peers/features.npy");
    if !scripts.is_empty() {
        step("descriptors for the peers");
        std::fs::create_dir_all(features.parent().unwrap_or(Path::new(".")))?;
        finish(cargo(bench("embedding")).args(["--", "--features"]).arg(&features))?;
    }
    let all = |when: &str| -> Result<Vec<Peer>> {
        if scripts.is_empty() {
            return Ok(Vec::new());
        }
        step(&format!("peers of host/recognition, {when} our own benches"));
        scripts.iter().map(|script| time_peer(script, &features)).collect()
    };
    let before = all("before")?;
    step("host/recognition");
    let mut found = Vec::new();
    for name in ["embedding", "background"] {
        let text = output(cargo(bench(name)).env("FARNEAR_JSON", "1"))?;
        found.extend(rows(&text)?);
    }
    if found.is_empty() {
        bail!("the benches of host/recognition printed no figures");
    }
    let after = all("after")?;
    let peers: Vec<Peer> = before.into_iter().zip(after).map(|(a, b)| better(a, b)).collect();
    Ok(section(&found, &peers))
}

fn time_peer(script: &Path, features: &Path) -> Result<Peer> {
    let mut command = Command::new("python3");
    for name in ["OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"] {
        command.env(name, "1");
    }
    let text = output(command.arg(script).arg(features))?;
    let name = script.file_name().unwrap_or_default().to_string_lossy().into_owned();
    peer(&name, &text).with_context(|| format!("{} printed no figures", script.display()))
}

/// `isomap_ms: {min, median}` and so on, or single numbers `isomap_s`, `rbf_train_s`, `embed_us`.
fn peer(name: &str, text: &str) -> Result<Peer> {
    let line = text.lines().rev().find(|line| line.starts_with('{')).context("no line is a JSON object")?;
    let json: Value = serde_json::from_str(line).with_context(|| format!("not JSON: {line}"))?;
    let several = |key: &str| Some([json[key]["min"].as_f64()?, json[key]["median"].as_f64()?]);
    let single = |key: &str, scale: f64| json[key].as_f64().map(|value| [scale * value; 2]);
    let times = COMPARED.iter().zip([("isomap_s", 1e3), ("rbf_train_s", 1e3), ("embed_us", 1e-3)]);
    let found: Option<Vec<[f64; 2]>> =
        times.map(|((_, key), (other, scale))| several(key).or_else(|| single(other, scale))).collect();
    let times_ms = found.and_then(|found| found.try_into().ok());
    Ok(Peer {
        name: name.into(),
        version: json["version"].as_str().unwrap_or("scikit-learn").into(),
        times_ms: times_ms
            .with_context(|| format!("isomap_ms, rbf_training_ms or embedding_ms is missing in {line}"))?,
    })
}

fn better(a: Peer, b: Peer) -> Peer {
    let mut times_ms = a.times_ms;
    for (ours, theirs) in times_ms.iter_mut().flatten().zip(b.times_ms.iter().flatten()) {
        *ours = ours.min(*theirs);
    }
    Peer { times_ms, ..a }
}

/// Too slow for a bench: processor time by the shell's `time`.
const NESTED_SEARCH: &str = "A whole nested search (`farnear activity evaluate --leave-one-subject-out`, everything chosen again for each left-out subject) on 287 synthetic clips in four views, 5 subjects, 11 activities, 54,192 frames, takes 69 s of processor time order-free and 91 s ordered with views fused, 130 s ordered with every view by itself, 39 s by the thesis' method (November 2026, measured on the side, not with this table).";

fn section(rows: &[Row], peers: &[Peer]) -> String {
    let mut text = String::from(
        "## People\n\nFrom masks to points: 1500 synthetic silhouettes of some 220 x 120 pixels, 360 numbers each, 12 neighbours, 3 dimensions \
         (`training_from_1500_masks` describes them, lays them out and learns the RBF map; `landmark_isomap_20000` has 500 landmarks). \
         From video: 640x480, a made scene and, where it is at hand, the highway sequence of ChangeDetection.net doubled; \
         `frame_to_point` is everything from a colour frame to its embedded point. Times are per frame or silhouette where there are \
         several.\n\n",
    );
    text.push_str(NESTED_SEARCH);
    text.push_str("\n\n| what | threads | min ms | median ms |\n|---|--:|--:|--:|\n");
    for Row { name, threads, min_ms, median_ms, .. } in rows {
        let _ = writeln!(text, "| {name} | {threads} | {min_ms:.4} | {median_ms:.4} |");
    }
    if peers.is_empty() {
        return text;
    }
    text.push_str("\n| peer, one thread | Isomap min ms | RBF training min ms | embedding a frame min ms |\n|---|--:|--:|--:|\n");
    for Peer { name, version, times_ms: [isomap, training, embedding] } in peers {
        let _ = writeln!(
            text,
            "| {name}, {version} | {:.1} | {:.1} | {:.4} |",
            isomap[0], training[0], embedding[0]
        );
    }
    text.push_str(
        "\n| ours | threads | against | ratio of minima | ratio of medians |\n|---|--:|---|--:|--:|\n",
    );
    for row in rows {
        let Some(index) = COMPARED.iter().position(|(name, _)| *name == row.name) else { continue };
        for peer in peers {
            let [min, median] = peer.times_ms[index];
            let Row { name, threads, min_ms, median_ms, .. } = row;
            let _ = writeln!(
                text,
                "| {name} | {threads} | {} | {:.2} | {:.2} |",
                peer.name,
                min / min_ms,
                median / median_ms
            );
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    const OURS: &str =
        r#"{"name": "isomap_1500", "backend": "-", "threads": 4, "min_ms": 50.0, "median_ms": 100.0}"#;
    const THEIRS: &str = r#"{"isomap_ms": {"min": 500.0, "median": 600.0}, "rbf_training_ms": {"min": 200.0, "median": 210.0}, "embedding_ms": {"min": 0.06, "median": 0.07}, "version": "scikit-learn 1"}"#;

    #[test]
    fn ratios_are_theirs_over_ours_and_the_better_run_counts() {
        let slow = peer("p.py", &THEIRS.replace("500.0", "900.0")).unwrap();
        let peer = better(slow, peer("p.py", THEIRS).unwrap());
        let text = section(&rows(OURS).unwrap(), &[peer]);
        assert!(text.contains("| isomap_1500 | 4 | p.py | 10.00 | 6.00 |"), "{text}");
    }

    #[test]
    fn single_figures_in_seconds_are_read_too() {
        let found =
            peer("q.py", r#"{"n": 1500, "isomap_s": 0.5, "rbf_train_s": 0.28, "embed_us": 90.0}"#).unwrap();
        assert_eq!(found.times_ms[0], [500.0, 500.0]);
        assert!((found.times_ms[2][0] - 0.09).abs() < 1e-12);
        assert!(
            peer("r.py", r#"{"isomap_s": 0.5}"#).is_err_and(|e| e.to_string().contains("rbf_training_ms"))
        );
    }
}

//! Registration of pairs from files, with its processor time; `peer_ecc.py` compares it with OpenCV's ECC. Arguments:
//! WIDTH HEIGHT TIMES FAR NEAR [FAR NEAR ...], images of 32-bit floats, row by row. Prints one JSON object per pair.
//! One thread; the processor time is the minimum of TIMES runs, as Linux counts it for all threads.
#![allow(clippy::unwrap_used, missing_docs)] // A benchmark may stop; it has no users.

use std::fs;
use std::hint::black_box;

use farnear_depth::prepare::align::{Model, estimate};
use farnear_depth::prepare::warp::Warp;
use ndarray::Array2;

fn cpu_ms() -> f64 {
    let of_task = |entry: std::io::Result<fs::DirEntry>| -> f64 {
        let text = fs::read_to_string(entry.unwrap().path().join("schedstat")).unwrap();
        text.split(' ').next().unwrap().parse::<f64>().unwrap()
    };
    fs::read_dir("/proc/self/task").unwrap().map(of_task).sum::<f64>() * 1e-6
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with('-')).collect();
    let [width, height, times, files @ ..] = &arguments[..] else {
        println!("registration: for peer_ecc.py");
        return;
    };
    let [width, height, times] = [width, height, times].map(|n| n.parse::<usize>().unwrap());
    let image = |file: &String| {
        let bytes = fs::read(file).unwrap();
        let pixels = bytes.chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect();
        Array2::from_shape_vec((height, width), pixels).unwrap()
    };
    rayon::ThreadPoolBuilder::new().num_threads(1).build_global().unwrap();
    for pair in files.chunks_exact(2) {
        let [far, near] = [image(&pair[0]), image(&pair[1])];
        let mut least_ms = f64::INFINITY;
        let mut found = None;
        for _ in 0..times {
            let start = cpu_ms();
            found = black_box(estimate(far.view(), near.view(), Model::Similarity, Warp::IDENTITY));
            least_ms = least_ms.min(cpu_ms() - start);
        }
        let Warp { matrix: [[a, b], [c, d]], shift: [x, y] } = found.unwrap().warp;
        println!("{{\"warp\": [[{a}, {b}, {x}], [{c}, {d}, {y}]], \"cpu_ms\": {least_ms:.3}}}");
    }
}

//! Times from silhouettes to points: `cargo bench -p farnear-recognition --bench embedding`. The gallery is 1500 seeded
//! synthetic silhouettes. `-- --features FILE.npy` only writes its descriptors (N x 360).
//! `FARNEAR_JSON=1` prints JSON lines. `landmark_isomap_20000` runs first, so the peak memory is its own.

use std::{hint::black_box, io::Write, time::Instant};

use farnear_recognition::embedding::{
    descriptor::{ANGLES, Scaling, centroid_distance},
    geodesic::all_pairs,
    isomap::isomap,
    landmark::landmark_isomap,
    neighbours::Graph,
    rbf::Rbf,
};
use farnear_shadow::synthetic::scene::{Kind, scene};
use farnear_shadow::{Method, remove};
use farnear_silhouettes::mask::Mask;
use farnear_silhouettes::silhouette::view::{Canvas, View, draw, extent};
use farnear_silhouettes::synthetic::body::{Build, joints, walking};
use ndarray::{Array2, s};
use rand::{Rng, SeedableRng};
use rayon::prelude::*;

const GALLERY: usize = 1500;
const LARGE: usize = 20_000;
const NEIGHBOURS: usize = 12;

fn silhouette(i: usize) -> Mask {
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(i as u64);
    let build = Build { height_mm: rng.random_range(1600.0..1900.0), ..Build::default() };
    let mut pose = walking(rng.random_range(0.0..1.0), rng.random_range(0.5..1.2));
    pose.lean_deg = rng.random_range(0.0..90.0);
    for arm in &mut pose.arms {
        arm.shoulder_deg = rng.random_range(-20.0..120.0);
    }
    let body = joints(&build, &pose).capsules(&build);
    let view = View { gamma_deg: 45.0 * (i % 8) as f64 + rng.random_range(-5.0..5.0), ..View::default() };
    let canvas = Canvas::fitting(&extent(&body, &view), 8.0, 2).expect("finite");
    draw(&body, &view, &canvas)
}

fn centroid_distances(mask: &Mask) -> [f32; ANGLES] {
    centroid_distance(mask.view(), Scaling::KeepAspect).expect("drawn")
}

fn described(masks: &[Mask]) -> Array2<f32> {
    let mut all = Array2::<f32>::zeros((masks.len(), ANGLES));
    for (mask, mut row) in masks.iter().zip(all.rows_mut()) {
        row.iter_mut().zip(centroid_distances(mask)).for_each(|(out, v)| *out = v);
    }
    all
}

/// Runs `work` `repeats` times with `threads` threads and prints the times of one of its `per` parts.
fn time<T: Send>(
    name: &str,
    threads: usize,
    repeats: usize,
    per: usize,
    mut work: impl FnMut() -> T + Send,
) -> T {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
    pool.install(|| {
        let mut times = Vec::new();
        let mut last = None;
        for _ in 0..repeats {
            let start = Instant::now();
            last = Some(black_box(work()));
            times.push(1e3 * start.elapsed().as_secs_f64() / per as f64);
        }
        times.sort_by(f64::total_cmp);
        let (min, median) = (times[0], times[times.len() / 2]);
        if std::env::var_os("FARNEAR_JSON").is_some() {
            println!(
                "{{\"name\": \"{name}\", \"backend\": \"-\", \"threads\": {threads}, \"min_ms\": {min:.5}, \"median_ms\": {median:.5}}}"
            );
        } else {
            println!("{name:28} {threads} threads {min:12.4} ms at best {median:12.4} ms median");
        }
        last.expect("ran")
    })
}

fn peak_mib() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    Some(line.trim().trim_end_matches(" kB").trim().parse::<f64>().ok()? / 1024.0)
}

fn write_features(path: &str) -> std::io::Result<()> {
    let descriptors = described(&(0..GALLERY).map(silhouette).collect::<Vec<_>>());
    let header = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({GALLERY}, {ANGLES}), }}");
    let header = format!("{header:<117}\n");
    let mut file = std::io::BufWriter::new(std::fs::File::create(path)?);
    file.write_all(b"\x93NUMPY\x01\x00")?;
    file.write_all(&(header.len() as u16).to_le_bytes())?;
    file.write_all(header.as_bytes())?;
    for value in &descriptors {
        file.write_all(&value.to_le_bytes())?;
    }
    file.flush()
}

fn main() -> std::io::Result<()> {
    let arguments: Vec<String> = std::env::args().collect();
    if let Some(at) = arguments.iter().position(|text| text == "--features") {
        let path = arguments.get(at + 1).map_or("features.npy", String::as_str);
        return write_features(path);
    }
    // Each mask is dropped once described, to limit the memory.
    let rows: Vec<[f32; ANGLES]> =
        (0..LARGE).into_par_iter().map(|i| centroid_distances(&silhouette(i))).collect();
    let large = Array2::from_shape_fn((LARGE, ANGLES), |(i, angle)| rows[i][angle]);
    drop(rows);
    let threads = std::thread::available_parallelism().map_or(1, usize::from).min(4);
    time("landmark_isomap_20000", threads, 1, 1, || {
        landmark_isomap(large.view(), NEIGHBOURS, 500, 3).expect("connected")
    });
    drop(large);
    if let Some(mib) = peak_mib() {
        eprintln!("peak of resident memory with landmark_isomap_20000: {mib:.0} MiB");
    }
    let masks: Vec<Mask> = (0..GALLERY).map(silhouette).collect();
    let all = described(&masks);
    time("descriptor", 1, 20, masks.len(), || described(&masks));
    let laid_out = time("isomap_1500", 1, 9, 1, || isomap(all.view(), NEIGHBOURS, 3)).expect("connected");
    let graph =
        time("neighbour_graph_1500", 1, 9, 1, || Graph::new(all.view(), NEIGHBOURS)).expect("neighbours");
    time("geodesics_1500", 1, 9, 1, || all_pairs(&graph));
    if threads > 1 {
        time("isomap_1500", threads, 15, 1, || isomap(all.view(), NEIGHBOURS, 3)).expect("connected");
    }
    let points = laid_out.coordinates.view();
    let rbf =
        time("rbf_training_1500", 1, 5, 1, || Rbf::train(all.view(), points, 0.1, 1e-3)).expect("solvable");
    time("embedding_of_a_frame", 1, 20, 300, || {
        all.slice(s![..300, ..]).rows().into_iter().map(|row| rbf.embed(row).expect("width")[0]).sum::<f32>()
    });
    time("training_from_1500_masks", 1, 3, 1, || {
        let descriptors = described(&masks);
        let laid_out = isomap(descriptors.view(), NEIGHBOURS, 3).expect("connected");
        Rbf::train(descriptors.view(), laid_out.coordinates.view(), 0.1, 1e-3).expect("solvable")
    });
    let scenes: Vec<_> = (0..40).map(|seed| scene(Kind::Standard, seed)).collect();
    time("shadow_cut_640x480", 1, 9, scenes.len(), || {
        for scene in &scenes {
            black_box(
                remove(&scene.silhouette, &scene.camera, scene.sun, 0.05, Method::Hybrid).expect("cut"),
            );
        }
    });
    Ok(())
}

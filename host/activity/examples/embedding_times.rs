//! Times the embedding chain on a synthetic gallery: `cargo run --release --example embedding_times -- [N] [FEATURES.npy]`.
//! With a file name the N x 360 descriptors are written there, so that another implementation can be timed on the same data.
//! `RAYON_NUM_THREADS=1` measures one thread.

use farnear_activity::embedding::descriptor::{ANGLES, Scaling, centroid_distance};
use farnear_activity::embedding::isomap::isomap;
use farnear_activity::embedding::landmark::landmark_isomap;
use farnear_activity::embedding::neighbours::Neighbourhood;
use farnear_activity::embedding::rbf::Rbf;
use farnear_activity::mask::Mask;
use farnear_activity::silhouette::view::{Canvas, View, draw, extent};
use farnear_activity::synthetic::body::{Build, joints, walking};
use ndarray::Array2;
use rand::{Rng, SeedableRng};
use std::io::Write;
use std::time::Instant;

fn gallery(n: usize) -> Vec<Mask> {
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(1);
    (0..n)
        .map(|i| {
            let build = Build { height_mm: rng.random_range(1600.0..1900.0), ..Build::default() };
            let mut pose = walking(rng.random_range(0.0..1.0), rng.random_range(0.5..1.2));
            pose.lean_deg = rng.random_range(0.0..90.0);
            for arm in &mut pose.arms {
                arm.shoulder_deg = rng.random_range(-20.0..120.0);
            }
            let body = joints(&build, &pose).capsules(&build);
            let view =
                View { gamma_deg: 45.0 * (i % 8) as f64 + rng.random_range(-5.0..5.0), ..View::default() };
            let canvas = Canvas::fitting(&extent(&body, &view), 8.0, 2).expect("finite");
            draw(&body, &view, &canvas)
        })
        .collect()
}

fn timed<T>(name: &str, per: usize, mut run: impl FnMut() -> T) -> T {
    let mut best = f64::INFINITY;
    let mut last = None;
    for _ in 0..3 {
        let start = Instant::now();
        last = Some(run());
        best = best.min(start.elapsed().as_secs_f64());
    }
    println!("{name:40} {:10.3} ms   {:8.2} us each", 1e3 * best, 1e6 * best / per as f64);
    last.expect("ran")
}

fn main() -> std::io::Result<()> {
    let mut arguments = std::env::args().skip(1);
    let n = arguments.next().and_then(|text| text.parse().ok()).unwrap_or(1500);
    let masks = gallery(n);
    let descriptors = timed("descriptors", n, || {
        let mut all = Array2::<f32>::zeros((n, ANGLES));
        for (mask, mut row) in masks.iter().zip(all.rows_mut()) {
            let found = centroid_distance(mask.view(), Scaling::KeepAspect).expect("drawn");
            row.iter_mut().zip(found).for_each(|(out, v)| *out = v);
        }
        all
    });
    if let Some(path) = arguments.next() {
        let header = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({n}, {ANGLES}), }}");
        let header = format!("{header:<117}\n");
        let mut file = std::io::BufWriter::new(std::fs::File::create(path)?);
        file.write_all(b"\x93NUMPY\x01\x00")?;
        file.write_all(&(header.len() as u16).to_le_bytes())?;
        file.write_all(header.as_bytes())?;
        for value in &descriptors {
            file.write_all(&value.to_le_bytes())?;
        }
    }
    let neighbourhood = Neighbourhood::Nearest(12);
    if n > 6000 {
        timed("landmark Isomap, 500 landmarks", n, || {
            landmark_isomap(descriptors.view(), neighbourhood, 500, 3)
        })
        .expect("connected");
        return Ok(());
    }
    let graph = timed("  neighbour graph", n, || {
        farnear_activity::embedding::neighbours::Graph::new(descriptors.view(), neighbourhood)
            .expect("neighbours")
    });
    timed("  geodesics", n, || farnear_activity::embedding::geodesic::all_pairs(&graph));
    let laid_out = timed("Isomap", n, || isomap(descriptors.view(), neighbourhood, 3)).expect("connected");
    println!("residual variance {:?}", laid_out.residual_variance());
    let rbf =
        timed("RBF training", n, || Rbf::train(descriptors.view(), laid_out.coordinates.view(), 0.1, 1e-3))
            .expect("solvable");
    println!("condition number {:.3e}", rbf.condition);
    timed("RBF embedding", n, || {
        descriptors.rows().into_iter().map(|row| rbf.embed(row).expect("width")[0]).sum::<f32>()
    });
    Ok(())
}

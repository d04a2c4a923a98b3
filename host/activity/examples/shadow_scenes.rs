//! Removes the shadows of 100 seeded scenes of each kind and prints the scores: `cargo run --release --example shadow_scenes`.

use farnear_activity::shadow::{Method, remove};
use farnear_activity::shadow_score::ShadowScore;
use farnear_activity::synthetic::scene::{Kind, scene};

fn main() {
    println!("kind      method   removed %  wrongly %  IoU %   (pooled | mean of scenes)   ms");
    for kind in [Kind::Standard, Kind::Pitched, Kind::Bending, Kind::Behind] {
        let scenes: Vec<_> = (0..100).map(|seed| scene(kind, seed)).collect();
        for method in [Method::Thesis, Method::Hybrid] {
            let (mut pooled, mut mean, mut seconds) = (ShadowScore::default(), [0.0; 3], 0.0);
            for (n, scene) in scenes.iter().enumerate() {
                let start = std::time::Instant::now();
                let done = remove(&scene.silhouette, &scene.camera, scene.sun, 0.05, method);
                seconds += start.elapsed().as_secs_f64();
                let (result, report) = match done {
                    Ok(done) => done,
                    Err(error) => {
                        println!("scene {n}: {error}");
                        continue;
                    }
                };
                let truth = scene.truth();
                let mut score = ShadowScore::default();
                for total in [&mut score, &mut pooled] {
                    total.add(None, result.view(), truth.view()).expect("masks of one scene have one shape");
                }
                for (sum, value) in mean.iter_mut().zip([
                    score.removed_percent().unwrap_or(f64::NAN),
                    score.wrongly_removed_percent().unwrap_or(f64::NAN),
                    score.iou_percent().unwrap_or(f64::NAN),
                ]) {
                    *sum += value / scenes.len() as f64;
                }
                if std::env::args().any(|a| a == "-v") {
                    println!(
                        "{kind:?} {method:?} {n:3} eta {:6.1} u {:.2} ({:.2}) foot {:.0},{:.0} half {} removed {:.0} wrongly {:.1} iou {:.1}",
                        report.shadow.eta_rad.to_degrees(),
                        report.subject.distance_m,
                        scene.stands_at_m[1],
                        report.shadow.foot_px[0],
                        report.shadow.foot_px[1],
                        report.half_plane,
                        score.removed_percent().unwrap_or(f64::NAN),
                        score.wrongly_removed_percent().unwrap_or(f64::NAN),
                        score.iou_percent().unwrap_or(f64::NAN)
                    );
                }
            }
            println!(
                "{:9} {:8} {:8.1} {:10.1} {:8.1}   | {:.1} {:.1} {:.1}   {:.3}",
                format!("{kind:?}"),
                format!("{method:?}"),
                pooled.removed_percent().unwrap_or(f64::NAN),
                pooled.wrongly_removed_percent().unwrap_or(f64::NAN),
                pooled.iou_percent().unwrap_or(f64::NAN),
                mean[0],
                mean[1],
                mean[2],
                10.0 * seconds
            );
        }
    }
}

//! Leave-one-subject-out on skeleton data sets dressed with capsules, or on 21 synthetic people (`synthetic -`):
//! `cargo run --release --example evaluate_skeletons -- utkinect FILE.mat [thesis|order-free|ordered]...`

use farnear_activity::embedding::descriptor::Scaling;
use farnear_activity::evaluation::experiment::Experiment;
use farnear_activity::evaluation::leave_one_out::leave_one_subject_out;
use farnear_activity::evaluation::skeleton_clips::{florence, utkinect};
use farnear_activity::recognition::frames::Mode;
use farnear_activity::synthetic::activities::clips as synthetic;
use std::time::Instant;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [set, path, methods @ ..] = arguments.as_slice() else {
        return Err(
            "usage: evaluate_skeletons utkinect|florence|synthetic FILE.mat|- [thesis|order-free|ordered]..."
                .into(),
        );
    };
    let start = Instant::now();
    let bytes = if set == "synthetic" { Vec::new() } else { std::fs::read(path)? };
    let scaling = Scaling::default();
    let clips = match set.as_str() {
        "utkinect" => utkinect(&bytes, 4, scaling)?,
        "florence" => florence(&bytes, 4, scaling)?,
        "synthetic" => synthetic(21, 4, 8.0, scaling),
        other => return Err(format!("unknown set `{other}`").into()),
    };
    println!("{} clips described in {:.1} s", clips.len(), start.elapsed().as_secs_f64());
    for method in methods {
        let start = Instant::now();
        let experiment = match method.as_str() {
            "thesis" => Experiment::thesis(),
            "order-free" => Experiment::searched(Mode::OrderFree),
            "ordered" => Experiment::searched(Mode::Ordered),
            other => return Err(format!("unknown method `{other}`").into()),
        };
        let outcome = leave_one_subject_out(&clips, &experiment, Clone::clone)?;
        let percent = |(low, high): (f64, f64)| format!("{:.1} to {:.1}", 100.0 * low, 100.0 * high);
        println!(
            "{method:10} one view {:.1} % ({}), fused {:.1} % ({}), {:.1} s",
            100.0 * outcome.each.accuracy(),
            percent(outcome.each.interval()),
            100.0 * outcome.fused.accuracy(),
            percent(outcome.fused.interval()),
            start.elapsed().as_secs_f64()
        );
    }
    Ok(())
}

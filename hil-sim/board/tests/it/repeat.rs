//! Equal seeds give equal bytes; different seeds do not.

use crate::bench::{Bench, fine_shot, start_near_home};
use farnear_protocol::{Nanometres, message::Axis};
use farnear_scene::{Camera, Lens, Noise, OpticsFile, Scene, standard};
use farnear_sim::{config::RigConfig, imager::Imager};

fn session(seed: u64) -> (String, String, Vec<Vec<u8>>) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let trace = folder.path().join("trace.csv");
    let scenario = start_near_home();
    let config = RigConfig { seed, trace: Some(trace.clone()), scenario, ..RigConfig::default() };
    let mut bench = Bench::with(&config);
    bench.home();
    bench.move_to(Axis::SensorCoarse, Nanometres(5_821_300));
    bench.arm(&[10_000, 166_270].map(|target| fine_shot(target, 2_000, 50, 2_000)));
    bench.run();
    let lens = Lens::from_optics(&OpticsFile::parse(standard::OPTICS).expect("optics")).expect("a lens");
    let scene: Scene = "plane:900".parse().expect("a scene");
    let camera = Camera::new(64, 48, Noise::EightBit);
    let mut imager = Imager::new(&scene, &lens, &standard::PSF, camera, seed).expect("a picture");
    let frames = bench.rig.take_shots().iter().map(|shot| imager.frame(shot).expect("a picture")).collect();
    let events = format!("{:?}", bench.events);
    bench.rig.stop().expect("ends well");
    (std::fs::read_to_string(&trace).expect("a trace"), events, frames)
}

#[test]
fn one_seed_gives_one_session() {
    let (first, second) = (session(11), session(11));
    assert_eq!(first.2.len(), 2);
    assert!(first.0.lines().count() > 100, "the trace has rows");
    assert!(first == second, "two runs with one seed differ");
    let other = session(12);
    assert!(first.0 != other.0 && first.1 != other.1 && first.2 != other.2, "the seed has no effect");
}

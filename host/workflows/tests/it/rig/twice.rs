//! A second job on a running rig waits for nothing from the first.

use std::{
    path::Path,
    sync::atomic::{AtomicBool, Ordering},
    thread,
    time::{Duration, Instant},
};

use farnear_files::image_file::encode_png;
use farnear_protocol::message::{EventKind, Routine, ShotRecord};
use farnear_scripted_board::{Faults, Peer, plug_in};
use farnear_workflows::{
    Context, Result, WorkflowError,
    optics::GivenOptics,
    request::Request,
    rig::{
        RigAddress,
        check::{self, CheckRequest},
        continuous::{self, ContinuousRequest},
        focus::{self, FocusRequest},
        live,
        live_depth::{self, LiveDepthSettings},
        mechanics,
        motion::HomeRequest,
        open::OpenRig,
        pair::{self, CaptureRequest},
        sequence::{self, SequenceRequest},
        series::{self, SeriesSettings},
        targets::{self, TargetSeriesRequest},
    },
};
use ndarray::Array2;

use super::{Face, camera, optics, stack};

/// Extra time of a second run on a busy computer. Each needless wait for the board is at least 5 s.
const LEEWAY: Duration = Duration::from_secs(2);

/// Sum of piezo and coarse stage positions in best focus.
const SHARPEST_NM: i32 = 2_880_000;

/// A checkerboard whose contrast depends on the distance from the best focus.
fn picture(shot: &ShotRecord) -> Vec<u8> {
    let away_um = f64::from(shot.coarse.0 + shot.fine.0 - SHARPEST_NM) / 1e3;
    let contrast = 100.0 / (1.0 + (away_um / 60.0).powi(2));
    let light = |(row, column): (usize, usize)| {
        let sign = if (row / 2 + column / 2) % 2 == 0 { 1.0 } else { -1.0 };
        // Images differ, as those of a camera do.
        let noise = ((row * 31 + column * 17 + shot.trigger_number as usize * 7) % 97 % 5) as f64;
        (120.0 + sign * contrast + noise) as u16
    };
    encode_png(Array2::from_shape_fn((96, 96), light).view(), 8).unwrap()
}

/// Writes an image of each exposure to the folder until `over`.
fn feed(folder: &Path, board: &Peer, over: &AtomicBool) {
    let mut seen = 0;
    while !over.load(Ordering::Relaxed) {
        let taken: Vec<ShotRecord> = {
            let board = board.board();
            let shots = board.events.iter().filter_map(|event| match &event.kind {
                EventKind::ShotDone { shot, .. } | EventKind::FrameTaken { shot, .. } => Some(*shot),
                _ => None,
            });
            shots.skip(seen).collect()
        };
        for shot in &taken {
            let (draft, path) =
                (folder.join("draft"), folder.join(format!("image-{:05}.png", shot.trigger_number)));
            std::fs::write(&draft, picture(shot)).unwrap();
            std::fs::rename(draft, path).unwrap();
        }
        seen += taken.len();
        thread::sleep(Duration::from_millis(1));
    }
}

type Job<'a> = Box<dyn Fn(RigAddress, usize, &Context<'_>) -> Result<()> + 'a>;

/// Runs until two images or maps arrive.
fn until_two<T>(watch: impl FnOnce(&mut dyn FnMut(T) -> Result<()>) -> Result<()>) -> Result<()> {
    let mut count = 0;
    let ended = watch(&mut |_| {
        count += 1;
        let enough = WorkflowError::Cancelled { during: "watching".into() };
        if count < 2 { Ok(()) } else { Err(enough) }
    });
    match ended {
        Err(error) if error.is_cancelled() => Ok(()),
        other => other,
    }
}

#[test]
fn a_second_run_takes_no_longer_than_the_first() {
    let folder = tempfile::tempdir().unwrap();
    let images = folder.path().join("images");
    std::fs::create_dir(&images).unwrap();
    let out = |name: &str, run: usize| folder.path().join(format!("{name}-{run}"));
    let camera = || camera(&images);
    let jobs: Vec<(&str, Job<'_>)> = vec![
        ("home", Box::new(|rig, _, context| HomeRequest { rig, axis: vec![] }.run(context).map(drop))),
        (
            "capture",
            Box::new(|rig, run, context| {
                let (camera, out) = (camera(), out("pair", run));
                let optics = optics();
                let settings = CaptureRequest { rig, camera, optics, out, ..Default::default() };
                pair::capture(&settings, context).map(drop)
            }),
        ),
        (
            "series",
            Box::new(|rig, run, context| {
                let out = vec![out("series-a", run), out("series-b", run)];
                let settings =
                    SeriesSettings { rig, camera: camera(), optics: optics(), interval: Duration::ZERO, out };
                series::capture(&settings, context).map(drop)
            }),
        ),
        (
            "sequence",
            Box::new(|rig, run, context| {
                let (camera, out) = (camera(), out("sequence", run));
                let settings = SequenceRequest { rig, camera, out, ..stack() };
                sequence::run(&settings, context).map(drop)
            }),
        ),
        (
            "focus",
            Box::new(|rig, _, context| {
                let settings = FocusRequest {
                    rig,
                    camera: camera(),
                    optics: optics(),
                    start_mm: Some(52.9),
                    range_mm: 0.3,
                    ..Default::default()
                };
                focus::focus(&settings, context).map(drop)
            }),
        ),
        (
            "continuous",
            Box::new(|rig, run, context| {
                let (camera, out) = (camera(), Some(out("continuous", run)));
                let (optics, frames) = (Some(optics()), Some(4));
                let settings = ContinuousRequest { rig, camera, optics, frames, out, ..Default::default() };
                continuous::run(&settings, context).map(drop)
            }),
        ),
        (
            "live image",
            Box::new(|rig, _, context| {
                let settings = live::LiveSettings { rig, camera: camera() };
                until_two(|seen| live::watch(&settings, context, |_, image| seen(image)))
            }),
        ),
        (
            "live depth",
            Box::new(|rig, _, context| {
                let settings = LiveDepthSettings { rig, camera: camera(), optics: optics() };
                until_two(|seen| live_depth::watch(&settings, context, |depth| seen(depth.pair_ms)))
            }),
        ),
        (
            "targets",
            Box::new(|rig, run, context| {
                let (camera, optics, out) = (camera(), optics(), out("targets", run));
                let (distances, no_prompt) = (vec![900.0], false);
                let settings = TargetSeriesRequest { rig, camera, optics, distances, no_prompt, out };
                targets::capture(&settings, context).map(drop)
            }),
        ),
        (
            "mechanics",
            Box::new(|rig, _, context| mechanics::measure(&rig, Routine::Piezo, context).map(drop)),
        ),
        (
            "check",
            Box::new(|rig, _, context| {
                let settings = CheckRequest { rig, camera: camera(), resting_only: true, no_actuation: true };
                check::check(&settings, context).map(drop)
            }),
        ),
    ];
    let (port, board) = plug_in(Faults::default());
    board.board().hello.capabilities.memory = false;
    // The host waits longest for an emulated board.
    board.board().hello.emulated = true;
    board.board().hello.firmware = env!("CARGO_PKG_VERSION").try_into().unwrap();
    let face = Face::default();
    let context = face.context();
    let given = GivenOptics::read(&optics()).unwrap();
    let rig = RigAddress::Open(OpenRig::open(&RigAddress::Port(port), &given, &context).unwrap());
    let over = AtomicBool::new(false);
    thread::scope(|scope| {
        scope.spawn(|| feed(&images, &board, &over));
        let ended = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
            for (name, job) in &jobs {
                let took = [0, 1].map(|run| {
                    let begin = Instant::now();
                    job(rig.clone(), run, &context).unwrap_or_else(|error| panic!("{name}: {error}"));
                    begin.elapsed()
                });
                println!("{name}: {took:?}");
                assert!(took[1] < took[0] + LEEWAY, "{name}: {took:?}");
                assert!(took[0] < Duration::from_secs(10), "{name}: {took:?}");
            }
        }));
        over.store(true, Ordering::Relaxed);
        ended.unwrap();
    });
}

#[test]
fn a_sequence_writes_each_image_when_it_comes() {
    let (images, root) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let (port, board) = plug_in(Faults::default());
    let face = Face::default();
    let context = face.context();
    let (rig, camera, out) = (RigAddress::Port(port), camera(images.path()), root.path().join("out"));
    let settings = SequenceRequest { rig, camera, out, ..stack() };
    let written = || {
        let mut folders = root.path().read_dir().unwrap().flatten();
        folders.any(|folder| folder.path().join("shot-00.png").exists())
    };
    let wait_for = |reached: &dyn Fn() -> bool| {
        let until = Instant::now() + Duration::from_secs(30);
        while !reached() && Instant::now() < until {
            thread::sleep(Duration::from_millis(5));
        }
    };
    let first = || {
        board.board().events.iter().find_map(|event| match &event.kind {
            EventKind::ShotDone { shot, .. } => Some(*shot),
            _ => None,
        })
    };
    thread::scope(|scope| {
        let one = scope.spawn(|| {
            wait_for(&|| first().is_some());
            let draft = images.path().join("draft");
            std::fs::write(&draft, picture(&first().unwrap())).unwrap();
            std::fs::rename(draft, images.path().join("image-00000.png")).unwrap();
            wait_for(&written);
            let found = written();
            context.cancel.cancel();
            found
        });
        let error = sequence::run(&settings, &context).unwrap_err();
        assert!(one.join().unwrap(), "the other images have not come: {error}");
    });
    assert_eq!(root.path().read_dir().unwrap().count(), 0);
}

#[test]
fn a_strobe_of_another_length_is_reported_once_by_a_sequence_and_by_a_continuous_run() {
    let folder = tempfile::tempdir().unwrap();
    let images = |run: usize| folder.path().join(run.to_string());
    let jobs: [Job<'_>; 2] = [
        Box::new(|rig, run, context| {
            let (camera, out) = (camera(&images(run)), folder.path().join("sequence"));
            let settings = SequenceRequest { rig, camera, out, ..stack() };
            sequence::run(&settings, context).map(drop)
        }),
        Box::new(|rig, run, context| {
            let (camera, optics, frames) = (camera(&images(run)), Some(optics()), Some(4));
            let settings = ContinuousRequest { rig, camera, optics, frames, ..Default::default() };
            continuous::run(&settings, context).map(drop)
        }),
    ];
    for (run, job) in jobs.iter().enumerate() {
        std::fs::create_dir(images(run)).unwrap();
        let (port, board) = plug_in(Faults { strobe_longer_us: 3_000, ..Faults::default() });
        let face = Face::default();
        let over = AtomicBool::new(false);
        let ended = thread::scope(|scope| {
            scope.spawn(|| feed(&images(run), &board, &over));
            let ended = job(RigAddress::Port(port), run, &face.context());
            over.store(true, Ordering::Relaxed);
            ended
        });
        ended.unwrap();
        let notes = face.messages.lock().unwrap();
        assert_eq!(notes.iter().filter(|note| note.contains("lasted 8000 us")).count(), 1, "{notes:?}");
    }
}

//! Cancelling a workflow from any thread stops the rig.

use std::{
    thread,
    time::{Duration, Instant},
};

use farnear_protocol::message::Routine;
use farnear_scripted_board::{Faults, Peer, plug_in};
use farnear_workflows::{
    Context, Result, WorkflowError,
    request::Request,
    rig::{
        AxisName, RigAddress,
        check::{self, CheckRequest},
        continuous::{self, ContinuousRequest},
        focus::{self, FocusRequest},
        live,
        live_depth::{self, LiveDepthSettings},
        mechanics,
        motion::{HomeRequest, MoveRequest},
        pair::{self, CaptureRequest},
        sequence::{self, SequenceRequest},
        series::{self, SeriesSettings},
        targets::{self, TargetSeriesRequest},
    },
};

use super::{Face, camera, optics, stack};

/// Longest time from cancelling to the end of the workflow, with a board that stops immediately.
const STOPPED_WITHIN: Duration = Duration::from_millis(300);
/// A busy computer may be late once; a slow path is slow each time.
const TRIES: usize = 3;

/// Waits with a limit, so that a test fails instead of hanging.
fn wait_until(reached: impl Fn() -> bool) {
    let until = Instant::now() + Duration::from_secs(60);
    while !reached() && Instant::now() < until {
        thread::sleep(Duration::from_millis(5));
    }
}

/// Starts a workflow with this board and cancels it from a second thread when `under_way` is true.
fn cancelled(
    faults: &Faults,
    under_way: impl Fn(&Peer) -> bool + Clone + Send + 'static,
    workflow: impl Fn(RigAddress, &Context<'_>) -> Result<()>,
) -> (WorkflowError, Peer) {
    let mut took = Duration::ZERO;
    for _ in 0..TRIES {
        let (port, board) = plug_in(faults.clone());
        let face = Face::default();
        let context = face.context();
        let (cancel, watched, under_way) = (context.cancel.clone(), board.clone(), under_way.clone());
        let canceller = thread::spawn(move || {
            wait_until(|| under_way(&watched));
            cancel.cancel();
            Instant::now()
        });
        let error = workflow(RigAddress::Port(port), &context).expect_err("it is cancelled");
        let ended = Instant::now();
        took = ended.duration_since(canceller.join().unwrap());
        assert!(error.is_cancelled(), "{error}");
        if took < STOPPED_WITHIN {
            return (error, board);
        }
    }
    panic!("stopped {took:?} after it was cancelled, in each of {TRIES} tries")
}

#[test]
fn every_workflow_that_moves_stops_the_rig() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    let out = || path.join("out");
    type Job<'a> = Box<dyn Fn(RigAddress, &Context<'_>) -> Result<()> + 'a>;
    let jobs: Vec<(&str, Job<'_>)> = vec![
        ("home", Box::new(|rig, context| HomeRequest { rig, axis: vec![] }.run(context).map(drop))),
        (
            "move",
            Box::new(|rig, context| {
                let (axis, to_um) = (vec![AxisName::Fine], vec![50.0]);
                MoveRequest { rig, axis, to_um, home: false }.run(context).map(drop)
            }),
        ),
        ("mechanics", Box::new(|rig, context| mechanics::measure(&rig, Routine::Piezo, context).map(drop))),
        (
            "pair",
            Box::new(|rig, context| {
                let (camera, optics, out) = (camera(path), optics(), out());
                let settings = CaptureRequest { rig, camera, optics, out, ..Default::default() };
                pair::capture(&settings, context).map(drop)
            }),
        ),
        (
            "sequence",
            Box::new(|rig, context| {
                let settings = SequenceRequest { rig, camera: camera(path), out: out(), ..stack() };
                sequence::run(&settings, context).map(drop)
            }),
        ),
        (
            "focus",
            Box::new(|rig, context| {
                let settings =
                    FocusRequest { rig, camera: camera(path), optics: optics(), ..Default::default() };
                focus::focus(&settings, context).map(drop)
            }),
        ),
        (
            "targets",
            Box::new(|rig, context| {
                let (camera, distances, no_prompt) = (camera(path), vec![900.0], false);
                let (optics, out) = (optics(), out());
                let settings = TargetSeriesRequest { rig, camera, optics, distances, no_prompt, out };
                targets::capture(&settings, context).map(drop)
            }),
        ),
        (
            "continuous",
            Box::new(|rig, context| {
                let (camera, optics) = (camera(path), Some(optics()));
                let settings = ContinuousRequest { rig, camera, optics, ..Default::default() };
                continuous::run(&settings, context).map(drop)
            }),
        ),
        (
            "series",
            Box::new(|rig, context| {
                let (camera, out) = (camera(path), vec![path.join("series")]);
                series::capture(
                    &SeriesSettings { rig, camera, optics: optics(), interval: Duration::ZERO, out },
                    context,
                )
                .map(drop)
            }),
        ),
        (
            "live image",
            Box::new(|rig, context| {
                let settings = live::LiveSettings { rig, camera: camera(path) };
                live::watch(&settings, context, |_, _| Ok(()))
            }),
        ),
        (
            "live depth",
            Box::new(|rig, context| {
                let settings = LiveDepthSettings { rig, camera: camera(path), optics: optics() };
                live_depth::watch(&settings, context, |_| Ok(()))
            }),
        ),
    ];
    for (name, job) in jobs {
        let faults = Faults { never_ends: true, ..Faults::default() };
        let (error, board) = cancelled(&faults, |board| board.board().acts > 0, job);
        assert!(board.board().stops > 0, "{name}: {error}");
    }
    let left: Vec<_> = path.read_dir().unwrap().map(|entry| entry.unwrap().file_name()).collect();
    assert_eq!(left, ["out"], "the series' own folder, which is begun before the rig moves");
    assert_eq!(out().read_dir().unwrap().count(), 0);
}

#[test]
fn a_camera_that_gives_nothing_is_waited_for_no_longer() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    // After both exposures the workflow waits for the first image. The delay until then depends on the
    // machine, so an early cancellation is repeated later.
    for moment in [50, 500, 5_000].map(Duration::from_millis) {
        let exposed = move |board: &Peer| {
            let exposed = board.board().triggers > 0;
            if exposed {
                thread::sleep(moment);
            }
            exposed
        };
        let (error, board) = cancelled(&Faults::default(), exposed, |rig, context| {
            let out = path.join("out");
            let (camera, optics) = (camera(path), optics());
            let settings = CaptureRequest { rig, camera, optics, out, ..Default::default() };
            pair::capture(&settings, context).map(drop)
        });
        assert_eq!(board.board().stops, 1);
        assert!(!path.join("out").exists());
        if error.to_string().contains("waiting for the camera's image") {
            return;
        }
        println!("{moment:?} after the exposures: {error}");
    }
    panic!("it never waits for the camera's image");
}

#[test]
fn hands_that_do_not_come_are_waited_for_no_longer() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    let (port, board) = plug_in(Faults::default());
    board.board().hello.capabilities.memory = false;
    board.board().hello.firmware = env!("CARGO_PKG_VERSION").try_into().unwrap();
    let face = Face::default();
    let context = face.context();
    thread::scope(|scope| {
        scope.spawn(|| {
            wait_until(|| face.heard("press the home switch"));
            context.cancel.cancel();
        });
        let rig = RigAddress::Port(port);
        let settings = CheckRequest { rig, camera: camera(path), ..Default::default() };
        let error = check::check(&settings, &context).unwrap_err();
        assert!(matches!(&error, WorkflowError::Cancelled { .. }), "{error}");
    });
    assert_eq!(board.board().acts, 0);
}

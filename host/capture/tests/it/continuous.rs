//! Continuous capture with a scripted board: frames, drops, losses, end.

use std::time::Duration;

use farnear_capture::{
    ClientError,
    camera::{Camera, CameraError, Image},
    continuous::{Continuous, Loss, Outcome, Pace},
    expose::{CaptureError, expose},
};
use farnear_protocol::{
    message::{DropReason, RequestError, Shot, ShotRecord, TriggerMode},
    units::{Micros, Nanometres},
};
use farnear_scripted_board::Faults;
use ndarray::Array2;

use crate::scripted::{SHOT, connect};

const WAIT: Duration = Duration::from_millis(20);
const PAIR: [Shot; 2] = [SHOT, Shot { target: Nanometres(150_000), ..SHOT }];

/// Its pictures contain their trigger number, with configured losses.
#[derive(Default)]
struct Losing {
    lost: Vec<u32>,
}

impl Camera for Losing {
    fn kind(&self) -> &'static str {
        "losing"
    }
    fn arm(&mut self, _: TriggerMode, _: Micros) -> Result<(), CameraError> {
        Ok(())
    }
    fn trigger(&mut self, _: u32, _: Micros) -> Result<(), CameraError> {
        Ok(())
    }
    fn image(&mut self, shot: &ShotRecord, waited: Duration) -> Result<Image, CameraError> {
        let trigger_number = shot.trigger_number;
        if self.lost.contains(&trigger_number) {
            return Err(CameraError::Late { camera: "it".into(), trigger_number, waited });
        }
        Ok(Image::new(Array2::from_elem((3, 4), trigger_number as u16), 8))
    }
}

fn run(faults: Faults, mut camera: Losing, exposures: u32) -> Result<Vec<Result<u16, Loss>>, CaptureError> {
    let (client, _peer) = connect(faults);
    let pace = Pace { period: Micros(40_000), exposures };
    let mut stream = Continuous::start(&client, &mut camera, &PAIR, pace, WAIT)?;
    let mut found = Vec::new();
    while let Some(outcome) = stream.outcome()? {
        let (number, what) = match outcome {
            Outcome::Taken(frame) => (frame.number, Ok(frame.image.pixels[[0, 0]])),
            Outcome::Dropped { number, loss } => (number, Err(loss)),
        };
        assert_eq!(number as usize, found.len(), "a frame was passed over");
        found.push(what);
    }
    Ok(found)
}

#[test]
fn every_frame_has_a_picture_or_a_reason() {
    let dropped = Faults { drop_frames: vec![2, 3], ..Faults::default() };
    let frames = run(dropped, Losing { lost: vec![3] }, 5).unwrap();
    let busy = || Err(Loss::Board(DropReason::CameraBusy));
    assert_eq!(frames[..4], [Ok(0), Ok(1), busy(), busy()]);
    assert_eq!((&frames[4], &frames[6]), (&Ok(2), &Ok(4)));
    assert!(matches!(&frames[5], Err(Loss::Image { trigger_number: 3, .. })), "{:?}", frames[5]);
    assert_eq!(frames.len(), 7);
}

#[test]
fn reports_forgotten_events_without_ending_the_run() {
    // Event 0 is the start: 3 and 4 belong to frames 2 and 3.
    let faults = Faults { lose_events: vec![3, 4], forgetful: true, ..Faults::default() };
    let frames = run(faults, Losing::default(), 6).unwrap();
    assert_eq!(frames, [Ok(0), Ok(1), Err(Loss::EventLost), Err(Loss::EventLost), Ok(4), Ok(5)]);
}

#[test]
fn a_silent_camera_ends_the_run() {
    let error = run(Faults::default(), Losing { lost: (0..100).collect() }, 30).unwrap_err();
    assert!(matches!(error, CaptureError::Camera(CameraError::Late { .. })), "{error:?}");
}

#[test]
fn dropping_stops_the_run_and_waiting_frames_are_counted() {
    let (client, peer) = connect(Faults::default());
    let mut camera = Losing::default();
    let pace = Pace { period: Micros(0), exposures: 0 };
    let mut stream = Continuous::start(&client, &mut camera, &PAIR, pace, WAIT).unwrap();
    for number in 0..3 {
        let Some(Outcome::Taken(frame)) = stream.outcome().unwrap() else { panic!("no exposure {number}") };
        assert_eq!((frame.number, frame.record.index), (number, (number % 2) as u8));
    }
    while stream.waiting().unwrap() < 37 {
        std::thread::yield_now(); // the scripted board takes 40 at once
    }
    assert_eq!(peer.board().stops, 0);
    drop(stream);
    assert_eq!(peer.board().stops, 1);
    assert!(client.status().is_ok());
}

/// Exposes for its own time.
struct SelfTimed;

impl Camera for SelfTimed {
    fn kind(&self) -> &'static str {
        "self-timed"
    }
    fn arm(&mut self, _: TriggerMode, _: Micros) -> Result<(), CameraError> {
        Ok(())
    }
    fn sets_exposure(&mut self, _: TriggerMode) -> bool {
        true
    }
    fn trigger(&mut self, _: u32, _: Micros) -> Result<(), CameraError> {
        Ok(())
    }
    fn image(&mut self, shot: &ShotRecord, wait: Duration) -> Result<Image, CameraError> {
        Losing::default().image(shot, wait)
    }
}

#[test]
fn a_camera_with_its_own_exposure_takes_no_program_of_several() {
    let (client, peer) = connect(Faults::default());
    let mixed = [SHOT, Shot { exposure: Micros(5_000), ..SHOT }];
    let once = |camera: &mut dyn Camera, shots: &[Shot]| {
        expose(&client, camera, shots, WAIT, |_, _| -> Result<(), CaptureError> { Ok(()) })
    };
    let acts = peer.board().acts;
    let error = once(&mut SelfTimed, &mixed).unwrap_err();
    assert!(matches!(error, CaptureError::MixedExposures { index: 1, .. }), "{error:?}");
    assert!(error.to_string().contains("shot 1 exposes for 5000 us, the ones before for 1000 us"), "{error}");
    let pace = Pace { period: Micros(40_000), exposures: 2 };
    let error = Continuous::start(&client, &mut SelfTimed, &mixed, pace, WAIT).err().unwrap();
    assert!(matches!(error, CaptureError::MixedExposures { index: 1, .. }), "{error:?}");
    assert_eq!(peer.board().acts, acts, "nothing has begun");
    once(&mut SelfTimed, &[SHOT, SHOT]).unwrap();
    once(&mut Losing::default(), &mixed).unwrap();
}

#[test]
fn a_refusal_is_reported() {
    let (client, _peer) = connect(Faults::default());
    let pace = Pace { period: Micros(0), exposures: 1 };
    let refused = Continuous::start(&client, &mut Losing::default(), &[], pace, WAIT).err().unwrap();
    let CaptureError::Board(ClientError::Refused { error: RequestError::Shot { .. }, .. }) = refused else {
        panic!("{refused:?}")
    };
}

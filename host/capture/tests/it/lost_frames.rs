//! Frames lost where a program begins: no image is assigned to another exposure.

use std::time::Duration;

use farnear_capture::{
    camera::{Camera, CameraError, Frame, Image, Stamp, pairing::Pairing},
    continuous::{Continuous, Loss, Outcome, Pace},
    expose::{CaptureError, expose_in_parts},
};
use farnear_protocol::{
    message::{ShotRecord, TriggerMode},
    units::Micros,
};
use farnear_scripted_board::{Faults, Peer};
use ndarray::Array2;

use crate::scripted::{SHOT, connect};

const WAIT: Duration = Duration::from_millis(20);

/// Its frames have a count, as those of a GigE camera, and show their trigger number. One never arrives.
struct Counting {
    peer: Peer,
    lost: u32,
    next: u32,
    pairing: Pairing,
}

impl Counting {
    fn new(peer: &Peer, lost: u32) -> Self {
        Self { peer: peer.clone(), lost, next: 0, pairing: Pairing::default() }
    }

    fn take(&mut self) -> Option<Frame> {
        self.next += u32::from(self.next == self.lost);
        let (number, triggers) = (self.next, self.peer.board().triggers);
        (number < triggers).then(|| {
            self.next += 1;
            let image = Image::new(Array2::from_elem((3, 4), number as u16), 8);
            Frame { image, stamp: Stamp { count: Some(u64::from(number) + 1), time: None } }
        })
    }
}

impl Camera for Counting {
    fn kind(&self) -> &'static str {
        "counting"
    }
    fn arm(&mut self, _: TriggerMode, _: Micros) -> Result<(), CameraError> {
        self.pairing.begin();
        Ok(())
    }
    fn pairs_by_frames_before(&self) -> bool {
        true
    }
    fn trigger(&mut self, _: u32, _: Micros) -> Result<(), CameraError> {
        Ok(())
    }
    fn image(&mut self, shot: &ShotRecord, waited: Duration) -> Result<Image, CameraError> {
        while let Some(frame) = self.pairing.early().or_else(|| self.take()) {
            if let Some(image) = self.pairing.image("counting", frame, shot)? {
                return Ok(image);
            }
        }
        Err(CameraError::Late { camera: "counting".into(), trigger_number: shot.trigger_number, waited })
    }
}

#[test]
fn a_frame_lost_between_two_parts_shifts_no_image() {
    let (client, peer) = connect(Faults::default());
    assert_eq!(client.hello().limits.shots_max, 16);
    let mut camera = Counting::new(&peer, 16);
    let error = expose_in_parts(&client, &mut camera, &[SHOT; 20], WAIT, |_, record, image| {
        assert_eq!(u32::from(image.pixels[[0, 0]]), record.trigger_number);
        Ok::<(), CaptureError>(())
    })
    .unwrap_err();
    assert!(
        matches!(error, CaptureError::Camera(CameraError::Skipped { wanted: 16, came: 17 })),
        "{error:?}"
    );
}

#[test]
fn a_frame_lost_first_in_a_continuous_run_shifts_no_image() {
    let pace = Pace { period: Micros(40_000), exposures: 6 };
    for lost in 0..3 {
        let (client, peer) = connect(Faults::default());
        let mut camera = Counting::new(&peer, lost);
        let mut stream = match Continuous::start(&client, &mut camera, &[SHOT, SHOT], pace, WAIT) {
            Ok(stream) => stream,
            Err(error) => {
                let late = matches!(error, CaptureError::Camera(CameraError::Late { trigger_number: 0, .. }));
                assert!(late && lost == 0, "{error:?}");
                continue;
            }
        };
        // The board is ahead of the camera.
        while stream.waiting().unwrap() < 6 {
            std::thread::yield_now();
        }
        let mut missing = Vec::new();
        while let Some(outcome) = stream.outcome().unwrap() {
            match outcome {
                Outcome::Taken(frame) => {
                    assert_eq!(u32::from(frame.image.pixels[[0, 0]]), frame.record.trigger_number);
                }
                Outcome::Dropped { loss: Loss::Image { trigger_number, .. }, .. } => {
                    missing.push(trigger_number);
                }
                Outcome::Dropped { loss, .. } => panic!("{loss:?}"),
            }
        }
        assert_eq!(missing, [lost]);
    }
}

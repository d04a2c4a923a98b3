//! Continuous capture: far, near, far, near ..., or any cycle of shots, each exposure with its image, until it has taken as
//! many as wanted or is stopped.
//!
//! The board holds the pace and numbers its frames without a gap; what it drops it says. What is lost on the way to here is reported likewise:
//! an event that the board no longer remembers shows as a missing number, an image that does not come as such. Nothing is passed
//! over in silence, and no image is given to another exposure than its own.

use std::{
    collections::VecDeque,
    time::{Duration, Instant},
};

use farnear_protocol::{
    Request,
    message::{DropReason, EventKind, Shot, ShotRecord, TriggerMode},
    units::{Micros, Nanometres},
};

use crate::{
    camera::{Camera, CameraError, Image},
    client::Client,
    error::ClientError,
    expose::{CaptureError, one_trigger, wait_for_image},
    work::{Step, Work},
};

/// Images in a row that do not come, after which none is expected.
const UNDELIVERED_MAX: u32 = 8;

/// How it goes on, and for how long.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Pace {
    /// From one trigger to the next; 0 = as fast as position and camera allow.
    pub period: Micros,
    /// Exposures after which it ends; 0 = none, it goes on until it is stopped.
    pub exposures: u32,
}

/// An exposure with its image.
#[derive(Clone, PartialEq, Debug)]
pub struct Frame {
    /// Which moment of the pace, from 0.
    pub number: u32,
    /// Largest distance of the measured position from the one asked for, from the trigger's order to the end of the exposure.
    pub deviation: Nanometres,
    /// What the board measured.
    pub record: ShotRecord,
    pub image: Image,
}

/// Why there is no exposure, or no image of it.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Loss {
    Board(DropReason),
    /// The event that tells of it was lost, and the board no longer remembers it.
    EventLost,
    /// The image of this exposure did not come; with the camera's word for it.
    Image {
        trigger_number: u32,
        /// What the camera says.
        reason: String,
    },
}

/// What became of a frame.
#[derive(Clone, PartialEq, Debug)]
pub enum Outcome {
    /// It was exposed, and its image is here.
    Taken(Box<Frame>),
    Dropped {
        /// Which moment of the pace, from 0.
        number: u32,
        loss: Loss,
    },
}

/// An exposure that was reported of, without its image yet.
enum Reported {
    Taken { number: u32, deviation: Nanometres, record: ShotRecord },
    Dropped { number: u32, loss: Loss },
}

/// A continuous run; dropped before its end it stops the rig.
///
/// Images wait in the camera until they are asked for: a caller that takes longer than a period for each [`Self::outcome`] loses some, which is reported.
pub struct Continuous<'c> {
    client: Client,
    camera: &'c mut dyn Camera,
    work: Option<Work>,
    mode: TriggerMode,
    exposure: Micros,
    image_wait: Duration,
    /// The frame that is due next.
    next: u32,
    reported: VecDeque<Reported>,
    undelivered: u32,
}

impl<'c> Continuous<'c> {
    /// Arms camera and board with a cycle of shots and begins. Waits for each image at most `image_wait`.
    pub fn start(
        client: &Client,
        camera: &'c mut dyn Camera,
        shots: &[Shot],
        pace: Pace,
        image_wait: Duration,
    ) -> Result<Self, CaptureError> {
        let (mode, exposure) = one_trigger(shots)?;
        client.arm(shots)?;
        camera.arm(mode, exposure)?;
        let work = Some(client.start_continuous(shots, pace.period, pace.exposures)?);
        let client = client.clone();
        let reported = VecDeque::new();
        Ok(Self { client, camera, work, mode, exposure, image_wait, next: 0, reported, undelivered: 0 })
    }

    /// Frames that the board has reported of and nobody has asked for yet: whoever falls behind may want to leave some out.
    pub fn waiting(&mut self) -> Result<usize, CaptureError> {
        while let Some(work) = &mut self.work
            && let Some(step) = work.step_within(Duration::ZERO)?
        {
            let received = work.received();
            self.take(step, received)?;
        }
        Ok(self.reported.len())
    }

    /// What became of the next frame; `None` after the last. Frames come in order, none is left out.
    ///
    /// # Errors
    /// [`CaptureError`]; nothing comes after it, and the rig was stopped.
    pub fn outcome(&mut self) -> Result<Option<Outcome>, CaptureError> {
        let outcome = self.try_outcome();
        if outcome.is_err() {
            self.work = None;
            self.reported.clear();
        }
        outcome
    }

    fn try_outcome(&mut self) -> Result<Option<Outcome>, CaptureError> {
        loop {
            if let Some(reported) = self.reported.pop_front() {
                return self.fetch(reported).map(Some);
            }
            let Some(work) = &mut self.work else { return Ok(None) };
            let step = work.step()?;
            let received = work.received();
            self.take(step, received)?;
        }
    }

    fn take(&mut self, step: Step, received: Instant) -> Result<(), CaptureError> {
        match step {
            Step::Event(kind) => self.process(&kind, received)?,
            Step::Done(EventKind::ContinuousDone { exposures, dropped, .. }) => {
                self.work = None;
                self.miss_until(exposures.wrapping_add(dropped));
            }
            Step::Done(other) => {
                let during = "running the exposure program".into();
                return Err(ClientError::Nonsense { during, answer: format!("{other:?}") }.into());
            }
        }
        Ok(())
    }

    fn process(&mut self, kind: &EventKind, received: Instant) -> Result<(), CaptureError> {
        match *kind {
            EventKind::ShotReady { trigger_number, exposure, .. } => {
                self.camera.trigger(trigger_number, exposure)?;
            }
            EventKind::FrameTaken { frame, deviation, shot, .. } => {
                self.miss_until(frame);
                self.camera.reported(&shot, received);
                self.reported.push_back(Reported::Taken { number: frame, deviation, record: shot });
                self.next = frame.wrapping_add(1);
            }
            EventKind::FrameDropped { frame, reason, .. } => {
                self.miss_until(frame);
                self.reported.push_back(Reported::Dropped { number: frame, loss: Loss::Board(reason) });
                self.next = frame.wrapping_add(1);
            }
            _ => {}
        }
        Ok(())
    }

    /// Nothing was reported of the frames before this one.
    fn miss_until(&mut self, frame: u32) {
        while (frame.wrapping_sub(self.next) as i32) > 0 {
            self.reported.push_back(Reported::Dropped { number: self.next, loss: Loss::EventLost });
            self.next = self.next.wrapping_add(1);
        }
    }

    fn fetch(&mut self, reported: Reported) -> Result<Outcome, CaptureError> {
        let (number, deviation, record) = match reported {
            Reported::Taken { number, deviation, record } => (number, deviation, record),
            Reported::Dropped { number, loss } => return Ok(Outcome::Dropped { number, loss }),
        };
        match wait_for_image(&self.client, self.camera, &record, self.image_wait) {
            Ok(image) => {
                self.undelivered = 0;
                Ok(Outcome::Taken(Box::new(Frame { number, deviation, record, image })))
            }
            Err(CaptureError::Camera(
                error @ (CameraError::Late { .. }
                | CameraError::Skipped { .. }
                | CameraError::Incomplete { .. }),
            )) if self.undelivered + 1 < UNDELIVERED_MAX => {
                self.undelivered += 1;
                let (trigger_number, reason) = (record.trigger_number, error.to_string());
                Ok(Outcome::Dropped { number, loss: Loss::Image { trigger_number, reason } })
            }
            Err(error) => Err(error),
        }
    }
}

impl Drop for Continuous<'_> {
    fn drop(&mut self) {
        self.work = None; // stops the board where it still runs
        if self.mode == TriggerMode::FreeRunning {
            // The camera is to heed its trigger line again; whoever lets go has an error of their own, or none.
            let _ = self.camera.arm(TriggerMode::Hardware, self.exposure);
        }
    }
}

/// Puts frames together to whole cycles: far and near to pairs. A cycle of which an image is missing is left out.
#[derive(Clone, Debug)]
pub struct Cycles {
    /// Place in the program and repeat of each exposure of a cycle.
    places: Vec<(u8, u16)>,
    taken: Vec<Frame>,
    broken: u32,
}

impl Cycles {
    /// Of a cycle of these shots.
    pub fn of(shots: &[Shot]) -> Self {
        let places = (0..).zip(shots).flat_map(|(index, shot)| (0..shot.repeat).map(move |n| (index, n)));
        Self { places: places.collect(), taken: Vec::new(), broken: 0 }
    }

    /// Takes a frame; gives the cycle that it completes.
    pub fn push(&mut self, frame: Frame) -> Option<Vec<Frame>> {
        let place = (frame.record.index, frame.record.repeat);
        if self.places.get(self.taken.len()) != Some(&place) {
            self.broken += u32::from(!self.taken.is_empty());
            self.taken.clear();
            if self.places.first() != Some(&place) {
                return None;
            }
        }
        self.taken.push(frame);
        (self.taken.len() == self.places.len()).then(|| std::mem::take(&mut self.taken))
    }

    /// Cycles that were begun and not completed.
    pub fn broken(&self) -> u32 {
        self.broken
    }
}

impl Client {
    /// Runs the armed program again and again, a trigger each period (0: as fast as position and camera allow), until it has
    /// taken so many exposures (0: until the work is dropped). Its events are [`EventKind::FrameTaken`] and
    /// [`EventKind::FrameDropped`]; of those that are lost nothing is reported, their numbers are missing.
    pub fn start_continuous(
        &self,
        shots: &[Shot],
        period: Micros,
        exposures: u32,
    ) -> Result<Work, ClientError> {
        let round = self.program_time(shots)?;
        let silence = self.keep_alive();
        // No event comes for longer than a whole round, or a slow pace, takes.
        let work = round + Duration::from_micros(2 * u64::from(period.0));
        let during = "capturing continuously".to_string();
        self.start_work(&Request::RunContinuously { period, exposures, silence }, work, during)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use farnear_protocol::{message::Axis, units::BoardMicros};

    fn frame(number: u32, index: u8) -> Frame {
        let record = ShotRecord {
            index,
            repeat: 0,
            trigger_number: number,
            axis: Axis::SensorFine,
            asked: Nanometres(0),
            coarse: Nanometres(0),
            fine: Nanometres(0),
            lens: Nanometres(0),
            settle: Micros(0),
            trigger: BoardMicros(0),
            strobe_start: BoardMicros(0),
            strobe_end: BoardMicros(0),
            exposure: Micros(1),
        };
        let image = Image { pixels: ndarray::Array2::zeros((1, 1)), bits: 8 };
        Frame { number, deviation: Nanometres(0), record, image }
    }

    #[test]
    fn a_pair_is_a_far_image_and_the_near_one_after_it() {
        let shot = Shot {
            axis: Axis::SensorFine,
            target: Nanometres(0),
            exposure: Micros(1),
            settle_window: Nanometres(1),
            settle_dwell: Micros(1),
            repeat: 1,
            mode: TriggerMode::Hardware,
        };
        let mut cycles = Cycles::of(&[shot, shot]);
        let mut push = |number, index| {
            let cycle = cycles.push(frame(number, index));
            cycle.map(|cycle| cycle.iter().map(|frame| frame.number).collect::<Vec<_>>())
        };
        assert_eq!(push(0, 1), None, "a near image without its far one");
        assert_eq!((push(1, 0), push(2, 1)), (None, Some(vec![1, 2])));
        assert_eq!((push(3, 0), push(5, 0), push(7, 1)), (None, None, Some(vec![5, 7])));
        assert_eq!(cycles.broken(), 1);
    }
}

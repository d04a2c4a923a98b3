//! Continuous capture: cycles of shots (far, near, ...) with an image each, for a number of exposures or until stopped.
//! Dropped frames, lost events and missing images are reported; no image is assigned to another exposure.

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
    expose::{CaptureError, Format, check_exposures, expose_first, one_trigger, wait_for_image},
    work::{Step, Work},
};

/// Missing images in a row that end the run.
const UNDELIVERED_MAX: u32 = 8;

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Pace {
    /// 0 = as fast as possible.
    pub period: Micros,
    /// Limit of the run; 0 = until stopped.
    pub exposures: u32,
}

#[derive(Clone, PartialEq, Debug)]
pub struct Frame {
    /// Number of the period, from 0.
    pub number: u32,
    /// Largest deviation from the target between trigger and end of exposure.
    pub deviation: Nanometres,
    pub record: ShotRecord,
    pub image: Image,
}

#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Loss {
    Board(DropReason),
    /// The event was lost and the board has forgotten it.
    EventLost,
    Image {
        trigger_number: u32,
        reason: String,
    },
}

#[derive(Clone, PartialEq, Debug)]
pub enum Outcome {
    Taken(Box<Frame>),
    Dropped {
        /// Number of the period, from 0.
        number: u32,
        loss: Loss,
    },
}

enum Reported {
    Taken { number: u32, deviation: Nanometres, record: ShotRecord },
    Dropped { number: u32, loss: Loss },
}

/// A continuous run; dropping it stops the rig. Call [`Self::outcome`] once a period, or images are lost and reported.
pub struct Continuous<'c> {
    client: Client,
    camera: &'c mut dyn Camera,
    work: Option<Work>,
    mode: TriggerMode,
    exposure: Micros,
    image_wait: Duration,
    next: u32,
    reported: VecDeque<Reported>,
    undelivered: u32,
    format: Format,
}

impl<'c> Continuous<'c> {
    /// Arms camera and board and starts. Waits for each image at most `image_wait`. A camera that pairs by
    /// the frames before ([`Camera::pairs_by_frames_before`]) takes one image before the run.
    pub fn start(
        client: &Client,
        camera: &'c mut dyn Camera,
        shots: &[Shot],
        pace: Pace,
        image_wait: Duration,
    ) -> Result<Self, CaptureError> {
        let (mode, exposure) = one_trigger(shots)?;
        check_exposures(camera, shots)?;
        client.arm(shots)?;
        camera.arm(mode, exposure)?;
        // The first frame of the run has a frame before it, too: losing it would shift all.
        if let Some(first) = shots.first().filter(|_| camera.pairs_by_frames_before()) {
            let mut left = UNDELIVERED_MAX;
            // An incomplete frame has come, so that the next one is not shifted.
            while let Err(error) = expose_first(client, camera, *first, image_wait) {
                left -= 1;
                if left == 0 || !matches!(error, CaptureError::Camera(CameraError::Incomplete { .. })) {
                    return Err(error);
                }
            }
            client.arm(shots)?;
        }
        let work = Some(client.start_continuous(shots, pace.period, pace.exposures)?);
        let client = client.clone();
        Ok(Self {
            client,
            camera,
            work,
            mode,
            exposure,
            image_wait,
            next: 0,
            reported: VecDeque::new(),
            undelivered: 0,
            format: Format::default(),
        })
    }

    /// Number of reported frames not yet read; callers that fall behind may skip some.
    pub fn waiting(&mut self) -> Result<usize, CaptureError> {
        while let Some(work) = &mut self.work
            && let Some(step) = work.step_within(Duration::ZERO)?
        {
            let received = work.received();
            self.take(step, received)?;
        }
        Ok(self.reported.len())
    }

    /// Result of the next frame, in order without gaps; `None` after the last. An error stops the rig and ends the run.
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
                self.format.check(&image, record.trigger_number).map_err(CaptureError::Camera)?;
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
            // Re-enables the trigger line; the caller has its own error, if any.
            let _ = self.camera.arm(TriggerMode::Hardware, self.exposure);
        }
    }
}

/// Groups frames into cycles, e.g. far/near pairs; incomplete cycles are dropped.
#[derive(Clone, Debug)]
pub struct Cycles {
    places: Vec<(u8, u16)>,
    taken: Vec<Frame>,
    broken: u32,
}

impl Cycles {
    pub fn of(shots: &[Shot]) -> Self {
        let places = (0..).zip(shots).flat_map(|(index, shot)| (0..shot.repeat).map(move |n| (index, n)));
        Self { places: places.collect(), taken: Vec::new(), broken: 0 }
    }

    /// Adds a frame; returns the cycle that it completes.
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

    /// Incomplete cycles so far.
    pub fn broken(&self) -> u32 {
        self.broken
    }
}

impl Client {
    /// Repeats the armed program with this trigger period (0: as fast as possible) for `exposures` (0: until the work
    /// is dropped). Events are [`EventKind::FrameTaken`] and [`EventKind::FrameDropped`]; lost ones leave gaps.
    pub fn start_continuous(
        &self,
        shots: &[Shot],
        period: Micros,
        exposures: u32,
    ) -> Result<Work, ClientError> {
        let round = self.program_time(shots)?;
        let silence = self.keep_alive();
        // Events come at least once per round or period.
        let work = round + Duration::from_micros(2 * u64::from(period.0));
        let during = "capturing continuously".to_string();
        self.start_work(&Request::RunContinuously { period, exposures, silence }, work, during)
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use farnear_protocol::{message::Axis, units::BoardMicros};

    pub(crate) fn frame(number: u32, index: u8) -> Frame {
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
        let image = Image::new(ndarray::Array2::zeros((1, 1)), 8);
        Frame { number, deviation: Nanometres(0), record, image }
    }

    #[test]
    fn cycles_pair_a_far_image_with_the_following_near_one() {
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

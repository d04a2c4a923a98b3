//! The exposure program: up to 64 shots, and the one that runs.
//!
//! Each shot: move, settle, trigger, wait for the strobe, report; `repeat` exposures at each position. The next
//! move begins with the end of the exposure and so overlaps the camera's read-out; the next trigger waits for the
//! camera. At the trigger the position has been inside the settle window for the whole dwell, however long the
//! camera took.

use farnear_protocol::message::{Axis, Failure, Shot, ShotFault, ShotRecord};
use farnear_protocol::{BoardMicros, Micros, Nanometres};

use crate::camera::{Camera, NoAnswer};
use crate::io::ExposureEdges;
use crate::settings::{SETTLE_DWELL_MAX, SETTLE_WINDOW_MAX, Settings};
use crate::stage::{Positioning, Stage};

/// Shots a program may have.
pub const SHOTS_MAX: usize = 64;

/// The loaded shots.
#[derive(Clone, Debug)]
pub(crate) struct Shots {
    shots: [Option<Shot>; SHOTS_MAX],
}

impl Shots {
    pub(crate) const fn new() -> Self {
        Self { shots: [None; SHOTS_MAX] }
    }

    /// Puts a shot into its place; limits of the axis are the caller's.
    pub(crate) fn load(&mut self, index: u8, shot: Shot, settings: &Settings) -> Result<(), ShotFault> {
        let place = self.shots.get_mut(usize::from(index)).ok_or(ShotFault::Index)?;
        let camera = &settings.camera;
        if !(camera.exposure_min..=camera.exposure_max).contains(&shot.exposure) {
            return Err(ShotFault::Exposure);
        }
        let window = Nanometres(1)..=SETTLE_WINDOW_MAX;
        let dwell = Micros(1)..=SETTLE_DWELL_MAX;
        if !window.contains(&shot.settle_window) || !dwell.contains(&shot.settle_dwell) {
            return Err(ShotFault::Settle);
        }
        if shot.repeat == 0 {
            return Err(ShotFault::Repeat);
        }
        *place = Some(shot);
        Ok(())
    }

    /// A loaded shot.
    pub(crate) fn get(&self, index: u8) -> Option<&Shot> {
        self.shots.get(usize::from(index))?.as_ref()
    }
}

/// What a shot is doing.
#[derive(Clone, Debug)]
enum Phase {
    /// On the way, settling, or waiting for the camera.
    Positioning,
    /// Waiting for the strobe of this trigger; the positions are those of the trigger.
    Exposing { number: u32, coarse: Nanometres, fine: Nanometres, lens: Nanometres },
}

/// A program under way.
#[derive(Clone, Debug)]
pub(crate) struct Run {
    shots: u8,
    index: u8,
    shot: Shot,
    repeat: u16,
    exposures: u16,
    positioning: Positioning,
    /// From the start of the move until it was first settled.
    settle: Option<Micros>,
    phase: Phase,
}

/// What a tick of a program brought.
#[derive(Debug, Default)]
pub(crate) struct Progress {
    /// An exposure was taken.
    pub(crate) taken: Option<ShotRecord>,
    /// It is over: with this many exposures, or for this reason.
    pub(crate) end: Option<Result<u16, Failure>>,
}

impl Run {
    /// Sets off to the first of `count` shots; all of them are loaded, and `first` is the first.
    pub(crate) fn start(
        count: u8,
        first: Shot,
        stage: &mut Stage,
        settings: &Settings,
        now: BoardMicros,
    ) -> Self {
        Self {
            shots: count,
            index: 0,
            shot: first,
            repeat: 0,
            exposures: 0,
            positioning: approach(&first, stage, settings, now),
            settle: None,
            phase: Phase::Positioning,
        }
    }

    /// The axis that the present shot moves.
    pub(crate) const fn axis(&self) -> Axis {
        self.shot.axis
    }

    /// Goes on.
    pub(crate) fn tick(
        &mut self,
        shots: &Shots,
        stage: &mut Stage,
        camera: &mut Camera,
        settings: &Settings,
        now: BoardMicros,
    ) -> Progress {
        match self.phase {
            Phase::Positioning => match self.positioning.tick(stage, now) {
                None => Progress::default(),
                Some(Err(failure)) => Progress { taken: None, end: Some(Err(failure)) },
                Some(Ok(time)) => {
                    self.settle.get_or_insert(time);
                    if camera.is_ready(now) {
                        let number = camera.trigger(self.shot.exposure, now);
                        let (coarse, fine) = (stage.coarse.measured(), self.positioning.mean_fine());
                        self.phase = Phase::Exposing { number, coarse, fine, lens: stage.lens.measured() };
                    }
                    Progress::default()
                }
            },
            Phase::Exposing { number, coarse, fine, lens } => match camera.result(number) {
                None => Progress::default(),
                Some(Err(NoAnswer)) => Progress { taken: None, end: Some(Err(Failure::NoStrobe)) },
                Some(Ok(edges)) => {
                    let record = self.record(number, (coarse, fine, lens), &edges);
                    self.exposures = self.exposures.saturating_add(1);
                    self.phase = Phase::Positioning;
                    Progress { taken: Some(record), end: self.next(shots, stage, settings, now).map(Ok) }
                }
            },
        }
    }

    /// After an exposure: the next repeat, the next shot, or the end.
    fn next(
        &mut self,
        shots: &Shots,
        stage: &mut Stage,
        settings: &Settings,
        now: BoardMicros,
    ) -> Option<u16> {
        self.repeat += 1; // at most the shot's repeat, which fits
        if self.repeat < self.shot.repeat {
            return None;
        }
        (self.repeat, self.index, self.settle) = (0, self.index + 1, None);
        let Some(shot) = shots.get(self.index).filter(|_| self.index < self.shots) else {
            return Some(self.exposures);
        };
        self.shot = *shot;
        self.positioning = approach(shot, stage, settings, now);
        None
    }

    fn record(
        &self,
        number: u32,
        (coarse, fine, lens): (Nanometres, Nanometres, Nanometres),
        edges: &ExposureEdges,
    ) -> ShotRecord {
        ShotRecord {
            index: self.index,
            repeat: self.repeat,
            trigger_number: number,
            axis: self.shot.axis,
            asked: self.shot.target,
            coarse,
            fine,
            lens,
            settle: self.settle.unwrap_or_default(),
            trigger: edges.trigger,
            strobe_start: edges.strobe_start,
            strobe_end: edges.strobe_end,
            exposure: self.shot.exposure,
        }
    }
}

fn approach(shot: &Shot, stage: &mut Stage, settings: &Settings, now: BoardMicros) -> Positioning {
    let settled = (shot.settle_window, shot.settle_dwell);
    Positioning::start(stage, settings, (shot.axis, shot.target), settled, now)
}

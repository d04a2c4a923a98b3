//! Exposure program of up to 64 shots, and its execution.
//!
//! Each shot: move, settle, expose, wait for the strobe, report; `repeat` exposures per position. The next move starts
//! at the end of the exposure and overlaps read-out; the next exposure waits for the camera. At the trigger the
//! position has been settled for the whole dwell, however long the camera took. A pause waits for the current exposure;
//! a resumed program settles again. A continuous run repeats the shots with a period or as fast as possible.

pub(crate) mod pace;

use farnear_protocol::message::{
    Axis, DropReason, Failure, LightLevels, ProgramState, ProgramStatus, Shot, ShotFault, ShotLight,
    ShotRecord, TriggerMode,
};
use farnear_protocol::{BoardMicros, Micros, Nanometres, Settle};

use self::pace::Pace;
use crate::camera::{Camera, NoAnswer};
use crate::io::ExposureEdges;
use crate::motion::positioning::Positioning;
use crate::motion::stage::Stage;
use crate::settings::{SETTLE_DWELL_MAX, SETTLE_WINDOW_MAX, Settings};

pub const SHOTS_MAX: usize = 64;

#[derive(Clone, Debug)]
pub(crate) struct Shots {
    shots: [Option<Shot>; SHOTS_MAX],
    /// Not kept without power.
    lights: [Option<ShotLight>; SHOTS_MAX],
    armed: u8,
}

impl Shots {
    pub(crate) const fn new() -> Self {
        Self { shots: [None; SHOTS_MAX], lights: [None; SHOTS_MAX], armed: 0 }
    }

    /// The caller checks the axis' limits.
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
        self.set_light(index, None);
        self.armed = 0;
        Ok(())
    }

    /// A stored shot that the settings no longer permit is dropped.
    pub(crate) fn restore(&mut self, index: usize, shot: Shot, settings: &Settings) {
        let (min, max) = settings.limits(shot.axis);
        if (min..=max).contains(&shot.target) {
            let _ = self.load(index as u8, shot, settings); // an index is below SHOTS_MAX
        }
    }

    /// Arms the first `shots`, already checked; 0 disarms.
    pub(crate) const fn arm(&mut self, shots: u8) {
        self.armed = shots;
    }

    pub(crate) const fn armed(&self) -> u8 {
        self.armed
    }

    /// The caller has checked it.
    pub(crate) fn set_light(&mut self, index: u8, light: Option<ShotLight>) {
        if let Some(place) = self.lights.get_mut(usize::from(index)) {
            *place = light;
        }
    }

    pub(crate) fn light(&self, index: u8) -> Option<ShotLight> {
        self.lights.get(usize::from(index)).copied().flatten()
    }

    pub(crate) fn get(&self, index: u8) -> Option<&Shot> {
        self.shots.get(usize::from(index))?.as_ref()
    }
}

#[derive(Clone, Copy, Debug)]
struct Places {
    coarse: Nanometres,
    fine: Nanometres,
    lens: Nanometres,
}

#[derive(Clone, Debug)]
enum Phase {
    /// Moving, settling, or waiting for the camera.
    Positioning,
    /// Waiting for the strobe; positions at the trigger, largest deviation since.
    Exposing { number: u32, frame: u32, places: Places, deviation: Nanometres },
    /// Between two exposures.
    Paused,
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct Flash {
    pub(crate) trigger_number: u32,
    pub(crate) levels: LightLevels,
    pub(crate) edges: [BoardMicros; 2],
}

#[derive(Clone, Debug)]
pub(crate) struct Run {
    shots: u8,
    index: u8,
    shot: Shot,
    light: Option<ShotLight>,
    /// Of the latest exposure.
    flash: Option<Flash>,
    repeat: u16,
    exposures: u16,
    pace: Option<Pace>,
    positioning: Positioning,
    /// Time from the start of the move until settled.
    settle: Option<Micros>,
    phase: Phase,
    pausing: bool,
    /// Resumed while still braking: continues at rest.
    resuming: bool,
}

#[derive(Debug)]
pub(crate) enum Progress {
    On,
    Ready {
        number: u32,
    },
    Paused,
    /// Total number if it was the last.
    Taken {
        shot: ShotRecord,
        end: Option<u16>,
    },
    Frame {
        frame: u32,
        deviation: Nanometres,
        shot: ShotRecord,
        end: Option<(u32, u32)>,
    },
    Dropped {
        frame: u32,
        reason: DropReason,
    },
    /// The axis, if it failed.
    Failed {
        axis: Option<Axis>,
        reason: Failure,
    },
}

impl Run {
    /// Starts `count` loaded shots with `first`; endless with a pace.
    pub(crate) fn start(
        (count, (first, light)): (u8, (Shot, Option<ShotLight>)),
        pace: Option<Pace>,
        stage: &mut Stage,
        settings: &Settings,
        now: BoardMicros,
    ) -> Self {
        Self {
            shots: count,
            index: 0,
            shot: first,
            light,
            flash: None,
            repeat: 0,
            exposures: 0,
            pace,
            positioning: approach(&first, stage, settings, now),
            settle: None,
            phase: Phase::Positioning,
            pausing: false,
            resuming: false,
        }
    }

    /// Flash of the latest exposure; given once.
    pub(crate) const fn take_flash(&mut self) -> Option<Flash> {
        self.flash.take()
    }

    pub(crate) const fn status(&self) -> ProgramStatus {
        let paused = matches!(self.phase, Phase::Paused);
        let state = if paused { ProgramState::Paused } else { ProgramState::Running };
        ProgramStatus { state, shots: self.shots, index: self.index, exposures: self.exposures }
    }

    pub(crate) const fn shot(&self) -> (u8, u16, &Shot) {
        (self.index, self.repeat, &self.shot)
    }

    pub(crate) const fn pause(&mut self) {
        (self.pausing, self.resuming) = (true, false);
    }

    pub(crate) const fn is_pausing(&self) -> bool {
        self.pausing && !self.resuming
    }

    /// Resumes; settles again.
    pub(crate) fn resume(&mut self, stage: &mut Stage, settings: &Settings, now: BoardMicros) {
        match self.phase {
            Phase::Paused => self.set_off_anew(stage, settings, now),
            // It may still brake at another position than the target.
            Phase::Positioning => self.resuming = true,
            Phase::Exposing { .. } => self.pausing = false,
        }
    }

    fn set_off_anew(&mut self, stage: &mut Stage, settings: &Settings, now: BoardMicros) {
        (self.pausing, self.resuming) = (false, false);
        self.phase = Phase::Positioning;
        self.settle = None;
        self.positioning = approach(&self.shot, stage, settings, now);
        if let Some(pace) = &mut self.pace {
            pace.begin_anew();
        }
    }

    pub(crate) fn tick(
        &mut self,
        shots: &Shots,
        stage: &mut Stage,
        camera: &mut Camera,
        settings: &Settings,
        now: BoardMicros,
    ) -> Progress {
        match self.phase {
            Phase::Paused => Progress::On,
            Phase::Positioning if self.pausing => {
                // A stopped move ends where it stopped; a piezo's move takes 5 ms.
                stage.stop();
                if !stage.steppers_still() {
                    return Progress::On;
                }
                if self.resuming {
                    self.set_off_anew(stage, settings, now);
                    return Progress::On;
                }
                self.phase = Phase::Paused;
                Progress::Paused
            }
            Phase::Positioning => {
                let settled = match self.positioning.tick(stage, now) {
                    Some(Err(reason)) => return Progress::Failed { axis: Some(self.shot.axis), reason },
                    Some(Ok(time)) => {
                        self.settle.get_or_insert(time);
                        true
                    }
                    None => false,
                };
                self.expose_when_due(settled, stage, camera, now)
            }
            Phase::Exposing { number, frame, places, ref mut deviation } => {
                self.positioning.wait_from(now);
                *deviation = self.positioning.deviation(stage).max(*deviation);
                let deviation = *deviation;
                match camera.result(number) {
                    None => Progress::On,
                    Some(Err(NoAnswer)) => self.go_without(frame),
                    Some(Ok(edges)) => {
                        let shot = self.record(number, places, &edges);
                        self.flash = edges.flash.zip(self.light).map(|(edges, light)| Flash {
                            trigger_number: number,
                            levels: light.levels,
                            edges,
                        });
                        self.exposures = self.exposures.saturating_add(1);
                        self.phase = Phase::Positioning;
                        let Some(pace) = &mut self.pace else {
                            return Progress::Taken { shot, end: self.next(shots, stage, settings, now) };
                        };
                        let end = pace.answered();
                        if end.is_none() {
                            self.next(shots, stage, settings, now);
                        }
                        Progress::Frame { frame, deviation, shot, end }
                    }
                }
            }
        }
    }

    /// Exposes when position and camera are ready; in a continuous run at its time.
    fn expose_when_due(
        &mut self,
        settled: bool,
        stage: &Stage,
        camera: &mut Camera,
        now: BoardMicros,
    ) -> Progress {
        let Some(pace) = &mut self.pace else {
            let ready = settled && camera.is_ready(now);
            return if ready { self.expose(stage, camera, (0, now), now) } else { Progress::On };
        };
        let Some(due) = pace.due(now) else { return Progress::On };
        let late = pace.is_late(due, now);
        let reason = match (settled, camera.is_ready(due)) {
            (true, true) if !late => {
                let frame = pace.take(due);
                return self.expose(stage, camera, (frame, due), now);
            }
            _ if !pace.presses() => return Progress::On,
            (false, _) if !late => DropReason::NotSettled { error: self.positioning.error(stage) },
            _ => DropReason::CameraBusy,
        };
        Progress::Dropped { frame: pace.drop_frame(), reason }
    }

    /// No answer of the camera: a continuous run continues without the frame, unless several fail in a row.
    fn go_without(&mut self, frame: u32) -> Progress {
        if self.pace.as_mut().is_some_and(Pace::unanswered) {
            self.phase = Phase::Positioning;
            return Progress::Dropped { frame, reason: DropReason::NoStrobe };
        }
        Progress::Failed { axis: None, reason: Failure::NoStrobe }
    }

    fn expose(
        &mut self,
        stage: &Stage,
        camera: &mut Camera,
        (frame, due): (u32, BoardMicros),
        now: BoardMicros,
    ) -> Progress {
        let number = match self.shot.mode {
            TriggerMode::Hardware => camera.trigger(self.shot.exposure, self.light, due),
            TriggerMode::Software | TriggerMode::FreeRunning => camera.listen(now),
        };
        let places = Places {
            coarse: stage.coarse.measured(),
            fine: self.positioning.mean_fine(),
            lens: stage.lens.measured(),
        };
        let deviation = self.positioning.deviation(stage);
        self.phase = Phase::Exposing { number, frame, places, deviation };
        if self.shot.mode == TriggerMode::Software { Progress::Ready { number } } else { Progress::On }
    }

    /// After an exposure: next repeat, next shot, or end.
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
        (self.repeat, self.index) = (0, self.index + 1);
        if self.pace.is_some() && self.index >= self.shots {
            self.index = 0;
        }
        let Some(shot) = shots.get(self.index).filter(|_| self.index < self.shots) else {
            return Some(self.exposures);
        };
        let place = |shot: &Shot| (shot.axis, shot.target, shot.settle_window, shot.settle_dwell);
        let stays = self.pace.is_some() && place(shot) == place(&self.shot);
        (self.shot, self.light) = (*shot, shots.light(self.index));
        if !stays {
            self.settle = None;
        }
        if !self.pausing && !stays {
            self.positioning = approach(shot, stage, settings, now);
        }
        None
    }

    fn record(&self, number: u32, places: Places, edges: &ExposureEdges) -> ShotRecord {
        ShotRecord {
            index: self.index,
            repeat: self.repeat,
            trigger_number: number,
            axis: self.shot.axis,
            asked: self.shot.target,
            coarse: places.coarse,
            fine: places.fine,
            lens: places.lens,
            settle: self.settle.unwrap_or_default(),
            trigger: edges.trigger,
            strobe_start: edges.strobe_start,
            strobe_end: edges.strobe_end,
            exposure: self.shot.exposure,
        }
    }
}

fn approach(shot: &Shot, stage: &mut Stage, settings: &Settings, now: BoardMicros) -> Positioning {
    let settle = Settle { window: shot.settle_window, dwell: shot.settle_dwell };
    Positioning::start(stage, settings, (shot.axis, shot.target), settle, now)
}

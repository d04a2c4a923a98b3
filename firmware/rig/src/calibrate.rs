//! Calibration routines. Each occupies the whole rig, stores its results except travel as settings, and homes the axis.

mod backlash;
mod gauge;
mod sweep;
mod travel;

use farnear_protocol::message::{Axis, Calibration, Failure, Routine, SettingKey};

use self::backlash::Backlash;
use self::gauge::GaugeScale;
use self::sweep::Sweep;
use self::travel::Travel;
use crate::motion::axis::Stepper;
use crate::motion::home::Homing;
use crate::motion::stage::Stage;
use crate::settings::{Settings, StepperSettings};
use farnear_protocol::Nanometres;

#[derive(Clone, Debug)]
pub(crate) enum Calibrating {
    Travel(Travel),
    Backlash(Backlash),
    Piezo(Sweep),
    Gauge(GaugeScale),
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Step {
    On,
    Set(SettingKey, i32),
    Done(Calibration),
    Failed(Axis, Failure),
}

impl Calibrating {
    /// Starts with the next tick; `None` if the axis has no such routine.
    pub(crate) const fn new(routine: Routine) -> Option<Self> {
        match routine {
            Routine::Travel { axis: Axis::SensorFine } | Routine::Backlash { axis: Axis::SensorFine } => None,
            Routine::Travel { axis } => Some(Self::Travel(Travel::new(axis))),
            Routine::Backlash { axis } => Some(Self::Backlash(Backlash::new(axis))),
            Routine::Piezo => Some(Self::Piezo(Sweep::new())),
            Routine::Gauge => Some(Self::Gauge(GaugeScale::new())),
        }
    }

    pub(crate) const fn axes(&self) -> &'static [Axis] {
        match self {
            Self::Travel(travel) => only(travel.axis()),
            Self::Backlash(backlash) => only(backlash.axis()),
            Self::Piezo(_) => only(Axis::SensorFine),
            Self::Gauge(_) => &[Axis::SensorCoarse, Axis::SensorFine],
        }
    }

    /// Positions that the piezo must be allowed to reach.
    pub(crate) const fn places(&self) -> &'static [Nanometres] {
        match self {
            Self::Travel(_) | Self::Backlash(_) => &[],
            Self::Piezo(_) => &sweep::WHOLE_STROKE,
            Self::Gauge(_) => &gauge::PLACES,
        }
    }

    pub(crate) fn tick(&mut self, stage: &mut Stage, settings: &Settings) -> Step {
        match self {
            Self::Travel(travel) => travel.tick(stage, settings),
            Self::Backlash(backlash) => backlash.tick(stage, settings),
            Self::Piezo(sweep) => sweep.tick(&mut stage.fine),
            Self::Gauge(gauge) => gauge.tick(stage, settings),
        }
    }
}

const fn only(axis: Axis) -> &'static [Axis] {
    match axis {
        Axis::SensorCoarse => &[Axis::SensorCoarse],
        Axis::SensorFine => &[Axis::SensorFine],
        Axis::Lens => &[Axis::Lens],
    }
}

/// Homes the axis of a routine; returns its step until that is done or fails.
fn go_home(
    homing: &mut Homing,
    axis: Axis,
    stepper: &mut Stepper,
    settings: &StepperSettings,
    carried: Option<Nanometres>,
) -> Result<(), Step> {
    match homing.tick(stepper, settings, carried) {
        None => Err(Step::On),
        Some(Ok(_)) => Ok(()),
        Some(Err(failure)) => Err(Step::Failed(axis, failure)),
    }
}

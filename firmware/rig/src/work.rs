//! Long work per axis or for the whole rig, and its end. A program or calibration occupies all axes. Work that fails or
//! is stopped ends with its terminal event once its motion has stopped.

use farnear_protocol::message::{Axis, Failure};
use farnear_protocol::{Micros, Nanometres};

use crate::calibrate::Calibrating;
use crate::motion::home::Homing;
use crate::motion::positioning::Positioning;
use crate::program::Run;

#[derive(Clone, Debug)]
pub(crate) struct Active<W> {
    pub(crate) request: u32,
    pub(crate) silence: Micros,
    pub(crate) work: W,
}

#[derive(Clone, Debug)]
pub(crate) enum AxisWork {
    Home(Homing),
    Move {
        target: Nanometres,
        positioning: Positioning,
    },
    /// Ends with this once the axis is at rest.
    Ending(Failure),
}

#[derive(Clone, Debug)]
pub(crate) enum WholeWork {
    Program(Run),
    Calibration(Calibrating),
    /// As [`AxisWork::Ending`], once everything is at rest.
    Ending {
        axis: Option<Axis>,
        reason: Failure,
    },
}

#[derive(Clone, Debug)]
pub(crate) struct Works {
    axes: [Option<Active<AxisWork>>; Axis::ALL.len()],
    pub(crate) whole: Option<Active<WholeWork>>,
}

impl Works {
    pub(crate) const fn new() -> Self {
        Self { axes: [const { None }; Axis::ALL.len()], whole: None }
    }

    pub(crate) const fn on(&mut self, axis: Axis) -> &mut Option<Active<AxisWork>> {
        &mut self.axes[axis as usize]
    }

    pub(crate) fn request_on(&self, axis: Axis) -> Option<u32> {
        let own = self.axes[axis as usize].as_ref().map(|active| active.request);
        own.or(self.whole.as_ref().map(|active| active.request))
    }

    pub(crate) fn any(&self) -> Option<u32> {
        Axis::ALL.into_iter().find_map(|axis| self.request_on(axis))
    }

    pub(crate) const fn is_on(&self, axis: Axis) -> bool {
        self.axes[axis as usize].is_some()
    }

    /// The axis is homed, or waits for its switch to settle.
    pub(crate) const fn homes(&self, axis: Axis) -> bool {
        matches!(&self.axes[axis as usize], Some(Active { work: AxisWork::Home(_), .. }))
    }

    /// Active request with the shortest silence.
    pub(crate) fn shortest_silence(&self) -> Option<(u32, Micros)> {
        let axes = self.axes.iter().flatten();
        let of_axes = axes
            .filter(|active| !matches!(active.work, AxisWork::Ending(_)))
            .map(|active| (active.request, active.silence));
        let of_whole = self
            .whole
            .iter()
            .filter(|active| !matches!(active.work, WholeWork::Ending { .. }))
            .map(|active| (active.request, active.silence));
        of_axes.chain(of_whole).min_by_key(|(_, silence)| *silence)
    }

    pub(crate) fn end(&mut self, axis: Axis, reason: Failure) {
        if let Some(active) = &mut self.axes[axis as usize] {
            // A failure during a stop is more informative than the stop; the first failure more than later
            // ones.
            if !matches!(active.work, AxisWork::Ending(before) if before != Failure::Stopped) {
                active.work = AxisWork::Ending(reason);
            }
        }
    }

    pub(crate) fn end_whole(&mut self, axis: Option<Axis>, reason: Failure) {
        if let Some(active) = &mut self.whole
            && !matches!(active.work, WholeWork::Ending { reason: before, .. } if before != Failure::Stopped)
        {
            active.work = WholeWork::Ending { axis, reason };
        }
    }
}

//! Long work: what is under way on each axis, or on the whole rig, and how it ends.
//!
//! Each axis has a piece of work of its own; a program or a calibration occupies all. Work that fails or is stopped stays
//! until nothing of it moves any more, and then ends with its one terminal event.

use farnear_protocol::message::{Axis, Failure};
use farnear_protocol::{Micros, Nanometres};

use crate::calibrate::Calibrating;
use crate::motion::home::Homing;
use crate::motion::positioning::Positioning;
use crate::program::Run;

/// Work and the request that began it.
#[derive(Clone, Debug)]
pub(crate) struct Active<W> {
    pub(crate) request: u32,
    /// How long the host may say nothing.
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
    /// Ends with this once the axis stands.
    Ending(Failure),
}

#[derive(Clone, Debug)]
pub(crate) enum WholeWork {
    Program(Run),
    Calibration(Calibrating),
    /// Ends with this once everything stands.
    Ending {
        axis: Option<Axis>,
        reason: Failure,
    },
}

/// Everything that is under way.
#[derive(Clone, Debug)]
pub(crate) struct Works {
    axes: [Option<Active<AxisWork>>; Axis::ALL.len()],
    pub(crate) whole: Option<Active<WholeWork>>,
}

impl Works {
    pub(crate) const fn new() -> Self {
        Self { axes: [const { None }; Axis::ALL.len()], whole: None }
    }

    /// The work of an axis alone.
    pub(crate) const fn on(&mut self, axis: Axis) -> &mut Option<Active<AxisWork>> {
        &mut self.axes[axis as usize]
    }

    /// The request that an axis is busy with.
    pub(crate) fn request_on(&self, axis: Axis) -> Option<u32> {
        let own = self.axes[axis as usize].as_ref().map(|active| active.request);
        own.or(self.whole.as_ref().map(|active| active.request))
    }

    /// A request that is under way, if one is.
    pub(crate) fn any(&self) -> Option<u32> {
        Axis::ALL.into_iter().find_map(|axis| self.request_on(axis))
    }

    /// Whether an axis has work of its own.
    pub(crate) const fn is_on(&self, axis: Axis) -> bool {
        self.axes[axis as usize].is_some()
    }

    /// The request under way that allows the host the shortest silence.
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

    /// Ends the work of an axis.
    pub(crate) fn end(&mut self, axis: Axis, reason: Failure) {
        if let Some(active) = &mut self.axes[axis as usize] {
            // What broke on the way to a stop tells more than the stop; nothing tells more than what broke first.
            if !matches!(active.work, AxisWork::Ending(before) if before != Failure::Stopped) {
                active.work = AxisWork::Ending(reason);
            }
        }
    }

    /// Ends the work on all axes.
    pub(crate) fn end_whole(&mut self, axis: Option<Axis>, reason: Failure) {
        if let Some(active) = &mut self.whole
            && !matches!(active.work, WholeWork::Ending { reason: before, .. } if before != Failure::Stopped)
        {
            active.work = WholeWork::Ending { axis, reason };
        }
    }
}

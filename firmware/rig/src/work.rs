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

#[cfg(test)]
mod tests {
    use super::*;
    use farnear_protocol::message::Routine;

    fn on_axis(request: u32, ms: u32, work: AxisWork) -> Option<Active<AxisWork>> {
        Some(Active { request, silence: Micros(1_000 * ms), work })
    }

    #[test]
    fn the_shortest_silence_of_any_work_that_is_not_ending_counts() {
        let homes = || AxisWork::Home(Homing::new());
        let mut works = Works::new();
        assert_eq!(works.shortest_silence(), None);
        *works.on(Axis::SensorCoarse) = on_axis(1, 300, homes());
        *works.on(Axis::SensorFine) = on_axis(2, 200, homes());
        *works.on(Axis::Lens) = on_axis(3, 400, homes());
        assert_eq!(works.shortest_silence(), Some((2, Micros(200_000))));
        // A braking axis needs no host.
        works.end(Axis::SensorFine, Failure::Stopped);
        assert_eq!(works.shortest_silence(), Some((1, Micros(300_000))));
        let routine = Routine::Travel { axis: Axis::Lens };
        let work = WholeWork::Calibration(Calibrating::new(routine).expect("a routine"));
        works.whole = Some(Active { request: 4, silence: Micros(100_000), work });
        assert_eq!(works.shortest_silence(), Some((4, Micros(100_000))));
        works.end_whole(None, Failure::Stopped);
        assert_eq!(works.shortest_silence(), Some((1, Micros(300_000))));
    }

    #[test]
    fn the_first_failure_is_kept_and_replaces_a_stop() {
        let ending = |works: &Works| match (&works.axes[Axis::Lens as usize], &works.whole) {
            (
                Some(Active { work: AxisWork::Ending(of_axis), .. }),
                Some(Active { work: WholeWork::Ending { reason, .. }, .. }),
            ) => (*of_axis, *reason),
            other => panic!("{other:?}"),
        };
        let mut works = Works::new();
        *works.on(Axis::Lens) = on_axis(3, 400, AxisWork::Home(Homing::new()));
        let work = WholeWork::Ending { axis: None, reason: Failure::Stopped };
        works.whole = Some(Active { request: 4, silence: Micros(0), work });
        let (first, later) = (Failure::DriverFault, Failure::Alarm { number: 2 });
        for (reason, expected) in
            [(Failure::Stopped, Failure::Stopped), (first, first), (later, first), (Failure::Stopped, first)]
        {
            works.end(Axis::Lens, reason);
            works.end_whole(None, reason);
            assert_eq!(ending(&works), (expected, expected), "{reason:?}");
        }
    }
}

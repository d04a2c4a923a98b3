//! When the camera may be exposed, and the meaning of its strobe.
//!
//! Read-out overlaps the next move, but the next trigger waits for [`CameraSettings::readout`] after the exposure. Its
//! end comes from the strobe, before that from pulse length and longest latency. A strobe shorter than the pulse has
//! lost its beginning (loose contact): missing. Untriggered: the first to begin after listening started counts.

use farnear_protocol::message::{ShotLight, strobe_tolerance};
use farnear_protocol::{BoardMicros, Micros};

use crate::io::{ExposureEdges, Inputs, Trigger};
use crate::settings::CameraSettings;

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Awaited {
    Triggered,
    /// Free running or by the host, from this time on.
    Since(BoardMicros),
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
struct Pending {
    number: u32,
    deadline: BoardMicros,
    awaited: Awaited,
    /// A shorter strobe is invalid.
    shortest_us: u64,
}

#[derive(Clone, Debug)]
pub(crate) struct Camera {
    settings: CameraSettings,
    ready_at: BoardMicros,
    triggers: u32,
    pending: Option<Pending>,
    order: Option<Trigger>,
    edges: Option<(u32, ExposureEdges)>,
}

impl Camera {
    pub(crate) const fn new(settings: CameraSettings) -> Self {
        Self { settings, ready_at: BoardMicros(0), triggers: 0, pending: None, order: None, edges: None }
    }

    pub(crate) const fn apply(&mut self, settings: CameraSettings) {
        self.settings = settings;
    }

    /// Exposures since the reset; number of the next one.
    pub(crate) const fn triggers(&self) -> u32 {
        self.triggers
    }

    pub(crate) fn is_ready(&self, at: BoardMicros) -> bool {
        self.pending.is_none() && at >= self.ready_at
    }

    pub(crate) const fn period(&self, exposure: Micros) -> Micros {
        Micros(exposure.0.saturating_add(self.settings.readout.0))
    }

    /// Schedules an exposure; returns its number, from 0. The camera must be ready.
    pub(crate) fn trigger(&mut self, exposure: Micros, flash: Option<ShotLight>, at: BoardMicros) -> u32 {
        let end = at.0 + u64::from(exposure.0) + u64::from(self.settings.strobe_deadline.0);
        self.ready_at = BoardMicros(end + u64::from(self.settings.readout.0));
        self.order = Some(Trigger { at, length: exposure, flash });
        let shortest_us = u64::from(exposure.0.saturating_sub(strobe_tolerance(exposure).0));
        self.expect(BoardMicros(end), Awaited::Triggered, shortest_us)
    }

    pub(crate) fn listen(&mut self, now: BoardMicros) -> u32 {
        let deadline = BoardMicros(now.0 + u64::from(self.settings.patience.0));
        self.expect(deadline, Awaited::Since(now), 0)
    }

    fn expect(&mut self, deadline: BoardMicros, awaited: Awaited, shortest_us: u64) -> u32 {
        let number = self.triggers;
        self.triggers = self.triggers.wrapping_add(1);
        self.pending = Some(Pending { number, deadline, awaited, shortest_us });
        number
    }

    pub(crate) fn give_up(&mut self) {
        self.pending = self.pending.filter(|pending| pending.awaited == Awaited::Triggered);
    }

    pub(crate) const fn take_order(&mut self) -> Option<Trigger> {
        self.order.take()
    }

    pub(crate) const fn is_idle(&self) -> bool {
        self.pending.is_none() && self.order.is_none()
    }

    /// The board shall report exposures without trigger.
    pub(crate) fn is_listening(&self) -> bool {
        self.pending.is_some_and(|pending| pending.awaited != Awaited::Triggered)
    }

    /// Reads the board; unexpected edges are dropped.
    pub(crate) fn sense(&mut self, inputs: &Inputs) {
        self.edges = None;
        let Some(pending) = self.pending else { return };
        let edges = match pending.awaited {
            Awaited::Triggered => inputs.exposure,
            Awaited::Since(ready) => {
                inputs.strobe.filter(|strobe| strobe.start >= ready).map(|strobe| ExposureEdges {
                    trigger: ready,
                    strobe_start: strobe.start,
                    strobe_end: strobe.end,
                    flash: None,
                })
            }
        };
        if let Some(edges) = edges {
            let length_us = edges.strobe_end.0.saturating_sub(edges.strobe_start.0);
            self.edges = (length_us >= pending.shortest_us).then_some((pending.number, edges));
            self.ready_at =
                BoardMicros(edges.strobe_end.0.saturating_add(u64::from(self.settings.readout.0)));
            self.pending = None;
        } else if inputs.now > pending.deadline {
            self.pending = None;
        }
    }

    /// In the tick of the edges' arrival; an error at the deadline.
    pub(crate) fn result(&self, number: u32) -> Option<Result<ExposureEdges, NoAnswer>> {
        match self.edges {
            Some((of, edges)) if of == number => Some(Ok(edges)),
            _ if self.pending.is_some_and(|pending| pending.number == number) => None,
            _ => Some(Err(NoAnswer)),
        }
    }
}

/// The exposure signal was missing or incomplete.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct NoAnswer;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::StrobeEdges;
    use crate::settings::Settings;

    /// Whether an exposure is good whose signal begins and ends by so much too late and too early.
    fn answer(exposure: Micros, late_us: u64, early_us: u64) -> Option<bool> {
        let mut camera = Camera::new(Settings::DEFAULT.camera);
        let number = camera.trigger(exposure, None, BoardMicros(1_000));
        let end = BoardMicros(1_020 + u64::from(exposure.0) - early_us);
        let edges = ExposureEdges {
            trigger: BoardMicros(1_000),
            strobe_start: BoardMicros(1_020 + late_us),
            strobe_end: end,
            flash: None,
        };
        let now = BoardMicros(end.0 + 100);
        camera.sense(&Inputs { exposure: Some(edges), ..Inputs::idle(now) });
        assert!(!camera.is_ready(now), "it reads out");
        camera.result(number).map(|edges| edges.is_ok())
    }

    #[test]
    fn a_strobe_without_a_start_is_ignored_and_the_read_out_still_awaited() {
        // Found by the campaign: a wire reconnected during an exposure, which was reported 0.86 ms late.
        let of_late = |late_us| answer(Micros(5_884), late_us, 0);
        assert_eq!([0, 90, 859].map(of_late), [Some(true), Some(true), Some(false)]);
    }

    #[test]
    fn a_long_exposure_may_differ_by_the_clocks_of_camera_and_board() {
        let of_early = |early_us| answer(Micros(1_000_000), 0, early_us);
        // 200 ppm and 100 us.
        assert_eq!([0, 150, 300, 301].map(of_early), [Some(true), Some(true), Some(true), Some(false)]);
    }

    #[test]
    fn of_a_camera_that_runs_freely_an_exposure_begun_before_it_was_awaited_is_ignored() {
        let mut camera = Camera::new(Settings::DEFAULT.camera);
        let number = camera.listen(BoardMicros(10_000));
        let of_start = |start| {
            let strobe = StrobeEdges { start: BoardMicros(start), end: BoardMicros(15_000) };
            Inputs { strobe: Some(strobe), ..Inputs::idle(BoardMicros(15_100)) }
        };
        camera.sense(&of_start(9_999));
        assert_eq!((camera.result(number), camera.is_listening()), (None, true));
        camera.sense(&of_start(10_000));
        let edges = ExposureEdges {
            trigger: BoardMicros(10_000),
            strobe_start: BoardMicros(10_000),
            strobe_end: BoardMicros(15_000),
            flash: None,
        };
        assert_eq!((camera.result(number), camera.is_listening()), (Some(Ok(edges)), false));
        // Read-out of 10.5 ms.
        assert_eq!([25_499, 25_500].map(|at| camera.is_ready(BoardMicros(at))), [false, true]);
    }

    #[test]
    fn a_trigger_without_a_strobe_is_given_up_after_its_deadline_and_the_read_out_is_awaited() {
        let mut camera = Camera::new(Settings::DEFAULT.camera);
        let number = camera.trigger(Micros(2_000), None, BoardMicros(1_000));
        // Exposure and 5 ms.
        camera.sense(&Inputs::idle(BoardMicros(8_000)));
        assert_eq!(camera.result(number), None);
        camera.sense(&Inputs::idle(BoardMicros(8_001)));
        assert_eq!(camera.result(number), Some(Err(NoAnswer)));
        assert_eq!([18_499, 18_500].map(|at| camera.is_ready(BoardMicros(at))), [false, true]);
    }
}

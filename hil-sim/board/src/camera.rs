//! The camera's timing: from the trigger's edges to strobe, exposure and frame.
//!
//! A global-shutter camera in trigger-width mode: it collects light while the trigger is high, from 20 us after
//! its edge (with 2 us of jitter), and says so on the strobe; then it reads out for 10 ms and hears no trigger. A
//! command of its host makes it expose once as if triggered 1 ms later, or freely, one exposure a period.

use std::collections::BTreeMap;

use farnear_protocol::camera::FREE_RUNNING;

use crate::plant::Noise;

/// From the trigger's edge to the exposure's.
const LATENCY_NS: f64 = 20_000.0;
/// Standard deviation of the latency.
const JITTER_NS: f64 = 2_000.0;
const READOUT_NS: u64 = 10_000_000;
/// From a command of the host to the exposure: USB and the camera's own program.
const COMMAND_NS: u64 = 1_000_000;

/// What happens to the sensor at a moment.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Edge {
    /// It begins to collect light for the image of this name.
    Begin(u32),
    End,
}

/// A camera that runs freely.
#[derive(Clone, Copy, Debug)]
struct FreeRun {
    period_ns: u64,
    exposure_ns: u64,
}

#[derive(Debug)]
pub struct Camera {
    jitter: Noise,
    coming: BTreeMap<u64, Edge>,
    latency_ns: u64,
    armed: bool,
    busy_until_ns: u64,
    free_run: Option<FreeRun>,
    triggers: u32,
    missed: u32,
    deaf: bool,
    /// A frame's read-out takes so much longer.
    delay_ns: u64,
}

impl Camera {
    /// A camera whose jitter the seed draws.
    pub fn new(seed: u64) -> Self {
        Self {
            jitter: Noise::new(seed, "camera jitter"),
            coming: BTreeMap::new(),
            latency_ns: 0,
            armed: false,
            busy_until_ns: 0,
            free_run: None,
            triggers: 0,
            missed: 0,
            deaf: false,
            delay_ns: 0,
        }
    }

    fn is_busy(&self, now_ns: u64) -> bool {
        self.armed || !self.coming.is_empty() || now_ns < self.busy_until_ns
    }

    fn latency(&mut self) -> u64 {
        let latency_ns = LATENCY_NS + JITTER_NS * self.jitter.normal();
        libm::round(latency_ns.max(0.0)) as u64
    }

    fn schedule(&mut self, begin_ns: u64, exposure_ns: u64, id: u32) {
        let end_ns = begin_ns + exposure_ns.max(1);
        self.coming.insert(begin_ns, Edge::Begin(id));
        self.coming.insert(end_ns, Edge::End);
        self.busy_until_ns = end_ns + READOUT_NS + self.delay_ns;
    }

    /// An edge of the trigger line.
    pub fn trigger(&mut self, now_ns: u64, rising: bool) {
        if rising {
            self.triggers += 1;
            if self.deaf || self.is_busy(now_ns) {
                self.missed += 1;
                return;
            }
            self.armed = true;
            self.latency_ns = self.latency();
            self.coming.insert(now_ns + self.latency_ns, Edge::Begin(self.triggers - 1));
        } else if self.armed {
            self.armed = false;
            // A pulse of no length would end where it began.
            let begin = self.coming.keys().next_back().copied().unwrap_or(0);
            let end = (now_ns + self.latency_ns).max(begin + 1);
            self.coming.insert(end, Edge::End);
            self.busy_until_ns = end + READOUT_NS + self.delay_ns;
        }
    }

    /// The host's software trigger, for an image of this name; waits for the end of a read-out.
    pub fn expose(&mut self, now_ns: u64, exposure_ns: u64, id: u32) {
        if self.armed || !self.coming.is_empty() {
            self.missed += 1;
            return;
        }
        let begin_ns = now_ns.max(self.busy_until_ns) + COMMAND_NS + self.latency();
        self.schedule(begin_ns, exposure_ns, id);
    }

    /// The host lets the camera run freely, or (period 0) stops that.
    pub fn run_freely(&mut self, now_ns: u64, period_ns: u64, exposure_ns: u64) {
        // The next exposure is due a period ahead: one that has not begun never will, and is in no trigger's way.
        if let (Some(run), Some((&begin_ns, Edge::Begin(FREE_RUNNING)))) =
            (self.free_run.take(), self.coming.first_key_value())
            && begin_ns > now_ns
        {
            let last_end_ns = begin_ns + run.exposure_ns - run.period_ns.min(begin_ns);
            self.coming.clear();
            self.busy_until_ns = last_end_ns + READOUT_NS + self.delay_ns;
        }
        if period_ns > 0 {
            let shortest_ns = exposure_ns.max(1) + READOUT_NS;
            self.free_run = Some(FreeRun { period_ns: period_ns.max(shortest_ns), exposure_ns });
            if !self.armed && self.coming.is_empty() {
                let begin_ns = now_ns.max(self.busy_until_ns) + COMMAND_NS;
                self.schedule(begin_ns, exposure_ns, FREE_RUNNING);
            }
        }
    }

    /// When the next edge comes.
    pub fn next_ns(&self) -> Option<u64> {
        self.coming.keys().next().copied()
    }

    /// The next edge that is due.
    pub fn due(&mut self, now_ns: u64) -> Option<(u64, Edge)> {
        let at_ns = self.next_ns().filter(|at_ns| *at_ns <= now_ns)?;
        let edge = self.coming.remove(&at_ns)?;
        if let (Edge::End, Some(run)) = (edge, self.free_run)
            && !self.armed
        {
            let begin_ns = at_ns + run.period_ns - run.exposure_ns;
            self.schedule(begin_ns, run.exposure_ns, FREE_RUNNING);
        }
        Some((at_ns, edge))
    }

    /// Rising edges of the trigger since the board's reset.
    pub fn triggers(&self) -> u32 {
        self.triggers
    }

    /// Triggers that came while the camera was busy, since the start.
    pub fn missed(&self) -> u32 {
        self.missed
    }

    /// It hears no trigger, or hears them again.
    pub fn set_deaf(&mut self, deaf: bool) {
        self.deaf = deaf;
    }

    /// A frame's read-out takes so much longer than it should.
    pub fn set_delay_ns(&mut self, delay_ns: u64) {
        self.delay_ns = delay_ns;
    }

    /// Whether it collects light, or is about to.
    pub fn is_exposing(&self) -> bool {
        self.armed || !self.coming.is_empty()
    }

    /// The board was reset: the triggers are counted anew.
    pub fn board_reset(&mut self) {
        self.triggers = 0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exposure_is_as_long_as_the_pulse_and_readout_is_deaf() {
        let mut camera = Camera::new(1);
        camera.trigger(1_000_000, true);
        let (begin, edge) = camera.due(2_000_000).expect("begins");
        assert_eq!(edge, Edge::Begin(0));
        // 20 us with six standard deviations of jitter.
        assert!((1_008_000..1_032_000).contains(&begin), "{begin}");
        camera.trigger(6_000_000, false);
        assert_eq!(camera.due(6_005_000), None);
        assert_eq!(camera.due(7_000_000), Some((begin + 5_000_000, Edge::End)));
        camera.trigger(16_000_000, true);
        assert_eq!((camera.next_ns(), camera.triggers(), camera.missed()), (None, 2, 1));
        camera.trigger(16_001_000, false);
        camera.trigger(17_000_000, true);
        assert!(camera.next_ns().is_some());
    }

    #[test]
    fn it_exposes_on_command_and_freely() {
        let mut camera = Camera::new(1);
        camera.expose(1_000_000, 5_000_000, 7);
        let (begin, edge) = camera.due(3_000_000).expect("begins");
        assert_eq!((edge, begin > 2_000_000), (Edge::Begin(7), true));
        assert_eq!(camera.due(10_000_000), Some((begin + 5_000_000, Edge::End)));
        assert_eq!(camera.next_ns(), None);

        camera.run_freely(20_000_000, 40_000_000, 5_000_000);
        let mut edges = Vec::new();
        while let Some(edge) = camera.due(130_000_000) {
            edges.push(edge);
        }
        let begins: Vec<u64> =
            edges.iter().filter(|e| e.1 == Edge::Begin(FREE_RUNNING)).map(|e| e.0).collect();
        assert_eq!(begins, [21_000_000, 61_000_000, 101_000_000]);
        camera.run_freely(130_000_000, 0, 0);
        assert_eq!(camera.next_ns(), None, "the next had not begun, so that it hears a trigger at once");
        camera.expose(130_000_000, 5_000_000, 8);
        assert!(camera.next_ns().is_some_and(|begin_ns| begin_ns < 132_000_000), "{:?}", camera.next_ns());

        let mut camera = Camera::new(1);
        camera.run_freely(20_000_000, 40_000_000, 5_000_000);
        assert_eq!(camera.due(21_000_000).map(|e| e.1), Some(Edge::Begin(FREE_RUNNING)));
        camera.run_freely(23_000_000, 0, 0);
        assert_eq!(camera.due(200_000_000), Some((26_000_000, Edge::End)), "what has begun comes to its end");
        assert_eq!(camera.next_ns(), None);
    }
}

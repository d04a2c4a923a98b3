//! Camera timing from trigger edges to strobe, exposure and frame.
//!
//! Global shutter, trigger-width mode: exposure starts 20 us (2 us jitter) after the rising edge and lasts
//! while the trigger is high. Triggers are ignored during the read-out of 10 ms. Software triggers start 1 ms
//! after the command; free running exposes once per period.

use std::collections::BTreeMap;

use farnear_protocol::camera::FREE_RUNNING;

use crate::plant::Noise;

const LATENCY_NS: f64 = 20_000.0;
const JITTER_NS: f64 = 2_000.0;
const READOUT_NS: u64 = 10_000_000;
/// Delay from a host command to the exposure: USB and camera firmware.
const COMMAND_NS: u64 = 1_000_000;

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Edge {
    Begin(u32),
    End,
}

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
    /// Before the exposure that was scheduled last.
    was_busy_until_ns: u64,
    free_run: Option<FreeRun>,
    triggers: u32,
    /// Number of the next exposure by the trigger line.
    next_number: u32,
    missed: u32,
    ignores: bool,
    delay_ns: u64,
}

impl Camera {
    pub fn new(seed: u64) -> Self {
        Self {
            jitter: Noise::new(seed, "camera jitter"),
            coming: BTreeMap::new(),
            latency_ns: 0,
            armed: false,
            busy_until_ns: 0,
            was_busy_until_ns: 0,
            free_run: None,
            triggers: 0,
            next_number: 0,
            missed: 0,
            ignores: false,
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
        self.was_busy_until_ns = self.busy_until_ns;
        self.busy_until_ns = end_ns + READOUT_NS + self.delay_ns;
    }

    pub fn trigger(&mut self, now_ns: u64, rising: bool) {
        if rising {
            self.triggers += 1;
            let number = self.next_number;
            self.next_number = number.wrapping_add(1);
            if self.ignores || self.is_busy(now_ns) {
                self.missed += 1;
                return;
            }
            self.armed = true;
            self.latency_ns = self.latency();
            self.coming.insert(now_ns + self.latency_ns, Edge::Begin(number));
        } else if self.armed {
            self.armed = false;
            // The end must follow the beginning of an exposure.
            let begin = self.coming.keys().next_back().copied().unwrap_or(0);
            let end = (now_ns + self.latency_ns).max(begin + 1);
            self.coming.insert(end, Edge::End);
            self.busy_until_ns = end + READOUT_NS + self.delay_ns;
        }
    }

    /// Software trigger; waits for the end of a read-out.
    pub fn expose(&mut self, now_ns: u64, exposure_ns: u64, id: u32) {
        if self.armed || !self.coming.is_empty() {
            self.missed += 1;
            return;
        }
        let begin_ns = now_ns.max(self.busy_until_ns) + COMMAND_NS + self.latency();
        self.schedule(begin_ns, exposure_ns, id);
    }

    /// Starts free running; period 0 stops it.
    pub fn run_freely(&mut self, now_ns: u64, period_ns: u64, exposure_ns: u64) {
        // An exposure scheduled but not begun is cancelled, so that it does not block triggers.
        if let (Some(_), Some((&begin_ns, Edge::Begin(FREE_RUNNING)))) =
            (self.free_run.take(), self.coming.first_key_value())
            && begin_ns > now_ns
        {
            self.coming.clear();
            self.busy_until_ns = self.was_busy_until_ns;
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

    pub fn next_ns(&self) -> Option<u64> {
        self.coming.keys().next().copied()
    }

    pub fn due(&mut self, now_ns: u64) -> Option<(u64, Edge)> {
        let at_ns = self.next_ns().filter(|at_ns| *at_ns <= now_ns)?;
        let edge = self.coming.remove(&at_ns)?;
        if let (Edge::End, Some(run)) = (edge, self.free_run)
            && !self.armed
        {
            let begin_ns = (at_ns + run.period_ns - run.exposure_ns).max(self.busy_until_ns);
            self.schedule(begin_ns, run.exposure_ns, FREE_RUNNING);
        }
        Some((at_ns, edge))
    }

    /// Rising trigger edges since the board's reset.
    pub fn triggers(&self) -> u32 {
        self.triggers
    }

    /// Triggers that arrived while the camera was busy, since power-on.
    pub fn missed(&self) -> u32 {
        self.missed
    }

    pub fn set_ignores_triggers(&mut self, ignores: bool) {
        self.ignores = ignores;
    }

    pub fn set_delay_ns(&mut self, delay_ns: u64) {
        self.delay_ns = delay_ns;
    }

    pub fn is_exposing(&self) -> bool {
        self.armed || !self.coming.is_empty()
    }

    /// The board's number of its next exposure. It also numbers exposures that the trigger line does not show.
    pub fn board_numbers(&mut self, next: u32) {
        // A report may arrive after the next trigger.
        if next.wrapping_sub(self.next_number) as i32 > 0 {
            self.next_number = next;
        }
    }

    pub fn board_reset(&mut self) {
        (self.triggers, self.next_number) = (0, 0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exposure_lasts_as_long_as_the_pulse_and_readout_ignores_triggers() {
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
    fn triggers_continue_with_the_boards_number() {
        let mut camera = Camera::new(1);
        let begins = [(1, None), (2, Some(7)), (3, Some(5))].map(|(turn, reported)| {
            reported.into_iter().for_each(|next| camera.board_numbers(next));
            camera.trigger(turn * 100_000_000, true);
            camera.trigger(turn * 100_000_000 + 5_000_000, false);
            let begin = camera.due(turn * 100_000_000 + 50_000_000).map(|(_, edge)| edge);
            camera.due(turn * 100_000_000 + 50_000_000);
            begin
        });
        assert_eq!(begins, [0, 7, 8].map(|number| Some(Edge::Begin(number))));
        camera.board_reset();
        camera.trigger(400_000_000, true);
        let first = camera.due(450_000_000).map(|(_, edge)| edge);
        assert_eq!((first, camera.triggers()), (Some(Edge::Begin(0)), 1));
    }

    #[test]
    fn a_free_run_that_ends_before_its_first_exposure_does_not_shorten_the_readout() {
        let mut camera = Camera::new(1);
        camera.trigger(101_000_000, true);
        camera.trigger(106_000_000, false);
        while camera.due(107_000_000).is_some() {}
        camera.run_freely(108_000_000, 40_000_000, 5_000_000);
        camera.run_freely(109_000_000, 0, 0);
        camera.trigger(110_000_000, true);
        camera.trigger(111_000_000, false);
        assert_eq!((camera.next_ns(), camera.missed()), (None, 1));
        camera.trigger(117_000_000, true);
        assert_eq!(camera.missed(), 1, "the readout has ended");
    }

    #[test]
    fn a_slow_readout_delays_a_free_run() {
        let mut camera = Camera::new(1);
        camera.set_delay_ns(50_000_000);
        camera.run_freely(0, 40_000_000, 5_000_000);
        assert_eq!(camera.due(1_000_000), Some((1_000_000, Edge::Begin(FREE_RUNNING))));
        assert_eq!(camera.due(6_000_000), Some((6_000_000, Edge::End)));
        assert_eq!(camera.next_ns(), Some(66_000_000));
    }

    #[test]
    fn exposes_on_command_and_free_running() {
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
        assert_eq!(camera.next_ns(), None, "the next had not begun, so a trigger is accepted immediately");
        camera.expose(130_000_000, 5_000_000, 8);
        assert!(camera.next_ns().is_some_and(|begin_ns| begin_ns < 132_000_000), "{:?}", camera.next_ns());

        let mut camera = Camera::new(1);
        camera.run_freely(20_000_000, 40_000_000, 5_000_000);
        assert_eq!(camera.due(21_000_000).map(|e| e.1), Some(Edge::Begin(FREE_RUNNING)));
        camera.run_freely(23_000_000, 0, 0);
        assert_eq!(
            camera.due(200_000_000),
            Some((26_000_000, Edge::End)),
            "a started exposure ends normally"
        );
        assert_eq!(camera.next_ns(), None);
    }
}

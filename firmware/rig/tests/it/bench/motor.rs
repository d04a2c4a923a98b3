//! A stepper axis: step timer, motor, screw with play, encoder on the motor's shaft, end switches on the stage.

use std::collections::VecDeque;

use farnear_rig::io::{MotorInputs, MotorOutputs, STEP_TIMER_HZ, Segment, StepperState, TICK_US};

const QUEUE: usize = 4;
pub const STEP_UM: f64 = 0.15625;
pub const FAR_SWITCH_UM: f64 = 13_150.0;
/// Distance between closing and opening.
pub const HOME_HYSTERESIS_UM: f64 = 2.0;
/// Microsteps: 4.06 um.
pub const PLAY: i64 = 26;

#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct MotorFaults {
    pub stalled: bool,
    pub timer_dead: bool,
    /// One pulse more per segment.
    pub extra_pulse: bool,
    /// The board loses the segments behind the running one.
    pub queue_lost: bool,
    /// Fixed state of the switch, for every position.
    pub home_switch: Option<bool>,
    pub far_switch: Option<bool>,
    pub driver: bool,
}

pub struct Motor {
    pub faults: MotorFaults,
    queue: VecDeque<Segment>,
    /// Running segment, timer ticks and pulses of it.
    running: Option<(Segment, u32, u16)>,
    counted: u32,
    underrun: bool,
    /// All STEP edges, and the times of the last ones.
    pub edges: u64,
    pub last_edge_us: f64,
    pub closest_edges_us: f64,
    /// The motor, and the stage that it moves at the ends of the play; microsteps from the home switch.
    pub microsteps: i64,
    pub stage: i64,
    pub leftmost: i64,
    pub rightmost: i64,
    home_closed: bool,
    away: bool,
    pub enabled: bool,
    was_cut: bool,
}

impl Motor {
    pub fn new(position_um: f64) -> Self {
        let stage = (position_um / STEP_UM).round() as i64;
        Self {
            faults: MotorFaults::default(),
            queue: VecDeque::new(),
            running: None,
            counted: 0xFFFF_FF00, // wraps soon
            underrun: false,
            edges: 0,
            last_edge_us: f64::NEG_INFINITY,
            closest_edges_us: f64::INFINITY,
            microsteps: stage + PLAY / 2,
            stage,
            leftmost: stage,
            rightmost: stage,
            home_closed: stage <= 0,
            away: false,
            enabled: false,
            was_cut: false,
        }
    }

    pub fn position_um(&self) -> f64 {
        self.stage as f64 * STEP_UM
    }

    /// Timer and driver stop, the mechanics stay.
    pub fn power_off(&mut self) {
        self.queue.clear();
        (self.running, self.enabled, self.underrun) = (None, false, false);
    }

    /// `carried_um`: displacement of the home switch's tab by a piezo on the stage.
    pub fn inputs(&mut self, carried_um: f64) -> MotorInputs {
        let um = self.position_um();
        self.home_closed = um + carried_um <= if self.home_closed { HOME_HYSTERESIS_UM } else { 0.0 };
        MotorInputs {
            // The encoder's zero is arbitrary.
            encoder_counts: (self.microsteps * 5).div_euclid(4) as i32 + 12_345,
            home_switch: self.faults.home_switch.unwrap_or(self.home_closed),
            far_switch: self.faults.far_switch.unwrap_or(um >= FAR_SWITCH_UM),
            driver_fault: self.faults.driver,
            stepper: StepperState {
                pulses: self.counted,
                idle: self.running.is_none() && self.queue.is_empty(),
                underrun: self.underrun,
                room: (QUEUE - self.queue.len()) as u8,
            },
        }
    }

    /// Executes the outputs for a control tick; `cut`: the emergency stop has cut the STEP line.
    pub fn run(&mut self, outputs: &MotorOutputs, now: u64, cut: bool) {
        let idle = self.running.is_none() && self.queue.is_empty();
        // Segments that wait for a dead timer move nothing.
        let moves = !idle && !self.faults.timer_dead;
        assert!(!moves || outputs.direction_away == self.away, "DIR changes in motion");
        assert!(outputs.direction_away == self.away || outputs.segments.is_empty(), "DIR and STEP at once");
        self.away = outputs.direction_away;
        self.enabled = outputs.enable;
        if outputs.abort_steps {
            assert!(outputs.segments.is_empty(), "abort together with segments");
            self.queue.clear();
            self.underrun = false;
            if let Some((segment, ..)) = &mut self.running {
                segment.last = true;
            }
        }
        if cut {
            self.cut();
        }
        self.was_cut = cut;
        for segment in &outputs.segments {
            assert!(self.enabled, "steps for a driver without current");
            assert!(self.queue.len() < QUEUE, "more segments than there is room for");
            self.queue.push_back(*segment);
        }
        if self.faults.queue_lost {
            self.queue.clear();
        }
        if !self.faults.timer_dead {
            self.play(STEP_TIMER_HZ / 1_000_000 * TICK_US, now as f64, cut);
        }
    }

    /// The break input stops the timer, which looks like an underrun.
    pub fn cut(&mut self) {
        if !self.was_cut {
            self.underrun |= !self.queue.is_empty() || self.running.is_some();
            self.queue.clear();
            self.running = None;
            self.was_cut = true;
        }
    }

    fn play(&mut self, ticks: u32, now_us: f64, cut: bool) {
        let mut left = ticks;
        while left > 0 {
            if self.running.is_none() {
                self.running = self.queue.pop_front().map(|segment| (segment, 0, 0));
            }
            let Some((segment, at, given)) = self.running else { return };
            let period = u32::from(segment.period_ticks);
            // The edge comes in the middle of its period.
            let edge = u32::from(given) * period + period / 2;
            let end = u32::from(segment.pulses) * period;
            let next = if given < segment.pulses { edge } else { end };
            if at + left < next {
                self.running = Some((segment, at + left, given));
                return;
            }
            left -= next - at;
            if given < segment.pulses {
                let us = now_us + f64::from(ticks - left) / f64::from(STEP_TIMER_HZ / 1_000_000);
                if !cut {
                    self.edge(us);
                }
                self.running = Some((segment, next, given + 1));
            } else {
                self.counted = self.counted.wrapping_add(u32::from(segment.pulses));
                if self.faults.extra_pulse {
                    self.edge(now_us);
                    self.counted = self.counted.wrapping_add(1);
                }
                self.underrun |= !segment.last && self.queue.is_empty();
                self.running = None;
            }
        }
    }

    fn edge(&mut self, us: f64) {
        self.edges += 1;
        self.closest_edges_us = self.closest_edges_us.min(us - self.last_edge_us);
        self.last_edge_us = us;
        if !self.faults.stalled && self.enabled {
            self.turn(if self.away { 1 } else { -1 });
        }
    }

    pub fn turn(&mut self, microsteps: i64) {
        self.microsteps += microsteps;
        self.stage = self.stage.clamp(self.microsteps - PLAY, self.microsteps);
        self.leftmost = self.leftmost.min(self.stage);
        self.rightmost = self.rightmost.max(self.stage);
    }
}

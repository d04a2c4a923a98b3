//! A model of the rig's hardware: step timer, screw, encoder, switches, piezo, gauge, camera. And its faults.

use std::collections::VecDeque;

use farnear_protocol::{BoardMicros, Micros};
use farnear_rig::io::{
    DAC_FULL_SCALE_NM, ExposureEdges, GAUGE_CODE_ZERO, Inputs, Outputs, STEP_TIMER_HZ, Segment, StepperState,
    TICK_US,
};

/// Length of the board's segment queue.
const QUEUE: usize = 4;
/// The far switch closes here.
pub const FAR_SWITCH_UM: f64 = 13_150.0;
/// Way between closing and opening of the home switch.
const HOME_HYSTERESIS_UM: f64 = 20.0;

/// What can be wrong.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Faults {
    /// Pulses do not move the motor.
    pub stalled: bool,
    /// The step timer does not run.
    pub timer_dead: bool,
    /// The step timer gives one pulse more per segment.
    pub extra_pulse: bool,
    /// The board loses what waits behind the running segment.
    pub queue_lost: bool,
    /// The switch says this whatever the position.
    pub home_switch: Option<bool>,
    /// The switch says this whatever the position.
    pub far_switch: Option<bool>,
    /// The driver's DIAG line.
    pub driver: bool,
    /// The gauge answers this whatever the position.
    pub gauge: Option<Option<u32>>,
    /// The piezo does not move.
    pub piezo_dead: bool,
    /// The camera does not answer.
    pub no_strobe: bool,
}

/// The hardware.
pub struct Hardware {
    pub faults: Faults,
    queue: VecDeque<Segment>,
    /// The running segment, timer ticks into it, pulses given of it.
    running: Option<(Segment, u32, u16)>,
    counted: u32,
    underrun: bool,
    /// All STEP edges, and the times of the last ones in timer ticks.
    pub edges: u64,
    pub last_edge_us: f64,
    pub closest_edges_us: f64,
    /// Microsteps from the home switch.
    pub microsteps: i64,
    pub leftmost: i64,
    pub rightmost: i64,
    home_closed: bool,
    away: bool,
    enabled: bool,
    pub piezo_nm: f64,
    piezo_velocity: f64,
    pub dac: u16,
    random: u64,
    exposure: Option<(BoardMicros, Micros)>,
    /// Rising edges of the trigger: when, and how long.
    pub triggers: Vec<(u64, Micros)>,
    /// How long the camera was exposing when the piezo moved: nm between start and end of the exposure.
    pub piezo_at_trigger: Vec<f64>,
}

impl Hardware {
    pub fn new(position_um: f64) -> Self {
        let microsteps = (position_um / 0.15625).round() as i64;
        Self {
            faults: Faults::default(),
            queue: VecDeque::new(),
            running: None,
            counted: 0xFFFF_FF00, // wraps soon
            underrun: false,
            edges: 0,
            last_edge_us: f64::NEG_INFINITY,
            closest_edges_us: f64::INFINITY,
            microsteps,
            leftmost: microsteps,
            rightmost: microsteps,
            home_closed: microsteps <= 0,
            away: false,
            enabled: false,
            piezo_nm: 0.0,
            piezo_velocity: 0.0,
            dac: 0,
            random: 1,
            exposure: None,
            triggers: Vec::new(),
            piezo_at_trigger: Vec::new(),
        }
    }

    /// Where the screw is.
    pub fn position_um(&self) -> f64 {
        self.microsteps as f64 * 0.15625
    }

    /// What the board reads now.
    pub fn inputs(&mut self, now: BoardMicros) -> Inputs {
        let um = self.position_um();
        self.home_closed = um <= if self.home_closed { HOME_HYSTERESIS_UM } else { 0.0 };
        let gauge = (self.piezo_nm + self.noise() + f64::from(GAUGE_CODE_ZERO)).round();
        let mut exposure = None;
        if let Some((trigger, length)) = self.exposure {
            let strobe_start = BoardMicros(trigger.0 + 20);
            let strobe_end = BoardMicros(strobe_start.0 + u64::from(length.0));
            if strobe_end < now {
                self.exposure = None;
                exposure = Some(ExposureEdges { trigger, strobe_start, strobe_end });
            }
        }
        Inputs {
            now,
            // The encoder's own zero is anywhere.
            encoder_coarse_counts: (self.microsteps * 5).div_euclid(4) as i32 + 12_345,
            gauge_code: self.faults.gauge.unwrap_or(Some(gauge as u32)),
            home_switch: self.faults.home_switch.unwrap_or(self.home_closed),
            far_switch: self.faults.far_switch.unwrap_or(um >= FAR_SWITCH_UM),
            driver_fault: self.faults.driver,
            stepper: StepperState {
                pulses: self.counted,
                idle: self.running.is_none() && self.queue.is_empty(),
                underrun: self.underrun,
                room: (QUEUE - self.queue.len()) as u8,
            },
            exposure: exposure.filter(|_| !self.faults.no_strobe),
        }
    }

    /// Carries the outputs out and lets a control tick pass.
    pub fn run(&mut self, outputs: &Outputs, now: u64) {
        let idle = self.running.is_none() && self.queue.is_empty();
        assert!(idle || outputs.direction_away == self.away, "DIR changes in motion");
        assert!(outputs.direction_away == self.away || outputs.segments.is_empty(), "DIR and STEP at once");
        self.away = outputs.direction_away;
        self.enabled = outputs.enable;
        self.dac = outputs.piezo_dac;
        if outputs.abort_steps {
            assert!(outputs.segments.is_empty(), "abort together with segments");
            self.queue.clear();
            self.underrun = false;
            if let Some((segment, ..)) = &mut self.running {
                segment.last = true;
            }
        }
        for segment in &outputs.segments {
            assert!(self.enabled, "steps for a driver without current");
            assert!(self.queue.len() < QUEUE, "more segments than there is room for");
            self.queue.push_back(*segment);
        }
        if self.faults.queue_lost {
            self.queue.clear();
        }
        if let Some(length) = outputs.trigger {
            assert!(self.exposure.is_none(), "triggered while exposing");
            self.exposure = Some((BoardMicros(now + 10), length));
            self.triggers.push((now + 10, length));
            self.piezo_at_trigger.push(self.piezo_nm);
        }
        if !self.faults.timer_dead {
            self.play(STEP_TIMER_HZ / 1_000_000 * TICK_US, now as f64);
        }
        self.swing();
    }

    /// Plays segments for some timer ticks.
    fn play(&mut self, ticks: u32, now_us: f64) {
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
                self.edge(us);
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
            self.microsteps += if self.away { 1 } else { -1 };
            self.leftmost = self.leftmost.min(self.microsteps);
            self.rightmost = self.rightmost.max(self.microsteps);
        }
    }

    /// The piezo: 200 Hz, damping 0.03, by steps of 10 us.
    fn swing(&mut self) {
        if self.faults.piezo_dead {
            return;
        }
        let target = f64::from(self.dac) / 65_535.0 * f64::from(DAC_FULL_SCALE_NM);
        let omega = 2.0 * std::f64::consts::PI * 200.0;
        for _ in 0..20 {
            let force = omega * omega * (target - self.piezo_nm) - 0.06 * omega * self.piezo_velocity;
            self.piezo_velocity += 10e-6 * force;
            self.piezo_nm += 10e-6 * self.piezo_velocity;
        }
    }

    /// 3 nm RMS, roughly normal.
    fn noise(&mut self) -> f64 {
        let mut sum = -6.0;
        for _ in 0..12 {
            self.random = self.random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            sum += (self.random >> 11) as f64 / (1u64 << 53) as f64;
        }
        3.0 * sum
    }
}

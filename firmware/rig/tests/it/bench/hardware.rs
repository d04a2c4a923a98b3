//! A model of the rig's hardware with faults: two stepper axes, piezo, gauge, camera, safety inputs.

use farnear_protocol::message::{LightLevels, ShotLight};
use farnear_protocol::{BoardMicros, Micros};
use farnear_rig::io::{
    DAC_FULL_SCALE_NM, ExposureEdges, GAUGE_CODE_ZERO, Inputs, Outputs, StrobeEdges, Trigger,
};

use super::motor::Motor;

#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Faults {
    /// Fixed answer of the gauge, for every position.
    pub gauge: Option<Option<u32>>,
    pub piezo_dead: bool,
    pub no_strobe: bool,
    pub emergency_stop: bool,
    pub supply_low: bool,
    pub link_overflow: bool,
    pub memory_failed: bool,
}

pub struct Hardware {
    pub faults: Faults,
    pub coarse: Motor,
    pub lens: Motor,
    pub piezo_nm: f64,
    piezo_velocity: f64,
    pub dac: u16,
    random: u64,
    exposure: Option<(BoardMicros, Micros, Option<ShotLight>)>,
    pub lights: LightLevels,
    pub flash_cancelled: bool,
    pub triggers: Vec<(u64, Micros)>,
    pub piezo_at_trigger: Vec<f64>,
    /// Period and exposure of a free-running camera, us.
    pub free_running: Option<(u64, u64)>,
    /// Start and end of an exposure by the host.
    pub exposed_by_host: Option<(u64, u64)>,
    listened_since: Option<u64>,
}

impl Hardware {
    pub fn new(position_um: f64) -> Self {
        Self {
            faults: Faults::default(),
            coarse: Motor::new(position_um),
            lens: Motor::new(position_um + 500.0),
            piezo_nm: 0.0,
            piezo_velocity: 0.0,
            dac: 0,
            random: 1,
            exposure: None,
            lights: LightLevels::OFF,
            flash_cancelled: false,
            triggers: Vec::new(),
            piezo_at_trigger: Vec::new(),
            free_running: None,
            exposed_by_host: None,
            listened_since: None,
        }
    }

    pub fn position_um(&self) -> f64 {
        self.coarse.position_um()
    }

    /// The mechanics keep their positions.
    pub fn power_off(&mut self) {
        self.coarse.power_off();
        self.lens.power_off();
        (self.dac, self.exposure, self.listened_since) = (0, None, None);
    }

    pub fn inputs(&mut self, now: BoardMicros) -> Inputs {
        Inputs {
            now,
            gauge_code: self.gauge(),
            coarse: self.coarse.inputs(1e-3 * self.piezo_nm),
            lens: self.lens.inputs(0.0),
            emergency_stop: self.faults.emergency_stop,
            supply_low: self.faults.supply_low,
            memory_failed: self.faults.memory_failed,
            link_overflow: self.faults.link_overflow,
            exposure: self.exposure(now),
            strobe: self.strobe(now),
        }
    }

    pub fn gauge(&mut self) -> Option<u32> {
        let code = (self.piezo_nm + self.noise() + f64::from(GAUGE_CODE_ZERO)).round();
        self.faults.gauge.unwrap_or(Some(code as u32))
    }

    /// The triggered exposure, once it is over.
    pub fn exposure(&mut self, now: BoardMicros) -> Option<ExposureEdges> {
        let (trigger, length, flash) = self.exposure?;
        let strobe_start = BoardMicros(trigger.0 + 20);
        let strobe_end = BoardMicros(strobe_start.0 + u64::from(length.0));
        if strobe_end >= now {
            return None;
        }
        self.exposure = None;
        let after = |time: Micros| BoardMicros(trigger.0 + u64::from(time.0));
        let flash = flash.map(|flash| [after(flash.delay), after(Micros(flash.delay.0 + flash.length.0))]);
        (!self.faults.no_strobe).then_some(ExposureEdges { trigger, strobe_start, strobe_end, flash })
    }

    /// An untriggered exposure that ended in the last tick and began while the board listened.
    pub fn strobe(&self, BoardMicros(now): BoardMicros) -> Option<StrobeEdges> {
        let since = self.listened_since.filter(|_| !self.faults.no_strobe)?;
        let last_of = |(period, length): (u64, u64)| {
            let start = now.saturating_sub(length + 1) / period * period;
            (start, start + length)
        };
        let (start, end) = self.exposed_by_host.or(self.free_running.map(last_of))?;
        (start >= since && end < now && now - end <= 200)
            .then_some(StrobeEdges { start: BoardMicros(start), end: BoardMicros(end) })
    }

    pub fn open_circuit(&mut self) {
        self.faults.emergency_stop = true;
        self.coarse.cut();
        self.lens.cut();
    }

    pub fn run(&mut self, outputs: &Outputs, now: u64) {
        self.coarse.run(&outputs.coarse, now, self.faults.emergency_stop);
        self.lens.run(&outputs.lens, now, self.faults.emergency_stop);
        self.dac = outputs.piezo_dac.unwrap_or(self.dac);
        (self.lights, self.flash_cancelled) = (outputs.lights, outputs.cancel_flash);
        if let Some(Trigger { at, length, flash }) = outputs.trigger {
            assert!(self.exposure.is_none(), "triggered while exposing");
            assert!(!outputs.listen, "triggered while listening");
            let rises = at.0.max(now + 10);
            self.exposure = Some((BoardMicros(rises), length, flash));
            self.triggers.push((rises, length));
            self.piezo_at_trigger.push(self.piezo_nm);
        }
        if outputs.listen {
            self.listened_since.get_or_insert(now);
        } else {
            self.listened_since = None;
        }
        self.swing();
    }

    /// 200 Hz, damping 0.03, in steps of 10 us.
    pub fn swing(&mut self) {
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

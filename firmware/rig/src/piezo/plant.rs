//! Piezo model for tests: amplifier, second-order resonance, hysteresis, creep, gauge noise, latency.

use crate::io::{GAUGE_CODE_MAX, GAUGE_CODE_ZERO};

#[derive(Clone, Copy, Debug)]
pub(crate) struct Part {
    pub(crate) resonance_hz: f64,
    /// Width of the major loop / stroke.
    pub(crate) hysteresis: f64,
    /// Creep per decade / step.
    pub(crate) creep: f64,
    /// From the gauge sample to the DAC's output.
    pub(crate) latency_us: usize,
    /// Frequency of a second mode, and its share of a static deflection.
    pub(crate) second: (f64, f64),
}

pub(crate) const NOMINAL: Part =
    Part { resonance_hz: 200.0, hysteresis: 0.0, creep: 0.0, latency_us: 40, second: (700.0, 0.0) };

pub(crate) struct Plant {
    part: Part,
    /// Prandtl-Ishlinskii play operators: half widths and states, nm.
    plays: [(f64, f64); 6],
    /// Creep: first-order lags a decade apart, nm.
    crept: [f64; 5],
    /// Amplifier output, nm.
    drive: f64,
    pub(crate) position: f64,
    velocity: f64,
    /// Position and velocity of the second mode.
    second: (f64, f64),
    code: u16,
    random: u64,
}

impl Plant {
    const DAMPING: f64 = 0.03;
    const SECOND_DAMPING: f64 = 0.02;
    /// Amplifier lag: 5 kHz.
    const AMPLIFIER_S: f64 = 32e-6;
    const STROKE: f64 = 200e3;
    const NOISE: f64 = 3.0;

    pub(crate) fn new(part: Part, seed: u64) -> Self {
        Self {
            part,
            // After a descent from the top each play is at its upper edge: that corner of the loop is 0.
            plays: core::array::from_fn(|i| [Self::STROKE * (i as f64 + 1.0) / 24.0; 2].into()),
            crept: [0.0; 5],
            drive: 0.0,
            position: 0.0,
            velocity: 0.0,
            second: (0.0, 0.0),
            code: 0,
            random: seed,
        }
    }

    /// Sensor position; [`Self::position`] with a single mode.
    pub(crate) fn at(&self) -> f64 {
        self.position + self.part.second.1 * (self.second.0 - self.position)
    }

    /// Gauge with noise: the sum of twelve uniform numbers is nearly normal.
    pub(crate) fn gauge(&mut self) -> Option<u32> {
        let mut noise = -6.0;
        for _ in 0..12 {
            self.random = self.random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            noise += (self.random >> 11) as f64 / (1u64 << 53) as f64;
        }
        let code = self.at() + Self::NOISE * noise + f64::from(GAUGE_CODE_ZERO);
        Some(code.round().clamp(0.0, f64::from(GAUGE_CODE_MAX)) as u32)
    }

    pub(crate) fn tick(&mut self, code: Option<u16>) {
        let before = self.part.latency_us / 10;
        self.run(before);
        self.code = code.unwrap_or(self.code);
        self.run(20 - before);
    }

    fn run(&mut self, steps: usize) {
        let command = f64::from(self.code) / 65_535.0 * Self::STROKE;
        // Six plays of weight w, up to a quarter of the stroke, widen the loop by the sum of 2 w r = 1.75 w *
        // stroke.
        let weight = self.part.hysteresis / 1.75;
        let h = 10e-6;
        for _ in 0..steps {
            self.drive += (command - self.drive) * (1.0 - (-h / Self::AMPLIFIER_S).exp());
            let mut free = self.drive;
            for (half_width, held) in &mut self.plays {
                *held = held.clamp(self.drive - *half_width, self.drive + *half_width);
                // Plays reach stroke - 2 r at the top; the linear share completes it.
                let linear = (1.0 - 2.0 * *half_width / Self::STROKE) * self.drive;
                free += weight * (*held - *half_width - linear);
            }
            let mut target = free;
            for (decade, crept) in self.crept.iter_mut().enumerate() {
                *crept += (free - *crept) * h / (1e-3 * 10f64.powi(decade as i32));
                target += self.part.creep * *crept;
            }
            let omega = 2.0 * core::f64::consts::PI * self.part.resonance_hz;
            let force = omega * omega * (target - self.position);
            self.velocity += h * (force - 2.0 * Self::DAMPING * omega * self.velocity);
            self.position += h * self.velocity;
            let omega = 2.0 * core::f64::consts::PI * self.part.second.0;
            let (position, velocity) = &mut self.second;
            *velocity +=
                h * (omega * omega * (target - *position) - 2.0 * Self::SECOND_DAMPING * omega * *velocity);
            *position += h * *velocity;
        }
    }
}

//! The loop against a model of the piezo: amplifier, second-order resonance, hysteresis, creep, gauge noise,
//! latency.

use super::*;
use crate::settings::Settings;

/// What a piezo may be like.
#[derive(Clone, Copy, Debug)]
struct Part {
    resonance_hz: f64,
    /// Width of the major hysteresis loop as a share of the stroke.
    hysteresis: f64,
    /// Creep per decade of time as a share of the step.
    creep: f64,
    /// From the gauge's sample to the DAC's answer.
    latency_us: usize,
}

const NOMINAL: Part = Part { resonance_hz: 200.0, hysteresis: 0.0, creep: 0.0, latency_us: 40 };

/// A piezo, stepped at 10 us.
struct Plant {
    part: Part,
    /// Prandtl-Ishlinskii hysteresis: half widths of its play operators and what they hold, in nm.
    plays: [(f64, f64); 6],
    /// Creep: first-order lags a decade apart, in nm.
    crept: [f64; 5],
    /// The amplifier's output, in nm.
    drive: f64,
    position: f64,
    velocity: f64,
    code: u16,
    random: u64,
}

impl Plant {
    const DAMPING: f64 = 0.03;
    /// First-order lag of the amplifier: 5 kHz.
    const AMPLIFIER_S: f64 = 32e-6;
    const STROKE: f64 = 200e3;
    const NOISE: f64 = 3.0;

    fn new(part: Part, seed: u64) -> Self {
        Self {
            part,
            // After a descent from the top each play hangs at its upper edge: that corner of the loop is 0.
            plays: core::array::from_fn(|i| [Self::STROKE * (i as f64 + 0.5) / 12.0; 2].into()),
            crept: [0.0; 5],
            drive: 0.0,
            position: 0.0,
            velocity: 0.0,
            code: 0,
            random: seed,
        }
    }

    /// The gauge with its noise: a sum of twelve uniform numbers is normal enough.
    fn gauge(&mut self) -> Option<u32> {
        let mut noise = -6.0;
        for _ in 0..12 {
            self.random = self.random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            noise += (self.random >> 11) as f64 / (1u64 << 53) as f64;
        }
        let code = self.position + Self::NOISE * noise + f64::from(GAUGE_CODE_ZERO);
        Some(code.round().clamp(0.0, f64::from(GAUGE_CODE_MAX)) as u32)
    }

    /// One control tick, in which the DAC gets this code.
    fn tick(&mut self, code: u16) {
        let before = self.part.latency_us / 10;
        self.run(before);
        self.code = code;
        self.run(20 - before);
    }

    fn run(&mut self, steps: usize) {
        let command = f64::from(self.code) / 65_535.0 * Self::STROKE;
        // Six plays of weight w widen the loop by the sum of 2 w r = 6 w * stroke / 2.
        let weight = self.part.hysteresis / 3.0;
        let h = 10e-6;
        for _ in 0..steps {
            self.drive += (command - self.drive) * (1.0 - (-h / Self::AMPLIFIER_S).exp());
            let mut free = self.drive;
            for (half_width, held) in &mut self.plays {
                *held = held.clamp(self.drive - *half_width, self.drive + *half_width);
                // Plays reach stroke - 2 r at the top; the linear share makes up for it.
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
        }
    }
}

/// Moves, and gives the ticks after which the plant itself stays within 50 nm, and its worst overshoot in nm.
fn step(piezo: &mut Piezo, plant: &mut Plant, target: i32) -> (usize, f64) {
    let up = f64::from(target) > plant.position;
    piezo.go(Nanometres(target));
    let (mut settled, mut overshoot) = (0, 0f64);
    for tick in 0..500 {
        let gauge = plant.gauge();
        piezo.sense(gauge);
        plant.tick(piezo.act());
        let error = plant.position - f64::from(target);
        overshoot = overshoot.max(if up { error } else { -error });
        if error.abs() > 50.0 {
            settled = tick + 1;
        }
    }
    (settled, overshoot)
}

#[test]
fn far_to_near_is_inside_50_nm_within_15_ms_whatever_the_part_is_like() {
    let parts = [
        NOMINAL,
        Part { latency_us: 10, ..NOMINAL },
        Part { latency_us: 80, ..NOMINAL },
        Part { resonance_hz: 190.0, ..NOMINAL },
        Part { resonance_hz: 210.0, ..NOMINAL },
        Part { hysteresis: 0.12, ..NOMINAL },
        Part { creep: 0.015, ..NOMINAL },
        Part { hysteresis: 0.12, creep: 0.015, ..NOMINAL },
        Part { resonance_hz: 190.0, hysteresis: 0.12, creep: 0.015, latency_us: 40 },
        Part { resonance_hz: 210.0, hysteresis: 0.12, creep: 0.015, latency_us: 40 },
    ];
    for part in parts {
        for seed in 1..4 {
            let mut piezo = Piezo::new(Settings::DEFAULT.fine);
            let mut plant = Plant::new(part, seed);
            step(&mut piezo, &mut plant, 20_000);
            for target in [176_270, 20_000, 176_270, 20_000] {
                let (ticks, overshoot) = step(&mut piezo, &mut plant, target);
                assert!(ticks as u32 * TICK_US <= 15_000, "{part:?}: {ticks} ticks to {target}");
                // The command is shaped, so what swings is small against the step.
                assert!(overshoot < 0.04 * 156_270.0, "{part:?}: {overshoot} nm beyond {target}");
            }
        }
    }
}

#[test]
fn holding_turns_3_nm_of_gauge_noise_into_less_than_10_nm_of_motion() {
    let mut piezo = Piezo::new(Settings::DEFAULT.fine);
    let mut plant = Plant::new(Part { hysteresis: 0.12, ..NOMINAL }, 1);
    step(&mut piezo, &mut plant, 100_000);
    let (mut squares, mut worst) = (0.0, 0f64);
    for _ in 0..10_000 {
        let gauge = plant.gauge();
        piezo.sense(gauge);
        plant.tick(piezo.act());
        let error = plant.position - 100e3;
        squares += error * error;
        worst = worst.max(error.abs());
    }
    let rms = (squares / 10_000.0).sqrt();
    assert!(rms < 10.0 && worst < 50.0, "{rms} nm RMS, {worst} nm at worst");
}

#[test]
fn both_ends_of_the_range_are_reached_and_held() {
    let fine = Settings::DEFAULT.fine;
    let mut piezo = Piezo::new(fine);
    let mut plant = Plant::new(Part { hysteresis: 0.12, ..NOMINAL }, 5);
    for target in [fine.max.0, fine.min.0, fine.max.0] {
        let (ticks, _) = step(&mut piezo, &mut plant, target);
        assert!(ticks < 150, "{ticks} ticks to {target}");
    }
}

#[test]
fn a_dead_gauge_opens_the_loop_and_holds_the_command() {
    let mut piezo = Piezo::new(Settings::DEFAULT.fine);
    let mut plant = Plant::new(NOMINAL, 1);
    step(&mut piezo, &mut plant, 100_000);
    let held = piezo.act();
    for silent in [None, Some(0), Some(GAUGE_CODE_MAX)] {
        for _ in 0..10 {
            piezo.sense(silent);
            piezo.act();
        }
        assert!(piezo.gauge_failed());
        assert!(piezo.act().abs_diff(held) < 20, "{} after {held}", piezo.act());
        piezo.go(Nanometres(20_000));
    }
    // It comes back: the next move begins without a jump.
    let gauge = plant.gauge();
    piezo.sense(gauge);
    assert!(!piezo.gauge_failed());
    assert!(step(&mut piezo, &mut plant, 20_000).0 <= 75);
}

#[test]
fn a_single_lost_conversion_is_bridged() {
    let mut piezo = Piezo::new(Settings::DEFAULT.fine);
    let mut plant = Plant::new(NOMINAL, 1);
    step(&mut piezo, &mut plant, 100_000);
    for tick in 0..200 {
        let gauge = plant.gauge().filter(|_| tick % 3 > 0);
        piezo.sense(gauge);
        plant.tick(piezo.act());
        assert!((plant.position - 100e3).abs() < 50.0, "{}", plant.position);
    }
}

#[test]
fn holding_a_moving_piezo_ends_the_move() {
    let mut piezo = Piezo::new(Settings::DEFAULT.fine);
    let mut plant = Plant::new(NOMINAL, 1);
    step(&mut piezo, &mut plant, 20_000);
    piezo.go(Nanometres(170_000));
    for _ in 0..13 {
        let gauge = plant.gauge();
        piezo.sense(gauge);
        plant.tick(piezo.act());
    }
    piezo.hold();
    let here = piezo.target().0;
    assert!((20_000..170_000).contains(&here), "{here}");
    assert!(step(&mut piezo, &mut plant, here).0 <= 75);
}

#[test]
fn any_gauge_keeps_the_loop_in_bounds() {
    let mut piezo = Piezo::new(Settings::DEFAULT.fine);
    let mut random = 1u64;
    for tick in 0..200_000 {
        random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        let wild = (random >> 40) as u32 & GAUGE_CODE_MAX;
        piezo.sense(Some(wild.clamp(1, GAUGE_CODE_MAX - 1)));
        if tick % 100 == 0 {
            piezo.go(Nanometres((random >> 33) as i32 % 200_000));
        }
        piezo.act(); // overflow checks are on
    }
}

#[test]
fn any_way_settles_in_time() {
    let mut piezo = Piezo::new(Settings::DEFAULT.fine);
    let part = Part { resonance_hz: 205.0, hysteresis: 0.12, creep: 0.015, latency_us: 50 };
    let mut plant = Plant::new(part, 3);
    let mut random = 99u64;
    for _ in 0..200 {
        random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        let target = 5_000 + (random >> 33) as i32 % 190_001;
        let (ticks, _) = step(&mut piezo, &mut plant, target);
        assert!(ticks as u32 * TICK_US <= 15_000, "{ticks} ticks to {target}");
    }
}

//! The fine stage: amplifier, piezo with hysteresis and creep, flexure with the sensor board.
//!
//! - Amplifier: first order, 5 kHz.
//! - Hysteresis: Prandtl & Ishlinskii, ten play operators (Kuhnen, European J. Control 9, 2003, sec. 2); the
//!   full loop is 12 % of the stroke wide, closed at both ends.
//! - Creep: 1.5 % of the stroke per decade from 0.1 s to 1000 s, four first-order lags.
//! - Flexure: second order, 200 Hz, damping 0.03; optional second mode (`parts.toml`).
//! - Tension: inertia may pull the stack, which tolerates little. The maximum is recorded; nothing breaks.
//!
//! Solved exactly over steps of [`Piezo::STEP_NS`] with a constant drive: 0.2 us of host time per step.

use crate::parts::PiezoParts;

/// Free stroke at full voltage, micrometres; also the DAC's full scale.
const STROKE_UM: f64 = 200.0;
const DAC_MAX: f64 = 65_535.0;
const AMPLIFIER_HZ: f64 = 5_000.0;
const RESONANCE_HZ: f64 = 200.0;
const DAMPING: f64 = 0.03;
/// Width of the full loop, share of the stroke.
const HYSTERESIS: f64 = 0.12;
const PLAYS: usize = 10;
/// Creep per decade, and the lags' time constants in seconds.
const CREEP: f64 = 0.015;
const CREEP_S: [f64; 4] = [0.3, 3.0, 30.0, 300.0];

#[derive(Debug)]
pub struct Piezo {
    code: u16,
    /// Amplifier output as stroke, micrometres.
    drive_um: f64,
    plays_um: [f64; PLAYS],
    creep_um: [f64; CREEP_S.len()],
    first: Mode,
    second: Mode,
    parts: PiezoParts,
    pulled_um: f64,
    largest_step: u16,
    full_step: Propagator,
}

#[derive(Clone, Copy, Debug, Default)]
struct Mode {
    position_um: f64,
    velocity_um_s: f64,
}

impl Mode {
    fn step(&mut self, rest_um: f64, by: &Oscillation) {
        let (deviation, velocity) = (self.position_um - rest_um, self.velocity_um_s);
        self.position_um = rest_um + by.xx * deviation + by.xv * velocity;
        self.velocity_um_s = by.vx * deviation + by.vv * velocity;
    }
}

#[derive(Clone, Copy, Debug)]
struct Oscillation {
    xx: f64,
    xv: f64,
    vx: f64,
    vv: f64,
}

impl Oscillation {
    fn over(seconds: f64, resonance_hz: f64, damping: f64) -> Self {
        let omega = core::f64::consts::TAU * resonance_hz;
        let decay = damping * omega;
        let damped = omega * libm::sqrt(1.0 - damping * damping);
        let fade = libm::exp(-decay * seconds);
        let (sin, cos) = (libm::sin(damped * seconds), libm::cos(damped * seconds));
        Self {
            xx: fade * (cos + decay / damped * sin),
            xv: fade * sin / damped,
            vx: -fade * omega * omega / damped * sin,
            vv: fade * (cos - decay / damped * sin),
        }
    }
}

#[derive(Clone, Copy, Debug)]
struct Propagator {
    first: Oscillation,
    second: Oscillation,
    amplifier: f64,
    creep: [f64; CREEP_S.len()],
}

impl Propagator {
    fn over(seconds: f64, parts: &PiezoParts) -> Self {
        let first = Oscillation::over(seconds, RESONANCE_HZ, DAMPING);
        let second = if parts.second_mode_share > 0.0 {
            Oscillation::over(seconds, parts.second_mode_hz, parts.second_mode_damping)
        } else {
            first
        };
        Self {
            first,
            second,
            amplifier: libm::exp(-core::f64::consts::TAU * AMPLIFIER_HZ * seconds),
            creep: CREEP_S.map(|tau| libm::exp(-seconds / tau)),
        }
    }
}

/// Radius of play `i`, up to a quarter of the stroke: wider ones would not close in mid-loop.
fn radius_um(i: usize) -> f64 {
    0.25 * STROKE_UM * (i + 1) as f64 / PLAYS as f64
}

/// Weight of each play: the widths 2 r w add up to the full loop.
fn play_weight() -> f64 {
    let radii: f64 = (0..PLAYS).map(radius_um).sum();
    HYSTERESIS * STROKE_UM / (2.0 * radii)
}

impl Piezo {
    pub const STEP_NS: u64 = 20_000;

    pub fn new(parts: PiezoParts) -> Self {
        Self {
            code: 0,
            drive_um: 0.0,
            // State after a descent from full drive: the loop's lower left corner is position 0.
            plays_um: core::array::from_fn(radius_um),
            creep_um: [0.0; CREEP_S.len()],
            first: Mode::default(),
            second: Mode::default(),
            pulled_um: 0.0,
            largest_step: 0,
            full_step: Propagator::over(Self::STEP_NS as f64 * 1e-9, &parts),
            parts,
        }
    }

    pub fn set_dac(&mut self, code: u16) {
        self.largest_step = self.largest_step.max(code.abs_diff(self.code));
        self.code = code;
    }

    /// A code that the firmware did not send.
    pub fn disturb_dac(&mut self, code: u16) {
        self.code = code;
    }

    /// Largest change of the firmware's codes from one to the next, micrometres.
    pub fn largest_step_um(&self) -> f64 {
        f64::from(self.largest_step) / DAC_MAX * STROKE_UM
    }

    pub fn dac(&self) -> u16 {
        self.code
    }

    /// True position of the sensor board, micrometres from relaxed.
    pub fn position_um(&self) -> f64 {
        let Mode { position_um, .. } = self.first;
        position_um + self.parts.second_mode_share * (self.second.position_um - position_um)
    }

    /// Largest tension so far as elongation; divided by the stroke it is the share of the blocking force.
    pub fn pulled_um(&self) -> f64 {
        self.pulled_um
    }

    /// Static stroke of the drive with hysteresis, without creep.
    fn strain_um(&mut self) -> f64 {
        let u = self.drive_um;
        let weight = play_weight();
        let mut sum = 0.0;
        for (i, play) in self.plays_um.iter_mut().enumerate() {
            let r = radius_um(i);
            *play = play.min(u + r).max(u - r);
            sum += weight * (*play - r);
        }
        // The linear share completes the stroke at full drive: plays give `stroke - 2 r` there.
        let plays_at_top: f64 = (0..PLAYS).map(|i| weight * (STROKE_UM - 2.0 * radius_um(i))).sum();
        u * (1.0 - plays_at_top / STROKE_UM) + sum
    }

    /// Advances at most [`Piezo::STEP_NS`].
    pub fn step(&mut self, nanoseconds: u64) {
        let by = if nanoseconds == Self::STEP_NS {
            self.full_step
        } else {
            Propagator::over(nanoseconds as f64 * 1e-9, &self.parts)
        };
        let asked_um = f64::from(self.code) / DAC_MAX * STROKE_UM;
        self.drive_um = asked_um + (self.drive_um - asked_um) * by.amplifier;
        let strain_um = self.strain_um();
        for (creep, keeps) in self.creep_um.iter_mut().zip(by.creep) {
            *creep = CREEP * strain_um + (*creep - CREEP * strain_um) * keeps;
        }
        let rest_um = strain_um + self.creep_um.iter().sum::<f64>();
        self.first.step(rest_um, &by.first);
        self.second.step(rest_um, &by.second);
        self.pulled_um = self.pulled_um.max(self.position_um() - rest_um);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parts::Parts;

    fn run(piezo: &mut Piezo, code: u16, seconds: f64) -> Vec<f64> {
        piezo.set_dac(code);
        (0..(seconds / 20e-6) as usize)
            .map(|_| {
                piezo.step(Piezo::STEP_NS);
                piezo.position_um()
            })
            .collect()
    }

    #[test]
    fn a_step_rings_at_200_hz_and_decays_with_its_damping() {
        let mut piezo = Piezo::new(Parts::default().piezo);
        let path = run(&mut piezo, 6554, 0.05);
        let end = *run(&mut piezo, 6554, 0.5).last().expect("not empty");
        let peaks: Vec<usize> =
            (1..path.len() - 1).filter(|&i| path[i] > path[i - 1] && path[i] >= path[i + 1]).collect();
        // Peaks one damped period apart: 5.002 ms = 250 steps; and smaller by exp(-2 pi 0.03).
        assert!((249..=252).contains(&(peaks[1] - peaks[0])), "{peaks:?}");
        let ratio = (path[peaks[1]] - end) / (path[peaks[0]] - end);
        assert!((ratio - 0.828).abs() < 0.02, "{ratio}");
    }

    #[test]
    fn a_second_mode_adds_its_share_of_ringing() {
        let parts = PiezoParts { second_mode_hz: 800.0, second_mode_share: 0.1, ..Parts::default().piezo };
        let [mut with, mut without] = [parts, Parts::default().piezo].map(Piezo::new);
        let [a, b] = [&mut with, &mut without].map(|piezo| run(piezo, 6554, 0.02));
        // A tenth of 17.6 um plus the overshoot; during one swing of the second mode the first has hardly
        // moved.
        let most = a.iter().zip(&b).take(63).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!((1.0..5.0).contains(&most), "{most}");
        let [a, b] = [&mut with, &mut without].map(|piezo| *run(piezo, 6554, 0.5).last().expect("not empty"));
        assert!((a - b).abs() < 1e-6, "a slow drive moves both alike: {a} {b}");
    }

    #[test]
    fn releasing_a_stretched_stack_in_a_step_puts_it_under_tension_and_a_ramp_does_not() {
        let mut piezo = Piezo::new(Parts::default().piezo);
        for code in 0..=52_000 / 20 {
            run(&mut piezo, 20 * code, 40e-6);
        }
        assert!(piezo.pulled_um() < 2.0, "{} um by a ramp of 0.1 s", piezo.pulled_um());
        let before_um = piezo.position_um();
        run(&mut piezo, 0, 0.05);
        // Nearly the full step, reduced by hysteresis, creep and the amplifier's delay.
        assert!((0.7..1.0).contains(&(piezo.pulled_um() / before_um)), "{} um", piezo.pulled_um());
    }

    #[test]
    fn the_full_loop_is_twelve_percent_wide_and_closed_at_both_ends() {
        // Strain alone: creep and ringing are excluded.
        let mut piezo = Piezo::new(Parts::default().piezo);
        let mut at = |um: f64| {
            piezo.drive_um = um;
            piezo.strain_um()
        };
        let up: Vec<f64> = (0..=200).map(|i| at(f64::from(i))).collect();
        let down: Vec<f64> = (0..=200).rev().map(|i| at(f64::from(i))).collect();
        assert!(up[0].abs() < 1e-9 && down[200].abs() < 1e-9 && (up[200] - 200.0).abs() < 1e-9);
        let width = (0..=200).map(|i| down[200 - i] - up[i]).fold(0.0, f64::max);
        assert!((width / 200.0 - HYSTERESIS).abs() < 0.005, "{width}");
    }

    #[test]
    fn a_constant_drive_creeps_by_a_fixed_share_per_decade() {
        let mut piezo = Piezo::new(Parts::default().piezo);
        run(&mut piezo, 32_768, 1.0);
        let early = piezo.position_um();
        run(&mut piezo, 32_768, 9.0);
        let late = piezo.position_um();
        let creep = (late - early) / early;
        // First-order lags only approximate a logarithm: within a third.
        assert!((creep - CREEP).abs() < CREEP / 3.0, "{creep}");
    }
}

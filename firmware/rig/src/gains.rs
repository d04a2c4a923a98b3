//! Control gains of the piezo, computed at compile time from physical numbers.
//!
//! The piezo with the sensor is a lightly damped second-order system. With position `p`, scaled velocity
//! `w = v / omega`, both in nm, and the commanded free stroke `u`:
//! ```text
//! d/dt [p]   [   0          omega     ] [p]   [  0  ]
//!      [w] = [-omega  -2 zeta omega   ] [w] + [omega] (u + d)
//! ```
//! `d` is the effect of hysteresis and creep. Sampled with a zero-order hold at the control tick (Franklin, Powell,
//! Workman 1998, "Digital Control of Dynamic Systems", ch. 4) this gives
//! - the input shaper: two zero-vibration stages (Singer and Seering 1990) on the tick grid, together a ZVD;
//! - a current observer for `p`, `w`, `d` and the drift of `d` (ibid. section 8.2), whose estimated disturbance is
//!   subtracted from the command as integral control;
//! - state feedback that damps the resonance; both by Ackermann's formula.
//!
//! Gains are integers in 2^-24. Nothing here runs on the board.

use crate::matrix::{Matrix, add_scaled, apply, exponential, identity, product, solve};

pub(crate) const GAIN_BITS: u32 = 24;

#[derive(Clone, Copy, PartialEq, Debug)]
pub struct PiezoModel {
    /// First resonance with the sensor board mounted.
    pub resonance_hz: f64,
    pub damping: f64,
    pub tick_s: f64,
    /// From the gauge sample to the DAC's effect; less than a tick.
    pub latency_s: f64,
    pub feedback: Poles,
    /// Poles of the observer: two equal pairs.
    pub observer: Poles,
}

/// Controller gains in 2^-24.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Gains {
    /// Per tick, by rows.
    pub(crate) transition: [[i32; 2]; 2],
    /// Effect of the command after the latency.
    pub(crate) input: [i32; 2],
    /// Effect of the previous command during the latency.
    pub(crate) input_before: [i32; 2],
    /// Feedback of position and scaled velocity errors.
    pub(crate) feedback: [i32; 2],
    /// Correction of position, scaled velocity, disturbance and drift per nm of innovation.
    pub(crate) observer: [i32; 4],
    pub(crate) shaper: ShaperGains,
}

/// A zero-vibration stage: `out[k] = now x[k] + early x[k - half] + late x[k - half - 1]`; the weights sum to 1.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct ShaperGains {
    /// Whole ticks in half a resonance period.
    pub(crate) half: usize,
    pub(crate) now: i32,
    pub(crate) early: i32,
    pub(crate) late: i32,
}

/// A pair of poles: natural frequency and damping ratio.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Poles {
    pub hz: f64,
    pub damping: f64,
}

impl Gains {
    /// The resonance must be between 1/60 and 1/6 of the tick rate.
    pub const fn design(model: &PiezoModel) -> Self {
        let (a, b) = sampled(model, model.tick_s);
        let (rest, b_after) = sampled(model, model.tick_s - model.latency_s);
        let b_before = apply(&rest, &sampled(model, model.latency_s).1);

        // Ackermann: K = [0 1] [B AB]^-1 phi(A)
        let ab = apply(&a, &b);
        let last_row = solve(&[[b[0], b[1]], [ab[0], ab[1]]], &[0.0, 1.0]);
        let phi = characteristic(&a, model.feedback, model.tick_s);
        let feedback = [
            last_row[0] * phi[0][0] + last_row[1] * phi[1][0],
            last_row[0] * phi[0][1] + last_row[1] * phi[1][1],
        ];

        // The dual for the states [p, w, d, drift]: L = A^-1 phi(A) [C; CA; CAA; CAAA]^-1 [0 0 0 1]'
        let full: Matrix<4> = [
            [a[0][0], a[0][1], b[0], 0.0],
            [a[1][0], a[1][1], b[1], 0.0],
            [0.0, 0.0, 1.0, 1.0],
            [0.0, 0.0, 0.0, 1.0],
        ];
        let full2 = product(&full, &full);
        let full3 = product(&full2, &full);
        let seen: Matrix<4> = [[1.0, 0.0, 0.0, 0.0], full[0], full2[0], full3[0]];
        let pair = characteristic(&full, model.observer, model.tick_s);
        let column = solve(&seen, &[0.0, 0.0, 0.0, 1.0]);
        let observer = solve(&full, &apply(&product(&pair, &pair), &column));

        Self {
            transition: [[fixed(a[0][0]), fixed(a[0][1])], [fixed(a[1][0]), fixed(a[1][1])]],
            input: [fixed(b_after[0]), fixed(b_after[1])],
            input_before: [fixed(b_before[0]), fixed(b_before[1])],
            feedback: [fixed(feedback[0]), fixed(feedback[1])],
            observer: [fixed(observer[0]), fixed(observer[1]), fixed(observer[2]), fixed(observer[3])],
            shaper: shaper(model),
        }
    }
}

/// Free motion `d/dt [p, w]` of a second-order system.
const fn continuous(hz: f64, damping: f64) -> Matrix<2> {
    let omega = 2.0 * core::f64::consts::PI * hz;
    [[0.0, omega], [-omega, -2.0 * damping * omega]]
}

/// Transition and input of the model over a time with constant command.
const fn sampled(model: &PiezoModel, time_s: f64) -> (Matrix<2>, [f64; 2]) {
    let [m0, m1] = continuous(model.resonance_hz, model.damping);
    let omega = m0[1];
    let held = exponential(&scaled(&[[m0[0], m0[1], 0.0], [m1[0], m1[1], omega], [0.0; 3]], time_s));
    ([[held[0][0], held[0][1]], [held[1][0], held[1][1]]], [held[0][2], held[1][2]])
}

const fn scaled<const N: usize>(a: &Matrix<N>, factor: f64) -> Matrix<N> {
    add_scaled(&[[0.0; N]; N], a, factor)
}

/// `a` in the characteristic polynomial of a sampled pole pair: `a^2 - trace a + determinant`.
const fn characteristic<const N: usize>(a: &Matrix<N>, poles: Poles, tick_s: f64) -> Matrix<N> {
    let sampled = exponential(&scaled(&continuous(poles.hz, poles.damping), tick_s));
    let trace = sampled[0][0] + sampled[1][1];
    let determinant = sampled[0][0] * sampled[1][1] - sampled[0][1] * sampled[1][0];
    add_scaled(&add_scaled(&product(a, a), a, -trace), &identity::<N>(), determinant)
}

/// Weights without residual vibration: `now + early M^-half + late M^-(half + 1) = 0` for the free motion `M` per tick,
/// and `now + early + late = 1`. Each `M^-n` is `x + y F` (Cayley and Hamilton), which gives three linear equations.
const fn shaper(model: &PiezoModel) -> ShaperGains {
    let half = (0.5 / (model.resonance_hz * model.tick_s)) as usize;
    let motion = continuous(model.resonance_hz, model.damping);
    let early = exponential(&scaled(&motion, -(half as f64) * model.tick_s));
    let late = exponential(&scaled(&motion, -(half as f64 + 1.0) * model.tick_s));
    let weights =
        solve(&[[1.0, early[0][0], late[0][0]], [0.0, early[0][1], late[0][1]], [1.0; 3]], &[0.0, 0.0, 1.0]);
    let (early, late) = (fixed(weights[1]), fixed(weights[2]));
    ShaperGains { half, now: (1 << GAIN_BITS) - early - late, early, late }
}

const fn fixed(gain: f64) -> i32 {
    let scaled = gain * (1i64 << GAIN_BITS) as f64;
    (if scaled < 0.0 { scaled - 0.5 } else { scaled + 0.5 }) as i32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::Settings;

    const GAINS: Gains = Settings::DEFAULT.fine.gains;

    fn real(gain: i32) -> f64 {
        f64::from(gain) / f64::from(1 << GAIN_BITS)
    }

    #[test]
    fn the_shaper_has_a_zero_at_the_resonance() {
        // The zero-vibration condition with sines and cosines (Singer and Seering, eq. 7): sum of w_i
        // exp(zeta omega t_i) exp(j omega_d t_i) = 0.
        let omega = core::f64::consts::TAU * 200.0;
        let (grow, swing) = (0.03 * omega, omega * (1.0f64 - 0.03 * 0.03).sqrt());
        let shaper = GAINS.shaper;
        let taps = [(0, shaper.now), (shaper.half, shaper.early), (shaper.half + 1, shaper.late)];
        let (mut cosine, mut sine) = (0.0, 0.0);
        for (ticks, weight) in taps {
            let t = ticks as f64 * 200e-6;
            cosine += real(weight) * (grow * t).exp() * (swing * t).cos();
            sine += real(weight) * (grow * t).exp() * (swing * t).sin();
        }
        assert!(cosine.abs() < 1e-6 && sine.abs() < 1e-6, "{cosine} {sine}");
        assert!(taps.iter().all(|(_, weight)| *weight > 0));
        assert_eq!(taps.iter().map(|(_, weight)| weight).sum::<i32>(), 1 << GAIN_BITS);
    }

    #[test]
    fn the_model_rings_at_its_resonance_and_has_gain_one() {
        let [[a, b], [c, d]] = GAINS.transition.map(|row| row.map(real));
        // Trace and determinant of a sampled pair of poles in closed form.
        let (omega, t) = (core::f64::consts::TAU * 200.0, 200e-6);
        let fade = (-0.03 * omega * t).exp();
        assert!((a + d - 2.0 * fade * (omega * t * (1.0f64 - 0.03 * 0.03).sqrt()).cos()).abs() < 1e-6);
        assert!((a * d - b * c - fade * fade).abs() < 1e-6);
        // At rest under a constant command of 1: p = 1, w = 0.
        for (row, from_position, rest) in [(0, a, 1.0), (1, c, 0.0)] {
            let next = from_position + real(GAINS.input[row]) + real(GAINS.input_before[row]);
            assert!((next - rest).abs() < 1e-6, "{next}");
        }
    }

    #[test]
    fn feedback_puts_the_poles_where_they_were_asked() {
        let model = GAINS.transition.map(|row| row.map(real));
        let input = [0, 1].map(|i| real(GAINS.input[i]) + real(GAINS.input_before[i]));
        let gain = GAINS.feedback.map(real);
        let closed = [0, 1].map(|i| [0, 1].map(|j| model[i][j] - input[i] * gain[j]));
        // 200 Hz, critically damped: a double pole at exp(-omega t).
        let pole = (-core::f64::consts::TAU * 200.0 * 200e-6).exp();
        assert!((closed[0][0] + closed[1][1] - 2.0 * pole).abs() < 1e-5);
        assert!((closed[0][0] * closed[1][1] - closed[0][1] * closed[1][0] - pole * pole).abs() < 1e-5);
    }

    #[test]
    fn the_observer_forgets_a_wrong_start() {
        // Observer errors follow A (I - L C) and decay within 40 ticks (four poles at exp(-2 pi 500 / 5000) =
        // 0.53).
        let a = GAINS.transition.map(|row| row.map(real));
        let b = [0, 1].map(|i| real(GAINS.input[i]) + real(GAINS.input_before[i]));
        let mut error = [1.0, 1.0, 1.0, 1.0];
        for _ in 0..40 {
            let innovation = error[0];
            let corrected: [f64; 4] =
                core::array::from_fn(|i| error[i] - real(GAINS.observer[i]) * innovation);
            let [p, w, d, drift] = corrected;
            error = [
                a[0][0] * p + a[0][1] * w + b[0] * d,
                a[1][0] * p + a[1][1] * w + b[1] * d,
                d + drift,
                drift,
            ];
        }
        assert!(error.iter().all(|e| e.abs() < 1e-4), "{error:?}");
    }
}

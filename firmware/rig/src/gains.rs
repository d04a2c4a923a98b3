//! Control gains of the piezo, worked out by the compiler from a few physical numbers.
//!
//! The piezo with the sensor on it is a lightly damped second-order system. With position `p` and scaled velocity
//! `w = v / omega`, both in nm, and the commanded free stroke `u`:
//! ```text
//! d/dt [p]   [   0          omega     ] [p]   [  0  ]
//!      [w] = [-omega  -2 zeta omega   ] [w] + [omega] (u + d)
//! ```
//! `d` is what hysteresis and creep add to the command. Sampled with a zero-order hold at the control tick
//! (Franklin, Powell, Workman 1998, "Digital Control of Dynamic Systems", ch. 4) this gives
//! - the input shaper: two zero-vibration stages (Singer and Seering 1990) on the tick grid, together a ZVD;
//! - a current observer for `p`, `w`, `d` and the drift of `d` (ibid. section 8.2), which is integral control: the
//!   estimated disturbance is taken off the command;
//! - state feedback that damps the resonance; both by Ackermann's formula.
//!
//! Gains are integers in 2^-24. Nothing here runs on the board.

use crate::matrix::{Matrix, add_scaled, apply, exponential, identity, product, solve};

/// Fraction bits of a gain.
pub(crate) const GAIN_BITS: u32 = 24;

/// What is known of the piezo.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct PiezoModel {
    /// First resonance with the sensor board mounted.
    pub resonance_hz: f64,
    /// Its damping ratio.
    pub damping: f64,
    /// Control period in seconds.
    pub tick_s: f64,
    /// From sampling the gauge to the DAC's answer to it, in seconds; less than a tick.
    pub latency_s: f64,
    /// Where state feedback puts the resonance.
    pub feedback: Poles,
    /// Where the observer's errors die away: two equal pairs.
    pub observer: Poles,
}

/// Everything the piezo's control loop multiplies with, in 2^-24.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Gains {
    /// State transition over a tick, rows first.
    pub(crate) transition: [[i32; 2]; 2],
    /// Effect of the command over the rest of its tick, after the latency.
    pub(crate) input: [i32; 2],
    /// Effect of the command of the tick before, during the latency.
    pub(crate) input_before: [i32; 2],
    /// Feedback of position and scaled velocity errors.
    pub(crate) feedback: [i32; 2],
    /// Correction of position, scaled velocity, disturbance and drift per nm of surprise.
    pub(crate) observer: [i32; 4],
    /// One zero-vibration stage.
    pub(crate) shaper: ShaperGains,
}

/// A zero-vibration stage: `out[k] = now x[k] + early x[k - half] + late x[k - half - 1]`; the weights sum to 1.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct ShaperGains {
    /// Whole ticks in half a period of the resonance.
    pub(crate) half: usize,
    /// Weight of the present sample; the other two follow.
    pub(crate) now: i32,
    /// Weight of the sample `half` ticks ago.
    pub(crate) early: i32,
    /// Weight of the sample `half + 1` ticks ago.
    pub(crate) late: i32,
}

/// A pair of poles: natural frequency in Hz and damping ratio.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Poles {
    /// Natural frequency.
    pub hz: f64,
    /// Damping ratio.
    pub damping: f64,
}

impl Gains {
    /// Designs the gains. The resonance must lie between a sixtieth and a sixth of the tick rate.
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

/// The free motion `d/dt [p, w]` of a second-order system.
const fn continuous(hz: f64, damping: f64) -> Matrix<2> {
    let omega = 2.0 * core::f64::consts::PI * hz;
    [[0.0, omega], [-omega, -2.0 * damping * omega]]
}

/// Transition and input of the model over a time with the command held.
const fn sampled(model: &PiezoModel, time_s: f64) -> (Matrix<2>, [f64; 2]) {
    let [m0, m1] = continuous(model.resonance_hz, model.damping);
    let omega = m0[1];
    let held = exponential(&scaled(&[[m0[0], m0[1], 0.0], [m1[0], m1[1], omega], [0.0; 3]], time_s));
    ([[held[0][0], held[0][1]], [held[1][0], held[1][1]]], [held[0][2], held[1][2]])
}

const fn scaled<const N: usize>(a: &Matrix<N>, factor: f64) -> Matrix<N> {
    add_scaled(&[[0.0; N]; N], a, factor)
}

/// `a` put into the characteristic polynomial of a sampled pair of poles: `a^2 - trace a + determinant`.
const fn characteristic<const N: usize>(a: &Matrix<N>, poles: Poles, tick_s: f64) -> Matrix<N> {
    let sampled = exponential(&scaled(&continuous(poles.hz, poles.damping), tick_s));
    let trace = sampled[0][0] + sampled[1][1];
    let determinant = sampled[0][0] * sampled[1][1] - sampled[0][1] * sampled[1][0];
    add_scaled(&add_scaled(&product(a, a), a, -trace), &identity::<N>(), determinant)
}

/// Weights that leave no vibration at the resonance: `now + early M^-half + late M^-(half + 1) = 0` for the free
/// motion `M` over a tick, and `now + early + late = 1`. Every `M^-n` is `x + y F` (Cayley and Hamilton), so these
/// are three linear equations.
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

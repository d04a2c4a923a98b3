//! The fine axis: piezo, strain gauge and control loop.
//!
//! Each tick the gauge corrects an observer of position, velocity and disturbance. The command is the shaped set-point
//! minus the estimated disturbance (hysteresis, creep, gauge offset: integral action) minus state feedback on the
//! deviation from the undisturbed model, which damps residual vibration. Equations: [`crate::gains`]. Calibrated
//! hysteresis and creep are subtracted in advance ([`model`]); the observer learns the rest.
//!
//! Until its first move the piezo stays relaxed (code 0) with the loop open. The DAC keeps its code over a reset, so
//! the piezo may be anywhere. Retained memory has the code, 0 after power-on; without it nothing is output until the
//! gauge has given the position. Then the piezo is lowered smoothly, because a stack released suddenly swings into
//! tension. If the gauge fails or the piezo does not follow, the command is held and the loop opens until the next
//! move, before a loop that excites an unknown flexure mode can damage the stack. A DAC without a wire keeps its output
//! while the loop pushes the code to its end. If the piezo is still away from its target after the settling deadline, the
//! loop therefore opens and the code ramps to the gauge's position: a wire that returns then changes little.
//!
//! A piezo at its target for a second is idle: only creep moves it, so rare ticks suffice. The resonance model assumes
//! control ticks, so after a rest the gauge corrects only disturbance and drift, slowly. Fixed point: nm in 2^-10,
//! gains in 2^-24, sums in i64, saturating. Cost: about 35 multiplications a tick.

mod model;
mod trend;

use farnear_protocol::Nanometres;

use self::model::{GaugeScale, Lag, Scale};
use self::trend::Trend;
use crate::gains::{GAIN_BITS, Gains};
use crate::io::{GAUGE_CODE_MAX, GAUGE_CODE_ZERO, TICK_HZ, TICK_US};
use crate::relax;
use crate::settings::FineSettings;
use crate::shaper::Shaper;

/// At rest within this distance of the target ...
const AT_REST: Nanometres = Nanometres(100);
/// ... and within this swing (half the stated error minus gauge noise): a report may arrive at its other side.
const SWING: i32 = 45 << BITS;
/// Averaging ticks of the middle, as a shift: two thirds of a resonance period, of which a quarter remains.
const MIDDLE_SHIFT: u32 = 4;
/// Duration: one period of the resonance, in which a larger swing shows.
const NEAR_TICKS: u16 = 25;
const IDLE_TICKS: u16 = TICK_HZ as u16;
/// Shares, as shifts, of the error after a rest that go to disturbance and drift: critically damped, time constant 64
/// rests (0.13 s). At a resonance with Q = 30 the loop gain is a half.
const EASE_DISTURBANCE: u32 = 5;
const EASE_DRIFT: u32 = 15;
/// Mean innovation beyond which the piezo does not follow. The fast loop stays below 2 um, also 25 % off resonance, the
/// gentle one below 11 um. Exciting a mode with a share of 2 % reaches 18 um within 0.1 s, with 5 % 60.
const INNOVATION_LIMIT: i32 = 15_000 << BITS;
/// Averaging ticks of the innovation, as a shift: 3 ms.
const INNOVATION_SHIFT: u32 = 4;
/// Limit per tick, because a single reading may be wrong.
const INNOVATION_CLIP: i32 = 2 * INNOVATION_LIMIT;
/// Least disturbance at which the loop of a piezo away from its target opens. Hysteresis of 15 % and an amplifier 20 % off
/// make 70 um at the far end, but there the piezo reaches its target.
const UNREACHABLE: i32 = 40_000 << BITS;
/// Ticks of a ramp after a start or a failure, and the codes (3 um) below which none is needed.
const RAMP: u32 = TICK_HZ / 10;
const RELAXED: u16 = 1_000;

/// A piezo whose loop has opened, or whose DAC has dropped with the power, swings freely. At 200 Hz and a damping of 3 %
/// a swing of 20 um is 10 nm after this time.
const SWINGING_TICKS: u32 = TICK_HZ / 5;

/// Fraction bits of a position.
pub(crate) const BITS: u32 = 10;

/// Position, scaled velocity, disturbance and its drift per tick, each nm in 2^-10.
type State = [i32; 4];

#[derive(Clone, Debug)]
struct Loop {
    shaper: Shaper,
    model: [i32; 2],
    /// Prediction for this tick, corrected by the gauge.
    state: State,
    reference_before: i32,
    trend: Trend,
    innovation: i32,
}

impl Loop {
    /// After a rest of this many ticks: assumes the target position; the gauge's difference is disturbance.
    fn correct_after_rest(&mut self, measured: i32, target: i32, ticks: u32) {
        let off = i64::from(measured.saturating_sub(target)) << Trend::BITS;
        let (mut disturbance, mut drift) = self.trend.now();
        drift += off >> EASE_DRIFT;
        disturbance += drift * i64::from(ticks) + (off >> EASE_DISTURBANCE);
        self.trend = Trend::new(disturbance, drift);
        let fixed =
            |value: i64| (value >> Trend::BITS).clamp(i64::from(i32::MIN), i64::from(i32::MAX)) as i32;
        (self.model, self.state) = ([target, 0], [target, 0, fixed(disturbance), fixed(drift)]);
        self.reference_before = target;
    }
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Start {
    /// The DAC's code is not known, and the gauge has not given the position.
    Unknown,
    /// The code changes smoothly within `over` ticks.
    Ramp { from: u16, to: u16, ticks: u32, over: u32 },
    /// Relaxed or controlled.
    Over,
}

#[derive(Clone, Debug)]
pub(crate) struct Piezo {
    settings: FineSettings,
    scale: Scale,
    gauge: GaugeScale,
    start: Start,
    lag: Lag,
    control: Option<Loop>,
    /// A move was ordered: close the loop at the next valid reading.
    closing: bool,
    target: Nanometres,
    /// Command as output by the DAC, nm in 2^-10.
    command: i32,
    code: u16,
    measured: Nanometres,
    gauge_missing_ticks: u32,
    failed: bool,
    driven: bool,
    near_ticks: u16,
    still_ticks: u16,
    /// Ticks since the start, the loop opened or the ramp ended.
    open_ticks: u32,
    /// Ticks away from a target that the set-point has reached.
    away_ticks: u32,
    /// Middle of the swing, nm in 2^-10.
    middle: i32,
    /// Control ticks since the last executed one; more than one after a rest.
    passed: u32,
}

impl Piezo {
    pub(crate) const fn new(settings: FineSettings) -> Self {
        Self {
            settings,
            scale: Scale::new(settings.gain_pm_per_code),
            gauge: GaugeScale::new(settings.gauge_gain_ppm, settings.gauge_offset),
            start: Start::Unknown,
            lag: Lag::new(settings.hysteresis_ppm, settings.creep_ppm_per_decade),
            control: None,
            closing: false,
            target: Nanometres(0),
            command: 0,
            code: 0,
            measured: Nanometres(0),
            gauge_missing_ticks: 0,
            failed: false,
            driven: false,
            near_ticks: 0,
            still_ticks: 0,
            open_ticks: SWINGING_TICKS,
            away_ticks: 0,
            middle: 0,
            passed: 1,
        }
    }

    /// Lowers the piezo from the code that the DAC kept, also without the gauge. Unknown: from the gauge's position.
    pub(crate) const fn start_at(&mut self, code: Option<u16>) {
        self.open_ticks = 0;
        if let Some(code) = code {
            self.begin_to_relax((code, self.scale.played(code)));
        }
    }

    /// Interval to the next control tick, in ticks.
    pub(crate) const fn after(&mut self, ticks: u32) {
        self.passed = ticks;
    }

    /// Long at its target or uncontrolled, with a valid gauge: rare ticks suffice.
    pub(crate) fn is_settled_idle(&self) -> bool {
        let led = self.control.is_some() || self.closing || self.driven;
        let stands = self.arrived() && self.near_ticks >= IDLE_TICKS;
        self.start == Start::Over && self.gauge_fresh() && (stands || !led)
    }

    /// Gauge position; the last plausible one while it fails.
    pub(crate) const fn measured(&self) -> Nanometres {
        self.measured
    }

    /// Extension by gauge; without it, 0 if nothing is output.
    pub(crate) fn extension(&self) -> Option<Nanometres> {
        if !self.gauge_failed() {
            return Some(self.measured);
        }
        (self.played() == Some(0)).then_some(Nanometres(0))
    }

    pub(crate) const fn target(&self) -> Nanometres {
        self.target
    }

    pub(crate) const fn gauge_fresh(&self) -> bool {
        self.gauge_missing_ticks == 0
    }

    /// A closed loop is opened and closed again: a changed scale becomes a disturbance, and the shaper leads to the target.
    pub(crate) fn apply(&mut self, settings: FineSettings) {
        if settings == self.settings {
            return;
        }
        self.settings = settings;
        self.scale = Scale::new(settings.gain_pm_per_code);
        self.gauge = GaugeScale::new(settings.gauge_gain_ppm, settings.gauge_offset);
        self.lag = self.lag.with(settings.hysteresis_ppm, settings.creep_ppm_per_decade);
        if self.control.take().is_some() {
            (self.closing, self.open_ticks) = (true, SWINGING_TICKS);
        }
        self.command = self.scale.played(self.code);
        self.lag.push(self.command);
    }

    pub(crate) fn lowest(&self) -> Nanometres {
        if self.control.is_some() || self.closing { self.measured.min(self.target) } else { self.measured }
    }

    /// The gauge failed while the loop needed it; given once.
    pub(crate) const fn take_failure(&mut self) -> bool {
        core::mem::replace(&mut self.failed, false)
    }

    /// Gauge silent or saturated for too long: the position is unknown.
    pub(crate) const fn gauge_failed(&self) -> bool {
        self.gauge_missing_ticks as u64 * TICK_US as u64 > self.settings.gauge_deadline.0 as u64
    }

    /// The shaped set-point has reached the target.
    pub(crate) fn arrived(&self) -> bool {
        let shaper = &self.settings.gains.shaper;
        !self.closing && self.control.as_ref().is_none_or(|control| control.shaper.arrived(shaper))
    }

    pub(crate) fn is_moving(&self) -> bool {
        !self.arrived()
            || self.control.is_some() && self.still_ticks < NEAR_TICKS
            || matches!(self.start, Start::Ramp { .. })
            || self.is_swinging()
    }

    /// A move was ordered and waits for the end of a swing.
    pub(crate) const fn waits(&self) -> bool {
        self.closing && self.is_swinging()
    }

    /// A loop that closes now would take the swing for a disturbance and jump by it.
    const fn is_swinging(&self) -> bool {
        self.control.is_none() && self.open_ticks < SWINGING_TICKS
    }

    pub(crate) const fn go(&mut self, target: Nanometres) {
        self.target = target;
        self.closing = self.control.is_none();
        self.driven = false;
    }

    /// Opens the loop and outputs a code.
    pub(crate) const fn drive(&mut self, code: u16) {
        (self.control, self.closing, self.driven) = (None, false, true);
        self.start = Start::Over;
        self.code = code;
        self.command = self.scale.played(code);
        self.target = Nanometres(0);
    }

    /// The code from which a calibration may drive: known, and the gauge answers.
    pub(crate) fn driven_from(&self) -> Option<u16> {
        self.played().filter(|_| self.gauge_fresh())
    }

    /// The output code, once known.
    pub(crate) fn played(&self) -> Option<u16> {
        (self.start != Start::Unknown).then_some(self.code)
    }

    /// Closes the loop smoothly: at rest, with the unexplained part as disturbance.
    fn close(&mut self) {
        let here = fixed(self.measured);
        let disturbance = here.saturating_sub(self.command).saturating_sub(self.lag.offset());
        self.control = Some(Loop {
            shaper: Shaper::at(here),
            model: [here, 0],
            state: [here, 0, disturbance, 0],
            reference_before: here,
            trend: Trend::new(i64::from(disturbance) << Trend::BITS, 0),
            innovation: 0,
        });
        (self.closing, self.start) = (false, Start::Over);
    }

    pub(crate) fn hold(&mut self) {
        let on_its_way = !self.arrived();
        (self.closing, self.driven) = (false, false);
        if on_its_way {
            self.target = Nanometres(self.measured.0.clamp(self.settings.min.0, self.settings.max.0));
        }
    }

    pub(crate) fn sense(&mut self, gauge_code: Option<u32>) {
        let Some(code) = gauge_code.filter(|code| (1..GAUGE_CODE_MAX).contains(code)) else {
            self.gauge_missing_ticks = self.gauge_missing_ticks.saturating_add(1);
            (self.near_ticks, self.still_ticks) = (0, 0); // not seen near yet
            // The gauge saturates in a swing below its range.
            if self.gauge_failed() && !self.waits() {
                self.failed |= self.closing || self.driven || self.control.is_some();
                (self.control, self.closing, self.driven) = (None, false, false);
            }
            return;
        };
        self.gauge_missing_ticks = 0;
        self.measured = self.gauge.position(code as i32 - GAUGE_CODE_ZERO as i32);
        let rested = self.passed > 1;
        let off = self.target.0.saturating_sub(self.measured.0).saturating_abs();
        let (near, here) = (off <= AT_REST.0, fixed(self.measured));
        self.middle = if near { self.middle + ((here - self.middle) >> MIDDLE_SHIFT) } else { here };
        let still = near && (here - self.middle).abs() <= SWING;
        self.near_ticks = if near { self.near_ticks.saturating_add(1) } else { 0 };
        self.still_ticks = if still { self.still_ticks.saturating_add(1) } else { 0 };
        if self.start == Start::Unknown {
            self.begin_to_relax(self.scale.playable(fixed(self.measured)));
        }
        if self.closing && !self.is_swinging() {
            return self.close();
        }
        if let Some(control) = &mut self.control {
            if rested {
                return control.correct_after_rest(fixed(self.measured), fixed(self.target), self.passed);
            }
            let innovation = fixed(self.measured).saturating_sub(control.state[0]);
            for (state, gain) in control.state.iter_mut().zip(self.settings.gains.observer) {
                *state = state.saturating_add(sum([(gain, innovation)]));
            }
            control.trend.push(control.state[2]);
            control.innovation +=
                (innovation.saturating_abs().min(INNOVATION_CLIP) - control.innovation) >> INNOVATION_SHIFT;
            if control.innovation > INNOVATION_LIMIT {
                // The last command is part of its swing; the set-point does not swing.
                let still = control.reference_before.saturating_sub(self.lag.offset());
                (self.code, self.command) = self.scale.playable(still);
                (self.control, self.near_ticks, self.failed) = (None, 0, true);
                return;
            }
            let away = !near && control.shaper.arrived(&self.settings.gains.shaper);
            self.away_ticks = if away { self.away_ticks.saturating_add(1) } else { 0 };
            let late = self.away_ticks > self.settings.settle_deadline.0 / TICK_US;
            if late && control.state[2].saturating_abs() > UNREACHABLE {
                let (to, _) = self.scale.playable(here);
                self.start = Start::Ramp { from: self.code, to, ticks: 0, over: RAMP };
                (self.control, self.failed) = (None, true);
            }
        }
    }

    /// From a code and its command.
    const fn begin_to_relax(&mut self, (from, command): (u16, i32)) {
        (self.start, self.code, self.command) = if from > RELAXED {
            (Start::Ramp { from, to: 0, ticks: 0, over: RAMP }, from, command)
        } else {
            (Start::Over, 0, 0)
        };
    }

    /// The DAC drops to 0 with its supply; a stack that it stretches would swing into tension.
    pub(crate) const fn release(&mut self) {
        if matches!(self.start, Start::Unknown) || self.code == 0 {
            return;
        }
        (self.control, self.closing, self.driven) = (None, false, false);
        self.start = Start::Ramp { from: self.code, to: 0, ticks: 0, over: relax::FAST };
        self.target = Nanometres(0);
    }

    fn ramp(&mut self) {
        let Start::Ramp { from, to, ticks, over } = &mut self.start else { return };
        *ticks += 1;
        self.code = relax::code(*from, *to, *ticks, *over);
        if *ticks >= *over {
            self.start = Start::Over;
        }
        self.command = self.scale.played(self.code);
    }

    /// DAC code of this tick; `None` until the position is known.
    pub(crate) fn act(&mut self) -> Option<u16> {
        // Output during the rest.
        (1..self.passed).for_each(|_| self.lag.push(self.command));
        let led = self.control.is_some() || matches!(self.start, Start::Ramp { .. });
        self.open_ticks = if led { 0 } else { self.open_ticks.saturating_add(self.passed) };
        self.passed = 1;
        let gains = &self.settings.gains;
        if let Some(control) = &mut self.control {
            let reference = control.shaper.push(&gains.shaper, fixed(self.target));
            let [position, velocity, disturbance, drift] = control.state;
            let feedback = sum([
                (gains.feedback[0], position.saturating_sub(control.model[0])),
                (gains.feedback[1], velocity.saturating_sub(control.model[1])),
            ]);
            let wanted = reference.saturating_sub(disturbance).saturating_sub(feedback);
            // The lag depends on the command; the previous one is a good estimate.
            let ahead = self.lag.ahead(wanted.saturating_sub(self.lag.offset()));
            let input_before = self.command.saturating_add(self.lag.offset());
            (self.code, self.command) = self.scale.playable(wanted.saturating_sub(ahead));
            self.lag.push(self.command);
            let input = self.command.saturating_add(self.lag.offset());

            control.model = advance(gains, control.model, control.reference_before, reference);
            control.reference_before = reference;
            let [position, velocity] = advance(
                gains,
                [position, velocity],
                input_before.saturating_add(disturbance),
                input.saturating_add(disturbance),
            );
            control.state = [position, velocity, disturbance.saturating_add(drift), drift];
        } else {
            self.ramp();
            self.lag.push(self.command);
        }
        self.played()
    }
}

/// The undisturbed piezo one tick later; `before` is output until `command` takes effect.
fn advance(gains: &Gains, [position, velocity]: [i32; 2], before: i32, command: i32) -> [i32; 2] {
    let row = |i: usize| {
        let [a, b] = gains.transition[i];
        sum([(a, position), (b, velocity), (gains.input_before[i], before), (gains.input[i], command)])
    };
    [row(0), row(1)]
}

/// Sum of gain times value, rounded, saturated.
fn sum<const N: usize>(terms: [(i32, i32); N]) -> i32 {
    let sum = terms.iter().fold(1i64 << (GAIN_BITS - 1), |sum, (gain, value)| {
        sum.saturating_add(i64::from(*gain) * i64::from(*value))
    });
    (sum >> GAIN_BITS).clamp(i64::from(i32::MIN), i64::from(i32::MAX)) as i32
}

const fn fixed(position: Nanometres) -> i32 {
    position.0 << BITS // a gauge code or a position within the stroke: below 2^18
}

#[cfg(test)]
pub(crate) mod plant;
#[cfg(test)]
mod tests;

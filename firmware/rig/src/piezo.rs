//! The fine axis: piezo, strain gauge and the loop between them.
//!
//! Each tick the gauge corrects an observer of position, velocity and disturbance; the command is the shaped
//! set-point, less the estimated disturbance (hysteresis, creep, gauge offset: this is the integral action), less
//! state feedback on the difference from the undisturbed model's motion, which damps what shaping left. See
//! [`crate::gains`] for the equations.
//!
//! What the calibration has found of hysteresis and creep is taken off the command ahead of time ([`model`]); the observer
//! learns what is left of them.
//!
//! Until its first move the piezo stays relaxed (code 0) with the loop open. The DAC keeps its code over a reset of the board, so at
//! the start the piezo may stand anywhere. Retained memory has the code, 0 after power-on; where it has not, nothing is played until the gauge has said where. It is led down from there,
//! for a stack that is let go at once swings into tension. If the gauge fails, the command is held and the loop opens until
//! the next move. So it does where the piezo does not move as it should: a loop that feeds a mode of the flexure which it does
//! not know is opened before the stack is pulled apart.
//!
//! A piezo that has stood at its target for a second is idle: then it is enough to look rarely, for creep is all that moves it. The
//! model of the resonance knows control ticks only, so after a rest the gauge corrects disturbance and drift alone, slowly.
//!
//! Fixed point: nm in 2^-10, gains in 2^-24, sums in i64; saturating, so no input can wrap it. Cost: about 35
//! multiplications a tick.

mod model;
mod trend;

use farnear_protocol::Nanometres;

use self::model::{GaugeScale, Lag, Scale};
use self::trend::Trend;
use crate::gains::{GAIN_BITS, Gains};
use crate::io::{GAUGE_CODE_MAX, GAUGE_CODE_ZERO, TICK_HZ, TICK_US};
use crate::settings::FineSettings;
use crate::shaper::Shaper;

/// A piezo this near its target is at rest ...
const AT_REST: Nanometres = Nanometres(100);
/// ... and swings by no more than this about the middle of what was measured lately: half the stated error less the gauge's noise, for what
/// is told on one side may have swung to the other when it is heard.
const SWING: i32 = 45 << BITS;
/// Ticks of that middle, as a shift: two thirds of a period of the resonance, of which a quarter is left in it.
const MIDDLE_SHIFT: u32 = 4;
/// For so long: a period of the resonance, in which what swings farther is seen to.
const NEAR_TICKS: u16 = 25;
/// Ticks near the target after which it is idle.
const IDLE_TICKS: u16 = TICK_HZ as u16;
/// Shares, as shifts, of what it is off after a rest that are disturbance and drift in a control tick: critically damped, with 64 rests (0.13 s) as
/// time constant. At the resonance, of a Q of 30, the loop's gain is a half.
const EASE_DISTURBANCE: u32 = 5;
const EASE_DRIFT: u32 = 15;
/// Mean innovation beyond which the piezo does not follow. The fast loop's stays below 2 um, also with a resonance a quarter off, and the gentle loop's below
/// 11 um; one that feeds a mode with a share of 2 % goes to 18 um and more within 0.1 s, with 5 % to 60.
const INNOVATION_LIMIT: i32 = 15_000 << BITS;
/// Ticks of that mean, as a shift: 3 ms.
const INNOVATION_SHIFT: u32 = 4;
/// No tick counts for more, for a single reading may be all wrong.
const INNOVATION_CLIP: i32 = 2 * INNOVATION_LIMIT;
/// Ticks of the way down at the start, and the codes (3 um) below which it is none.
const RELAX: u32 = TICK_HZ / 10;
const RELAXED: u16 = 1_000;

/// Fraction bits of a position.
pub(crate) const BITS: u32 = 10;

/// Position, scaled velocity, disturbance and its drift per tick, each nm in 2^-10.
type State = [i32; 4];

#[derive(Clone, Debug)]
struct Loop {
    shaper: Shaper,
    /// Where the undisturbed model is: position and scaled velocity.
    model: [i32; 2],
    /// What is expected of this tick, corrected once the gauge is read.
    state: State,
    /// The shaped set-point of the tick before.
    reference_before: i32,
    trend: Trend,
    /// Running mean of how far the gauge is beside what was expected of the tick, without sign.
    innovation: i32,
}

impl Loop {
    /// Believes that it stands at its target, after so many ticks; what the gauge says beside that is disturbance.
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

/// How the piezo comes to rest after a start.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Start {
    /// The gauge has not said where it stands.
    Unknown,
    /// It is led down from a code.
    Down { from: u16, ticks: u32 },
    /// It is relaxed, or does what it was told.
    Over,
}

#[derive(Clone, Debug)]
pub(crate) struct Piezo {
    settings: FineSettings,
    scale: Scale,
    gauge: GaugeScale,
    start: Start,
    /// Code that the DAC has kept over the reset.
    kept_code: Option<u16>,
    /// What hysteresis and creep should be, as the calibration found them.
    lag: Lag,
    control: Option<Loop>,
    /// A move was ordered: close the loop as soon as the gauge says where it is.
    closing: bool,
    target: Nanometres,
    /// Command in nm in 2^-10, as the DAC plays it.
    command: i32,
    code: u16,
    measured: Nanometres,
    gauge_missing_ticks: u32,
    failed: bool,
    /// A sweep drives it without the loop, and reads the gauge.
    driven: bool,
    /// Ticks for which it has been near its target.
    near_ticks: u16,
    /// Those of them, the last ones, in which it has hardly swung.
    still_ticks: u16,
    /// The middle about which it swings there, nm in 2^-10.
    middle: i32,
    /// Control ticks since the one before: more than one after a rest.
    passed: u32,
}

impl Piezo {
    pub(crate) const fn new(settings: FineSettings) -> Self {
        Self {
            settings,
            scale: Scale::new(settings.gain_pm_per_code),
            gauge: GaugeScale::new(settings.gauge_gain_ppm, settings.gauge_offset),
            start: Start::Unknown,
            kept_code: None,
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
            middle: 0,
            passed: 1,
        }
    }

    /// The DAC has kept this code over the reset.
    pub(crate) const fn start_at(&mut self, code: Option<u16>) {
        self.kept_code = code;
    }

    /// So many control ticks' time after the tick before comes the one that follows.
    pub(crate) const fn after(&mut self, ticks: u32) {
        self.passed = ticks;
    }

    /// Whether it is enough to look rarely: it stands where it was sent for long, or nobody leads it, and the gauge speaks.
    pub(crate) fn is_settled_idle(&self) -> bool {
        let led = self.control.is_some() || self.closing || self.driven;
        let stands = self.arrived() && self.near_ticks >= IDLE_TICKS;
        self.start == Start::Over && self.gauge_fresh() && (stands || !led)
    }

    /// What the gauge says; the last believable value where it says nothing.
    pub(crate) const fn measured(&self) -> Nanometres {
        self.measured
    }

    /// How far it is stretched: what the gauge says or, where that is silent, nothing where nothing is played.
    pub(crate) fn extension(&self) -> Option<Nanometres> {
        if !self.gauge_failed() {
            return Some(self.measured);
        }
        (self.played() == Some(0)).then_some(Nanometres(0))
    }

    /// Where it was last sent.
    pub(crate) const fn target(&self) -> Nanometres {
        self.target
    }

    /// Whether the gauge was read in this tick.
    pub(crate) const fn gauge_fresh(&self) -> bool {
        self.gauge_missing_ticks == 0
    }

    /// Takes other numbers; nothing moves.
    pub(crate) const fn apply(&mut self, settings: FineSettings) {
        self.settings = settings;
        self.scale = Scale::new(settings.gain_pm_per_code);
        self.gauge = GaugeScale::new(settings.gauge_gain_ppm, settings.gauge_offset);
        self.lag = self.lag.with(settings.hysteresis_ppm, settings.creep_ppm_per_decade);
    }

    /// The lowest position on the way that is under way.
    pub(crate) fn lowest(&self) -> Nanometres {
        if self.control.is_some() || self.closing { self.measured.min(self.target) } else { self.measured }
    }

    /// Whether the gauge failed while the loop needed it; given once.
    pub(crate) const fn take_failure(&mut self) -> bool {
        core::mem::replace(&mut self.failed, false)
    }

    /// Whether the gauge has been silent or saturated for too long: where the piezo stands is not known then.
    pub(crate) const fn gauge_failed(&self) -> bool {
        self.gauge_missing_ticks as u64 * TICK_US as u64 > self.settings.gauge_deadline.0 as u64
    }

    /// Whether the shaped set-point has reached the target.
    pub(crate) fn arrived(&self) -> bool {
        let shaper = &self.settings.gains.shaper;
        !self.closing && self.control.as_ref().is_none_or(|control| control.shaper.arrived(shaper))
    }

    /// Whether it moves: its set-point does, or the loop has not brought it there yet, or it is led down after a start.
    pub(crate) fn is_moving(&self) -> bool {
        !self.arrived()
            || self.control.is_some() && self.still_ticks < NEAR_TICKS
            || self.start != Start::Over
    }

    /// Goes to `target`, closing the loop where it is open.
    pub(crate) const fn go(&mut self, target: Nanometres) {
        self.target = target;
        self.closing = self.control.is_none();
        self.driven = false;
    }

    /// Opens the loop and plays a code.
    pub(crate) const fn drive(&mut self, code: u16) {
        (self.control, self.closing, self.driven) = (None, false, true);
        self.start = Start::Over;
        self.code = code;
        self.command = self.scale.played(code);
        self.target = Nanometres(0);
    }

    /// The code that is played.
    pub(crate) const fn code(&self) -> u16 {
        self.code
    }

    /// The same, once it is known.
    pub(crate) fn played(&self) -> Option<u16> {
        (self.start != Start::Unknown).then_some(self.code)
    }

    /// Closes the loop without a jump: standing still, and what the command does not explain is disturbance.
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

    /// Stays where the gauge says it is now.
    pub(crate) fn hold(&mut self) {
        (self.closing, self.driven) = (false, false);
        if self.control.is_some() && !self.arrived() {
            self.target = Nanometres(self.measured.0.clamp(self.settings.min.0, self.settings.max.0));
        }
    }

    /// Reads the gauge and corrects the observer.
    pub(crate) fn sense(&mut self, gauge_code: Option<u32>) {
        let Some(code) = gauge_code.filter(|code| (1..GAUGE_CODE_MAX).contains(code)) else {
            self.gauge_missing_ticks = self.gauge_missing_ticks.saturating_add(1);
            (self.near_ticks, self.still_ticks) = (0, 0); // nobody has seen it near
            if self.gauge_failed() {
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
            self.begin_to_relax();
        }
        if self.closing {
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
                // The last command is somewhere on its swing; the set-point's does not swing.
                let still = control.reference_before.saturating_sub(self.lag.offset());
                (self.code, self.command) = self.scale.playable(still);
                (self.control, self.near_ticks, self.failed) = (None, 0, true);
            }
        }
    }

    /// The gauge has said for the first time where the piezo stands.
    fn begin_to_relax(&mut self) {
        // A gauge that is off, or whose front end is dead, would make the DAC jump by as much.
        let (from, command) = match self.kept_code {
            Some(code) => (code, self.scale.played(code)),
            None => self.scale.playable(fixed(self.measured)),
        };
        (self.start, self.code, self.command) = if from > RELAXED {
            (Start::Down { from, ticks: 0 }, from, command)
        } else {
            (Start::Over, 0, 0)
        };
    }

    /// Leads it down, gently at both ends so that nothing swings.
    fn relax(&mut self) {
        let Start::Down { from, ticks } = &mut self.start else { return };
        *ticks += 1;
        let (at, over) = (u64::from(*ticks), u64::from(RELAX));
        // Three squares less two cubes of the time that is left; 43 bits.
        let left = over - at;
        self.code = (u64::from(*from) * left * left * (3 * over - 2 * left) / (over * over * over)) as u16; // at most `from`
        if at >= over {
            self.start = Start::Over;
        }
        self.command = self.scale.played(self.code);
    }

    /// The DAC's code of this tick; `None` as long as nobody knows where the piezo stands.
    pub(crate) fn act(&mut self) -> Option<u16> {
        // What was played during the rest.
        (1..self.passed).for_each(|_| self.lag.push(self.command));
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
            // What the lag will be depends on the command; with the one before it is nearly known.
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
            self.relax();
            self.lag.push(self.command);
        }
        self.played()
    }
}

/// The undisturbed piezo one tick later; `before` is played until `command` is out.
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

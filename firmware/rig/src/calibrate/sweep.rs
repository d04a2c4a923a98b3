//! Gain, hysteresis and creep of the piezo: open-loop sweep and a step.
//!
//! 1. Down to code 0, then up and down once, so that the loop does not depend on the history.
//! 2. Up and down again, 0.5 s each, read at sixteen positions. The stroke is the gain, the largest difference the
//!    hysteresis. Smooth ends do not excite the resonance; creep adds less than a tenth to the hysteresis.
//! 3. Rest, then up to half the range; positions 0.15 and 1.5 s later give a decade of creep.

use farnear_protocol::Nanometres;
use farnear_protocol::message::{Axis, Calibration, Failure, Setting, SettingKey};

use super::Step;
use crate::io::{DAC_CODE_MAX, TICK_HZ};
use crate::piezo::Piezo;
use crate::settings::{FINE_MAX_NM, Values};

const SWEEP: u32 = TICK_HZ / 2;
/// Ticks of rest, and of the step.
const REST: u32 = TICK_HZ;
const STEP: u32 = TICK_HZ / 20;
/// Ticks from the step to the creep readings, and ticks averaged.
const EARLY: u32 = TICK_HZ * 15 / 100;
const LATE: u32 = TICK_HZ * 15 / 10;
const MEAN: u32 = 50;
const PLACES: usize = 16;
const HALF: u16 = DAC_CODE_MAX / 2;
/// The sweep reaches both ends of the stroke, so a smaller limit excludes it.
pub(super) const WHOLE_STROKE: [Nanometres; 1] = [Nanometres(FINE_MAX_NM)];

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Phase {
    /// From the present code.
    Down {
        from: u16,
    },
    WarmUp,
    WarmDown,
    Up,
    Back,
    Rest,
    Creep,
    Return,
    Tell(u8),
}

#[derive(Clone, Debug)]
pub(crate) struct Sweep {
    phase: Option<Phase>,
    ticks: u32,
    up: [i32; PLACES + 1],
    down: [i32; PLACES + 1],
    before_step: i32,
    early: i32,
    late: i32,
}

struct Found {
    gain_pm_per_code: i32,
    hysteresis_ppm: i32,
    creep_ppm_per_decade: i32,
}

impl Sweep {
    pub(crate) const fn new() -> Self {
        Self {
            phase: None,
            ticks: 0,
            up: [0; PLACES + 1],
            down: [0; PLACES + 1],
            before_step: 0,
            early: 0,
            late: 0,
        }
    }

    pub(crate) fn tick(&mut self, piezo: &mut Piezo) -> Step {
        let Some(phase) = self.phase else {
            let Some(from) = piezo.driven_from() else {
                return Step::Failed(Axis::SensorFine, Failure::Gauge);
            };
            self.phase = Some(Phase::Down { from });
            return Step::On;
        };
        self.ticks += 1;
        let (ticks, position) = (self.ticks, piezo.measured().0);
        let next = match phase {
            Phase::Down { from } => ramp(piezo, ticks, SWEEP, from, 0).then_some(Phase::WarmUp),
            Phase::WarmUp => ramp(piezo, ticks, SWEEP, 0, DAC_CODE_MAX).then_some(Phase::WarmDown),
            Phase::WarmDown => ramp(piezo, ticks, SWEEP, DAC_CODE_MAX, 0).then_some(Phase::Up),
            Phase::Up => {
                read(&mut self.up, ticks, position);
                ramp(piezo, ticks, SWEEP, 0, DAC_CODE_MAX).then_some(Phase::Back)
            }
            Phase::Back => {
                read(&mut self.down, ticks, position);
                ramp(piezo, ticks, SWEEP, DAC_CODE_MAX, 0).then_some(Phase::Rest)
            }
            Phase::Rest => {
                self.before_step = position;
                (ticks >= REST).then_some(Phase::Creep)
            }
            Phase::Creep => {
                ramp(piezo, ticks, STEP, 0, HALF);
                if (EARLY..EARLY + MEAN).contains(&ticks) {
                    self.early += position; // 50 times 18 bits
                } else if (LATE..LATE + MEAN).contains(&ticks) {
                    self.late += position;
                }
                (ticks >= LATE + MEAN).then_some(Phase::Return)
            }
            Phase::Return => ramp(piezo, ticks, SWEEP, HALF, 0).then_some(Phase::Tell(0)),
            Phase::Tell(done) => return self.tell(done),
        };
        if let Some(next) = next {
            (self.phase, self.ticks) = (Some(next), 0);
        }
        Step::On
    }

    /// Returns the settings one by one, then the end.
    fn tell(&mut self, done: u8) -> Step {
        let Some(found) = self.evaluate() else {
            return Step::Failed(Axis::SensorFine, Failure::Implausible);
        };
        self.phase = Some(Phase::Tell(done.saturating_add(1)));
        match done {
            0 => Step::Set(SettingKey::PiezoGainPmPerCode, found.gain_pm_per_code),
            1 => Step::Set(SettingKey::PiezoHysteresisPpm, found.hysteresis_ppm),
            2 => Step::Set(SettingKey::PiezoCreepPpmPerDecade, found.creep_ppm_per_decade),
            // None is negative.
            _ => Step::Done(Calibration::Piezo {
                gain_pm_per_code: found.gain_pm_per_code as u32,
                hysteresis_ppm: found.hysteresis_ppm as u32,
                creep_ppm_per_decade: found.creep_ppm_per_decade as u32,
            }),
        }
    }

    /// `None` for implausible readings, and for figures that are not permitted as settings.
    fn evaluate(&self) -> Option<Found> {
        let stroke = i64::from(self.up[PLACES]) - i64::from(self.up[0]);
        let pairs = self.up.iter().zip(self.down.iter().rev());
        let width = pairs.map(|(up, down)| i64::from(*down) - i64::from(*up)).max()?;
        let step = i64::from(self.early) / i64::from(MEAN) - i64::from(self.before_step);
        if stroke < 10_000 || step < 5_000 {
            return None; // it hardly moved
        }
        let creep = (i64::from(self.late) - i64::from(self.early)) / i64::from(MEAN);
        let found = Found {
            gain_pm_per_code: (stroke * 1_000 / i64::from(DAC_CODE_MAX)) as i32,
            hysteresis_ppm: (width.max(0) * 1_000_000 / stroke) as i32,
            creep_ppm_per_decade: (creep.max(0) * 1_000_000 / step) as i32,
        };
        // All or nothing is stored.
        let fits = [
            (SettingKey::PiezoGainPmPerCode, found.gain_pm_per_code),
            (SettingKey::PiezoHysteresisPpm, found.hysteresis_ppm),
            (SettingKey::PiezoCreepPpmPerDecade, found.creep_ppm_per_decade),
        ]
        .into_iter()
        .all(|(key, value)| {
            let Setting { min, max, .. } = Values::DEFAULT.setting(key);
            (min..=max).contains(&value)
        });
        fits.then_some(found)
    }
}

/// Drives from one code to another with smooth ends; returns whether it has arrived.
pub(super) fn ramp(piezo: &mut Piezo, ticks: u32, over: u32, from: u16, to: u16) -> bool {
    let (at, over) = (i64::from(ticks.min(over)), i64::from(over));
    // 3 t^2 - 2 t^3. The distance has 17 bits and the time 12: 54 bits in total.
    let way = (i64::from(to) - i64::from(from)) * at * at * (3 * over - 2 * at) / (over * over * over);
    piezo.drive((i64::from(from) + way) as u16); // between the two
    at == over
}

fn read(places: &mut [i32; PLACES + 1], ticks: u32, position: i32) {
    let (place, rest) = (ticks as usize * PLACES / SWEEP as usize, ticks as usize * PLACES % SWEEP as usize);
    if ticks == 1 {
        places[0] = position;
    } else if rest < PLACES {
        places[place.min(PLACES)] = position;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::piezo::plant::{NOMINAL, Part, Plant};
    use crate::settings::Settings;

    fn run(part: Part, seed: u64) -> (std::vec::Vec<(SettingKey, i32)>, Step) {
        let (mut piezo, mut plant) = (Piezo::new(Settings::DEFAULT.fine), Plant::new(part, seed));
        let (mut sweep, mut settings) = (Sweep::new(), std::vec::Vec::new());
        for _ in 0..10 * TICK_HZ {
            let gauge = plant.gauge();
            piezo.sense(gauge);
            match sweep.tick(&mut piezo) {
                Step::On => {}
                Step::Set(key, value) => settings.push((key, value)),
                end => return (settings, end),
            }
            plant.tick(piezo.act());
        }
        panic!("it does not end");
    }

    #[test]
    fn it_finds_what_the_part_is_like() {
        for (hysteresis, creep) in [(0.0, 0.0), (0.12, 0.0), (0.12, 0.015), (0.15, 0.01)] {
            let (settings, end) = run(Part { hysteresis, creep, ..NOMINAL }, 4);
            let Step::Done(Calibration::Piezo { gain_pm_per_code, hysteresis_ppm, creep_ppm_per_decade }) =
                end
            else {
                panic!("{end:?}")
            };
            // Creep of half a second lengthens the stroke and widens the loop.
            let gain = f64::from(gain_pm_per_code) / 3_052.0;
            assert!((gain - 1.0 - 2.0 * creep).abs() < 0.03, "{gain} for {creep}");
            let width = f64::from(hysteresis_ppm) * 1e-6;
            assert!((width - hysteresis).abs() < 0.002 + 0.9 * creep, "{width} for {hysteresis}");
            let found = f64::from(creep_ppm_per_decade) * 1e-6;
            assert!((found - creep).abs() < 0.005, "{found} for {creep}");
            assert_eq!(settings.len(), 3);
        }
    }

    #[test]
    fn a_piezo_that_hardly_moves_is_implausible() {
        let mut sweep = Sweep { up: [5; PLACES + 1], phase: Some(Phase::Tell(0)), ..Sweep::new() };
        let mut piezo = Piezo::new(Settings::DEFAULT.fine);
        assert_eq!(sweep.tick(&mut piezo), Step::Failed(Axis::SensorFine, Failure::Implausible));
    }

    #[test]
    fn stores_nothing_if_one_figure_is_out_of_range() {
        let first = |width: i32, creep: i32| {
            let up: [i32; PLACES + 1] = core::array::from_fn(|place| place as i32 * 12_500);
            let mut down = up;
            down.reverse();
            down[PLACES / 2] += width;
            let early = 100_000 * MEAN as i32;
            let late = early + creep * MEAN as i32;
            let phase = Some(Phase::Tell(0));
            let mut sweep = Sweep { up, down, early, late, phase, ..Sweep::new() };
            sweep.tick(&mut Piezo::new(Settings::DEFAULT.fine))
        };
        assert_eq!(first(20_000, 1_000), Step::Set(SettingKey::PiezoGainPmPerCode, 3_051));
        // Hysteresis of 40 % and creep of 12 % a decade; 30 % and 10 % are permitted.
        for (width, creep) in [(80_000, 1_000), (20_000, 12_000)] {
            assert_eq!(first(width, creep), Step::Failed(Axis::SensorFine, Failure::Implausible));
        }
    }
}

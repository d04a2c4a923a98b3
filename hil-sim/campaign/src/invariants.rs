//! Invariants of every run, checked against the observer's record.
//! | property | meaning |
//! |---|---|
//! | `hard-stop` | no driver pushes a stage against its hard stop if the home switch works, and at most until a stall otherwise |
//! | `piezo-step` | the piezo's command never changes by more than 60 um in a tick: a quarter of the stroke and the loop's correction; not with `dac-dead` or `piezo-dead` |
//! | `step-after-alarm` | no STEP pulse later than 2 ms after an alarm until it is cleared |
//! | `acts-twice` | no request acts twice: one end each, equal answers to repeats, no more exposures than accepted |
//! | `moves-unasked` | no motor moves without requested work |
//! | `exposure` | each exposure is reported with its stamps and a loaded length, and was within its tolerance or reported otherwise |
//! | `position` | a position reported as homed was homed by an accepted request in this boot and is correct within its stated error |
//! | `records` | settings, alarms and boot numbers survive everything, or their loss is reported |
//! | `works-after` | without faults the alarms can be cleared, and the rig homes, moves and captures |
//! | `runs` | the emulator plays the scenario to its end without an error (checked by [`crate::run`]) |
//!
//! A new property is a file of this module, a line in [`check`] and a row above.

mod exposures;
mod motion;
mod positions;
mod records;
mod requests;

use farnear_sim::{
    observer::{Seen, Sight},
    parts::Parts,
    scenario::Scenario,
};

#[derive(Clone, PartialEq, Debug)]
pub struct Broken {
    pub property: &'static str,
    pub at_ns: u64,
    pub what: String,
}

#[derive(Clone, Copy, Debug)]
pub struct Case<'a> {
    pub scenario: &'a Scenario,
    pub parts: &'a Parts,
    pub sights: &'a [Sight],
}

impl Case<'_> {
    fn has(&self, kinds: &[&str]) -> bool {
        self.scenario.happens.iter().any(|happening| kinds.contains(&happening.what.name))
    }

    /// Smallest event delay (virtual minus board time) per board life; a board with dead memory repeats boot number 1.
    fn clocks(&self) -> Vec<u64> {
        let mut clocks = vec![u64::MAX];
        for sight in self.sights {
            match &sight.seen {
                Seen::Reset => clocks.push(u64::MAX),
                Seen::Reported { event, .. } => {
                    let offset = sight.at_ns.saturating_sub(event.time.0.saturating_mul(1000));
                    clocks.last_mut().into_iter().for_each(|least| *least = offset.min(*least));
                }
                _ => {}
            }
        }
        clocks
    }
}

/// Violations of a run, ordered by time.
pub fn check(case: &Case<'_>) -> Vec<Broken> {
    let checks = [
        motion::hard_stop,
        motion::piezo_step,
        motion::step_after_alarm,
        motion::moves_unasked,
        requests::acts_twice,
        exposures::exposure,
        positions::position,
        records::records,
    ];
    let mut broken: Vec<Broken> = checks.iter().flat_map(|check| check(case)).collect();
    broken.sort_by_key(|broken| broken.at_ns);
    broken
}

#[cfg(test)]
mod tests;

//! What must hold in every run, whatever happens to the rig: held against what a witness saw.
//!
//! | property | that is |
//! |---|---|
//! | `hard-stop` | no driver pushes a stage against its hard stop: not at all with a home switch that works, and not beyond a stall with a dead one |
//! | `step-after-alarm` | no STEP pulse comes later than 2 ms after an alarm, until that is cleared |
//! | `acts-twice` | no request acts twice: one end for each, the same answer to its repeats, no more exposures than were asked for |
//! | `moves-unasked` | no motor moves without work that was asked for |
//! | `exposure` | every exposure is told, with its own stamps, and was inside its window, or that is told |
//! | `position` | a position that is called homed was homed in this boot and is the true one within its stated error |
//! | `records` | settings, alarms and boot numbers outlast everything, or their loss is told |
//! | `works-after` | once everything is mended the alarms can be cleared, and the rig homes, moves and exposes |
//!
//! A new property is a file of this module with a function over all sights, a line in [`check`], and a row above.

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

/// A property that did not hold.
#[derive(Clone, PartialEq, Debug)]
pub struct Broken {
    pub property: &'static str,
    /// When, virtual nanoseconds.
    pub at_ns: u64,
    /// What was seen instead.
    pub what: String,
}

/// A run, and what is known of the rig.
#[derive(Clone, Copy, Debug)]
pub struct Case<'a> {
    pub scenario: &'a Scenario,
    pub parts: &'a Parts,
    pub sights: &'a [Sight],
}

impl Case<'_> {
    /// Whether something of these kinds is in the scenario.
    fn has(&self, kinds: &[&str]) -> bool {
        self.scenario.happens.iter().any(|happening| kinds.contains(&happening.what.name))
    }

    /// For each life of the board, from one reset to the next, virtual nanoseconds less the board's time: the least delay with which one of
    /// its events was heard. Not by the number of its boot: a board whose memory is dead counts from 1 again when power comes back.
    fn clocks(&self) -> Vec<u64> {
        let mut clocks = vec![u64::MAX];
        for sight in self.sights {
            match &sight.seen {
                Seen::Reset => clocks.push(u64::MAX),
                Seen::Told { event, .. } => {
                    let offset = sight.at_ns.saturating_sub(event.time.0.saturating_mul(1000));
                    clocks.last_mut().into_iter().for_each(|least| *least = offset.min(*least));
                }
                _ => {}
            }
        }
        clocks
    }
}

/// Everything that did not hold, in the order of time.
pub fn check(case: &Case<'_>) -> Vec<Broken> {
    let checks = [
        motion::hard_stop,
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

//! Removes parts of a scenario while it violates the same property (after Zeller & Hildebrandt, IEEE TSE 28, 2002).

use farnear_sim::{
    SimError,
    faults::When,
    scenario::{Scenario, Step},
};

use crate::host_model::Outcome;

/// Limit of runs; each takes seconds.
const RUNS: u32 = 60;

/// All scenarios with one part removed.
fn smaller(scenario: &Scenario) -> Vec<Scenario> {
    let mut found = Vec::new();
    let mut with = |change: &dyn Fn(&mut Scenario)| {
        let mut other = scenario.clone();
        change(&mut other);
        if other != *scenario {
            found.push(other);
        }
    };
    for place in (0..scenario.happens.len()).rev() {
        with(&|other| {
            other.happens.remove(place);
        });
    }
    for place in (0..scenario.host.len()).rev() {
        with(&|other| {
            other.host.remove(place);
        });
    }
    with(&|other| other.parts = toml::Table::new());
    with(&|other| other.bit_error_rate = 0.0);
    for place in 0..scenario.happens.len() {
        with(&|other| other.happens[place].for_ms = None);
        with(&|other| other.happens[place].when = simpler(other.happens[place].when));
    }
    for place in 0..scenario.host.len() {
        with(&|other| {
            let step = &mut other.host[place];
            *step = Step { goes_on_after_ms: None, ..step.clone() };
        });
    }
    found
}

fn simpler(when: When) -> When {
    match when {
        When::After { ms } => When::After { ms: ms.round() },
        When::On { moment, .. } => When::On { moment, nth: 1, delay_ms: 0.0 },
        When::Chance { per_s } => When::Chance { per_s },
    }
}

/// `play` runs a scenario.
pub fn shrink(
    scenario: &Scenario,
    property: &str,
    mut play: impl FnMut(&Scenario) -> Result<Outcome, SimError>,
) -> Result<Scenario, SimError> {
    let mut small = scenario.clone();
    let mut runs = 0;
    'again: loop {
        for other in smaller(&small) {
            if runs == RUNS {
                return Ok(small);
            }
            runs += 1;
            if play(&other)?.broken.iter().any(|broken| broken.property == property) {
                small = other;
                continue 'again;
            }
        }
        return Ok(small);
    }
}

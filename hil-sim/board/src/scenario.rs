//! A scenario: the rig, its faults and its host's requests as TOML; `docs/hil.md` describes each field.
//!
//! ```toml
//! seed = 7                   # mechanics and random faults; --seed overrides it
//! start_um = [800.0, 900.0]  # sensor and lens stage at power-on
//! bit_error_rate = 1e-4      # per bit, in both directions
//! garbage = [1, 255, 0, 66]  # the host receives this first
//! unplug_after_ms = 500      # virtual time after power-on; the port closes
//!
//! [parts.gauge]              # as in parts.toml
//! gain = 1.01
//!
//! [[happens]]                # any number, any order
//! after_ms = 1500            # or: on = "exposure-begins", nth = 2, delay_ms = 1; or: chance_per_s = 0.5
//! what = "motor-stalls"
//! stage = "lens"             # or "sensor" (default)
//! for_ms = 200               # then reverted; without it, never
//!
//! [[host]]                   # without steps, any client is the host
//! does = "home"
//! [[host]]
//! does = "move"
//! axis = "lens"
//! to_um = 1200.0
//! ```

pub mod host;

use std::path::Path;

use serde::{Deserialize, Serialize};

pub use self::host::Step;
use crate::{
    error::SimError,
    faults::Happening,
    parts::Parts,
    plant::{StageName, TRAVEL_UM},
};

#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Scenario {
    /// `None`: the caller's seed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub seed: Option<u64>,
    /// Sensor and lens stage at power-on, micrometres from their home edges; `None`: random.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub start_um: Option<[f64; 2]>,
    /// Probability per bit in each direction.
    #[serde(skip_serializing_if = "is_zero")]
    pub bit_error_rate: f64,
    /// Bytes that the host receives first.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub garbage: Vec<u8>,
    /// Virtual time after the board's start at which the port closes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unplug_after_ms: Option<u64>,
    #[serde(skip_serializing_if = "toml::Table::is_empty")]
    pub parts: toml::Table,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub happens: Vec<Happening>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub host: Vec<Step>,
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "signature required by serde")]
fn is_zero(rate: &f64) -> bool {
    *rate == 0.0
}

impl Scenario {
    /// Errors have line, field and range.
    pub fn read(path: &Path) -> Result<Self, SimError> {
        let wrong = |reason: String| SimError::Scenario { path: path.into(), reason };
        let text = std::fs::read_to_string(path).map_err(|error| wrong(error.to_string()))?;
        Self::parse(&text).map_err(wrong)
    }

    /// Returns a description of the first error.
    pub fn parse(text: &str) -> Result<Self, String> {
        let scenario: Self = toml::from_str(text).map_err(|error| error.to_string())?;
        // TOML gives no position for numbers next to tables; their line is searched.
        let wrong = |field: &str, what: String| {
            let line = text.lines().position(|line| line.trim_start().starts_with(field));
            line.map_or(what.clone(), |line| format!("line {}: {what}", line + 1))
        };
        let rate = scenario.bit_error_rate;
        if !(0.0..=1.0).contains(&rate) {
            return Err(wrong("bit_error_rate", format!("bit_error_rate = {rate} is not in 0 to 1")));
        }
        let inside = |um: &f64| (-50.0..=TRAVEL_UM).contains(um);
        if let Some(start_um) = scenario.start_um
            && !start_um.iter().all(inside)
        {
            let what = format!("start_um = {start_um:?} is not in -50 to {TRAVEL_UM}, the travel");
            return Err(wrong("start_um", what));
        }
        scenario.parts().map_err(|reason| wrong("[parts", reason))?;
        Ok(scenario)
    }

    pub fn text(&self) -> String {
        // Tables, numbers and strings only, so it cannot fail.
        toml::to_string(self)
            .unwrap_or_else(|error| unreachable!("a scenario that TOML cannot express: {error}"))
    }

    /// The error names the invalid number and its range.
    pub fn parts(&self) -> Result<Parts, String> {
        Parts::parse(&self.parts.to_string())
    }

    pub fn start_um(&self, stage: StageName) -> Option<f64> {
        let [sensor, lens] = self.start_um?;
        Some(match stage {
            StageName::Sensor => sensor,
            StageName::Lens => lens,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::faults::{Moment, When, motion};

    fn refused(text: &str, expected: &[&str]) {
        let reason = Scenario::parse(text).expect_err(text);
        for expected in expected {
            assert!(reason.contains(expected), "{expected:?} is missed in: {reason}");
        }
    }

    #[test]
    fn a_written_scenario_reads_back_equal() {
        let text = "seed = 7\nstart_um = [800, 900.5]\n[parts.gauge]\ngain = 1.01\n\
                    [[happens]]\nafter_ms = 7\nwhat = \"motor-stalls\"\nstage = \"lens\"\nfor_ms = 1.5\n\
                    [[happens]]\non = \"exposure-begins\"\nnth = 3\nwhat = \"link-noise\"\n\
                    [[happens]]\nchance_per_s = 0.5\nwhat = \"memory-bit-flips\"\naddress = 99\nbit = 7\n\
                    [[host]]\ndoes = \"home\"\n[[host]]\ndoes = \"move\"\naxis = \"lens\"\nto_um = 12.5\n";
        let scenario = Scenario::parse(text).expect("a good file");
        let [stalls, noise, flips] = scenario.happens.as_slice() else { panic!("{scenario:?}") };
        assert_eq!((stalls.what, stalls.when), (motion::MOTOR_STALLS, When::After { ms: 7.0 }));
        assert_eq!((stalls.stage, stalls.for_ms), (StageName::Lens, Some(1.5)));
        assert_eq!(noise.when, When::On { moment: Moment::ExposureBegins, nth: 3, delay_ms: 0.0 });
        assert_eq!((noise.amount, flips.address, flips.bit), (300.0, 99, 7));
        assert_eq!(scenario.parts().expect("good parts").gauge.gain, 1.01);
        assert_eq!(Scenario::parse(&scenario.text()).as_ref(), Ok(&scenario), "{}", scenario.text());
        assert_eq!(Scenario::default().text(), "");
    }

    #[test]
    fn errors_have_line_field_and_expected_range() {
        refused("seed = 1\nbit_error_rate = 2.0", &["line 2", "bit_error_rate = 2", "0 to 1"]);
        refused("bit_eror_rate = 0.1", &["line 1", "bit_eror_rate"]);
        refused("\nstart_um = [1.0, 99999.0]", &["line 2", "start_um", "13000"]);
        refused("[parts.gauge]\ngain = 3", &["line 1", "gauge.gain = 3", "0.5 to 1.5"]);
        let happens = |rest| format!("seed = 3\n\n[[happens]]\nafter_ms = 7\nwhat = {rest}");
        refused(
            &happens("\"motor-stals\""),
            &["line 5", "what = \"motor-stals\" is unknown, expected one of emergency-stop, "],
        );
        refused(&happens("\"memory-bit-flips\"\nbit = 99"), &["line 3", "bit = 99", "0 to 7"]);
        refused(&happens("\"memory-bit-flips\"\naddress = 32768"), &["line 3", "address = 32768", "32767"]);
        refused(&happens("\"motor-weak\"\namount = 2"), &["line 3", "amount = 2", "0 to 1"]);
        refused(&happens("\"reset-button\"\nstage = \"lens\""), &["line 3", "stage has no effect"]);
        refused(&happens("\"reset-button\"\nfor_ms = 3"), &["line 3", "for_ms has no effect"]);
        refused(&happens("\"reset-button\"\non = \"alarm\""), &["line 3", "exclude each other"]);
        refused(&happens("\"reset-button\"\nnth = 2"), &["line 3", "nth"]);
        refused(
            "[[happens]]\nwhat = \"reset-button\"",
            &["line 1", "after_ms, after_cycles, on and chance_per_s"],
        );
        refused("[[happens]]\non = \"dawn\"\nwhat = \"reset-button\"", &["line 2", "dawn", "motion-begins"]);
        refused("[[host]]\ndoes = \"dance\"", &["line 2", "dance", "home"]);
        refused("[[host]]\ndoes = \"move\"\naxis = \"lens\"", &["to_um"]);
    }
}

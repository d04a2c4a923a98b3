//! Exposure programs from a file, and focus stacks.
//! ```toml
//! exposure_us = 5000            # defaults of all shots
//! settle_window_nm = 100
//! settle_dwell_us = 2000
//! repeat = 1
//! trigger = "hardware"          # hardware, software, free-running; the same for all shots
//! [[shot]]
//! axis = "coarse"               # coarse, fine, lens
//! to_um = 5800.0
//! [[shot]]
//! axis = "fine"
//! to_um = 120.0
//! exposure_us = 2000
//! ```

use farnear_protocol::{
    Settle,
    message::{Axis, Shot, ShotRecord, TriggerMode},
    units::{Micros, Nanometres},
};
use serde::{Deserialize, Deserializer, de::Error};

#[derive(Clone, Copy, PartialEq, Debug)]
pub struct ShotDefaults {
    pub exposure: Micros,
    /// `None`, also for the dwell: as [`Settle::of_shot`].
    pub settle_window: Option<Nanometres>,
    pub settle_dwell: Option<Micros>,
    pub repeat: u16,
    pub mode: TriggerMode,
}

impl Default for ShotDefaults {
    fn default() -> Self {
        Self {
            exposure: Micros(5_000),
            settle_window: None,
            settle_dwell: None,
            repeat: 1,
            mode: TriggerMode::Hardware,
        }
    }
}

impl ShotDefaults {
    pub fn shot(&self, axis: Axis, target: Nanometres) -> Shot {
        let usual = Settle::of_shot(axis);
        Shot {
            axis,
            target,
            exposure: self.exposure,
            settle_window: self.settle_window.unwrap_or(usual.window),
            settle_dwell: self.settle_dwell.unwrap_or(usual.dwell),
            repeat: self.repeat,
            mode: self.mode,
        }
    }

    /// Focus stack of `steps` shots, both ends included; a single step uses the first.
    pub fn stack(&self, axis: Axis, from: Nanometres, to: Nanometres, steps: usize) -> Vec<Shot> {
        let span = i64::from(to.0) - i64::from(from.0);
        let intervals = steps.saturating_sub(1).max(1) as i64;
        (0..steps as i64)
            .map(|step| {
                let offset = (span * step * 2 + intervals * span.signum()) / (intervals * 2);
                self.shot(axis, Nanometres((i64::from(from.0) + offset) as i32))
            })
            .collect()
    }
}

#[derive(Debug, thiserror::Error)]
pub enum ProgramError {
    #[error("{0}")]
    Toml(#[from] toml::de::Error),
    #[error("it has no [[shot]]")]
    Empty,
    #[error("shot {index}: {to_um} um is out of range: expected a number between -2147483 and 2147483 um")]
    Position { index: usize, to_um: f64 },
}

// Repeated in both structs, because serde cannot reject unknown keys next to a flattened struct.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ProgramFile {
    exposure_us: Option<u32>,
    settle_window_nm: Option<i32>,
    settle_dwell_us: Option<u32>,
    repeat: Option<u16>,
    trigger: Option<Trigger>,
    #[serde(default)]
    shot: Vec<ShotEntry>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ShotEntry {
    #[serde(deserialize_with = "axis_by_name")]
    axis: Axis,
    to_um: f64,
    exposure_us: Option<u32>,
    settle_window_nm: Option<i32>,
    settle_dwell_us: Option<u32>,
    repeat: Option<u16>,
    trigger: Option<Trigger>,
}

struct Options {
    exposure_us: Option<u32>,
    settle_window_nm: Option<i32>,
    settle_dwell_us: Option<u32>,
    repeat: Option<u16>,
    trigger: Option<Trigger>,
}

#[derive(Deserialize, Clone, Copy)]
#[serde(rename_all = "kebab-case")]
enum Trigger {
    Hardware,
    Software,
    FreeRunning,
}

fn axis_by_name<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Axis, D::Error> {
    let name = String::deserialize(deserializer)?;
    Axis::ALL.into_iter().find(|axis| axis.name() == name).ok_or_else(|| {
        let names = Axis::ALL.map(Axis::name).join(", ");
        D::Error::custom(format!("unknown axis `{name}`, expected one of {names}"))
    })
}

impl Options {
    fn over(&self, defaults: &ShotDefaults) -> ShotDefaults {
        ShotDefaults {
            exposure: self.exposure_us.map_or(defaults.exposure, Micros),
            settle_window: self.settle_window_nm.map(Nanometres).or(defaults.settle_window),
            settle_dwell: self.settle_dwell_us.map(Micros).or(defaults.settle_dwell),
            repeat: self.repeat.unwrap_or(defaults.repeat),
            mode: self.trigger.map_or(defaults.mode, |trigger| match trigger {
                Trigger::Hardware => TriggerMode::Hardware,
                Trigger::Software => TriggerMode::Software,
                Trigger::FreeRunning => TriggerMode::FreeRunning,
            }),
        }
    }
}

/// Micrometres to nanometres; `None` beyond the range.
pub fn nanometres(position_um: f64) -> Option<Nanometres> {
    let nm = (position_um * 1e3).round();
    (nm.is_finite() && nm.abs() <= f64::from(i32::MAX)).then_some(Nanometres(nm as i32))
}

/// Reads a program file; `exposure` is that of shots whose file names none. The board checks the shots when armed.
pub fn read_program(text: &str, exposure: Micros) -> Result<Vec<Shot>, ProgramError> {
    let ProgramFile { exposure_us, settle_window_nm, settle_dwell_us, repeat, trigger, shot } =
        toml::from_str(text)?;
    let options = Options { exposure_us, settle_window_nm, settle_dwell_us, repeat, trigger };
    if shot.is_empty() {
        return Err(ProgramError::Empty);
    }
    let defaults = options.over(&ShotDefaults { exposure, ..ShotDefaults::default() });
    let shots = shot.into_iter().enumerate().map(|(index, entry)| {
        let ShotEntry { axis, to_um, exposure_us, settle_window_nm, settle_dwell_us, repeat, trigger } =
            entry;
        let options = Options { exposure_us, settle_window_nm, settle_dwell_us, repeat, trigger };
        let target = nanometres(to_um).ok_or(ProgramError::Position { index, to_um })?;
        Ok(options.over(&defaults).shot(axis, target))
    });
    shots.collect()
}

#[derive(Clone, PartialEq, Debug)]
pub struct SequenceShot {
    pub name: String,
    pub record: ShotRecord,
    pub mode: TriggerMode,
}

/// File name of an image of the shot with this index; the names of all `shots` sort in their order.
pub fn image_name(index: usize, shots: usize, record: &ShotRecord, repeats: u16) -> String {
    let digits = shots.saturating_sub(1).to_string().len().max(2);
    let places = repeats.saturating_sub(1).to_string().len().max(3);
    match repeats {
        0..=1 => format!("shot-{index:0digits$}.png"),
        _ => format!("shot-{index:0digits$}-{:0places$}.png", record.repeat),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_program_file_applies_its_defaults_to_shots() {
        let shots = read_program(
            "exposure_us = 3000\ntrigger = \"software\"\n\
             [[shot]]\naxis = \"coarse\"\nto_um = 5800.0\nsettle_window_nm = 700\n\
             [[shot]]\naxis = \"fine\"\nto_um = -0.5\nexposure_us = 20\nrepeat = 3\n",
            Micros(7),
        )
        .unwrap();
        let modes = shots.iter().all(|shot| shot.mode == TriggerMode::Software);
        assert!(modes && shots.len() == 2);
        assert_eq!(
            (shots[0].axis, shots[0].target.0, shots[0].exposure.0),
            (Axis::SensorCoarse, 5_800_000, 3000)
        );
        assert_eq!((shots[0].settle_window.0, shots[1].settle_window.0), (700, 100));
        assert_eq!((shots[1].target.0, shots[1].exposure.0, shots[1].repeat), (-500, 20, 3));
    }

    #[test]
    fn a_program_that_names_no_exposure_has_the_given_one() {
        let shots = read_program("[[shot]]\naxis = \"fine\"\nto_um = 1.0\n", Micros(2_000)).unwrap();
        assert_eq!(shots[0].exposure, Micros(2_000));
    }

    #[test]
    fn invalid_programs_are_rejected_with_a_reason() {
        for (text, phrase) in [
            ("exposure_us = 3", "no [[shot]]"),
            ("[[shot]]\naxis = \"z\"\nto_um = 1.0", "unknown axis `z`"),
            ("[[shot]]\naxis = \"fine\"", "to_um"),
            ("[[shot]]\naxis = \"fine\"\nto_um = 1e12", "shot 0: 1000000000000 um is out of range"),
            ("exposre_us = 3\n[[shot]]\naxis = \"fine\"\nto_um = 1.0", "exposre_us"),
            ("[[shot]]\naxis = \"fine\"\nto_um = 1.0\nexposre_us = 3", "exposre_us"),
        ] {
            let error = read_program(text, Micros(7)).unwrap_err().to_string();
            assert!(error.contains(phrase), "{error}");
        }
    }

    #[test]
    fn the_names_of_the_images_sort_by_shot() {
        let record = crate::continuous::tests::frame(0, 0).record;
        let names =
            |shots: usize| (0..shots).map(|index| image_name(index, shots, &record, 1)).collect::<Vec<_>>();
        assert_eq!((&*names(64)[7], &*names(101)[7]), ("shot-07.png", "shot-007.png"));
        assert!([64, 100, 101].into_iter().all(|shots| names(shots).is_sorted()));
        assert_eq!(image_name(7, 8, &record, 1000), "shot-07-000.png");
        assert_eq!(image_name(7, 8, &record, 1001), "shot-07-0000.png");
    }

    #[test]
    fn a_stack_has_both_its_ends() {
        let stack = ShotDefaults::default().stack(Axis::Lens, Nanometres(100), Nanometres(-900), 4);
        assert_eq!(stack.iter().map(|shot| shot.target.0).collect::<Vec<_>>(), [100, -233, -567, -900]);
        assert_eq!(ShotDefaults::default().stack(Axis::Lens, Nanometres(5), Nanometres(9), 1).len(), 1);
    }
}

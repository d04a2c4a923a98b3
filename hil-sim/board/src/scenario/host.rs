//! Steps of a scenario's host.

use farnear_protocol::message::{Axis, SettingKey};
use serde::{Deserialize, Serialize};

#[derive(Clone, PartialEq, Debug)]
pub enum Deed {
    Home(Option<Axis>),
    Move {
        axis: Axis,
        to_um: f64,
    },
    /// Loads, arms and runs a piezo program with one shot per position.
    Expose(Program),
    Continuous {
        program: Program,
        /// Trigger period; 0: as fast as possible.
        period_us: u32,
        exposures: u32,
    },
    Calibrate(Axis),
    Set {
        key: SettingKey,
        value: i32,
    },
    Stop,
    /// Immediate stop with an alarm.
    Halt,
    Reboot,
    /// Pauses the program after the current exposure.
    Pause,
    Resume,
    Clear,
    Silent {
        ms: f64,
    },
    /// Waits and answers keep-alives.
    Wait {
        ms: f64,
    },
}

#[derive(Clone, PartialEq, Debug)]
pub struct Program {
    pub at_um: Vec<f64>,
    pub exposure_us: u32,
    /// Position tolerance.
    pub window_nm: i32,
}

#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[serde(try_from = "Row", into = "Row")]
pub struct Step {
    pub deed: Deed,
    /// Continues after this time even if the step has not ended; `None`: waits for its end.
    pub goes_on_after_ms: Option<f64>,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Verb {
    Home,
    Move,
    Expose,
    Continuous,
    Calibrate,
    Set,
    Stop,
    Halt,
    Reboot,
    Pause,
    Resume,
    Clear,
    Silent,
    Wait,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Row {
    does: Verb,
    #[serde(skip_serializing_if = "Option::is_none")]
    axis: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    to_um: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    at_um: Option<Vec<f64>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    exposure_us: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    window_nm: Option<i32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    period_us: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    exposures: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    key: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    value: Option<i32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    ms: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    goes_on_after_ms: Option<f64>,
}

impl Row {
    fn new(does: Verb) -> Self {
        Self {
            does,
            axis: None,
            to_um: None,
            at_um: None,
            exposure_us: None,
            window_nm: None,
            period_us: None,
            exposures: None,
            key: None,
            value: None,
            ms: None,
            goes_on_after_ms: None,
        }
    }

    fn given(&self) -> Vec<&'static str> {
        let fields = [
            ("axis", self.axis.is_some()),
            ("to_um", self.to_um.is_some()),
            ("at_um", self.at_um.is_some()),
            ("exposure_us", self.exposure_us.is_some()),
            ("window_nm", self.window_nm.is_some()),
            ("period_us", self.period_us.is_some()),
            ("exposures", self.exposures.is_some()),
            ("key", self.key.is_some()),
            ("value", self.value.is_some()),
            ("ms", self.ms.is_some()),
        ];
        fields.into_iter().filter_map(|(name, there)| there.then_some(name)).collect()
    }

    fn only(&self, allowed: &[&str]) -> Result<(), String> {
        let verb = toml::Value::try_from(self.does).ok();
        let verb = verb.as_ref().and_then(toml::Value::as_str).unwrap_or_default();
        match self.given().into_iter().find(|field| !allowed.contains(field)) {
            Some(field) if allowed.is_empty() => {
                Err(format!("{field} has no effect with does = \"{verb}\": leave it out"))
            }
            Some(field) => Err(format!(
                "{field} has no effect with does = \"{verb}\", which accepts {}",
                allowed.join(", ")
            )),
            None => Ok(()),
        }
    }

    fn axis(&self) -> Result<Option<Axis>, String> {
        let Some(name) = &self.axis else { return Ok(None) };
        let found = Axis::ALL.into_iter().find(|axis| axis.name() == name);
        let names = Axis::ALL.map(Axis::name).join(", ");
        found.map(Some).ok_or_else(|| format!("axis = {name:?} is unknown, expected one of {names}"))
    }

    fn program(&self) -> Result<Program, String> {
        let at_um = self.at_um.clone().unwrap_or_else(|| vec![10.0, 166.27]);
        if at_um.is_empty() || at_um.len() > 64 {
            return Err(format!("at_um has {} positions, 1 to 64 are expected", at_um.len()));
        }
        Ok(Program {
            at_um,
            exposure_us: self.exposure_us.unwrap_or(2_000),
            window_nm: self.window_nm.unwrap_or(100),
        })
    }

    fn with_program(self, program: Program) -> Self {
        let Program { at_um, exposure_us, window_nm } = program;
        Self { at_um: Some(at_um), exposure_us: Some(exposure_us), window_nm: Some(window_nm), ..self }
    }

    fn setting(&self) -> Result<Deed, String> {
        let name = self.key.as_deref().unwrap_or_default();
        let key = SettingKey::ALL.into_iter().find(|key| key.name() == name).ok_or_else(|| {
            let names = SettingKey::ALL.map(SettingKey::name).join(", ");
            format!("key = {name:?} is unknown, expected one of {names}")
        })?;
        let value = self.value.ok_or("does = \"set\" wants value = a whole number")?;
        Ok(Deed::Set { key, value })
    }
}

const PROGRAM: [&str; 5] = ["at_um", "exposure_us", "window_nm", "period_us", "exposures"];

impl TryFrom<Row> for Step {
    type Error = String;

    fn try_from(row: Row) -> Result<Self, String> {
        let allowed: &[&str] = match row.does {
            Verb::Home | Verb::Calibrate => &["axis"],
            Verb::Move => &["axis", "to_um"],
            Verb::Expose => &PROGRAM[..3],
            Verb::Continuous => &PROGRAM,
            Verb::Set => &["key", "value"],
            Verb::Silent | Verb::Wait => &["ms"],
            Verb::Stop | Verb::Halt | Verb::Reboot | Verb::Pause | Verb::Resume | Verb::Clear => &[],
        };
        row.only(allowed)?;
        let ms = || row.ms.filter(|ms| (0.0..=1e6).contains(ms)).ok_or("ms = 0 to 1000000 is expected");
        let deed = match row.does {
            Verb::Home => Deed::Home(row.axis()?),
            Verb::Move => {
                let axis =
                    row.axis()?.ok_or("does = \"move\" wants axis = \"coarse\", \"fine\" or \"lens\"")?;
                let to_um = row.to_um.filter(|um| um.abs() <= 1e6);
                Deed::Move { axis, to_um: to_um.ok_or("does = \"move\" wants to_um = a position")? }
            }
            Verb::Expose => Deed::Expose(row.program()?),
            Verb::Continuous => Deed::Continuous {
                program: row.program()?,
                period_us: row.period_us.unwrap_or(0),
                exposures: row.exposures.unwrap_or(10),
            },
            Verb::Calibrate => Deed::Calibrate(
                row.axis()?.ok_or("does = \"calibrate\" wants axis = \"coarse\" or \"lens\"")?,
            ),
            Verb::Set => row.setting()?,
            Verb::Stop => Deed::Stop,
            Verb::Halt => Deed::Halt,
            Verb::Reboot => Deed::Reboot,
            Verb::Pause => Deed::Pause,
            Verb::Resume => Deed::Resume,
            Verb::Clear => Deed::Clear,
            Verb::Silent => Deed::Silent { ms: ms()? },
            Verb::Wait => Deed::Wait { ms: ms()? },
        };
        let goes_on_after_ms = row.goes_on_after_ms;
        if goes_on_after_ms.is_some_and(|ms| !(0.0..=1e6).contains(&ms)) {
            return Err(format!("goes_on_after_ms = {goes_on_after_ms:?} is not in 0 to 1000000"));
        }
        Ok(Self { deed, goes_on_after_ms })
    }
}

impl From<Step> for Row {
    fn from(step: Step) -> Self {
        let name = |axis: Axis| Some(axis.name().to_string());
        let row = match step.deed {
            Deed::Home(axis) => Self { axis: axis.and_then(name), ..Self::new(Verb::Home) },
            Deed::Move { axis, to_um } => {
                Self { axis: name(axis), to_um: Some(to_um), ..Self::new(Verb::Move) }
            }
            Deed::Expose(program) => Self::new(Verb::Expose).with_program(program),
            Deed::Continuous { program, period_us, exposures } => {
                let row = Self::new(Verb::Continuous).with_program(program);
                Self { period_us: Some(period_us), exposures: Some(exposures), ..row }
            }
            Deed::Calibrate(axis) => Self { axis: name(axis), ..Self::new(Verb::Calibrate) },
            Deed::Set { key, value } => {
                Self { key: Some(key.name().into()), value: Some(value), ..Self::new(Verb::Set) }
            }
            Deed::Stop => Self::new(Verb::Stop),
            Deed::Halt => Self::new(Verb::Halt),
            Deed::Reboot => Self::new(Verb::Reboot),
            Deed::Pause => Self::new(Verb::Pause),
            Deed::Resume => Self::new(Verb::Resume),
            Deed::Clear => Self::new(Verb::Clear),
            Deed::Silent { ms } => Self { ms: Some(ms), ..Self::new(Verb::Silent) },
            Deed::Wait { ms } => Self { ms: Some(ms), ..Self::new(Verb::Wait) },
        };
        Self { goes_on_after_ms: step.goes_on_after_ms, ..row }
    }
}

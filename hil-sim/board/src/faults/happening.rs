//! One scheduled fault: time, kind, target, duration.

use serde::{Deserialize, Serialize};

use super::{Kind, Moment};
use crate::plant::StageName;

#[derive(Clone, Copy, PartialEq, Debug)]
pub enum When {
    After {
        ms: f64,
    },
    On {
        moment: Moment,
        nth: u32,
        delay_ms: f64,
    },
    /// Poisson process, drawn from the seed.
    Chance {
        per_s: f64,
    },
}

#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
#[serde(try_from = "Row", into = "Row")]
pub struct Happening {
    pub when: When,
    pub what: Kind,
    /// `None`: never reverted.
    pub for_ms: Option<f64>,
    pub stage: StageName,
    /// In the unit of the kind.
    pub amount: f64,
    pub address: u16,
    pub bit: u8,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Row {
    #[serde(skip_serializing_if = "Option::is_none")]
    after_ms: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    after_cycles: Option<u64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    on: Option<Moment>,
    #[serde(skip_serializing_if = "Option::is_none")]
    nth: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    delay_ms: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    chance_per_s: Option<f64>,
    what: Kind,
    #[serde(skip_serializing_if = "Option::is_none")]
    for_ms: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    stage: Option<StageName>,
    #[serde(skip_serializing_if = "Option::is_none")]
    amount: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    address: Option<u16>,
    #[serde(skip_serializing_if = "Option::is_none")]
    bit: Option<u8>,
}

/// Longest time in a file: one day.
const LONGEST_MS: f64 = 86_400_000.0;

/// Core clock 168 MHz: times are rounded to whole cycles.
const CYCLES_PER_MS: f64 = 168_000.0;

fn within(name: &str, value: f64, (min, max): (f64, f64)) -> Result<f64, String> {
    // NaN is outside every range.
    if (min..=max).contains(&value) {
        Ok(value)
    } else {
        Err(format!("{name} = {value} is not in {min} to {max}"))
    }
}

impl Row {
    fn when(&self) -> Result<When, String> {
        if self.after_ms.is_some() && self.after_cycles.is_some() {
            return Err("after_ms and after_cycles exclude each other: name one of them".into());
        }
        let after_cycles = self.after_cycles.map(|cycles| cycles as f64 / CYCLES_PER_MS);
        let after_ms = self.after_ms.or(after_cycles);
        let after_ms = after_ms.map(|ms| within("after_ms", ms, (0.0, LONGEST_MS))).transpose()?;
        let delay_ms = self.delay_ms.map(|ms| within("delay_ms", ms, (0.0, LONGEST_MS))).transpose()?;
        let per_s = self.chance_per_s.map(|rate| within("chance_per_s", rate, (1e-6, 1e4))).transpose()?;
        if self.on.is_none() && (self.nth.is_some() || delay_ms.is_some()) {
            return Err("nth and delay_ms require `on`".into());
        }
        match (after_ms, self.on, per_s) {
            (Some(ms), None, None) => Ok(When::After { ms }),
            (None, Some(moment), None) => match self.nth.unwrap_or(1) {
                0 => Err("nth = 0 is invalid: the first time is nth = 1".into()),
                nth => Ok(When::On { moment, nth, delay_ms: delay_ms.unwrap_or(0.0) }),
            },
            (None, None, Some(per_s)) => Ok(When::Chance { per_s }),
            (None, None, None) => {
                Err("when does it happen? One of after_ms, after_cycles, on and chance_per_s is expected"
                    .into())
            }
            _ => Err("after_ms, on and chance_per_s exclude each other: name one of them".into()),
        }
    }

    fn superfluous(&self) -> Option<&'static str> {
        let Takes { stage, amount, place } = self.what.takes;
        let fields = [
            ("stage", self.stage.is_some() && !stage),
            ("amount", self.amount.is_some() && amount.is_none()),
            ("address", self.address.is_some() && !place),
            ("bit", self.bit.is_some() && !place),
            ("for_ms", self.for_ms.is_some() && self.what.revert.is_none()),
        ];
        fields.into_iter().find_map(|(name, there)| there.then_some(name))
    }
}

impl TryFrom<Row> for Happening {
    type Error = String;

    fn try_from(row: Row) -> Result<Self, String> {
        let kind = row.what;
        if let Some(field) = row.superfluous() {
            return Err(format!("{field} has no effect with what = \"{}\": leave it out", kind.name));
        }
        let (address, bit) = (row.address.unwrap_or(0), row.bit.unwrap_or(0));
        within("address", f64::from(address), (0.0, (rigless::chip::fram::SIZE - 1) as f64))?;
        within("bit", f64::from(bit), (0.0, 7.0))?;
        let amount = match (kind.takes.amount, row.amount) {
            (Some(range), Some(amount)) => within("amount", amount, (range.min, range.max))?,
            (Some(range), None) => range.usual,
            (None, _) => 0.0,
        };
        Ok(Self {
            when: row.when()?,
            what: kind,
            for_ms: row.for_ms.map(|ms| within("for_ms", ms, (0.0, LONGEST_MS))).transpose()?,
            stage: row.stage.unwrap_or(StageName::Sensor),
            amount,
            address,
            bit,
        })
    }
}

impl From<Happening> for Row {
    fn from(happening: Happening) -> Self {
        let Happening { when, what, for_ms, stage, amount, address, bit } = happening;
        let (mut after_ms, mut on, mut chance_per_s) = (None, None, None);
        match when {
            When::After { ms } => after_ms = Some(ms),
            When::On { moment, nth, delay_ms } => on = Some((moment, nth, delay_ms)),
            When::Chance { per_s } => chance_per_s = Some(per_s),
        }
        let takes = what.takes;
        Self {
            after_ms,
            after_cycles: None,
            on: on.map(|(moment, ..)| moment),
            nth: on.map(|(_, nth, _)| nth).filter(|nth| *nth != 1),
            delay_ms: on.map(|(_, _, ms)| ms).filter(|ms| *ms != 0.0),
            chance_per_s,
            what,
            for_ms,
            stage: takes.stage.then_some(stage),
            amount: takes.amount.map(|_| amount),
            address: takes.place.then_some(address),
            bit: takes.place.then_some(bit),
        }
    }
}

#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Takes {
    pub stage: bool,
    pub amount: Option<Amount>,
    pub place: bool,
}

#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Amount {
    pub min: f64,
    pub max: f64,
    pub usual: f64,
}

impl Takes {
    pub const NOTHING: Self = Self { stage: false, amount: None, place: false };
    pub const STAGE: Self = Self { stage: true, ..Self::NOTHING };
    pub const PLACE: Self = Self { place: true, ..Self::NOTHING };

    pub const fn amount(min: f64, max: f64, usual: f64) -> Self {
        Self { amount: Some(Amount { min, max, usual }), ..Self::NOTHING }
    }

    pub const fn stage_and_amount(min: f64, max: f64, usual: f64) -> Self {
        Self { amount: Some(Amount { min, max, usual }), ..Self::STAGE }
    }
}

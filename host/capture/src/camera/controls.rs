use std::{fmt, str::FromStr};

#[derive(Clone, PartialEq, Debug)]
pub enum Setting {
    ExposureUs(f64),
    /// Unit as in the camera's [`Control`].
    Gain(f64),
    BlackLevel(f64),
    /// Name as listed by the camera.
    PixelFormat(String),
    /// Column, row, width, height in pixels.
    Region([u32; 4]),
    /// Line as listed by the camera.
    TriggerSource(String),
}

const NAMES: [&str; 6] = ["exposure_us", "gain", "black_level", "pixel_format", "region", "trigger_source"];

impl Setting {
    pub fn name(&self) -> &'static str {
        match self {
            Self::ExposureUs(_) => NAMES[0],
            Self::Gain(_) => NAMES[1],
            Self::BlackLevel(_) => NAMES[2],
            Self::PixelFormat(_) => NAMES[3],
            Self::Region(_) => NAMES[4],
            Self::TriggerSource(_) => NAMES[5],
        }
    }

    pub fn value(&self) -> String {
        match self {
            Self::ExposureUs(value) | Self::Gain(value) | Self::BlackLevel(value) => value.to_string(),
            Self::PixelFormat(name) | Self::TriggerSource(name) => name.clone(),
            Self::Region([column, row, width, height]) => format!("{column},{row},{width},{height}"),
        }
    }
}

/// As [`Setting::from_str`] reads it.
impl fmt::Display for Setting {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}={}", self.name(), self.value())
    }
}

impl FromStr for Setting {
    type Err = String;

    /// `gain=3.5`, `region=0,0,640,480`.
    fn from_str(text: &str) -> Result<Self, String> {
        let (name, value) = text.split_once('=').ok_or_else(|| format!("`{text}`: expected NAME=VALUE"))?;
        let number = || match value.parse::<f64>() {
            Ok(number) if number.is_finite() => Ok(number),
            _ => Err(format!("{name}={value}: expected a number")),
        };
        match name {
            "exposure_us" => Ok(Self::ExposureUs(number()?)),
            "gain" => Ok(Self::Gain(number()?)),
            "black_level" => Ok(Self::BlackLevel(number()?)),
            "pixel_format" => Ok(Self::PixelFormat(value.into())),
            "trigger_source" => Ok(Self::TriggerSource(value.into())),
            "region" => {
                let parts: Result<Vec<u32>, _> = value.split(',').map(str::parse).collect();
                let parts = parts.ok().and_then(|parts| <[u32; 4]>::try_from(parts).ok());
                parts.map(Self::Region).ok_or_else(|| {
                    format!(
                        "region={value}: expected COLUMN,ROW,WIDTH,HEIGHT in pixels, e.g. region=0,0,640,480"
                    )
                })
            }
            _ => Err(format!("nothing is called `{name}`: expected one of {}", NAMES.join(", "))),
        }
    }
}

/// A setting, or a read-only value if it has no range.
#[derive(Clone, PartialEq, Debug)]
pub struct Control {
    /// [`Setting::name`], or the camera's own name of a read-only value.
    pub name: String,
    pub value: String,
    pub range: Range,
}

#[derive(Clone, PartialEq, Debug)]
pub enum Range {
    Fixed,
    Number {
        min: f64,
        max: f64,
        /// Empty for the camera's own steps.
        unit: &'static str,
    },
    Choice(Vec<String>),
}

impl Range {
    /// Whether a number is in range; false for names.
    pub fn has(&self, value: f64) -> bool {
        matches!(self, Self::Number { min, max, .. } if (*min..=*max).contains(&value))
    }
}

impl fmt::Display for Range {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Fixed => out.write_str("fixed"),
            Self::Number { min, max, unit: "" } => write!(out, "{min} to {max}"),
            Self::Number { min, max, unit } => write!(out, "{min} to {max} {unit}"),
            Self::Choice(names) => out.write_str(&names.join(", ")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_round_trip_through_text() {
        for text in ["exposure_us=1250.5", "gain=-3", "pixel_format=Mono12", "region=8,16,640,480"] {
            let setting: Setting = text.parse().unwrap();
            assert_eq!(format!("{}={}", setting.name(), setting.value()), text);
        }
        for (text, phrase) in [
            ("gain", "NAME=VALUE"),
            ("gain=much", "expected a number"),
            ("gain=NaN", "expected a number"),
            ("region=1,2,3", "WIDTH"),
            ("gian=1", "black_level"),
        ] {
            let error = text.parse::<Setting>().unwrap_err();
            assert!(error.contains(phrase), "{error}");
        }
    }

    #[test]
    fn ranges_print_their_unit() {
        let range = Range::Number { min: 10.0, max: 1e6, unit: "us" };
        assert_eq!(range.to_string(), "10 to 1000000 us");
        assert!(range.has(10.0) && !range.has(9.0) && !Range::Fixed.has(0.0));
    }
}

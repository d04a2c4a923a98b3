use aravis::{
    Auto,
    glib::{Error, GString},
    prelude::*,
};

use super::{GenicamCamera, unusable};
use crate::camera::{CameraError, Control, Range, Setting};

const AUTOMATICS: [&str; 3] = ["ExposureAuto", "GainAuto", "BlackLevelAuto"];
const ACTIVATION: &str = "TriggerActivation";
const RISING: &str = "RisingEdge";
const FALLING: &str = "FallingEdge";
/// Triggers of a frame, the best one first.
const STARTS: [&str; 3] = ["FrameStart", "FrameBurstStart", "AcquisitionStart"];
/// Steps of the camera's exposure: some lines, and a part of the exposure. The board's tolerance of the strobe is narrower.
const EXPOSURE_OFF_US: f64 = 100.0;
const EXPOSURE_OFF: f64 = 0.01;
/// Steps of gain and black level; Aravis cuts fractions off for whole numbers.
const LEVEL_OFF: f64 = 0.5;

impl GenicamCamera {
    /// The entry that is set; `None` for an absent feature. `Camera::string` crashes at a value without an entry.
    pub(super) fn entry(&self, name: &str) -> Option<String> {
        let known = self.camera.dup_available_enumerations(name).ok()?;
        let value = self.camera.integer(name).ok()?;
        known.contains(&value).then(|| self.camera.string(name).ok())?.map(|entry| entry.to_string())
    }

    /// Turns off what changes brightness between two images or bends the tone curve: depth compares the images and
    /// needs values proportional to the light.
    pub(super) fn steady(&self) -> Result<(), CameraError> {
        let camera = &self.camera;
        // A camera may lock them, e.g. ExposureAuto while the pulse is the exposure.
        let usable = |name: &str| camera.is_feature_available(name).unwrap_or(false);
        for name in AUTOMATICS {
            if usable(name) && self.entry(name).is_some_and(|mode| mode != "Off") {
                camera.set_string(name, "Off").map_err(self.failed())?;
            }
        }
        let enabled = usable("GammaEnable").then(|| camera.boolean("GammaEnable"));
        let bends = |gamma: f64| (gamma - 1.0).abs() > 1e-3;
        match enabled {
            Some(Ok(true)) => camera.set_boolean("GammaEnable", false).map_err(self.failed()),
            None if usable("Gamma") && self.gamma().is_some_and(bends) => {
                camera.set_float("Gamma", 1.0).map_err(self.failed())
            }
            _ => Ok(()),
        }
    }

    fn gamma(&self) -> Option<f64> {
        self.camera.float("Gamma").ok()
    }

    /// Turns off all triggers and returns them. A camera may refuse one while another is on, so the refused ones are tried
    /// again. A refusal counts where the trigger is on.
    pub(super) fn triggers_off(&self) -> Result<Vec<GString>, CameraError> {
        let camera = &self.camera;
        if !camera.is_feature_available("TriggerSelector").map_err(self.failed())? {
            camera.set_string("TriggerMode", "Off").map_err(self.failed())?;
            return Ok(Vec::new());
        }
        let triggers = camera.dup_available_triggers().map_err(self.failed())?;
        let mut refused = None;
        for _ in 0..2 {
            refused = None;
            for trigger in &triggers {
                camera.set_string("TriggerSelector", trigger).map_err(self.failed())?;
                let Err(error) = camera.set_string("TriggerMode", "Off") else { continue };
                if !self.answers() {
                    return Err(self.gone());
                }
                if self.entry("TriggerMode").is_some_and(|mode| mode != "Off") {
                    refused = Some(error);
                }
            }
            if refused.is_none() {
                break;
            }
        }
        refused.map_or(Ok(triggers), |error| Err(self.failed()(error)))
    }

    /// Does the same as Aravis' function, which however stops at the first refusal and always sets the rising edge. An
    /// opto-coupler with an open collector inverts the pulse and needs the falling one.
    pub(super) fn set_trigger(&self, source: &str) -> Result<(), CameraError> {
        let camera = &self.camera;
        let set = |name: &str, entry: &str| camera.set_string(name, entry).map_err(self.failed());
        const LIMIT: &str = "AcquisitionFrameRateEnable";
        if camera.is_feature_available(LIMIT).map_err(self.failed())? {
            camera.set_boolean(LIMIT, false).map_err(self.failed())?;
        }
        let triggers = self.triggers_off()?;
        if !triggers.is_empty() {
            let has = |name: &&str| triggers.iter().any(|trigger| trigger == *name);
            let start = STARTS.into_iter().find(has);
            let none = || unusable(&self.id, format!("it has none of the triggers {}", STARTS.join(", ")));
            set("TriggerSelector", start.ok_or_else(none)?)?;
        }
        set("TriggerMode", "On")?;
        let edges = camera.dup_available_enumerations_as_strings(ACTIVATION).unwrap_or_default();
        let falls = self.entry(ACTIVATION).is_some_and(|edge| edge == FALLING);
        if !falls && edges.iter().any(|edge| edge == RISING) {
            set(ACTIVATION, RISING)?;
        }
        set("TriggerSource", source)
    }

    /// Name and bounds of a setting that is a whole number under its standard name, where Aravis expects fractions.
    fn whole(&self, setting: &Setting) -> Option<(&'static str, i64, i64)> {
        let name = match setting {
            Setting::ExposureUs(_) => "ExposureTime",
            Setting::Gain(_) => "Gain",
            _ => "BlackLevel",
        };
        self.camera.integer_bounds(name).ok().map(|(min, max)| (name, min, max))
    }

    fn number(&self, setting: &Setting) -> Result<f64, Error> {
        match (self.whole(setting), setting) {
            (Some((name, ..)), _) => self.camera.integer(name).map(|value| value as f64),
            (None, Setting::ExposureUs(_)) => self.camera.exposure_time(),
            (None, Setting::Gain(_)) => self.camera.gain(),
            (None, _) => self.camera.black_level(),
        }
    }

    pub(super) fn all_controls(&self) -> Result<Vec<Control>, CameraError> {
        let failed = self.failed();
        let camera = &self.camera;
        let mut controls = Vec::new();
        let mut add =
            |name: &str, value: String, range| controls.push(Control { name: name.into(), value, range });
        for setting in [Setting::ExposureUs(0.0), Setting::Gain(0.0), Setting::BlackLevel(0.0)] {
            if let (Some(range), Ok(value)) = (self.range(&setting), self.number(&setting)) {
                add(setting.name(), value.to_string(), range);
            }
        }
        let names = |names: Vec<GString>| Range::Choice(names.iter().map(ToString::to_string).collect());
        let formats = camera.dup_available_pixel_formats_as_strings().map_err(&failed)?;
        let format = self.entry("PixelFormat").unwrap_or_else(|| "unknown".into());
        add("pixel_format", format, names(formats));
        let (column, row, width, height) = camera.region().map_err(&failed)?;
        add("region", format!("{column},{row},{width},{height}"), Range::Fixed);
        if let (Some(source), Ok(sources)) =
            (self.entry("TriggerSource"), camera.dup_available_trigger_sources())
        {
            add("trigger_source", source, names(sources));
        }
        if let Ok((width, height)) = camera.sensor_size() {
            add("sensor", format!("{width}x{height}"), Range::Fixed);
        }
        for (name, value) in [("vendor", camera.vendor_name()), ("model", camera.model_name())] {
            if let Ok(value) = value {
                add(name, value.to_string(), Range::Fixed);
            }
        }
        for name in AUTOMATICS.into_iter().chain([ACTIVATION]) {
            if let Some(entry) = self.entry(name) {
                add(name, entry, Range::Fixed);
            }
        }
        if let Ok(enabled) = camera.boolean("GammaEnable") {
            add("GammaEnable", enabled.to_string(), Range::Fixed);
        }
        if let Some(gamma) = self.gamma() {
            add("Gamma", gamma.to_string(), Range::Fixed);
        }
        for name in ["BinningHorizontal", "BinningVertical"] {
            if let Ok(pixels) = camera.integer(name) {
                add(name, pixels.to_string(), Range::Fixed);
            }
        }
        Ok(controls)
    }

    pub(super) fn set_number(&self, setting: &Setting, value: f64) -> Result<(), CameraError> {
        let wrong = |expected: String| CameraError::Setting {
            name: setting.name(),
            value: setting.value(),
            expected,
        };
        let range = self.range(setting).ok_or_else(|| match self.answers() {
            true => wrong(format!("{} has no such feature", self.id)),
            false => self.gone(),
        })?;
        if !range.has(value) {
            return Err(wrong(format!("expected {range}")));
        }
        // Automatic modes are switched off; a camera without them needs nothing.
        let _ = match setting {
            Setting::ExposureUs(_) => self.camera.set_exposure_time_auto(Auto::Off),
            Setting::Gain(_) => self.camera.set_gain_auto(Auto::Off),
            _ => Ok(()),
        };
        let set = match (self.whole(setting), setting) {
            (Some(_), Setting::Gain(_) | Setting::BlackLevel(_)) if value.fract() != 0.0 => {
                return Err(wrong("expected a whole number".into()));
            }
            (Some((name, ..)), _) => self.camera.set_integer(name, value.round() as i64),
            (None, Setting::ExposureUs(_)) => self.camera.set_exposure_time(value),
            // Aravis ignores a negative gain.
            (None, Setting::Gain(_)) if value < 0.0 => self.camera.set_float("Gain", value),
            (None, Setting::Gain(_)) => self.camera.set_gain(value),
            (None, _) => self.camera.set_black_level(value),
        };
        set.map_err(self.failed())?;
        let off = match setting {
            Setting::ExposureUs(_) => EXPOSURE_OFF_US + value * EXPOSURE_OFF,
            _ => LEVEL_OFF,
        };
        let taken = self.number(setting).map_err(self.failed())?;
        match (taken - value).abs() > off {
            true => Err(wrong(format!("the camera made {taken} of it; expected a value that it can set"))),
            false => Ok(()),
        }
    }

    pub(super) fn range(&self, setting: &Setting) -> Option<Range> {
        let camera = &self.camera;
        let unit = if matches!(setting, Setting::ExposureUs(_)) { "us" } else { "" };
        let (min, max) = match (self.whole(setting), setting) {
            (Some((_, min, max)), _) => (min as f64, max as f64),
            (None, Setting::ExposureUs(_)) => camera.exposure_time_bounds().ok()?,
            (None, Setting::Gain(_)) if camera.is_gain_available().ok()? => camera.gain_bounds().ok()?,
            (None, Setting::BlackLevel(_)) if self.has_black_level() => camera.black_level_bounds().ok()?,
            _ => return None,
        };
        Some(Range::Number { min, max, unit })
    }

    /// Checked by name, because the bindings report success for absent features.
    fn has_black_level(&self) -> bool {
        ["BlackLevel", "BlackLevelRaw"]
            .iter()
            .any(|name| self.camera.is_feature_available(name).unwrap_or(false))
    }

    pub(super) fn set_region(&self, setting: &Setting, region: [u32; 4]) -> Result<(), CameraError> {
        let camera = &self.camera;
        let wrong = |expected: String| CameraError::Setting {
            name: setting.name(),
            value: setting.value(),
            expected,
        };
        let (width, height) = camera.sensor_size().map_err(self.failed())?;
        let inside = |first: u32, length: u32, side: i32| {
            length > 0 && u64::from(first) + u64::from(length) <= u64::try_from(side).unwrap_or(0)
        };
        if !inside(region[0], region[2], width) || !inside(region[1], region[3], height) {
            return Err(wrong(format!("expected a part of the sensor's {width}x{height} px")));
        }
        let [column, row, width, height] = region.map(|side| i32::try_from(side).unwrap_or(i32::MAX));
        let steps = [
            ("column", column, camera.x_offset_bounds(), camera.x_offset_increment()),
            ("row", row, camera.y_offset_bounds(), camera.y_offset_increment()),
            ("width", width, camera.width_bounds(), camera.width_increment()),
            ("height", height, camera.height_bounds(), camera.height_increment()),
        ];
        for (name, asked, bounds, step) in steps {
            // A camera without an offset has no bounds of it.
            let (Ok((least, _)), Ok(step)) = (bounds, step) else { continue };
            let beyond = i64::from(asked) - i64::from(least);
            if beyond < 0 || (step > 1 && beyond % i64::from(step) != 0) {
                return Err(wrong(format!("expected a {name} from {least} px in steps of {step} px")));
            }
        }
        camera.set_region(column, row, width, height).map_err(self.failed())?;
        let taken = camera.region().map_err(self.failed())?;
        match taken == (column, row, width, height) {
            true => Ok(()),
            false => {
                Err(wrong(format!("the camera made {taken:?} of it; expected a region that it can set")))
            }
        }
    }

    pub(super) fn choice(
        &self,
        setting: &Setting,
        asked: &str,
        known: &[GString],
    ) -> Result<(), CameraError> {
        if known.iter().any(|name| name == asked) {
            return Ok(());
        }
        let names: Vec<&str> = known.iter().map(|name| name.as_str()).collect();
        let expected = format!("expected one of {}", names.join(", "));
        Err(CameraError::Setting { name: setting.name(), value: setting.value(), expected })
    }
}

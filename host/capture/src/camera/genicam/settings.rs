use aravis::{Auto, prelude::*};

use super::GenicamCamera;
use crate::camera::{CameraError, Range, Setting};

impl GenicamCamera {
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
        let set = match setting {
            Setting::ExposureUs(_) => {
                let _ = self.camera.set_exposure_time_auto(Auto::Off);
                self.camera.set_exposure_time(value)
            }
            Setting::Gain(_) => {
                let _ = self.camera.set_gain_auto(Auto::Off);
                self.camera.set_gain(value)
            }
            _ => self.camera.set_black_level(value),
        };
        set.map_err(self.failed())
    }

    pub(super) fn range(&self, setting: &Setting) -> Option<Range> {
        let camera = &self.camera;
        let (bounds, unit) = match setting {
            Setting::ExposureUs(_) => (camera.exposure_time_bounds(), "us"),
            Setting::Gain(_) if camera.is_gain_available().ok()? => (camera.gain_bounds(), ""),
            Setting::BlackLevel(_) if self.has_black_level() => (camera.black_level_bounds(), ""),
            _ => return None,
        };
        let (min, max) = bounds.ok()?;
        Some(Range::Number { min, max, unit })
    }

    /// Checked by name, because the bindings report success for absent features.
    fn has_black_level(&self) -> bool {
        ["BlackLevel", "BlackLevelRaw"]
            .iter()
            .any(|name| self.camera.is_feature_available(name).unwrap_or(false))
    }

    pub(super) fn set_region(&self, setting: &Setting, region: [u32; 4]) -> Result<(), CameraError> {
        let (width, height) = self.camera.sensor_size().map_err(self.failed())?;
        let inside = |first: u32, length: u32, side: i32| {
            length > 0 && u64::from(first) + u64::from(length) <= u64::try_from(side).unwrap_or(0)
        };
        if !inside(region[0], region[2], width) || !inside(region[1], region[3], height) {
            let expected = format!("expected a part of the sensor's {width}x{height} px");
            return Err(CameraError::Setting { name: setting.name(), value: setting.value(), expected });
        }
        let [column, row, width, height] = region.map(|side| i32::try_from(side).unwrap_or(i32::MAX));
        self.camera.set_region(column, row, width, height).map_err(self.failed())
    }

    pub(super) fn choice(
        &self,
        setting: &Setting,
        asked: &str,
        known: &[aravis::glib::GString],
    ) -> Result<(), CameraError> {
        if known.iter().any(|name| name == asked) {
            return Ok(());
        }
        let names: Vec<&str> = known.iter().map(|name| name.as_str()).collect();
        let expected = format!("expected one of {}", names.join(", "));
        Err(CameraError::Setting { name: setting.name(), value: setting.value(), expected })
    }
}

//! Properties of the emulated parts (`parts.toml`, with sources). A file of the same form overrides values.

use std::path::Path;

use farnear_scene::{Defects, EllipticalDistortion, Lens, View};
use rigless::chip::fram::DEVICE_ID;
use serde::{Deserialize, Serialize};

use crate::error::SimError;

const STANDARD: &str = include_str!("../parts.toml");

#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Parts {
    pub processor: ProcessorParts,
    pub gauge_converter: ConverterParts,
    pub gauge: GaugeParts,
    pub piezo: PiezoParts,
    pub memory: MemoryParts,
    pub supply: SupplyParts,
    pub switches: SwitchParts,
    pub wires: WireParts,
    pub driver: DriverParts,
    pub imaging: ImagingParts,
    pub half_mirror: HalfMirrorParts,
}

#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HalfMirrorParts {
    /// Share of the light: first and second camera.
    pub light: [f64; 2],
    /// Offset of the second image from the first, right and down.
    pub second_shift_px: [f64; 2],
    /// Rotation of the second image, from x towards y.
    pub second_rotation_deg: f64,
    /// Whether the second image is mirrored left to right.
    pub second_mirrored: bool,
}

impl HalfMirrorParts {
    pub fn second_view(&self) -> View {
        View { shift_px: self.second_shift_px, rotation_deg: self.second_rotation_deg, ..View::default() }
    }
}

/// Fields up to `field_radius`: [`EllipticalDistortion`]; the next four: [`Defects`].
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ImagingParts {
    pub field_offset: f64,
    pub field_curvature: f64,
    pub field_slope: f64,
    pub field_centre: [f64; 2],
    pub field_radius: [f64; 2],
    pub vignetting: f64,
    pub uneven_light: [f64; 2],
    pub hot_pixel_share: f64,
    pub hot_pixel_e: f64,
    /// Speed of the scene in the image, right and down.
    pub scene_px_per_s: [f64; 2],
    pub light: LightParts,
}

#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LightParts {
    /// Exposure time at which a brightness of 1 exposes as the camera's exposure level says.
    pub exposure_ms: f64,
    /// Brightness of the room.
    pub room: f64,
    /// Share of the room's light that flickers, and how often a second.
    pub flicker: f64,
    pub flicker_hz: f64,
    /// Brightness that each light output adds when fully on.
    pub lamps: [f64; 2],
    /// The scene is blank; the second output projects the scene's texture.
    pub blank_walls: bool,
}

impl LightParts {
    /// Mean brightness of an exposure from the outputs' means: textured and even light.
    pub fn brightness(&self, (begin_ns, end_ns): (u64, u64), outputs: [f64; 2]) -> (f64, f64) {
        let turn = |at_ns: u64| std::f64::consts::TAU * self.flicker_hz * 1e-9 * at_ns as f64;
        let (begin, end) = (turn(begin_ns), turn(end_ns));
        let swing = if end > begin { (begin.cos() - end.cos()) / (end - begin) } else { begin.sin() };
        let gain = 1e-6 * end_ns.saturating_sub(begin_ns) as f64 / self.exposure_ms;
        let room = self.room * (1.0 + self.flicker * swing);
        let [first, second] = [0, 1].map(|i| self.lamps[i] * outputs[i]);
        let (textured, even) =
            if self.blank_walls { (second, room + first) } else { (room + first + second, 0.0) };
        (gain * textured, gain * even)
    }
}

impl ImagingParts {
    /// The lens with its field curvature, if any.
    pub fn lens(&self, lens: Lens) -> Lens {
        if [self.field_offset, self.field_curvature, self.field_slope] == [0.0; 3] {
            return lens;
        }
        lens.with_distortion(EllipticalDistortion {
            offset: self.field_offset,
            curvature: self.field_curvature,
            slope: self.field_slope,
            centre: self.field_centre,
            radius: self.field_radius,
        })
    }

    pub fn defects(&self) -> Defects {
        Defects {
            vignetting: self.vignetting,
            uneven_light: self.uneven_light,
            hot_pixel_share: self.hot_pixel_share,
            hot_pixel_e: self.hot_pixel_e,
        }
    }
}

#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ProcessorParts {
    pub cycles_per_instruction: f64,
    /// Factor while the flash accelerator is not fully on.
    pub without_accelerator: f64,
}

#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ConverterParts {
    /// Minimum CNV pulse; the converter may not sample a shorter one.
    pub pulse_min_ns: u64,
    /// Shortest conversion. Without CNV low by then there is no busy indicator.
    pub conversion_min_ns: u64,
    /// Longest conversion; nothing can be read before.
    pub conversion_max_ns: u64,
    pub pull_up_ohm: f64,
    pub line_pf: f64,
    /// Input threshold as a share of the supply.
    pub threshold: f64,
}

impl ConverterParts {
    /// Time for a released low line to reach the threshold.
    pub fn rise_ns(&self) -> f64 {
        let time_constant_ns = self.pull_up_ohm * self.line_pf * 1e-3;
        -time_constant_ns * libm::log(1.0 - self.threshold)
    }
}

#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GaugeParts {
    /// Reading per micrometre, relative to the data sheet.
    pub gain: f64,
    /// Reading at the relaxed piezo.
    pub offset_um: f64,
    pub noise_um: f64,
}

#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MemoryParts {
    pub make: MemoryMake,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub enum MemoryMake {
    #[serde(rename = "FM25V02")]
    Fm25v02,
    /// Successor with another revision in its name.
    #[serde(rename = "FM25V02A")]
    Fm25v02a,
    #[serde(rename = "none")]
    None,
}

impl MemoryMake {
    pub const fn name(self) -> [u8; 9] {
        match self {
            Self::Fm25v02 => DEVICE_ID,
            Self::Fm25v02a => [0x7f, 0x7f, 0x7f, 0x7f, 0x7f, 0x7f, 0xc2, 0x22, 0x08],
            Self::None => [0xff; 9],
        }
    }
}

#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SupplyParts {
    /// Option bytes at the first power-on.
    pub brown_out: BrownOut,
    /// Falling thresholds of levels 1 to 3.
    pub brown_out_mv: [u32; 3],
    /// Threshold of the power-down reset, which is always on.
    pub power_down_mv: u32,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum BrownOut {
    /// Factory setting.
    Off,
    #[serde(rename = "level-1")]
    Level1,
    #[serde(rename = "level-2")]
    Level2,
    #[serde(rename = "level-3")]
    Level3,
}

impl BrownOut {
    /// Field BOR_LEV of the option bytes (RM0090, section 3.9.10).
    pub const fn bits(self) -> u64 {
        match self {
            Self::Level3 => 0b00,
            Self::Level2 => 0b01,
            Self::Level1 => 0b10,
            Self::Off => 0b11,
        }
    }
}

impl SupplyParts {
    pub fn reset_mv(&self, bor_lev: u64) -> u32 {
        match bor_lev {
            0b00 => self.brown_out_mv[2],
            0b01 => self.brown_out_mv[1],
            0b10 => self.brown_out_mv[0],
            _ => self.power_down_mv,
        }
    }
}

#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PiezoParts {
    pub second_mode_hz: f64,
    pub second_mode_damping: f64,
    /// Share of the second mode in a static deflection; 0 = none.
    pub second_mode_share: f64,
}

#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SwitchParts {
    pub bounce_us: u64,
    pub bounces_per_ms: f64,
    /// Length of a false opening.
    pub glitch_us: u64,
    /// Rate of false openings while the driver is on.
    pub glitches_per_s: f64,
}

#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WireParts {
    /// Pull resistors at the selects, clock and trigger; without them a reset lets these float.
    pub resistors: bool,
    pub break_rise_us: u64,
    pub break_bounce_us: u64,
}

#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DriverParts {
    /// Minimum time from DIR to STEP.
    pub direction_setup_ns: u64,
    /// Minimum time from STEP to DIR.
    pub direction_hold_ns: u64,
    /// Standstill under current before the first motion.
    pub standstill_ms: u64,
}

impl Default for Parts {
    fn default() -> Self {
        // Constant input, checked by a test.
        toml::from_str(STANDARD).unwrap_or_else(|error| unreachable!("parts.toml: {error}"))
    }
}

impl Parts {
    /// Reads a file with the values that differ from the default and from `base` (a scenario's `[parts]`).
    pub fn read(path: &Path, base: &toml::Table) -> Result<Self, SimError> {
        let wrong = |reason: String| SimError::Parts { path: path.into(), reason };
        let text = std::fs::read_to_string(path).map_err(|error| wrong(error.to_string()))?;
        Self::parse_over(base, &text).map_err(wrong)
    }

    pub(crate) fn parse(text: &str) -> Result<Self, String> {
        Self::parse_over(&toml::Table::new(), text)
    }

    fn parse_over(base: &toml::Table, text: &str) -> Result<Self, String> {
        let mut table: toml::Table = toml::from_str(STANDARD).map_err(|error| error.to_string())?;
        let other: toml::Table = toml::from_str(text).map_err(|error| error.to_string())?;
        for (part, values) in base.clone().into_iter().chain(other) {
            match (table.get_mut(&part), values) {
                (Some(toml::Value::Table(known)), toml::Value::Table(values)) => known.extend(values),
                (Some(_), _) => return Err(format!("{part} is a table: [{part}]")),
                (None, values) => drop(table.insert(part, values)), // rejected by name below
            }
        }
        let parts: Self = table.try_into().map_err(|error: toml::de::Error| error.to_string())?;
        parts.check()?;
        Ok(parts)
    }

    fn check(&self) -> Result<(), String> {
        let (processor, converter) = (&self.processor, &self.gauge_converter);
        let ranges = [
            ("processor.cycles_per_instruction", processor.cycles_per_instruction, 0.5, 10.0),
            ("processor.without_accelerator", processor.without_accelerator, 1.0, 10.0),
            ("gauge_converter.pull_up_ohm", converter.pull_up_ohm, 1.0, 1e6),
            ("gauge_converter.line_pf", converter.line_pf, 0.0, 1e4),
            ("gauge_converter.threshold", converter.threshold, 0.01, 0.99),
            ("gauge.gain", self.gauge.gain, 0.5, 1.5),
            ("gauge.offset_um", self.gauge.offset_um, -20.0, 20.0),
            ("gauge.noise_um", self.gauge.noise_um, 0.0, 10.0),
            ("piezo.second_mode_hz", self.piezo.second_mode_hz, 1.0, 5e3),
            ("piezo.second_mode_damping", self.piezo.second_mode_damping, 1e-4, 0.9),
            ("piezo.second_mode_share", self.piezo.second_mode_share, 0.0, 1.0),
            ("switches.bounces_per_ms", self.switches.bounces_per_ms, 0.0, 1e3),
            ("switches.glitches_per_s", self.switches.glitches_per_s, 0.0, 1e4),
            ("imaging.light.exposure_ms", self.imaging.light.exposure_ms, 0.001, 60_000.0),
            ("imaging.light.room", self.imaging.light.room, 0.0, 100.0),
            ("imaging.light.flicker", self.imaging.light.flicker, 0.0, 1.0),
            ("imaging.light.flicker_hz", self.imaging.light.flicker_hz, 0.1, 10_000.0),
            ("imaging.light.lamps, first", self.imaging.light.lamps[0], 0.0, 100.0),
            ("imaging.light.lamps, second", self.imaging.light.lamps[1], 0.0, 100.0),
            ("imaging.field_offset", self.imaging.field_offset, -2.0, 2.0),
            ("imaging.field_curvature", self.imaging.field_curvature, -5.0, 5.0),
            ("imaging.field_slope", self.imaging.field_slope, -5.0, 5.0),
            ("imaging.field_centre, x", self.imaging.field_centre[0], -10.0, 10.0),
            ("imaging.field_centre, y", self.imaging.field_centre[1], -10.0, 10.0),
            ("imaging.field_radius, x", self.imaging.field_radius[0], 0.1, 100.0),
            ("imaging.field_radius, y", self.imaging.field_radius[1], 0.1, 100.0),
            ("imaging.scene_px_per_s, x", self.imaging.scene_px_per_s[0], -1e5, 1e5),
            ("imaging.scene_px_per_s, y", self.imaging.scene_px_per_s[1], -1e5, 1e5),
            ("half_mirror.light, first", self.half_mirror.light[0], 0.01, 10.0),
            ("half_mirror.light, second", self.half_mirror.light[1], 0.01, 10.0),
            ("half_mirror.second_shift_px, x", self.half_mirror.second_shift_px[0], -1e3, 1e3),
            ("half_mirror.second_shift_px, y", self.half_mirror.second_shift_px[1], -1e3, 1e3),
            ("half_mirror.second_rotation_deg", self.half_mirror.second_rotation_deg, -10.0, 10.0),
        ];
        for (name, value, min, max) in ranges {
            if !(min..=max).contains(&value) {
                return Err(format!("{name} = {value} is not in {min} to {max}"));
            }
        }
        self.check_whole_numbers()
    }

    fn check_whole_numbers(&self) -> Result<(), String> {
        let (converter, supply, switches, wires, driver) =
            (&self.gauge_converter, &self.supply, &self.switches, &self.wires, &self.driver);
        let [level_1, level_2, level_3] = supply.brown_out_mv.map(u64::from);
        let ranges: [(&str, u64, u64, u64); 14] = [
            ("gauge_converter.pulse_min_ns", converter.pulse_min_ns, 0, 1_000_000),
            ("gauge_converter.conversion_min_ns", converter.conversion_min_ns, 0, 1_000_000),
            ("gauge_converter.conversion_max_ns", converter.conversion_max_ns, 0, 1_000_000),
            // Below the 3.3 V of the supply with their hysteresis.
            ("supply.brown_out_mv, level 1", level_1, 1_000, 3_100),
            ("supply.brown_out_mv, level 2", level_2, 1_000, 3_100),
            ("supply.brown_out_mv, level 3", level_3, 1_000, 3_100),
            ("supply.power_down_mv", supply.power_down_mv.into(), 0, 3_100),
            ("switches.bounce_us", switches.bounce_us, 0, 100_000),
            ("switches.glitch_us", switches.glitch_us, 0, 1_000_000),
            ("wires.break_rise_us", wires.break_rise_us, 0, 1_000_000),
            ("wires.break_bounce_us", wires.break_bounce_us, 0, 100_000),
            ("driver.direction_setup_ns", driver.direction_setup_ns, 0, 1_000_000),
            ("driver.direction_hold_ns", driver.direction_hold_ns, 0, 1_000_000),
            ("driver.standstill_ms", driver.standstill_ms, 0, 100_000),
        ];
        match ranges.into_iter().find(|(_, value, min, max)| !(min..=max).contains(&value)) {
            Some((name, value, min, max)) => Err(format!("{name} = {value} is not in {min} to {max}")),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_overrides_only_the_values_that_it_contains() {
        assert_eq!(Parts::default().check(), Ok(()));
        let parts = Parts::parse("[memory]\nmake = \"FM25V02\"").expect("a good file");
        assert_eq!(parts, Parts { memory: MemoryParts { make: MemoryMake::Fm25v02 }, ..Parts::default() });
        let refused = |text, expected: &str| {
            let reason = Parts::parse(text).expect_err(text);
            assert!(reason.contains(expected), "{reason}");
        };
        refused("[gauge]\ngain = 3.0", "gauge.gain = 3 is not in 0.5 to 1.5");
        refused("[gauge]\ngian = 1.0", "gian");
        refused("[gouge]\ngain = 1.0", "gouge");
        refused("gauge = 1", "gauge is a table");
        refused("[memory]\nmake = \"FM25V05\"", "FM25V05");
        refused(
            "[switches]\nbounce_us = 10000000000000000",
            "switches.bounce_us = 10000000000000000 is not in 0 to 100000",
        );
        refused("[switches]\nglitch_us = 10000000000000000", "switches.glitch_us");
        refused("[wires]\nbreak_rise_us = 10000000000000000", "wires.break_rise_us");
        refused("[supply]\nbrown_out_mv = [2190, 2500, 3300]", "supply.brown_out_mv, level 3 = 3300");
    }

    #[test]
    fn a_file_overrides_a_scenarios_parts_and_keeps_the_others() {
        let scenario: toml::Table =
            toml::from_str("[gauge]\ngain = 1.01\noffset_um = 0.5\n").expect("a good table");
        let parts = Parts::parse_over(&scenario, "[gauge]\ngain = 1.02\n[piezo]\nsecond_mode_share = 0.1")
            .expect("a good file");
        assert_eq!((parts.gauge.gain, parts.gauge.offset_um), (1.02, 0.5));
        assert_eq!(parts.piezo.second_mode_share, 0.1);
    }

    #[test]
    fn a_released_line_rises_with_its_time_constant() {
        // 21.6 kOhm and 15 pF: 0.32 us, half way after 0.69 of that.
        let rise_ns = Parts::default().gauge_converter.rise_ns();
        assert!((rise_ns - 224.6).abs() < 1.0, "{rise_ns}");
    }
}

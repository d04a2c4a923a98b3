//! Settings by key with ranges.

use farnear_protocol::message::{Axis, Setting, SettingKey, StepperKeys};
use farnear_protocol::{Micros, Nanometres};

use super::{STEP_PM, Settings, StepperSettings};

pub(crate) const KEYS: usize = SettingKey::ALL.len();

/// Values in the order of [`SettingKey::ALL`].
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Values([i32; KEYS]);

impl Values {
    pub const DEFAULT: Self = {
        let mut values = [0; KEYS];
        let mut i = 0;
        while i < KEYS {
            values[i] = range(SettingKey::ALL[i]).0;
            i += 1;
        }
        Self(values)
    };

    pub const fn get(&self, key: SettingKey) -> i32 {
        self.0[key as usize]
    }

    /// A setting for the host. Smallest and largest position bound each other.
    pub fn setting(&self, key: SettingKey) -> Setting {
        let (default, mut min, mut max) = range(key);
        for (low, high) in Axis::ALL.map(limit_keys) {
            if key == low {
                max = self.get(high);
            } else if key == high {
                min = self.get(low);
            }
        }
        Setting { key, value: self.get(key), default, min, max }
    }

    /// Changes a setting, or returns it with its range if `value` is outside.
    pub fn set(&mut self, key: SettingKey, value: i32) -> Result<(), Setting> {
        let setting = self.setting(key);
        if !(setting.min..=setting.max).contains(&value) {
            return Err(setting);
        }
        self.0[key as usize] = value;
        Ok(())
    }

    /// Values from memory: those out of range, e.g. of another firmware, become the default.
    pub(crate) fn restored(values: [i32; KEYS]) -> Self {
        let mut restored = Self::DEFAULT;
        for (key, value) in SettingKey::ALL.into_iter().zip(values) {
            let (_, min, max) = range(key);
            if (min..=max).contains(&value) {
                restored.0[key as usize] = value;
            }
        }
        for (low, high) in Axis::ALL.map(limit_keys) {
            if restored.get(low) > restored.get(high) {
                restored.0[low as usize] = range(low).0;
                restored.0[high as usize] = range(high).0;
            }
        }
        restored
    }

    pub(crate) const fn raw(&self) -> &[i32; KEYS] {
        &self.0
    }
}

const fn limit_keys(axis: Axis) -> (SettingKey, SettingKey) {
    match StepperKeys::of(axis) {
        Some(StepperKeys { min, max, .. }) => (min, max),
        None => (SettingKey::FineMinNm, SettingKey::FineMaxNm),
    }
}

/// Default, smallest and largest value. Reasons in [`Settings`] are not repeated.
const fn range(key: SettingKey) -> (i32, i32, i32) {
    match key {
        // The thesis' lens (f = 50 mm) needs 52.8 to 53.0 mm (Li 2014, chapter 4): 5.9 mm into the travel. Lenses of 4 mm
        // focus closer, those of 400 mm further.
        SettingKey::DatumNm => (47_000_000, 1_000_000, DISTANCE_NM),
        // Homing brakes a quarter of a millimetre beyond the switch, possibly on both stages.
        SettingKey::DistanceMinNm => (46_450_000, 0, DISTANCE_NM),
        SettingKey::CoarseMinNm | SettingKey::LensMinNm => (0, 0, TRAVEL_NM),
        SettingKey::CoarseMaxNm | SettingKey::LensMaxNm => (TRAVEL_NM, 0, TRAVEL_NM),
        // 6.25 mm/s is 40 kHz: 13 mm in 2.2 s, and 750 rpm, where such a motor still has torque at 24 V.
        SettingKey::CoarseSpeedNmPerS | SettingKey::LensSpeedNmPerS => (6_250_000, 160_000, 6_250_000),
        // 50 mm/s2, a tenth of what the motor's torque allows.
        SettingKey::CoarseAccelerationUmPerS2 | SettingKey::LensAccelerationUmPerS2 => {
            (50_000, 1_000, 400_000)
        }
        // Bends of 31 ms, two periods of the lowest resonance that such a stage may have.
        SettingKey::CoarseJerkUmPerS3 | SettingKey::LensJerkUmPerS3 => (1_600_000, 10_000, 100_000_000),
        // Screw of the parts list; the calibration measures the real one.
        SettingKey::CoarseBacklashNm | SettingKey::LensBacklashNm => (4_000, 0, 100_000),
        // A stalled motor slips by four full steps (10 um) at a time; load angle and latency stay below 4 um.
        SettingKey::CoarseFollowingNm | SettingKey::LensFollowingNm => (6_000, 1_000, 100_000),
        SettingKey::FineMinNm => (FINE_MIN_NM, FINE_MIN_NM, FINE_MAX_NM),
        SettingKey::FineMaxNm => (FINE_MAX_NM, FINE_MIN_NM, FINE_MAX_NM),
        // 200 um over 65535 codes.
        SettingKey::PiezoGainPmPerCode => (3_052, 2_000, 4_000),
        // Not measured yet: the loop alone compensates hysteresis and creep.
        SettingKey::PiezoHysteresisPpm => (0, 0, 300_000),
        SettingKey::PiezoCreepPpmPerDecade => (0, 0, 100_000),
        // Read-out takes 10 ms and overlaps the next move; 5 % for its clock.
        SettingKey::CameraReadoutUs => (10_500, 0, 1_000_000),
        // Latency 20 us; without answer after 5 ms the trigger was missed.
        SettingKey::StrobeDeadlineUs => (5_000, 100, 1_000_000),
        // Data sheet value until calibrated; such a gauge errs by less than a tenth.
        SettingKey::GaugeGainPpm => (1_000_000, 900_000, 1_100_000),
        // The converter's range starts 10 um below zero.
        SettingKey::GaugeOffsetNm => (0, -9_000, 9_000),
        // The fast loop, for a flexure with a single resonance.
        SettingKey::PiezoSecondMode => (0, 0, 1),
    }
}

/// Largest distance of sensor and lens; with both travels it stays within 32 bits.
const DISTANCE_NM: i32 = 1_000_000_000;
/// The micrometers' travel; the far switches sit beyond it.
const TRAVEL_NM: i32 = 13_000_000;
/// 5 um at each end of the stroke are the loop's: hysteresis and creep move the ends, and saturation prevents damping.
const FINE_MIN_NM: i32 = 5_000;
pub(crate) const FINE_MAX_NM: i32 = 195_000;

impl Settings {
    pub const fn with(mut self, values: &Values) -> Self {
        self.datum = Nanometres(values.get(SettingKey::DatumNm));
        self.distance_min = Nanometres(values.get(SettingKey::DistanceMinNm));
        self.coarse = self.coarse.with(values, StepperKeys::COARSE);
        self.lens = self.lens.with(values, StepperKeys::LENS);
        self.fine.min = Nanometres(values.get(SettingKey::FineMinNm));
        self.fine.max = Nanometres(values.get(SettingKey::FineMaxNm));
        self.fine.gain_pm_per_code = values.get(SettingKey::PiezoGainPmPerCode) as u32;
        self.fine.hysteresis_ppm = values.get(SettingKey::PiezoHysteresisPpm) as u32;
        self.fine.creep_ppm_per_decade = values.get(SettingKey::PiezoCreepPpmPerDecade) as u32;
        self.fine.gauge_gain_ppm = values.get(SettingKey::GaugeGainPpm) as u32;
        if values.get(SettingKey::PiezoSecondMode) != 0 {
            self.fine.gains = self.fine.gentle_gains;
            // With a shorter one this loop may still creep through the window.
            self.fine.dwell_min = Micros(10_000);
        }
        self.fine.gauge_offset = Nanometres(values.get(SettingKey::GaugeOffsetNm));
        self.camera.readout = Micros(values.get(SettingKey::CameraReadoutUs) as u32);
        self.camera.strobe_deadline = Micros(values.get(SettingKey::StrobeDeadlineUs) as u32);
        self
    }
}

impl StepperSettings {
    const fn with(mut self, values: &Values, keys: StepperKeys) -> Self {
        let StepperKeys { min, max, speed, acceleration, jerk, backlash, following } = keys;
        self.min = Nanometres(values.get(min));
        self.max = Nanometres(values.get(max));
        self.speed = pulses(values.get(speed), 1_000);
        // A rig set to be slow also homes slowly.
        self.home_search_speed = smaller(self.home_search_speed, self.speed);
        self.home_leave_speed = smaller(self.home_leave_speed, self.speed);
        self.acceleration = pulses(values.get(acceleration), 1_000_000);
        self.jerk = pulses(values.get(jerk), 1_000_000);
        self.backlash = Nanometres(values.get(backlash));
        self.following = Nanometres(values.get(following));
        self
    }
}

const fn smaller(a: u32, b: u32) -> u32 {
    if a < b { a } else { b }
}

/// A length in units of `pm` picometres as pulses; the ranges keep it positive and within 32 bits.
const fn pulses(value: i32, pm: u64) -> u32 {
    (value as u64 * pm / STEP_PM as u64) as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_keys_are_in_the_order_of_their_numbers_and_the_defaults_in_their_ranges() {
        for (index, key) in SettingKey::ALL.into_iter().enumerate() {
            assert_eq!(key as usize, index);
            let setting = Values::DEFAULT.setting(key);
            assert!((setting.min..=setting.max).contains(&setting.default), "{setting:?}");
            assert_eq!(setting.value, setting.default);
        }
    }

    #[test]
    fn speeds_become_pulses() {
        let settings = Settings::DEFAULT;
        let stepper = settings.coarse;
        assert_eq!((stepper.speed, stepper.acceleration, stepper.jerk), (40_000, 320_000, 10_240_000));
        assert_eq!(settings.coarse, settings.lens);
    }

    #[test]
    fn a_slow_rig_homes_slowly() {
        let mut values = Values::DEFAULT;
        values.set(SettingKey::LensSpeedNmPerS, 500_000).expect("within its range");
        let settings = Settings::DEFAULT.with(&values);
        assert_eq!((settings.lens.home_search_speed, settings.lens.home_leave_speed), (3_200, 3_200));
        assert_eq!(settings.coarse.home_search_speed, Settings::DEFAULT.coarse.home_search_speed);
    }

    #[test]
    fn the_datum_suits_short_and_long_lenses() {
        let mut values = Values::DEFAULT;
        // Lenses of 4, 8 and 400 mm, focused a few millimetres into the travel.
        for datum in [2_000_000, 3_000_000, 405_000_000] {
            for key in [SettingKey::DatumNm, SettingKey::DistanceMinNm] {
                assert_eq!(values.set(key, datum), Ok(()), "{datum}");
            }
        }
    }

    #[test]
    fn a_value_outside_its_range_is_rejected_with_the_range() {
        let mut values = Values::DEFAULT;
        let refused = values.set(SettingKey::CoarseMaxNm, 13_000_001);
        assert!(matches!(refused, Err(Setting { max: 13_000_000, min: 0, .. })), "{refused:?}");
        assert_eq!(values, Values::DEFAULT);
        values.set(SettingKey::CoarseMaxNm, 5_000_000).expect("within the travel");
        assert_eq!(values.setting(SettingKey::CoarseMinNm).max, 5_000_000, "they bound each other");
        assert!(values.set(SettingKey::CoarseMinNm, 5_000_001).is_err());
    }

    #[test]
    fn stored_values_out_of_range_become_the_default() {
        let mut raw = *Values::DEFAULT.raw();
        (raw[0], raw[2]) = (i32::MIN, 1_000);
        let values = Values::restored(raw);
        assert_eq!(
            (values.get(SettingKey::DatumNm), values.get(SettingKey::CoarseMinNm)),
            (47_000_000, 1_000)
        );
    }

    #[test]
    fn stored_limits_that_exclude_each_other_become_the_defaults_of_their_axis() {
        use SettingKey::{CoarseMaxNm, FineMaxNm, FineMinNm, LensMaxNm, LensMinNm};
        for (low, high) in Axis::ALL.map(limit_keys) {
            let mut raw = *Values::DEFAULT.raw();
            (raw[CoarseMaxNm as usize], raw[LensMinNm as usize]) = (12_000_000, 100_000);
            (raw[LensMaxNm as usize], raw[FineMinNm as usize]) = (11_000_000, 6_000);
            raw[FineMaxNm as usize] = 190_000;
            let mut expected = raw;
            (raw[low as usize], raw[high as usize]) = (100_001, 100_000);
            for key in [low, high] {
                expected[key as usize] = range(key).0;
            }
            assert_eq!(Values::restored(raw).raw(), &expected, "{low:?}");
            // Equal limits leave one position.
            (raw[low as usize], raw[high as usize]) = (100_000, 100_000);
            assert_eq!(Values::restored(raw).raw(), &raw, "{low:?}");
        }
    }

    #[test]
    fn each_setting_changes_its_own_number() {
        use SettingKey::*;
        type Change = fn(&mut Settings);
        let table: [(SettingKey, i32, Change); SettingKey::ALL.len()] = [
            (DatumNm, 48_000_001, |s| s.datum = Nanometres(48_000_001)),
            (DistanceMinNm, 46_000_001, |s| s.distance_min = Nanometres(46_000_001)),
            (CoarseMinNm, 1_001, |s| s.coarse.min = Nanometres(1_001)),
            (CoarseMaxNm, 12_000_001, |s| s.coarse.max = Nanometres(12_000_001)),
            // A pulse is 156.25 nm.
            (CoarseSpeedNmPerS, 5_000_000, |s| s.coarse.speed = 32_000),
            (CoarseAccelerationUmPerS2, 100_000, |s| s.coarse.acceleration = 640_000),
            (CoarseJerkUmPerS3, 3_200_000, |s| s.coarse.jerk = 20_480_000),
            (CoarseBacklashNm, 7_001, |s| s.coarse.backlash = Nanometres(7_001)),
            (CoarseFollowingNm, 8_001, |s| s.coarse.following = Nanometres(8_001)),
            (LensMinNm, 1_002, |s| s.lens.min = Nanometres(1_002)),
            (LensMaxNm, 12_000_002, |s| s.lens.max = Nanometres(12_000_002)),
            (LensSpeedNmPerS, 5_000_000, |s| s.lens.speed = 32_000),
            (LensAccelerationUmPerS2, 100_000, |s| s.lens.acceleration = 640_000),
            (LensJerkUmPerS3, 3_200_000, |s| s.lens.jerk = 20_480_000),
            (LensBacklashNm, 7_002, |s| s.lens.backlash = Nanometres(7_002)),
            (LensFollowingNm, 8_002, |s| s.lens.following = Nanometres(8_002)),
            (FineMinNm, 6_001, |s| s.fine.min = Nanometres(6_001)),
            (FineMaxNm, 190_001, |s| s.fine.max = Nanometres(190_001)),
            (PiezoGainPmPerCode, 3_001, |s| s.fine.gain_pm_per_code = 3_001),
            (PiezoHysteresisPpm, 120_001, |s| s.fine.hysteresis_ppm = 120_001),
            (PiezoCreepPpmPerDecade, 15_001, |s| s.fine.creep_ppm_per_decade = 15_001),
            (CameraReadoutUs, 20_001, |s| s.camera.readout = Micros(20_001)),
            (StrobeDeadlineUs, 6_001, |s| s.camera.strobe_deadline = Micros(6_001)),
            (GaugeGainPpm, 1_010_001, |s| s.fine.gauge_gain_ppm = 1_010_001),
            (GaugeOffsetNm, -501, |s| s.fine.gauge_offset = Nanometres(-501)),
            (PiezoSecondMode, 1, |s| {
                (s.fine.gains, s.fine.dwell_min) = (s.fine.gentle_gains, Micros(10_000));
            }),
        ];
        for (key, value, change) in table {
            let (mut values, mut expected) = (Values::DEFAULT, Settings::DEFAULT);
            values.set(key, value).expect("within its range");
            change(&mut expected);
            assert_ne!(expected, Settings::DEFAULT, "{key:?}");
            assert_eq!(Settings::DEFAULT.with(&values), expected, "{key:?}");
        }
        assert_eq!(table.map(|(key, ..)| key), SettingKey::ALL);
    }
}

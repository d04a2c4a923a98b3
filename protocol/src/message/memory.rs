//! Non-volatile settings and records.

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use super::Axis;

/// A record in memory with version, CRC and two copies.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, Debug)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum RecordName {
    Settings,
    /// Boots, alarms, steps, and the last moved axes.
    Counters,
    Alarms,
    /// Loaded exposure program.
    Program,
    /// Coefficients of the depth correction.
    Correction,
}

macro_rules! settings {
    ($($(#[$about:meta])* $key:ident = $name:literal;)+) => {
        /// A setting; its name has the unit.
        #[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
        #[cfg_attr(feature = "defmt", derive(defmt::Format))]
        pub enum SettingKey {
            $($(#[$about])* $key,)+
        }

        impl SettingKey {
            /// All settings in wire order.
            pub const ALL: [Self; 26] = [$(Self::$key,)+];

            /// Name for users and files, e.g. `coarse_min_nm`.
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$key => $name,)+
                }
            }
        }
    };
}

settings! {
    /// Distance of principal plane and sensor with all axes at 0.
    DatumNm = "datum_nm";
    /// Smallest distance of sensor and lens (datum + coarse + fine + lens).
    DistanceMinNm = "distance_min_nm";
    CoarseMinNm = "coarse_min_nm";
    CoarseMaxNm = "coarse_max_nm";
    CoarseSpeedNmPerS = "coarse_speed_nm_per_s";
    CoarseAccelerationUmPerS2 = "coarse_acceleration_um_per_s2";
    CoarseJerkUmPerS3 = "coarse_jerk_um_per_s3";
    /// Backlash of stage A's screw; moves end from the same side, this far and a margin before the target.
    CoarseBacklashNm = "coarse_backlash_nm";
    /// Largest difference of steps and encoder (following error).
    CoarseFollowingNm = "coarse_following_nm";
    LensMinNm = "lens_min_nm";
    LensMaxNm = "lens_max_nm";
    LensSpeedNmPerS = "lens_speed_nm_per_s";
    LensAccelerationUmPerS2 = "lens_acceleration_um_per_s2";
    LensJerkUmPerS3 = "lens_jerk_um_per_s3";
    LensBacklashNm = "lens_backlash_nm";
    LensFollowingNm = "lens_following_nm";
    FineMinNm = "fine_min_nm";
    FineMaxNm = "fine_max_nm";
    /// Piezo stroke per DAC code, from the sweep.
    PiezoGainPmPerCode = "piezo_gain_pm_per_code";
    /// Width of the piezo's hysteresis loop relative to the sweep.
    PiezoHysteresisPpm = "piezo_hysteresis_ppm";
    /// Piezo creep per decade of time, relative to a step.
    PiezoCreepPpmPerDecade = "piezo_creep_ppm_per_decade";
    /// Time from the end of an exposure to the next trigger.
    CameraReadoutUs = "camera_readout_us";
    /// Longest delay of the exposure signal after the trigger pulse.
    StrobeDeadlineUs = "strobe_deadline_us";
    /// Position relative to the gauge's reading, from its calibration.
    GaugeGainPpm = "gauge_gain_ppm";
    /// Gauge reading at the relaxed piezo, from its calibration.
    GaugeOffsetNm = "gauge_offset_nm";
    /// 1 if the fast loop would excite a second mode of the piezo's flexure; a slower loop is then used.
    PiezoSecondMode = "piezo_second_mode";
}

/// Settings of a stepper axis.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct StepperKeys {
    pub min: SettingKey,
    pub max: SettingKey,
    pub speed: SettingKey,
    pub acceleration: SettingKey,
    pub jerk: SettingKey,
    pub backlash: SettingKey,
    pub following: SettingKey,
}

impl StepperKeys {
    /// Settings of stage A's stepper.
    pub const COARSE: Self = Self {
        min: SettingKey::CoarseMinNm,
        max: SettingKey::CoarseMaxNm,
        speed: SettingKey::CoarseSpeedNmPerS,
        acceleration: SettingKey::CoarseAccelerationUmPerS2,
        jerk: SettingKey::CoarseJerkUmPerS3,
        backlash: SettingKey::CoarseBacklashNm,
        following: SettingKey::CoarseFollowingNm,
    };
    /// Settings of stage B's stepper.
    pub const LENS: Self = Self {
        min: SettingKey::LensMinNm,
        max: SettingKey::LensMaxNm,
        speed: SettingKey::LensSpeedNmPerS,
        acceleration: SettingKey::LensAccelerationUmPerS2,
        jerk: SettingKey::LensJerkUmPerS3,
        backlash: SettingKey::LensBacklashNm,
        following: SettingKey::LensFollowingNm,
    };

    /// Settings of an axis; `None` if it is not a stepper.
    pub const fn of(axis: Axis) -> Option<Self> {
        match axis {
            Axis::SensorCoarse => Some(Self::COARSE),
            Axis::SensorFine => None,
            Axis::Lens => Some(Self::LENS),
        }
    }
}

/// A setting with its range.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, Debug)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Setting {
    pub key: SettingKey,
    /// Value in the unit of the name.
    pub value: i32,
    pub default: i32,
    pub min: i32,
    pub max: i32,
}

/// Lifetime counters, kept without power.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Counters {
    pub boots: u32,
    pub alarms: u32,
    pub triggers: u64,
    pub coarse_steps: u64,
    pub lens_steps: u64,
    pub homings: u32,
    /// Boots with a damaged newer copy of a record.
    pub repaired: u32,
}

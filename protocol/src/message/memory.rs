//! Non-volatile settings and records.

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use super::Axis;

/// A record in memory with version, CRC and two copies.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, Debug)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[allow(missing_docs, reason = "names and types describe these fields")]
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

/// A setting; its name has the unit.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[allow(missing_docs, reason = "names and types describe these fields")]
pub enum SettingKey {
    /// Distance of principal plane and sensor with all axes at 0.
    DatumNm,
    /// Smallest distance of sensor and lens (datum + coarse + fine + lens).
    DistanceMinNm,
    CoarseMinNm,
    CoarseMaxNm,
    CoarseSpeedNmPerS,
    CoarseAccelerationUmPerS2,
    CoarseJerkUmPerS3,
    /// Backlash of stage A's screw; moves end from the same side, this far and a margin before the target.
    CoarseBacklashNm,
    /// Largest difference of steps and encoder (following error).
    CoarseFollowingNm,
    LensMinNm,
    LensMaxNm,
    LensSpeedNmPerS,
    LensAccelerationUmPerS2,
    LensJerkUmPerS3,
    LensBacklashNm,
    LensFollowingNm,
    FineMinNm,
    FineMaxNm,
    /// Piezo stroke per DAC code, from the sweep.
    PiezoGainPmPerCode,
    /// Width of the piezo's hysteresis loop relative to the sweep.
    PiezoHysteresisPpm,
    /// Piezo creep per decade of time, relative to a step.
    PiezoCreepPpmPerDecade,
    /// Time from the end of an exposure to the next trigger.
    CameraReadoutUs,
    /// Longest delay of the exposure signal after the trigger pulse.
    StrobeDeadlineUs,
    /// Position relative to the gauge's reading, from its calibration.
    GaugeGainPpm,
    /// Gauge reading at the relaxed piezo, from its calibration.
    GaugeOffsetNm,
    /// 1 if the fast loop would excite a second mode of the piezo's flexure; a slower loop is then used.
    PiezoSecondMode,
}

impl SettingKey {
    /// All settings in wire order.
    pub const ALL: [Self; 26] = [
        Self::DatumNm,
        Self::DistanceMinNm,
        Self::CoarseMinNm,
        Self::CoarseMaxNm,
        Self::CoarseSpeedNmPerS,
        Self::CoarseAccelerationUmPerS2,
        Self::CoarseJerkUmPerS3,
        Self::CoarseBacklashNm,
        Self::CoarseFollowingNm,
        Self::LensMinNm,
        Self::LensMaxNm,
        Self::LensSpeedNmPerS,
        Self::LensAccelerationUmPerS2,
        Self::LensJerkUmPerS3,
        Self::LensBacklashNm,
        Self::LensFollowingNm,
        Self::FineMinNm,
        Self::FineMaxNm,
        Self::PiezoGainPmPerCode,
        Self::PiezoHysteresisPpm,
        Self::PiezoCreepPpmPerDecade,
        Self::CameraReadoutUs,
        Self::StrobeDeadlineUs,
        Self::GaugeGainPpm,
        Self::GaugeOffsetNm,
        Self::PiezoSecondMode,
    ];

    /// Name for users and files, e.g. `coarse_min_nm`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::DatumNm => "datum_nm",
            Self::DistanceMinNm => "distance_min_nm",
            Self::CoarseMinNm => "coarse_min_nm",
            Self::CoarseMaxNm => "coarse_max_nm",
            Self::CoarseSpeedNmPerS => "coarse_speed_nm_per_s",
            Self::CoarseAccelerationUmPerS2 => "coarse_acceleration_um_per_s2",
            Self::CoarseJerkUmPerS3 => "coarse_jerk_um_per_s3",
            Self::CoarseBacklashNm => "coarse_backlash_nm",
            Self::CoarseFollowingNm => "coarse_following_nm",
            Self::LensMinNm => "lens_min_nm",
            Self::LensMaxNm => "lens_max_nm",
            Self::LensSpeedNmPerS => "lens_speed_nm_per_s",
            Self::LensAccelerationUmPerS2 => "lens_acceleration_um_per_s2",
            Self::LensJerkUmPerS3 => "lens_jerk_um_per_s3",
            Self::LensBacklashNm => "lens_backlash_nm",
            Self::LensFollowingNm => "lens_following_nm",
            Self::FineMinNm => "fine_min_nm",
            Self::FineMaxNm => "fine_max_nm",
            Self::PiezoGainPmPerCode => "piezo_gain_pm_per_code",
            Self::PiezoHysteresisPpm => "piezo_hysteresis_ppm",
            Self::PiezoCreepPpmPerDecade => "piezo_creep_ppm_per_decade",
            Self::CameraReadoutUs => "camera_readout_us",
            Self::StrobeDeadlineUs => "strobe_deadline_us",
            Self::GaugeGainPpm => "gauge_gain_ppm",
            Self::GaugeOffsetNm => "gauge_offset_nm",
            Self::PiezoSecondMode => "piezo_second_mode",
        }
    }
}

/// Settings of a stepper axis.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[allow(missing_docs, reason = "names and types describe these fields")]
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
#[allow(missing_docs, reason = "names and types describe these fields")]
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
#[allow(missing_docs, reason = "names and types describe these fields")]
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

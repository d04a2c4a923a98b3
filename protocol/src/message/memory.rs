//! What the board keeps without power: settings by key, and the records they lie in.

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

use super::Axis;

/// A record in the board's memory. Each has a version, a CRC and two copies.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, Debug)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum RecordName {
    /// The settings.
    Settings,
    /// Boots, alarms, steps, and what moved last.
    Counters,
    /// The last alarms.
    Alarms,
    /// The loaded exposure program.
    Program,
    /// The coefficients of the depth correction.
    Correction,
}

/// Names a setting; the unit of its value is in the name.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum SettingKey {
    /// Distance from the lens' principal plane to the sensor with all axes at 0.
    DatumNm,
    /// Smallest distance between sensor and lens stage (datum + coarse + fine + lens).
    DistanceMinNm,
    /// Smallest position of stage A's stepper.
    CoarseMinNm,
    /// Largest position of stage A's stepper.
    CoarseMaxNm,
    /// Speed of stage A's stepper.
    CoarseSpeedNmPerS,
    /// Acceleration of stage A's stepper.
    CoarseAccelerationUmPerS2,
    /// Jerk of stage A's stepper.
    CoarseJerkUmPerS3,
    /// Backlash of stage A's screw; moves end from the same side, this far and a little more before the target.
    CoarseBacklashNm,
    /// Largest difference between steps and encoder of stage A.
    CoarseFollowingNm,
    /// Smallest position of stage B.
    LensMinNm,
    /// Largest position of stage B.
    LensMaxNm,
    /// Speed of stage B's stepper.
    LensSpeedNmPerS,
    /// Acceleration of stage B's stepper.
    LensAccelerationUmPerS2,
    /// Jerk of stage B's stepper.
    LensJerkUmPerS3,
    /// Backlash of stage B's screw.
    LensBacklashNm,
    /// Largest difference between steps and encoder of stage B.
    LensFollowingNm,
    /// Smallest position of the piezo.
    FineMinNm,
    /// Largest position of the piezo.
    FineMaxNm,
    /// Stroke of the piezo per code of its converter, from the sweep.
    PiezoGainPmPerCode,
    /// Width of the piezo's hysteresis loop in parts per million of the sweep, from the sweep.
    PiezoHysteresisPpm,
    /// Creep of the piezo in parts per million of a step per decade of time.
    PiezoCreepPpmPerDecade,
    /// From the end of an exposure until the camera may be triggered again.
    CameraReadoutUs,
    /// The camera's exposure signal must have come this long after the trigger pulse has ended.
    StrobeDeadlineUs,
    /// Position for what the strain gauge says, parts per million, from its calibration.
    GaugeGainPpm,
    /// What the strain gauge says where the piezo is relaxed, from its calibration.
    GaugeOffsetNm,
    /// 1 where the piezo's flexure has a second mode that the fast loop would feed: a slower one then leaves it alone.
    PiezoSecondMode,
}

impl SettingKey {
    /// All, in order.
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

    /// Its name for people and files, e.g. `coarse_min_nm`.
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

/// The settings that every stepper axis has.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct StepperKeys {
    /// Smallest position.
    pub min: SettingKey,
    /// Largest position.
    pub max: SettingKey,
    /// Speed of a move.
    pub speed: SettingKey,
    /// Acceleration of a move.
    pub acceleration: SettingKey,
    /// Jerk of a move.
    pub jerk: SettingKey,
    /// Backlash of the screw.
    pub backlash: SettingKey,
    /// Largest difference between steps and encoder.
    pub following: SettingKey,
}

impl StepperKeys {
    /// Of stage A's stepper.
    pub const COARSE: Self = Self {
        min: SettingKey::CoarseMinNm,
        max: SettingKey::CoarseMaxNm,
        speed: SettingKey::CoarseSpeedNmPerS,
        acceleration: SettingKey::CoarseAccelerationUmPerS2,
        jerk: SettingKey::CoarseJerkUmPerS3,
        backlash: SettingKey::CoarseBacklashNm,
        following: SettingKey::CoarseFollowingNm,
    };
    /// Of stage B's stepper.
    pub const LENS: Self = Self {
        min: SettingKey::LensMinNm,
        max: SettingKey::LensMaxNm,
        speed: SettingKey::LensSpeedNmPerS,
        acceleration: SettingKey::LensAccelerationUmPerS2,
        jerk: SettingKey::LensJerkUmPerS3,
        backlash: SettingKey::LensBacklashNm,
        following: SettingKey::LensFollowingNm,
    };

    /// Of an axis; `None` where that is not a stepper.
    pub const fn of(axis: Axis) -> Option<Self> {
        match axis {
            Axis::SensorCoarse => Some(Self::COARSE),
            Axis::SensorFine => None,
            Axis::Lens => Some(Self::LENS),
        }
    }
}

/// A setting and what it may be.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, Debug)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Setting {
    /// Which.
    pub key: SettingKey,
    /// Its value, in the unit of its name.
    pub value: i32,
    /// What it is on a board that was never set.
    pub default: i32,
    /// Smallest value allowed.
    pub min: i32,
    /// Largest value allowed.
    pub max: i32,
}

/// What the board has counted in its life; kept without power.
#[derive(Serialize, Deserialize, Schema, Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Counters {
    /// Boots.
    pub boots: u32,
    /// Alarms.
    pub alarms: u32,
    /// Triggers.
    pub triggers: u64,
    /// STEP pulses of stage A.
    pub coarse_steps: u64,
    /// STEP pulses of stage B.
    pub lens_steps: u64,
    /// Homings that reached their end.
    pub homings: u32,
    /// Records of which only the older copy was good at a boot.
    pub repaired: u32,
}

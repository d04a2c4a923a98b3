//! Capture folder: `far.png` and `near.png`, or the images of a sequence, and `capture.toml` with their settings. The
//! folder is created atomically. An emulated rig's has no clock time, port or random number and is repeatable.

use std::{collections::BTreeMap, path::Path};

use farnear_files::{
    EncodeError,
    image_file::encode_png,
    staging::{Staging, StagingError},
};
use farnear_protocol::message::{Hello, LightLevels, SCHEMA_KEY, ShotRecord};
use serde::{Deserialize, Serialize};

use crate::{
    camera::Image,
    client::Client,
    describe::{cause_name, trigger_name, um},
    expose::sensor_mm,
    pair::{Pair, Taken},
    sequence::SequenceShot,
};

pub const CAPTURE_FILE: &str = "capture.toml";
const FORMAT: u32 = 2;

#[derive(Serialize, Deserialize, Clone, PartialEq, Debug)]
pub struct CaptureRecord {
    pub format: u32,
    pub made_by: String,
    /// RFC 3339; real hardware only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time: Option<String>,
    pub stage: StageRecord,
    /// Far first in a pair.
    pub exposure: Vec<ExposureRecord>,
    pub camera: CameraRecord,
    /// Second camera, for pairs of one exposure.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub half_mirror: Option<HalfMirrorRecord>,
    pub board: BoardRecord,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub simulation: Option<SimulationRecord>,
    #[serde(default, skip_serializing_if = "toml::Table::is_empty")]
    pub optics: toml::Table,
}

#[derive(Serialize, Deserialize, Clone, PartialEq, Debug)]
pub struct StageRecord {
    /// Sensor distance with all axes at 0.
    pub datum_mm: f64,
    #[serde(default)]
    pub lens_measured_um: f64,
    /// Coarse target of a pair.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub coarse_asked_um: Option<f64>,
    pub coarse_measured_um: f64,
    /// Board time of both moves and images of a pair, without exposures.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub moving_us: Option<u64>,
}

/// One exposure. Times since the board's reset; positions by encoder and gauge.
#[derive(Serialize, Deserialize, Clone, PartialEq, Debug)]
pub struct ExposureRecord {
    pub image: String,
    /// Sensor distance by the optics, in a pair.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sensor_asked_mm: Option<f64>,
    /// By encoders and gauge.
    pub sensor_measured_mm: f64,
    /// Moved axis in a sequence: `coarse`, `fine` or `lens`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub axis: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub asked_um: Option<f64>,
    /// Piezo target in a pair.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fine_asked_um: Option<f64>,
    pub fine_measured_um: f64,
    pub coarse_measured_um: f64,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lens_measured_um: Option<f64>,
    /// In a sequence: `hardware`, `software` or `free-running`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub triggered_by: Option<String>,
    /// From the start of the move until settled.
    pub settle_us: u32,
    pub exposure_us: u32,
    pub trigger_number: u32,
    pub trigger_us: u64,
    /// By the camera's signal.
    pub strobe_start_us: u64,
    pub strobe_end_us: u64,
}

#[derive(Serialize, Deserialize, Clone, PartialEq, Debug)]
pub struct CameraRecord {
    pub kind: String,
    pub width: usize,
    pub height: usize,
    /// Camera bits; 9 to 15 are shifted up to 16 in the files.
    pub bits: u8,
    /// Variance of a pixel by the camera's lossy compression (JPEG), as a part of full scale squared.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub coding_variance: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub averaged: Option<u16>,
    /// Brightness of both light outputs, percent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub light_percent: Option<[f64; 2]>,
    /// Whether exposures without the board's light were subtracted.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub ambient_subtracted: bool,
    /// Whether dark and flat frames were applied.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub corrected: bool,
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub settings: BTreeMap<String, String>,
}

/// The second camera, which took the near image.
#[derive(Serialize, Deserialize, Clone, PartialEq, Debug)]
pub struct HalfMirrorRecord {
    pub second_camera: String,
    /// Extra sensor distance as given by the user.
    pub second_further_um: f64,
    /// Whether its image was mirrored left to right.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub second_mirrored: bool,
}

#[derive(Serialize, Deserialize, Clone, PartialEq, Debug)]
pub struct BoardRecord {
    pub name: String,
    pub firmware: String,
    pub protocol: u8,
    pub schema_key: String,
    pub unique_id: String,
    pub boot: u32,
    pub reset_cause: String,
    pub emulated: bool,
}

#[derive(Serialize, Deserialize, Clone, PartialEq, Eq, Debug)]
pub struct SimulationRecord {
    pub scene: String,
    pub psf: String,
    pub noise: String,
    pub seed: u64,
}

#[derive(Clone, PartialEq, Debug)]
pub struct Circumstances {
    pub made_by: String,
    pub time: Option<String>,
    /// [`crate::camera::Camera::kind`].
    pub camera: &'static str,
    pub simulation: Option<SimulationRecord>,
    pub optics: toml::Table,
}

#[derive(Debug, thiserror::Error)]
pub enum RecordError {
    #[error(transparent)]
    Staging(#[from] StagingError),
    #[error(transparent)]
    Image(#[from] EncodeError),
    #[error("cannot write the capture's record: {0}")]
    Toml(#[from] toml::ser::Error),
    #[error("{path}: {reason}")]
    Read { path: String, reason: String },
}

pub fn record_of(pair: &Pair, client: &Client, circumstances: Circumstances) -> CaptureRecord {
    let stage = StageRecord {
        datum_mm: um(client.hello().limits.datum) / 1000.0,
        lens_measured_um: um(pair.far.record.lens),
        coarse_asked_um: Some(um(pair.coarse.asked)),
        coarse_measured_um: um(pair.coarse.measured),
        moving_us: Some(pair.moving_us()),
    };
    let exposure = vec![pair_exposure("far.png", &pair.far), pair_exposure("near.png", &pair.near)];
    record(client, circumstances, stage, exposure, &pair.far.image)
}

/// The record of a sequence with its first image; `None` without shots.
pub fn record_of_sequence(
    shots: &[SequenceShot],
    image: &Image,
    client: &Client,
    circumstances: Circumstances,
) -> Option<CaptureRecord> {
    let (first, limits) = (shots.first()?, &client.hello().limits);
    let stage = StageRecord {
        datum_mm: um(limits.datum) / 1000.0,
        lens_measured_um: um(first.record.lens),
        coarse_asked_um: None,
        coarse_measured_um: um(first.record.coarse),
        moving_us: None,
    };
    let exposure = shots.iter().map(|shot| ExposureRecord {
        axis: Some(shot.record.axis.name().into()),
        asked_um: Some(um(shot.record.asked)),
        lens_measured_um: Some(um(shot.record.lens)),
        triggered_by: Some(trigger_name(shot.mode).into()),
        ..exposure_record(&shot.name, &shot.record, sensor_mm(&shot.record, limits))
    });
    Some(record(client, circumstances, stage, exposure.collect(), image))
}

fn record(
    client: &Client,
    circumstances: Circumstances,
    stage: StageRecord,
    exposure: Vec<ExposureRecord>,
    image: &Image,
) -> CaptureRecord {
    let hello: &Hello = client.hello();
    let (height, width) = image.pixels.dim();
    CaptureRecord {
        format: FORMAT,
        made_by: circumstances.made_by,
        time: circumstances.time,
        stage,
        exposure,
        camera: CameraRecord {
            kind: circumstances.camera.into(),
            width,
            height,
            bits: image.bits,
            coding_variance: Some(image.coding_variance).filter(|variance| *variance > 0.0),
            averaged: None,
            light_percent: client.light(0).map(LightLevels::percent),
            ambient_subtracted: false,
            corrected: false,
            settings: BTreeMap::new(),
        },
        half_mirror: None,
        board: BoardRecord {
            name: hello.board.as_str().into(),
            firmware: hello.firmware.as_str().into(),
            protocol: client.protocol(),
            schema_key: format!("{SCHEMA_KEY:016x}"),
            unique_id: hello.unique_id.iter().map(|byte| format!("{byte:02x}")).collect(),
            boot: hello.boot,
            reset_cause: cause_name(hello.reset_cause).into(),
            emulated: hello.emulated,
        },
        simulation: circumstances.simulation,
        optics: circumstances.optics,
    }
}

fn pair_exposure(name: &str, taken: &Taken) -> ExposureRecord {
    ExposureRecord {
        sensor_asked_mm: Some(taken.sensor_asked_mm),
        fine_asked_um: Some(um(taken.record.asked)),
        ..exposure_record(name, &taken.record, taken.sensor_measured_mm)
    }
}

fn exposure_record(name: &str, record: &ShotRecord, sensor_measured_mm: f64) -> ExposureRecord {
    ExposureRecord {
        image: name.into(),
        sensor_asked_mm: None,
        sensor_measured_mm,
        axis: None,
        asked_um: None,
        fine_asked_um: None,
        fine_measured_um: um(record.fine),
        coarse_measured_um: um(record.coarse),
        lens_measured_um: None,
        triggered_by: None,
        settle_us: record.settle.0,
        exposure_us: record.exposure.0,
        trigger_number: record.trigger_number,
        trigger_us: record.trigger.0,
        strobe_start_us: record.strobe_start.0,
        strobe_end_us: record.strobe_end.0,
    }
}

/// Begins a capture folder; called before motion, so that an unwritable folder is reported first.
pub fn begin_folder(folder: &Path) -> Result<Staging, RecordError> {
    Ok(Staging::new_folder(folder)?)
}

/// Writes pair and record, and publishes the folder.
pub fn finish_folder(staged: Staging, pair: &Pair, record: &CaptureRecord) -> Result<(), RecordError> {
    write_image(&staged, "far.png", &pair.far.image)?;
    write_image(&staged, "near.png", &pair.near.image)?;
    finish_sequence(staged, record)
}

/// Writes an image of a sequence.
pub fn write_image(staged: &Staging, name: &str, image: &Image) -> Result<(), RecordError> {
    let png = encode_png(image.pixels.view(), image.bits)?;
    Ok(staged.write(name, &png)?)
}

/// Writes the record, and publishes the folder.
pub fn finish_sequence(staged: Staging, record: &CaptureRecord) -> Result<(), RecordError> {
    staged.write(CAPTURE_FILE, toml::to_string(record)?.as_bytes())?;
    Ok(staged.finish()?)
}

pub fn read_record(folder: &Path) -> Result<Option<CaptureRecord>, RecordError> {
    let path = folder.join(CAPTURE_FILE);
    let failed = |reason: String| RecordError::Read { path: path.display().to_string(), reason };
    match std::fs::read_to_string(&path) {
        Ok(text) => Ok(Some(toml::from_str(&text).map_err(|error| failed(error.to_string()))?)),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(failed(error.to_string())),
    }
}

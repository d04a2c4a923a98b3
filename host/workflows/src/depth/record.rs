//! `depth.toml`: what made a map.

use farnear_depth::{
    operators::Operators, optics::Optics, pipeline::Settings, prepare::Report, validity::Lost,
};
use farnear_files::{image_file::Grey, map::Scale};
use serde::Serialize;

use super::{Computed, DepthRequest, Inputs, noise::Uncertainty, output::Outputs, pair::name_of, part::Part};
use crate::{MADE_BY, error::Result, inputs::HashedFile};

/// Version of the record.
const FORMAT: u32 = 1;

#[derive(Serialize)]
struct Record<'a> {
    format: u32,
    made_by: &'static str,
    far: String,
    near: String,
    units: &'static str,
    warnings: &'a [String],
    /// Which outputs were written, where they are not the usual ones.
    #[serde(skip_serializing_if = "Option::is_none")]
    write: Option<String>,
    /// Scale of depth.png's codes, mm; code 0 = no value.
    #[serde(skip_serializing_if = "Option::is_none")]
    png: Option<Scale>,
    method: String,
    /// Over how many pixels evidence was summed.
    window: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    correction: Option<String>,
    /// The request; results are in `prepared`.
    align: String,
    balance: String,
    /// How colour became grey, where not by the mean.
    #[serde(skip_serializing_if = "Option::is_none")]
    grey: Option<Grey>,
    #[serde(skip_serializing_if = "Option::is_none")]
    white_level: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    camera: Option<String>,
    min_confidence: f32,
    /// Where the map lies in the images, where it is of a part of them.
    #[serde(skip_serializing_if = "Option::is_none")]
    part: Option<Part>,
    settings: Settings,
    /// Report of the preparation.
    prepared: Report,
    /// Why pixels have no depth: the numbers in reason.png, in words, and the part of the map.
    no_depth: &'a [Lost],
    #[serde(skip_serializing_if = "Option::is_none")]
    uncertainty: Option<&'a Uncertainty>,
    optics: Optics,
    #[serde(skip_serializing_if = "Option::is_none")]
    operators: Option<&'a Operators>,
    /// The files that the map was made from.
    input: Vec<HashedFile>,
}

/// The record as TOML. `png` is the scale of depth.png, where that is written.
pub fn record(
    settings: &DepthRequest,
    inputs: &Inputs,
    computed: &Computed,
    warnings: &[String],
    png: Option<Scale>,
    files: Vec<HashedFile>,
) -> Result<String> {
    let usual = settings.write == Outputs::default();
    Ok(toml::to_string(&Record {
        format: FORMAT,
        made_by: MADE_BY,
        far: name_of(&settings.far),
        near: name_of(&settings.near),
        units: "mm",
        warnings,
        write: (!usual).then(|| settings.write.to_string()),
        png,
        method: inputs.method.method().to_string(),
        window: computed.window.to_string(),
        correction: settings.correction.as_deref().map(name_of),
        align: settings.align.to_string(),
        balance: settings.balance.to_string(),
        grey: (settings.grey != Grey::default()).then_some(settings.grey),
        white_level: settings.white_level,
        camera: settings.camera_frames.as_deref().map(name_of),
        min_confidence: settings.min_confidence,
        part: inputs.cut.map(|cut| cut.part()),
        prepared: computed.report,
        no_depth: &computed.lost,
        settings: Settings { threads: rayon::current_num_threads(), ..settings.computation() },
        uncertainty: computed.deviation.as_ref().map(|(_, found)| found),
        optics: inputs.optics,
        operators: inputs.method.operators(),
        input: files,
    })?)
}

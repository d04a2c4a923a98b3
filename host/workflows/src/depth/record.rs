//! `depth.toml`: provenance of a map.

use farnear_depth::{
    operators::Operators, optics::Optics, pipeline::Settings, prepare::Report, validity::Lost,
};
use farnear_files::{image_file::Grey, map::Scale};
use serde::Serialize;

use super::{Computed, DepthRequest, Inputs, noise::Uncertainty, output::Outputs, pair::name_of, part::Part};
use crate::{MADE_BY, error::Result, inputs::HashedFile};

const FORMAT: u32 = 1;

#[derive(Serialize)]
struct Record<'a> {
    format: u32,
    made_by: &'static str,
    far: String,
    near: String,
    units: &'static str,
    warnings: &'a [String],
    #[serde(skip_serializing_if = "Option::is_none")]
    write: Option<String>,
    /// Scale of depth.png's codes, mm; code 0 = no value.
    #[serde(skip_serializing_if = "Option::is_none")]
    png: Option<Scale>,
    method: String,
    window: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    correction: Option<String>,
    /// The request; results are in `prepared`.
    align: String,
    balance: String,
    /// Conversion of colour to grey, if not the mean.
    #[serde(skip_serializing_if = "Option::is_none")]
    grey: Option<Grey>,
    #[serde(skip_serializing_if = "Option::is_none")]
    white_level: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    camera: Option<String>,
    min_confidence: f32,
    /// Position of the map in the images, if of a part, or if averaging left out columns or rows.
    #[serde(skip_serializing_if = "Option::is_none")]
    part: Option<Part>,
    settings: Settings,
    prepared: Report,
    /// Why pixels have no depth: the codes of reason.png, descriptions, and shares of the map.
    no_depth: &'a [Lost],
    #[serde(skip_serializing_if = "Option::is_none")]
    uncertainty: Option<&'a Uncertainty>,
    optics: Optics,
    #[serde(skip_serializing_if = "Option::is_none")]
    operators: Option<&'a Operators>,
    input: Vec<HashedFile>,
}

/// `png` is the scale of depth.png, if written.
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
        part: inputs.part,
        prepared: computed.report,
        no_depth: &computed.lost,
        settings: Settings { threads: rayon::current_num_threads(), ..settings.computation() },
        uncertainty: computed.deviation.as_ref().map(|(_, found)| found),
        optics: inputs.optics,
        operators: inputs.method.operators(),
        input: files,
    })?)
}

//! The folder of results.

use std::path::Path;

use anyhow::Result;
use farnear_capture::{aside::Aside, image_file::encode_png};
use farnear_depth::{
    operators::Operators,
    optics::Optics,
    pipeline::{DepthMap, Settings},
};
use ndarray::Array2;
use serde::Serialize;

use super::{method::Prepared, name_of, noise::Uncertainty};
use crate::{
    files::{map, mesh},
    picture,
};

/// All that is written.
pub struct Results<'a> {
    /// The file of the far-focused image.
    pub far: &'a Path,
    /// The file of the near-focused image.
    pub near: &'a Path,
    /// The far-focused image, the mesh's colour.
    pub picture: &'a Array2<f32>,
    /// The map.
    pub depth: &'a DepthMap,
    /// Standard deviation of each depth in mm, and its figures.
    pub deviation: Option<&'a (Array2<f32>, Uncertainty)>,
    /// How depth was computed.
    pub method: &'a Prepared,
    /// With which windows.
    pub settings: Settings,
    /// The optics.
    pub optics: &'a Optics,
    /// The file of the correction.
    pub correction: Option<&'a Path>,
    /// What the user was warned of.
    pub warnings: &'a [String],
}

/// The content of `depth.toml`: what made the map.
#[derive(Serialize)]
struct Sidecar<'a> {
    format: u32,
    made_by: String,
    far: String,
    near: String,
    units: &'static str,
    warnings: &'a [String],
    /// How depth.png's codes stand for mm; code 0 = no value.
    png: map::Scale,
    method: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    correction: Option<String>,
    settings: Settings,
    #[serde(skip_serializing_if = "Option::is_none")]
    uncertainty: Option<&'a Uncertainty>,
    optics: Optics,
    #[serde(skip_serializing_if = "Option::is_none")]
    operators: Option<&'a Operators>,
}

impl Results<'_> {
    /// Writes everything to the folder `out`, or nothing.
    ///
    /// # Errors
    /// Which file cannot be written.
    pub fn write(&self, out: &Path) -> Result<()> {
        let aside = Aside::into_folder(out)?;
        let map = self.depth.depth_mm.view();
        let confidence = self.depth.confidence.view();
        let (codes, png) = map::codes(map);
        let sidecar = Sidecar {
            format: 1,
            made_by: concat!("farnear ", env!("CARGO_PKG_VERSION")).into(),
            far: name_of(self.far),
            near: name_of(self.near),
            units: "mm",
            warnings: self.warnings,
            png,
            method: self.method.name(),
            correction: self.correction.map(name_of),
            // The number of threads changes nothing in the result.
            settings: Settings { threads: Settings::default().threads, ..self.settings },
            uncertainty: self.deviation.map(|(_, found)| found),
            optics: *self.optics,
            operators: self.method.operators(),
        };
        aside.write("depth.npy", &map::npy(map)?)?;
        aside.write("depth.tiff", &map::tiff(map)?)?;
        aside.write("depth.png", &encode_png(codes.view(), 16).map_err(anyhow::Error::msg)?)?;
        aside.write("confidence.npy", &map::npy(confidence)?)?;
        if let Some((deviation, _)) = self.deviation {
            aside.write("uncertainty.npy", &map::npy(deviation.view())?)?;
        }
        aside.write("mesh.ply", &mesh::ply(map, self.picture.view(), self.optics))?;
        aside.write("view.png", &picture::view_png(map, confidence)?)?;
        aside.write("depth.toml", toml::to_string(&sidecar)?.as_bytes())?;
        Ok(aside.finish()?)
    }
}

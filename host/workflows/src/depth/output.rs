//! The folder of results, and the table of what can be in it.

use std::{collections::BTreeSet, fmt, path::Path, str::FromStr};

use farnear_files::{
    exr,
    image_file::encode_png,
    map::{self, Scale},
    mesh::{self, Projection},
    npy,
    staging::Staging,
    view,
};
use ndarray::{Array2, ArrayView2};

use super::{Computed, DepthSettings, Inputs, record::record};
use crate::{MADE_BY, context::Context, error::Result};

/// A file of results.
struct Output {
    /// The names by which it is asked for.
    names: &'static [&'static str],
    /// The file.
    file: &'static str,
    /// Its bytes; `None` where there is nothing for it.
    bytes: fn(&Results<'_>) -> Result<Option<Vec<u8>>>,
}

/// All that can be written: a new writer is a line here. Beside it there is always `depth.toml`, which says what made the
/// map.
#[rustfmt::skip]
const OUTPUTS: &[Output] = &[
    Output { names: &["npy"], file: "depth.npy", bytes: |results| Ok(Some(npy::write(results.depth()))) },
    Output { names: &["tiff"], file: "depth.tiff", bytes: |results| Ok(Some(map::tiff(results.depth())?)) },
    Output { names: &["png"], file: "depth.png", bytes: |results| results.png() },
    // A map does not travel without its confidence; depth.exr and view.png hold it themselves.
    Output { names: &["npy", "tiff", "png"], file: "confidence.npy", bytes: |results| Ok(Some(npy::write(results.confidence()))) },
    Output { names: &["npy", "tiff", "png"], file: "reason.png", bytes: |results| results.reasons() },
    Output { names: &["npy", "tiff", "png"], file: "uncertainty.npy", bytes: |results| Ok(results.deviation().map(npy::write)) },
    Output { names: &["mesh"], file: "mesh.ply", bytes: |results| Ok(Some(results.mesh())) },
    Output { names: &["view"], file: "view.png", bytes: |results| Ok(Some(view::view_png(results.depth(), results.confidence())?)) },
    Output { names: &["exr"], file: "depth.exr", bytes: |results| results.exr() },
];

/// What is written where nothing else is asked for.
const USUAL: [&str; 5] = ["npy", "tiff", "png", "mesh", "view"];

/// Which of the outputs are written.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Outputs(BTreeSet<&'static str>);

/// A name that belongs to no output.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
#[error("there is no output \"{name}\"; expected some of {}", Outputs::names().join(","))]
pub struct UnknownOutput {
    /// The name.
    pub name: String,
}

impl Outputs {
    /// All names, in the table's order.
    pub fn names() -> Vec<&'static str> {
        let mut names: Vec<&str> = Vec::new();
        for name in OUTPUTS.iter().flat_map(|output| output.names) {
            if !names.contains(name) {
                names.push(name);
            }
        }
        names
    }

    fn outputs(&self) -> impl Iterator<Item = &'static Output> {
        OUTPUTS.iter().filter(|output| output.names.iter().any(|name| self.0.contains(name)))
    }
}

impl Default for Outputs {
    fn default() -> Self {
        Self(BTreeSet::from(USUAL))
    }
}

impl FromStr for Outputs {
    type Err = UnknownOutput;

    /// A list such as `npy,exr`.
    fn from_str(text: &str) -> Result<Self, UnknownOutput> {
        let known = |name: &str| {
            let found = Self::names().into_iter().find(|known| *known == name.trim());
            found.ok_or_else(|| UnknownOutput { name: name.trim().into() })
        };
        text.split(',').map(known).collect::<Result<_, _>>().map(Self)
    }
}

impl fmt::Display for Outputs {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let names: Vec<&str> = Self::names().into_iter().filter(|name| self.0.contains(name)).collect();
        f.write_str(&names.join(","))
    }
}

/// All that is written.
pub(super) struct Results<'a> {
    settings: &'a DepthSettings,
    inputs: &'a Inputs,
    computed: &'a Computed,
    /// What depth.png holds, where that is written.
    codes: Option<(Array2<u16>, Scale)>,
    /// What made the map, as TOML.
    record: String,
}

impl<'a> Results<'a> {
    pub(super) fn new(
        settings: &'a DepthSettings,
        inputs: &'a Inputs,
        computed: &'a Computed,
        warnings: &[String],
    ) -> Result<Self> {
        let codes = settings.write.0.contains("png").then(|| map::codes(computed.map.depth_mm.view()));
        let scale = codes.as_ref().map(|(_, scale)| *scale);
        let record = record(settings, inputs, computed, warnings, scale)?;
        Ok(Self { settings, inputs, computed, codes, record })
    }

    /// Writes everything to the folder `out`, or nothing.
    ///
    /// # Errors
    /// Which file cannot be written; [`crate::WorkflowError::Cancelled`].
    pub(super) fn write(&self, out: &Path, context: &Context<'_>) -> Result<()> {
        let staged = Staging::into_folder(out)?;
        for output in self.settings.write.outputs() {
            context.cancel.check("writing the results")?;
            if let Some(bytes) = (output.bytes)(self)? {
                staged.write(output.file, &bytes)?;
            }
        }
        staged.write("depth.toml", self.record.as_bytes())?;
        context.cancel.check("writing the results")?;
        Ok(staged.finish()?)
    }

    fn depth(&self) -> ArrayView2<'_, f32> {
        self.computed.map.depth_mm.view()
    }

    fn confidence(&self) -> ArrayView2<'_, f32> {
        self.computed.map.confidence.view()
    }

    fn deviation(&self) -> Option<ArrayView2<'_, f32>> {
        self.computed.deviation.as_ref().map(|(deviation, _)| deviation.view())
    }

    fn png(&self) -> Result<Option<Vec<u8>>> {
        let encoded = self.codes.as_ref().map(|(codes, _)| encode_png(codes.view(), 16));
        Ok(encoded.transpose()?)
    }

    fn reasons(&self) -> Result<Option<Vec<u8>>> {
        let codes = self.computed.judgement.reasons.mapv(u16::from);
        Ok(Some(encode_png(codes.view(), 8)?))
    }

    fn mesh(&self) -> Vec<u8> {
        let optics = &self.inputs.optics;
        let projection =
            Projection { focal_length_mm: optics.focal_length_mm(), pixel_um: optics.pixel_um() };
        mesh::ply(self.depth(), self.inputs.pair.far.view(), projection)
    }

    /// Depth as compositors expect it, `Z`, here in mm; what made it stands in the header.
    fn exr(&self) -> Result<Option<Vec<u8>>> {
        let mut channels = vec![("Z", self.depth()), ("confidence", self.confidence())];
        channels.extend(self.deviation().map(|deviation| ("deviation", deviation)));
        let attributes = [
            ("farnear:made_by", MADE_BY),
            ("farnear:units", "mm"),
            ("farnear:optics", &toml::to_string(&self.inputs.optics)?),
            ("farnear:record", &self.record),
        ];
        Ok(Some(exr::write(&channels, &attributes)?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn outputs_are_asked_for_by_name() {
        let some: Outputs = "exr, npy".parse().unwrap();
        assert_eq!(some.to_string(), "npy,exr");
        let files: Vec<_> = some.outputs().map(|output| output.file).collect();
        assert_eq!(files, ["depth.npy", "confidence.npy", "reason.png", "uncertainty.npy", "depth.exr"]);
        assert_eq!("npy,tiff,png,mesh,view".parse(), Ok(Outputs::default()));
        let unknown = "npy,jpg".parse::<Outputs>().unwrap_err();
        assert_eq!(
            unknown.to_string(),
            "there is no output \"jpg\"; expected some of npy,tiff,png,mesh,view,exr"
        );
        assert!("".parse::<Outputs>().is_err());
    }
}

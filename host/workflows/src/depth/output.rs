//! Folder of results, and the table of its possible files.

use std::{
    collections::BTreeSet,
    fmt,
    fs::File,
    io::{self, BufWriter, Write},
    path::Path,
    str::FromStr,
};

use farnear_depth::optics::Optics;
use farnear_files::{
    exr, glb,
    image_file::{png_to, png8_to},
    map::{self, Scale},
    mesh, npy, view,
};
use ndarray::ArrayView2;
use rayon::prelude::*;

use super::{Computed, DepthRequest, Inputs, record::record};
use crate::{
    MADE_BY,
    context::Context,
    error::{Result, WorkflowError},
    inputs::hashed,
    measure::{NO_SCALE, lateral, projection},
    request::Request,
    result_folder::{self, DEPTH_RECORD},
};

type Sink = BufWriter<File>;

struct Output {
    names: &'static [&'static str],
    file: &'static str,
    /// Writes in pieces: with several megapixels a file can exceed all maps together.
    write: fn(&Results<'_>, &mut Sink) -> io::Result<()>,
}

/// Possible outputs: a new writer is a line here. `depth.toml` with the provenance is always written.
#[rustfmt::skip]
const OUTPUTS: &[Output] = &[
    Output { names: &["npy"], file: "depth.npy", write: |results, to| npy::write_to(results.depth(), to) },
    Output { names: &["tiff"], file: "depth.tiff", write: |results, to| map::tiff_to(results.depth(), to) },
    Output { names: &["png"], file: "depth.png", write: |results, to| results.png(to) },
    // A map is never without confidence; depth.exr and view.png contain it.
    Output { names: &["npy", "tiff", "png"], file: "confidence.npy", write: |results, to| npy::write_to(results.confidence(), to) },
    Output { names: &["npy", "tiff", "png"], file: "reason.png", write: |results, to| results.reasons(to) },
    Output { names: &["npy", "tiff", "png"], file: UNCERTAINTY, write: |results, to| results.uncertainty(to) },
    Output { names: &[MESH], file: "mesh.ply", write: |results, to| results.mesh(to) },
    Output { names: &[GLB], file: "mesh.glb", write: |results, to| results.glb(to) },
    Output { names: &["view"], file: "view.png", write: |results, to| results.view(to) },
    Output { names: &["exr"], file: "depth.exr", write: |results, to| results.exr(to) },
];

pub(crate) fn files() -> impl Iterator<Item = &'static str> {
    OUTPUTS.iter().map(|output| output.file)
}

/// Outputs that also need the image.
const MESH: &str = "mesh";
const GLB: &str = "glb";
/// Output that depends on another option.
const UNCERTAINTY: &str = "uncertainty.npy";

/// Outputs without `--write`.
const USUAL: [&str; 5] = ["npy", "tiff", "png", "mesh", "view"];

#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Outputs(BTreeSet<&'static str>);

#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
#[error("unknown output \"{name}\"; expected some of {}", Outputs::names().join(","))]
pub struct UnknownOutput {
    pub name: String,
}

impl Outputs {
    /// In the table's order.
    pub fn names() -> Vec<&'static str> {
        let mut names: Vec<&str> = Vec::new();
        for name in OUTPUTS.iter().flat_map(|output| output.names) {
            if !names.contains(name) {
                names.push(name);
            }
        }
        names
    }

    pub(super) fn show_image(&self) -> bool {
        [MESH, GLB].iter().any(|name| self.0.contains(name))
    }

    /// Fails where the optics do not suffice: positions in glTF are in metres.
    pub(super) fn check(&self, optics: &Optics) -> Result<()> {
        if self.0.contains(GLB) && projection(optics, None).is_none() {
            return Err(WorkflowError::parameter("write", GLB, NO_SCALE));
        }
        Ok(())
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

pub(super) struct Results<'a> {
    settings: &'a DepthRequest,
    inputs: &'a Inputs,
    computed: &'a Computed,
    /// Scale of depth.png's codes, mm, if written.
    scale: Option<Scale>,
    record: String,
}

impl<'a> Results<'a> {
    pub(super) fn new(
        settings: &'a DepthRequest,
        inputs: &'a Inputs,
        computed: &'a Computed,
        warnings: &[String],
        out: &Path,
    ) -> Result<Self> {
        let files = hashed(&Request::inputs(settings), out)?;
        let scale = settings.write.0.contains("png").then(|| map::scale(computed.map.depth_mm.view()));
        let record = record(settings, inputs, computed, warnings, scale, files)?;
        Ok(Self { settings, inputs, computed, scale, record })
    }

    /// Writes all outputs to `out`, or nothing.
    pub(super) fn write(&self, out: &Path, context: &Context<'_>) -> Result<()> {
        let staged = result_folder::depth(out)?;
        let there = |output: &&Output| output.file != UNCERTAINTY || self.deviation().is_some();
        let outputs: Vec<&Output> = self.settings.write.outputs().filter(there).collect();
        let cancel = &context.cancel;
        outputs.into_par_iter().try_for_each(|output| -> Result<()> {
            cancel.check("writing the results")?;
            Ok(staged.fill(output.file, |to| (output.write)(self, to))?)
        })?;
        staged.write(DEPTH_RECORD, self.record.as_bytes())?;
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

    fn uncertainty(&self, to: &mut Sink) -> io::Result<()> {
        self.deviation().map_or(Ok(()), |deviation| npy::write_to(deviation, to))
    }

    fn png(&self, to: &mut Sink) -> io::Result<()> {
        let Some(scale) = self.scale else { return Ok(()) };
        png_to(map::codes(self.depth(), scale).view(), 16, to).map_err(io::Error::other)
    }

    fn reasons(&self, to: &mut Sink) -> io::Result<()> {
        png8_to(self.computed.reasons.view(), to).map_err(io::Error::other)
    }

    fn view(&self, to: &mut Sink) -> io::Result<()> {
        to.write_all(&view::view_png(self.depth(), self.confidence()).map_err(io::Error::other)?)
    }

    fn mesh(&self, to: &mut Sink) -> io::Result<()> {
        let lateral = lateral(&self.inputs.optics, self.inputs.part);
        mesh::write(self.depth(), self.computed.image.view(), lateral, "mm", to)
    }

    fn glb(&self, to: &mut Sink) -> io::Result<()> {
        let projection =
            projection(&self.inputs.optics, self.inputs.part).ok_or_else(|| io::Error::other(NO_SCALE))?;
        glb::write(self.depth(), self.computed.image.view(), projection, to)
    }

    /// Depth channel `Z` as used by compositors, here in mm; its origin is in the header.
    fn exr(&self, to: &mut Sink) -> io::Result<()> {
        let mut channels = vec![("Z", self.depth()), ("confidence", self.confidence())];
        channels.extend(self.deviation().map(|deviation| ("deviation", deviation)));
        let attributes = [
            ("farnear:made_by", MADE_BY),
            ("farnear:units", "mm"),
            ("farnear:optics", &toml::to_string(&self.inputs.optics).map_err(io::Error::other)?),
            ("farnear:record", &self.record),
        ];
        exr::write_to(&channels, &attributes, to)
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
            "unknown output \"jpg\"; expected some of npy,tiff,png,mesh,glb,view,exr"
        );
        assert!("".parse::<Outputs>().is_err());
    }
}

//! Depth of a pair.

use farnear_depth::pipeline::Settings;

use super::{Call, Fields, Work, value};
use crate::{
    depth::{self, DepthSettings, method::Method},
    error::{Result, WorkflowError},
    optics,
    psf::PsfSource,
};

pub(super) fn work(fields: &mut Fields) -> Result<Box<dyn Work>> {
    let usual = Settings::default();
    let computation = Settings {
        smoothing_px: fields.or("smooth", usual.smoothing_px)?,
        median_px: fields.or("median", usual.median_px)?,
        fill: fields.flag("fill")?,
        threads: 1, // cores are shared among jobs
        ..usual
    };
    let settings = DepthSettings {
        far: fields.path("far")?,
        near: fields.path("near")?,
        optics: fields.optional_path("optics")?,
        psf: fields.optional::<PsfSource>("psf")?.map(|psf| psf.relative_to(fields.base())),
        operators: fields.name_or_file("operators")?,
        method: fields.or("method", Method::default())?,
        computation,
        window: fields.optional("window")?,
        align: fields.or("align", Default::default())?,
        balance: fields.or("balance", Default::default())?,
        region: fields.optional("region")?,
        camera: fields.optional_path("camera")?,
        min_confidence: fields.or("min_confidence", 0.0)?,
        correction: fields.optional_path("correction")?,
        uncertainty: fields.optional("uncertainty")?,
        write: fields.or("write", Default::default())?,
        out: Some(fields.path("out")?),
    };
    if let (Some(window), Some(smooth)) = (settings.window, fields.optional::<usize>("smooth")?) {
        return Err(WorkflowError::parameter(
            "window",
            window,
            format!("smooth {smooth} is a window too; name one"),
        ));
    }
    let mut inputs = vec![settings.far.clone(), settings.near.clone()];
    inputs.extend(optics::file_of_pair(settings.optics.as_deref(), &settings.far));
    inputs.extend(settings.operators.clone().filter(|operators| operators.is_file()));
    inputs.extend(settings.psf.as_ref().and_then(PsfSource::file).map(Into::into));
    inputs.extend(settings.correction.clone());
    inputs.extend(settings.camera.clone());
    Ok(Box::new(Call {
        settings,
        inputs,
        run: |settings, out, shared, context| {
            let settings = DepthSettings { out: Some(out.into()), ..settings.clone() };
            value(depth::compute_sharing(&settings, &shared.depth, context)?)
        },
    }))
}

#[cfg(test)]
mod tests {
    use std::{fs, path::Path};

    use farnear_capture::record::CAPTURE_FILE;

    use super::*;

    #[test]
    fn whatever_makes_a_map_is_an_input() {
        let folder = tempfile::tempdir().expect("a folder");
        let job = |text: &str| {
            let table = text.parse().expect("TOML");
            let mut fields = Fields::of_table(&table, folder.path())?;
            let work = work(&mut fields)?;
            fields.all_taken()?;
            let inputs = work.inputs();
            let name =
                |path: &Path| path.strip_prefix(folder.path()).expect("in the folder").display().to_string();
            Ok::<_, WorkflowError>(inputs.iter().map(|path| name(path)).collect::<Vec<_>>())
        };
        let pair = "far = 'far.png'\nnear = 'near.png'\nout = 'depth'\n";
        assert_eq!(job(pair).expect("a job"), ["far.png", "near.png"]);
        fs::write(folder.path().join("optics.toml"), "").expect("a writable folder");
        assert_eq!(job(pair).expect("a job"), ["far.png", "near.png", "optics.toml"]);
        // What a record says goes before the file beside it, as for `farnear depth`.
        fs::write(folder.path().join(CAPTURE_FILE), "").expect("a writable folder");
        assert_eq!(job(pair).expect("a job"), ["far.png", "near.png", CAPTURE_FILE]);
        fs::write(folder.path().join("mine.toml"), "").expect("a writable folder");
        let more = format!(
            "{pair}operators = 'mine.toml'\npsf = 'ring.png,radius=9'\ncorrection = 'c.toml'\ncamera = 'cam'\noptics = 'o.toml'\n"
        );
        let all = ["far.png", "near.png", "o.toml", "mine.toml", "ring.png", "c.toml", "cam"];
        assert_eq!(job(&more).expect("a job"), all);
        assert_eq!(job(&format!("{pair}operators = 'gro:linear'\n")).expect("a job").len(), 3);
        for (wrong, phrase) in [
            ("window = 'adaptive'\nsmooth = 9\n", "smooth"),
            ("smoth = 9\n", "smoth"),
            ("method = 'magic'\n", "magic"),
        ] {
            let error = job(&format!("{pair}{wrong}")).expect_err("wrong").to_string();
            assert!(error.contains(phrase), "{error}");
        }
    }
}

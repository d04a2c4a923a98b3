//! Silhouettes, shadow and activities.

use std::path::{Path, PathBuf};

use farnear_files::staging::Staging;
use farnear_shadow as shadow;
use farnear_shadow::sun::{self, Place};
use farnear_silhouettes::readers::recording::{Choices, Up};
use farnear_silhouettes::silhouette::parts::Fill;
use serde_json::Value;

use super::{BatchError, Call, Fields, Job, value};
use crate::{
    activity::{
        recognition::{Model, Recognition, RecognitionSettings},
        views::{View, ViewKind},
    },
    context::Context,
    error::Result,
    shadow::removal::{self, LightSource, RemovalSettings},
    silhouettes::markers::{self, MarkersSettings},
    sun::Moment,
};

pub(super) fn markers(fields: &mut Fields) -> Result<Box<dyn Job>> {
    let template = fields.name_or_file("template")?.ok_or(BatchError::MissingField { name: "template" })?;
    let settings = MarkersSettings {
        file: fields.path("file")?,
        choices: Choices {
            unit: fields.optional("units")?,
            up: up(fields)?,
            person: fields.optional("person")?,
        },
        template: Some(template.display().to_string()),
        out: fields.path("out")?,
        views: fields.or("views", 8)?,
        first_view_deg: fields.or("first_view_deg", 0.0)?,
        elevation_deg: fields.or("elevation_deg", 0.0)?,
        mm_per_px: fields.or("mm_per_px", 6.0)?,
        close_mm: fields.optional("close_mm")?,
        fill: match fields.optional_text("fill")?.as_deref() {
            None | Some("hull") => Fill::Hull,
            Some("triplets") => Fill::Triplets,
            Some(other) => return Err(BatchError::field("fill", other, "expected hull or triplets").into()),
        },
        every: fields.or("every", 1)?,
        centred: fields.flag("centred")?,
        keep: fields.optional("keep")?,
        samples: None,
    };
    let mut inputs = vec![settings.file.clone()];
    inputs.extend(template.is_file().then_some(template));
    Ok(Box::new(Call {
        inputs,
        settings,
        run: |settings, out, context| {
            value(markers::draw(&MarkersSettings { out: out.into(), ..settings.clone() }, context)?)
        },
    }))
}

fn up(fields: &mut Fields) -> Result<Option<Up>, BatchError> {
    match fields.optional_text("up")?.as_deref() {
        None => Ok(None),
        Some("x") => Ok(Some(Up::X)),
        Some("y") => Ok(Some(Up::Y)),
        Some("z") => Ok(Some(Up::Z)),
        Some(other) => Err(BatchError::field("up", other, "expected x, y or z")),
    }
}

pub(super) fn shadow(fields: &mut Fields) -> Result<Box<dyn Job>> {
    let light = light(fields)?;
    let settings = RemovalSettings {
        masks: fields.path("masks")?,
        camera: fields.path("camera")?,
        light,
        method: fields.or("method", shadow::Method::default())?,
        out: fields.path("out")?,
        stages: None, // a job makes the one folder that is written down as its result
    };
    Ok(Box::new(Call {
        inputs: vec![settings.masks.clone(), settings.camera.clone()],
        settings,
        run: |settings, out, context| {
            value(removal::remove_from_masks(
                &RemovalSettings { out: out.into(), ..settings.clone() },
                context,
            )?)
        },
    }))
}

/// `lamp`, `shadow_direction`, or the sun's `lat`, `lon` and `time`.
fn light(fields: &mut Fields) -> Result<LightSource> {
    if let Some(lamp) = fields.optional_text("lamp")? {
        let lamp =
            removal::parse_lamp(&lamp).map_err(|expected| BatchError::field("lamp", &lamp, expected))?;
        return Ok(LightSource::Lamp(lamp));
    }
    if let Some(degrees) = fields.optional("shadow_direction")? {
        return Ok(LightSource::Direction { degrees });
    }
    let degrees = |fields: &mut Fields, name| -> Result<f64> {
        Ok(fields.optional(name)?.ok_or(BatchError::MissingField { name })?)
    };
    let place = Place::new(degrees(fields, "lat")?, degrees(fields, "lon")?)?;
    let moment = Moment { place, time: sun::parse_time(&fields.text("time")?)? };
    Ok(LightSource::Sun { moment, rate_hz: fields.optional("rate_hz")? })
}

struct Recognising {
    model: PathBuf,
    views: Vec<PathBuf>,
    kind: Option<ViewKind>,
    among: Vec<String>,
    window: Option<usize>,
}

pub(super) fn recognise(fields: &mut Fields) -> Result<Box<dyn Job>> {
    let settings = Recognising {
        model: fields.name_or_file("model")?.ok_or(BatchError::MissingField { name: "model" })?,
        views: fields.paths("views")?,
        kind: match fields.optional_text("as")?.as_deref() {
            None => None,
            Some("masks") => Some(ViewKind::Masks),
            Some("video") => Some(ViewKind::Video),
            Some(other) => return Err(BatchError::field("as", other, "expected masks or video").into()),
        },
        among: fields.texts("among"),
        window: fields.optional("window")?,
    };
    fields.path("out")?;
    let mut inputs = settings.views.clone();
    // One that comes with the program is the program's version.
    inputs.extend(Model::file(&settings.model).map(Path::to_path_buf));
    Ok(Box::new(Call { inputs, settings, run: recognised }))
}

/// Writes `answers.jsonl`, an answer a frame, and `recognition.json`, that for the whole.
fn recognised(settings: &Recognising, out: &Path, context: &Context<'_>) -> Result<Value> {
    let model = context.cache.model(&settings.model)?;
    let view = |path: &PathBuf| -> Result<View> {
        let kind = settings.kind.map_or_else(|| ViewKind::guess(path), Ok)?;
        Ok(View { path: path.clone(), kind })
    };
    let views = settings.views.iter().map(view).collect::<Result<Vec<View>>>()?;
    let settings = RecognitionSettings {
        views,
        among: settings.among.clone(),
        window: settings.window,
        annotated_video: None,
    };
    let mut work = Recognition::begin(&model, &settings)?;
    let mut answers = String::new();
    while let Some(answer) = work.next(context)? {
        answers.push_str(&value(answer)?.to_string());
        answers.push('\n');
    }
    let figures = value(work.finish()?)?;
    let mut kept = figures.clone();
    // Another number each time; the same recording is to give the same file.
    kept.as_object_mut().map(|kept| kept.remove("seconds_per_frame"));
    let staged = Staging::new_folder(out)?;
    staged.write("answers.jsonl", answers.as_bytes())?;
    staged.write("recognition.json", format!("{kept}\n").as_bytes())?;
    staged.finish()?;
    Ok(figures)
}

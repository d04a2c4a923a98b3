//! Recognition of activities.

use std::path::{Path, PathBuf};

use farnear_files::staging::Staging;
use serde_json::Value;

use super::{BatchError, Call, Fields, Job, value};
use crate::{
    activity::{
        recognition::{Model, Recognition, RecognitionSettings},
        views::{View, ViewKind},
    },
    context::Context,
    error::Result,
};

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

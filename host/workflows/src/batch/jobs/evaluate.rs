//! Job: evaluates a method or a finished model on samples.

use std::{
    fs,
    path::{Path, PathBuf},
};

use farnear_recognition::choice::Views;
use farnear_recognition::classifier::Family;
use farnear_recognition::frames::Mode;
use farnear_recognition::self_training::ROUNDS;
use serde_json::Value;

use super::{BatchError, Call, Fields, Job, value};
use crate::{
    activity::{
        evaluation::{self, EvaluationSettings, LearnFrom},
        judging::{self, JudgingSettings},
        method::{Adaptation, Method, Pattern},
        recognition::Model,
        samples::Samples,
        shipped::Shipped,
    },
    context::Context,
    error::{Result, WorkflowError},
};

const FIGURES: &str = "figures.json";

pub(super) fn work(fields: &mut Fields) -> Result<Box<dyn Job>> {
    let samples = fields.path("samples")?;
    fields.path("out")?;
    let views = fields.optional::<Views>("views")?;
    let self_training = if fields.flag("adapt")? { ROUNDS } else { 0 };
    let mut inputs = masks_of(&samples)?;
    if let Some(model) = fields.name_or_file("model")? {
        let fused = views == Some(Views::Fused);
        let same = fields.texts("same").iter().map(|text| same(text)).collect::<Result<_, BatchError>>()?;
        inputs.extend(Model::file(&model).map(Path::to_path_buf));
        let settings = JudgingSettings { samples, same, self_training, fused, open_blind: None, out: None };
        return Ok(Box::new(Call { inputs, settings: (model, settings), run: judged }));
    }
    let others = fields.flag("leave_one_subject_out")?;
    let train = fields.optional_path("train")?;
    if let Some(train) = &train {
        inputs.extend(masks_of(train)?);
    }
    let learn_from = match (others, train) {
        (true, None) => LearnFrom::OtherSubjects,
        (true, Some(train)) => LearnFrom::SamplesOfOthers(train),
        (false, Some(train)) => LearnFrom::Samples(train),
        (false, None) => return Err(BatchError::MissingField { name: "leave_one_subject_out" }.into()),
    };
    let classifier = fields.or("classifier", Family::Svc)?;
    let pattern = match fields.optional_text("features")? {
        None => Pattern::Codebook { mode: fields.or("mode", Mode::OrderFree)?, classifier },
        Some(name) => match Shipped::named(&name) {
            Some(model) => Pattern::Features { model, classifier },
            None => {
                let reason = "expected a model that comes with the program: farnear activity models";
                return Err(BatchError::field("features", name, reason).into());
            }
        },
    };
    let method = Method { pattern, search: !fields.flag("no_search")? };
    let adaptation = Adaptation { self_training, ..Adaptation::default() };
    let settings = EvaluationSettings { samples, learn_from, method, adaptation, views, out: None };
    Ok(Box::new(Call {
        inputs,
        settings,
        run: |settings, out, context| {
            let settings = EvaluationSettings { out: Some(out.into()), ..settings.clone() };
            kept(value(evaluation::evaluate(&settings, context)?)?, out)
        },
    }))
}

fn masks_of(samples: &Path) -> Result<Vec<PathBuf>> {
    let mut inputs = vec![samples.to_path_buf()];
    inputs.extend(Samples::folders(samples)?);
    Ok(inputs)
}

fn same(text: &str) -> Result<(String, String), BatchError> {
    let (own, known) = text
        .split_once('=')
        .ok_or_else(|| BatchError::field("same", text, "expected NAME IN THE SAMPLES=NAME IN THE MODEL"))?;
    Ok((own.trim().into(), known.trim().into()))
}

fn judged(
    (model, settings): &(PathBuf, JudgingSettings),
    out: &Path,
    context: &Context<'_>,
) -> Result<Value> {
    let model = context.cache.model(model)?;
    let settings = JudgingSettings { out: Some(out.into()), ..settings.clone() };
    kept(value(judging::judge(&model, &settings, context)?)?, out)
}

/// Writes the figures without times, so that equal samples give equal files.
fn kept(figures: Value, out: &Path) -> Result<Value> {
    let mut same = figures.clone();
    if let Some(same) = same.as_object_mut() {
        same.retain(|name, _| !name.starts_with("seconds"));
    }
    fs::write(out.join(FIGURES), format!("{same}\n"))
        .map_err(|source| WorkflowError::Folder { folder: out.into(), source })?;
    Ok(figures)
}

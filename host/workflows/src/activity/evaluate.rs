//! The task of evaluation: a method on subjects outside its training, or a finished model.

use std::path::{Path, PathBuf};

use farnear_files::staging::Staging;
use farnear_recognition::alignment::Alignment;
use farnear_recognition::choice::Views;
use farnear_recognition::evaluation::confusion::Confusion;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{
    evaluation::{self, EvaluationFigures, OpenSetFigures},
    judging::{self, JudgingFigures},
    method::{MethodOptions, none_of},
    recognition::Model,
    samples::Samples,
    sets::{self, SetsFigures},
};
use crate::{
    context::Context,
    error::{Result, WorkflowError},
    request::{PathKind, Request, json},
};

const FIGURES: &str = "figures.json";

/// Evaluates the method: every subject is recognised by a model of the others.
///
/// With --leave-one-subject-out each subject in turn is left out of the training, in which everything that can be
/// chosen is chosen by cross-validation over the remaining subjects. --train gives other samples to learn from (clean
/// masks for damaged ones of the same people, say; a subject's own are left out as before). Without
/// --leave-one-subject-out but with --train all of that is learned from, and the subjects must be others.
///
/// --open-set leaves out activities instead of subjects: half of the subjects train the others, the other half performs all.
///
/// --model judges a finished model instead: answers among all that it knows and among what the samples hold, how far confidences are
/// from the fraction of right answers, how many known and unknown activities it calls unknown. With --leave-one-set-out it is judged on several
/// sets: expect of a new set the figures of the worst left-out one.
#[derive(Clone, Default, PartialEq, Eq, Debug, Serialize, Deserialize, JsonSchema)]
#[cfg_attr(feature = "clap", derive(clap::Args))]
#[cfg_attr(
    feature = "clap",
    command(
        after_help = "Example: farnear activity evaluate samples.toml --leave-one-subject-out --mode ordered --json\n\
         \x20        farnear activity evaluate samples.toml --model everyday --same 'clap hands=clap' --out judged/\n\
         \x20        farnear activity evaluate one/samples.toml --model everyday --leave-one-set-out two/samples.toml three/samples.toml"
    )
)]
#[serde(default)]
pub struct EvaluateRequest {
    /// The samples, TOML (see farnear activity train --help).
    pub samples: PathBuf,
    /// Leave every subject out in turn.
    #[cfg_attr(feature = "clap", arg(long))]
    pub leave_one_subject_out: bool,
    /// Learn from these samples instead.
    #[cfg_attr(feature = "clap", arg(long, value_name = "SAMPLES"))]
    pub train: Option<PathBuf>,
    /// Judge this model: a file, or the name of one that comes with the program.
    #[cfg_attr(feature = "clap", arg(long, value_name = "FILE|NAME"))]
    pub model: Option<PathBuf>,
    /// Judge the model on these sets too, each with a limit for unknown activities that the other sets give.
    #[cfg_attr(feature = "clap", arg(long, value_name = "SAMPLES", num_args = 1..))]
    pub leave_one_set_out: Vec<PathBuf>,
    /// Open sets that their samples file marks as blind, for this reason; every opening is recorded in openings.csv next to the file.
    #[cfg_attr(feature = "clap", arg(long, value_name = "REASON"))]
    pub open_blind_set: Option<String>,
    /// An activity's name in the samples and in the model, where they differ; may be repeated.
    #[cfg_attr(feature = "clap", arg(long, value_name = "SAMPLES=MODEL"))]
    pub same: Vec<String>,
    /// Leave every activity out of the training in turn, and report how often it is called unknown.
    #[cfg_attr(feature = "clap", arg(long))]
    pub open_set: bool,
    /// Learn on from one's own surest answers for the clips that are recognised, without their labels: for clips from another camera,
    /// sensor or laboratory than those learned from.
    #[cfg_attr(feature = "clap", arg(long))]
    pub adapt: bool,
    /// Bring the frames of the clips that are recognised to those learned from, without labels: none, mean, spread (mean and
    /// spread) or coral (covariance too).
    #[cfg_attr(feature = "clap", arg(long, value_name = "STATISTICS", default_value = "none"))]
    #[schemars(with = "String")]
    pub align: Alignment,
    #[cfg_attr(feature = "clap", command(flatten))]
    #[serde(flatten)]
    pub method: MethodOptions,
    /// each: every view by itself, answers counted together; fused: all views of a clip at once [default: fused, or each where clips
    /// differ in their views; with --model: each for a model of one view, fused for a model of several, which refuses each].
    #[cfg_attr(feature = "clap", arg(long))]
    #[schemars(with = "Option<String>")]
    pub views: Option<Views>,
    /// Folder for figures.json, confusion.png, confusion.md and evaluation.toml (the choices of every fold), or wrong.csv (a model's
    /// mistakes).
    #[cfg_attr(feature = "clap", arg(long, value_name = "DIR"))]
    pub out: Option<PathBuf>,
}

#[derive(Clone, PartialEq, Debug, Serialize)]
#[serde(untagged)]
pub enum EvaluateFigures {
    Method(EvaluationFigures),
    OpenSet(OpenSetFigures),
    Model(JudgingFigures),
    Sets(SetsFigures),
}

impl EvaluateFigures {
    pub fn confusion(&self) -> Option<&Confusion> {
        match self {
            Self::Method(figures) => Some(&figures.confusion),
            Self::Model(figures) => Some(&figures.confusion),
            Self::OpenSet(_) | Self::Sets(_) => None,
        }
    }
}

impl Request for EvaluateRequest {
    const NAME: &'static str = "activity evaluate";
    const REQUIRED: &'static [&'static str] = &["samples"];
    const PATHS: &'static [(&'static str, PathKind)] = &[
        ("samples", PathKind::Input),
        ("train", PathKind::Input),
        ("model", PathKind::InputOrName),
        ("leave_one_set_out", PathKind::Input),
        ("out", PathKind::OutputFolder),
    ];
    type Figures = EvaluateFigures;

    fn check(&self) -> Result<()> {
        self.method.method()?;
        for same in &self.same {
            pair(same)?;
        }
        let learning = [
            ("--leave-one-subject-out", self.leave_one_subject_out),
            ("--train", self.train.is_some()),
            ("--open-set", self.open_set),
        ];
        let views = ("--views", self.views.is_some());
        let adapt = ("--adapt", self.adapt);
        let align = ("--align", self.align != Alignment::None);
        let set = self.leave_one_set_out.first();
        if let Some(model) = &self.model {
            none_of("model", model.display(), learning)?;
            none_of("model", model.display(), [align, ("options of the method", !self.method.is_default())])?;
            let sets: Vec<&PathBuf> = std::iter::once(&self.samples).chain(&self.leave_one_set_out).collect();
            let twice = (1..sets.len()).find(|at| sets[..*at].iter().any(|set| same_file(set, sets[*at])));
            if let Some(at) = twice {
                let expected = "expected each set once: a limit from the set itself says nothing";
                return Err(WorkflowError::parameter("leave-one-set-out", sets[at].display(), expected));
            }
            return set.map_or(Ok(()), |set| none_of("leave-one-set-out", set.display(), [views, adapt]));
        }
        let of_models = [
            ("leave-one-set-out", set.map(|set| set.display().to_string())),
            ("open-blind-set", self.open_blind_set.clone()),
            ("same", self.same.first().cloned()),
        ];
        if let Some((name, value)) = of_models.into_iter().find_map(|(name, value)| Some((name, value?))) {
            return Err(WorkflowError::parameter(name, value, "it needs --model"));
        }
        match (self.open_set, self.leave_one_subject_out || self.train.is_some()) {
            (true, _) => none_of("open-set", true, [learning[0], learning[1], views, adapt, align]),
            (false, true) => Ok(()),
            (false, false) => Err(WorkflowError::parameter(
                "what to learn from",
                "is missing",
                "--leave-one-subject-out (the other subjects), --train SAMPLES, or both; or --open-set; or --model to judge a finished one",
            )),
        }
    }

    fn run(&self, context: &Context<'_>) -> Result<EvaluateFigures> {
        self.check()?;
        let out = self.out.as_deref().map(Staging::new_folder).transpose()?;
        let model = self.model.as_deref().map(|model| context.cache.model(model)).transpose()?;
        let figures = match &model {
            Some(model) if self.leave_one_set_out.is_empty() => {
                EvaluateFigures::Model(judging::judge(model, self, out.as_ref(), context)?)
            }
            Some(model) => EvaluateFigures::Sets(sets::leave_one_set_out(model, self, context)?),
            None if self.open_set => EvaluateFigures::OpenSet(evaluation::open_set(self, context)?),
            None => EvaluateFigures::Method(evaluation::evaluate(self, out.as_ref(), context)?),
        };
        if let (Some(staged), Some(out)) = (out, &self.out) {
            staged.write(FIGURES, untimed(&figures)?.as_bytes())?;
            staged.finish()?;
            context.info(&format!("wrote {}", out.display()));
        }
        Ok(figures)
    }

    /// The masks too.
    fn inputs(&self) -> Vec<PathBuf> {
        let samples = || std::iter::once(&self.samples).chain(&self.train).chain(&self.leave_one_set_out);
        let masks = samples().flat_map(|file| Samples::folders(file).unwrap_or_default());
        let model = self.model.as_deref().and_then(Model::file).map(Path::to_path_buf);
        samples().cloned().chain(masks).chain(model).collect()
    }
}

impl EvaluateRequest {
    /// Names in the samples and in the model.
    pub(super) fn same(&self) -> impl Iterator<Item = (&str, &str)> {
        self.same.iter().filter_map(|same| pair(same).ok())
    }

    pub(super) fn name_in_model(&self, activity: &str) -> String {
        self.same().find(|(own, _)| *own == activity).map_or(activity, |(_, known)| known).to_owned()
    }
}

fn same_file(a: &Path, b: &Path) -> bool {
    a == b || a.canonicalize().is_ok_and(|a| b.canonicalize().is_ok_and(|b| a == b))
}

fn pair(same: &str) -> Result<(&str, &str)> {
    let pair = same.split_once('=').map(|(own, known)| (own.trim(), known.trim()));
    pair.ok_or_else(|| WorkflowError::parameter("same", same, "NAME IN THE SAMPLES=NAME IN THE MODEL"))
}

/// The figures without times, so that equal samples give equal files.
fn untimed(figures: &EvaluateFigures) -> Result<String> {
    let mut figures = json(figures)?;
    if let Some(figures) = figures.as_object_mut() {
        figures.retain(|name, _| !name.starts_with("seconds"));
    }
    Ok(format!("{figures}\n"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::activity::training::TrainRequest;

    #[test]
    fn options_that_exclude_each_other_are_refused_by_name() {
        let model = EvaluateRequest { model: Some("everyday".into()), ..EvaluateRequest::default() };
        let features = MethodOptions { features: Some("everyday".into()), ..MethodOptions::default() };
        let others = EvaluateRequest { leave_one_subject_out: true, ..EvaluateRequest::default() };
        for (request, phrases) in [
            (EvaluateRequest::default(), ["what to learn from", "--train"]),
            (EvaluateRequest { open_set: true, ..model.clone() }, ["model everyday", "--open-set"]),
            (
                EvaluateRequest { method: features.clone(), ..model.clone() },
                ["model everyday", "of the method"],
            ),
            (
                EvaluateRequest { open_set: true, adapt: true, ..EvaluateRequest::default() },
                ["open-set", "--adapt"],
            ),
            (EvaluateRequest { same: vec!["a=b".into()], ..others.clone() }, ["same a=b", "--model"]),
            (EvaluateRequest { same: vec!["a".into()], ..model.clone() }, ["same a", "NAME IN THE MODEL"]),
            (
                EvaluateRequest {
                    leave_one_set_out: vec!["b.toml".into()],
                    views: Some(Views::Each),
                    ..model.clone()
                },
                ["leave-one-set-out b.toml", "--views"],
            ),
            (
                EvaluateRequest {
                    method: MethodOptions { epl: Some(super::super::method::Epl::Thesis), ..features },
                    ..others.clone()
                },
                ["epl thesis", "--features"],
            ),
        ] {
            let error = request.check().expect_err("refused").to_string();
            assert!(phrases.iter().all(|phrase| error.contains(phrase)), "{error}");
        }
        assert!(model.check().is_ok() && others.check().is_ok());
    }

    #[test]
    fn names_and_subjects_are_checked_before_masks_are_read() {
        let folder = tempfile::tempdir().unwrap();
        let samples = |name: &str| {
            let sample = "[[sample]]\nmasks = \"absent\"\nsubject = \"anna\"\nactivity = \"walk\"\n";
            std::fs::write(folder.path().join(name), sample).unwrap();
            folder.path().join(name)
        };
        let one = EvaluateRequest { samples: samples("a.toml"), ..EvaluateRequest::default() };
        let same = vec!["wlak=walk".into()];
        let model = EvaluateRequest { model: Some("everyday".into()), same, ..one.clone() };
        let sets = EvaluateRequest { leave_one_set_out: vec![samples("b.toml")], ..model.clone() };
        let others = EvaluateRequest { train: Some(samples("c.toml")), ..one };
        for (request, phrase) in [(model, "`wlak`"), (sets, "`wlak`"), (others, "`anna`")] {
            let error = request.run(&Context::unattended()).unwrap_err().to_string();
            assert!(error.contains(phrase), "{error}");
        }
    }

    #[test]
    fn training_needs_clips_and_options_of_motion_files_need_them() {
        let samples = TrainRequest { samples: Some("a.toml".into()), ..TrainRequest::default() };
        assert!(samples.check().is_ok());
        for (request, phrase) in [
            (TrainRequest::default(), "--motion"),
            (TrainRequest { template: Some("bvh".into()), ..samples.clone() }, "template bvh"),
            (TrainRequest { window: Some(4), ..samples.clone() }, "window"),
            (TrainRequest { cameras: 0, ..samples }, "cameras"),
        ] {
            let error = request.check().expect_err("refused").to_string();
            assert!(error.contains(phrase), "{error}");
        }
    }
}

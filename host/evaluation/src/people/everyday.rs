//! The shipped recognisers on sets that they were not trained on.

use std::sync::Arc;

use anyhow::{Context, Result};
use farnear_recognition::choice::names;
use farnear_recognition::classifier::Classifier;
use farnear_recognition::clip::{Clip, Track};
use farnear_recognition::embedding::descriptor::Scaling;
use farnear_recognition::evaluation::{
    calibration::Reliability, confusion::Confusion, leave_one_out::EvaluationError, open_set::open_set,
};
use farnear_recognition::experiment::Experiment;
use farnear_recognition::frames::Mode;
use farnear_recognition::model::{Answer, Recogniser};
use farnear_recognition::space::SpaceSettings;
use farnear_recognition::watch::Unwatched;
use ndarray::Axis;
use rayon::prelude::*;

use super::{broken, data::Data, recognition::accuracy, sets};
use crate::page::Page;

/// Mode, kind of silhouettes, and the model.
pub const MODELS: [(&str, &str, &[u8]); 4] = [
    ("ordered", "full frames", include_bytes!("../../../recognition/models/everyday.fnm")),
    ("ordered", "100x100", include_bytes!("../../../recognition/models/everyday-cut-out.fnm")),
    ("order-free", "full frames", include_bytes!("../../../recognition/models/everyday-order-free.fnm")),
    ("order-free", "100x100", include_bytes!("../../../recognition/models/everyday-order-free-cut-out.fnm")),
];

const SAME: [(&str, &str); 7] = [
    ("wave hands", "wave two hands"),
    ("clap hands", "clap"),
    ("wave", "wave one hand"),
    ("wave one", "wave one hand"),
    ("wave two", "wave two hands"),
    ("jack", "jumping jack"),
    ("tight lace", "tie laces"),
];

struct Judged {
    truth: String,
    answer: Answer,
}

pub fn measure(page: &mut Page, data: &Data) -> Result<()> {
    page.heading("The models that come with the program");
    page.paragraph(
        "`everyday` and `everyday-order-free` have learned from synthetic people only (`farnear activity train-synthetic`); no clip of these sets was trained on, and one model answers for \
         all of them, from any side. *All* lets it answer any of its activities, *among* those that the set holds (`--among`); *one view* counts the answers of all views, *fused* is one answer from \
         all of them. *Calibration* is the expected calibration error of the answers among the set's activities. *Known called unknown* has a limit of 1.3 times the one that gives 5 % on synthetic people. How synthetic people move \
         (which hand, where hands go, how deep they bend, how fast they are, where a clip begins and ends) and their proportions were set after looking at these sets' silhouettes and joints and at the confusions, so that the figures are not blind.",
    );
    let mut all: Vec<(&str, Vec<Clip>)> = Vec::new();
    for read in [sets::utkinect, sets::florence, sets::weizmann] {
        if let Some(set) = read(data)? {
            all.push((set.name, set.clips));
        }
    }
    let walking = broken::walking(data)?;
    if !walking.is_empty() {
        all.push(("KTH walking", walking));
    }
    if all.is_empty() {
        page.paragraph("Skipped: none of the sets is at hand.");
        return Ok(());
    }
    let mut rows = Vec::new();
    for (mode, kind, bytes) in MODELS {
        let model = Recogniser::from_bytes(bytes).context("a model that comes with the program")?;
        for (name, clips) in &all {
            rows.push(row(&model, [name, mode, kind], clips)?);
        }
    }
    let head = [
        "set",
        "mode",
        "silhouettes",
        "activities",
        "clips",
        "all, one view, %",
        "among, one view, %",
        "among, fused, %",
        "calibration",
        "known called unknown, %",
    ];
    page.table(3, &head, &rows);
    page.subheading("Untaught activities");
    page.paragraph(
        "Models trained on a set itself, default settings, all views fused: each activity in turn is left out of the training on half of the subjects, the other half does all activities, and the other way round \
         (`farnear activity evaluate --open-set`). The limit is the conformal rule's for 5 % of false alarms among right answers; wrong ones are called unknown oftener. An *auxiliary model* compares the answer of `everyday` for a clip with its answers for the training clips of the same activity; the distance to the \
         *nearest clip* of the training is what streaming answers and un-segmented recordings have. All the activities left out are among those that `everyday` knows; *model without this class* is \
         `everyday` without the activity left out, as it would be for something truly new. Half of the strips are 15 clips, of which no limit can keep the promise.",
    );
    let mut rows = Vec::new();
    for (name, clips) in all.iter().filter(|(_, clips)| activities(clips).len() > 2) {
        for (mode_name, mode) in [("ordered", Mode::Ordered), ("order-free", Mode::OrderFree)] {
            for (by, of) in BY {
                let whole = auxiliary_model(clips)?;
                let experiment = |left_out: &str| Experiment {
                    second: of(&whole, left_out).map(Arc::new),
                    ..Experiment::codebook(SpaceSettings { mode, ..SpaceSettings::default() })
                };
                let percent = |share: f64| format!("{:.1}", 100.0 * share);
                let figures = match open_set(clips, experiment, Scaling::default(), &Unwatched) {
                    Ok(rows) => rows.last().map(|mean| {
                        let [strange, known] =
                            [mean.unknown_of_strangers, mean.unknown_of_known].map(percent);
                        [format!("{:.3}", mean.auroc), strange, known]
                    }),
                    Err(EvaluationError::OpenSetClips { .. }) => None,
                    Err(other) => return Err(other.into()),
                };
                let figures = figures.unwrap_or_else(|| ["-"; 3].map(str::to_owned));
                rows.push([[*name, mode_name, by].map(str::to_owned), figures].concat());
            }
        }
    }
    let head = [
        "set",
        "mode",
        "strange by",
        "area under the ROC curve",
        "left out called unknown, %",
        "known called unknown, %",
    ];
    page.table(3, &head, &rows);
    Ok(())
}

type Second = fn(&Recogniser, &str) -> Option<Recogniser>;

const BY: [(&str, Second); 3] = [
    ("auxiliary model", |everyday, _| Some(everyday.clone())),
    ("model without this class", |everyday, left_out| Some(without(everyday, called(left_out)))),
    ("nearest clip", |_, _| None),
];

fn auxiliary_model(clips: &[Clip]) -> Result<Recogniser> {
    let cut_out = clips.iter().flat_map(|clip| &clip.views).any(|view| view.boxes.is_none());
    let (_, _, bytes) = MODELS[usize::from(cut_out)];
    Recogniser::from_bytes(bytes).context("a model that comes with the program")
}

/// The model without an activity; the others share its probability.
fn without(model: &Recogniser, activity: &str) -> Recogniser {
    let mut model = model.clone();
    let kept: Vec<usize> = (0..model.activities.len()).filter(|k| model.activities[*k] != activity).collect();
    if let Classifier::Softmax(linear) = &mut model.classifier {
        linear.weights = linear.weights.select(Axis(0), &kept);
        linear.offsets = linear.offsets.select(Axis(0), &kept);
        model.limits.distances = kept.iter().map(|k| model.limits.distances[*k]).collect();
        model.activities.retain(|name| name != activity);
    }
    model
}

fn called(activity: &str) -> &str {
    SAME.iter().find(|(own, _)| *own == activity).map_or(activity, |(_, known)| known)
}

fn activities(clips: &[Clip]) -> Vec<String> {
    names(clips.iter().map(|clip| &clip.activity))
}

fn judged(model: &Recogniser, clips: &[Clip]) -> Result<(Vec<Judged>, Vec<Judged>)> {
    let shapes =
        |view: &Track| Track { boxes: view.boxes.clone().filter(|_| model.uses_boxes()), ..view.clone() };
    let of_clip = |clip: &Clip| -> Result<(Vec<Judged>, Judged)> {
        let truth = called(&clip.activity).to_owned();
        let views: Vec<Track> = clip.views.iter().map(shapes).collect();
        let each = views.iter().map(|view| {
            let answer = model.recognise(std::slice::from_ref(view))?;
            Ok(Judged { truth: truth.clone(), answer })
        });
        let each = each.collect::<Result<Vec<Judged>>>()?;
        Ok((each, Judged { answer: model.recognise(&views)?, truth }))
    };
    let both = clips.par_iter().map(of_clip).collect::<Result<Vec<_>>>()?;
    let (each, fused): (Vec<Vec<Judged>>, Vec<Judged>) = both.into_iter().unzip();
    Ok((each.into_iter().flatten().collect(), fused))
}

fn common(model: &Recogniser, judged: &[Judged]) -> Vec<String> {
    let known = |activity: &&String| judged.iter().any(|judged| judged.truth == **activity);
    model.activities.iter().filter(known).cloned().collect()
}

fn row(model: &Recogniser, names: [&str; 3], clips: &[Clip]) -> Result<Vec<String>> {
    let (each, fused) = judged(model, clips)?;
    let among = common(model, &each);
    let is_right = |judged: &&Judged| judged.answer.best() == Some(&judged.truth);
    let right = each.iter().filter(is_right).count();
    let (mut one, mut together) = (Confusion::new(among.clone()), Confusion::new(among.clone()));
    let mut reliability = Reliability::default();
    let place = |name: &String| among.iter().position(|activity| activity == name).unwrap_or(0);
    for (confusion, answers) in [(&mut one, &each), (&mut together, &fused)] {
        for judged in answers {
            let answer = judged.answer.among(&among);
            confusion.count(place(&judged.truth), answer.best().map_or(0, place));
        }
    }
    for judged in &each {
        let answer = judged.answer.among(&among);
        reliability.count(answer.confidence, answer.best() == Some(&judged.truth));
    }
    let unknown = each.iter().filter(|judged| judged.answer.outlier_score > 1.0).count();
    let share = |count: usize, of: usize| format!("{:.1}", 100.0 * count as f64 / of.max(1) as f64);
    // Views are not independent: as many trials as clips.
    let with_interval = |confusion: &Confusion| accuracy(confusion, clips.len());
    let mut cells: Vec<String> = names.iter().map(|name| (*name).to_owned()).collect();
    cells.extend([
        among.len().to_string(),
        clips.len().to_string(),
        share(right, each.len()),
        with_interval(&one),
        if clips.iter().all(|clip| clip.views.len() == 1) { "-".into() } else { with_interval(&together) },
        if among.len() > 1 { format!("{:.3}", reliability.expected_error()) } else { "-".into() },
        share(unknown, each.len()),
    ]);
    Ok(cells)
}

//! Models of everyday activities: trained on synthetic people, and those of the package.

use farnear_recognition::clip::Clip;
use farnear_recognition::embedding::descriptor::Scaling;
use farnear_recognition::evaluation::open_set::open_set;
use farnear_recognition::experiment::Experiment;
use farnear_recognition::model::{Answer, Recogniser};
use farnear_recognition::network::training::NetworkSettings;
use farnear_recognition::space::{PatternKind, SpaceSettings};
use farnear_recognition::synthetic::everyday;
use farnear_recognition::watch::{Unwatched, Watch};
use std::sync::Arc;

const SHIPPED: [&[u8]; 4] = [
    include_bytes!("../../models/everyday.fnm"),
    include_bytes!("../../models/everyday-order-free.fnm"),
    include_bytes!("../../models/everyday-cut-out.fnm"),
    include_bytes!("../../models/everyday-order-free-cut-out.fnm"),
];

fn few(first: usize, people: usize) -> Vec<Clip> {
    let names = ["walk", "jumping jack", "crouch", "lie down"];
    everyday::clips_of(&names, first, people, Scaling::default())
}

fn right(model: &Recogniser, clips: &[Clip]) -> usize {
    let is_right = |clip: &&Clip| model.recognise(&clip.views).expect("fits").best() == Some(&clip.activity);
    clips.iter().filter(is_right).count()
}

fn small() -> NetworkSettings {
    NetworkSettings { widths: [24, 32, 24], batch: 16, ..NetworkSettings::default() }
}

#[test]
fn a_network_learns_from_synthetic_people_survives_a_file_and_takes_any_number_of_views() {
    let (people, others) = (few(0, 12), few(500, 8));
    let space = SpaceSettings { dimensions: 12, gallery: 800, ..SpaceSettings::default() };
    let model = Recogniser::train_network(&people, &others, &space, &small(), Scaling::default(), &Unwatched)
        .expect("trained");
    let found = right(&model, &others);
    // By chance 8 of 32.
    assert!(found >= 24, "{found} of {}", others.len());
    let back = Recogniser::from_bytes(&model.to_bytes().expect("encoded")).expect("decoded");
    assert_eq!(back, model);
    // The joint answer is at least as sure where the views agree; an empty view changes nothing.
    let view = others[0].views[0].clone();
    let one = model.recognise(std::slice::from_ref(&view)).expect("fits");
    let two = model.recognise(&[view.clone(), view.clone()]).expect("fits");
    assert_eq!(one.best(), two.best());
    let nobody = view.select(&[]);
    assert_eq!(model.recognise(&[view.clone(), nobody.clone()]).expect("fits"), one);
    assert_eq!(model.recognise(&[nobody.clone(), nobody]).expect("fits").activity, None);
    // Restricted answers sum to 1.
    let among = one.among(&["walk".into(), "crouch".into()]);
    assert_eq!(among.probabilities.len(), 2);
    assert!((among.probabilities.iter().map(|p| p.1).sum::<f32>() - 1.0).abs() < 1e-5);
}

struct Stopping;

impl Watch for Stopping {
    fn is_stopped(&self) -> bool {
        true
    }
}

#[test]
fn training_stops_when_asked_and_refuses_a_single_activity() {
    let (mut people, others) = (few(0, 3), few(500, 1));
    let space = SpaceSettings { dimensions: 4, gallery: 200, ..SpaceSettings::default() };
    let train = |people: &[Clip], watch: &dyn Watch| {
        Recogniser::train_network(people, &others, &space, &small(), Scaling::default(), watch)
    };
    assert!(train(&people, &Stopping).expect_err("stopped").to_string().contains("stopped"));
    people.retain(|clip| clip.activity == "walk");
    assert!(train(&people, &Unwatched).expect_err("one").to_string().contains("at least two activities"));
}

#[test]
fn the_shipped_models_are_small_and_know_people_they_never_saw() {
    let bytes: usize = SHIPPED.iter().map(|bytes| bytes.len()).sum();
    // A fifth of the program.
    assert!(bytes <= 5_000_000, "{bytes} bytes in the repository and the program");
    // People used neither for training (from 0) nor for calibration (from 100 000).
    let people = everyday::clips(700_000, 4, Scaling::default());
    for (index, shipped) in SHIPPED.iter().enumerate() {
        let model = Recogniser::from_bytes(shipped).expect("whole");
        assert_eq!(model.activities.len(), everyday::ACTIVITIES.len());
        assert_eq!((model.views, model.uses_boxes()), (1, index < 2));
        let found = right(&model, &people);
        // Three in five: the weakest of the four is right in 73 % of 116 such clips, standard deviation 4.
        assert!(5 * found >= 3 * people.len(), "model {index}: {found} of {}", people.len());
        // Limits are set for 5 % of false alarms; 116 clips leave room for chance.
        let unknown =
            people.iter().filter(|clip| model.recognise(&clip.views).expect("fits").outlier_score > 1.0);
        let unknown = unknown.count();
        assert!(10 * unknown <= 2 * people.len(), "model {index}: {unknown} of {} unknown", people.len());
    }
}

#[test]
fn a_restricted_model_measures_the_outlier_score_for_the_activities_it_answers() {
    let model = Recogniser::from_bytes(SHIPPED[0]).expect("whole");
    let names: Vec<String> = ["walk", "lie down"].map(str::to_owned).to_vec();
    let restricted = model.restricted_to(&names);
    let clips = everyday::clips_of(&["walk", "lie down"], 700_000, 6, Scaling::default());
    let mut sure = 0;
    for clip in &clips {
        let [all, few] = [&model, &restricted].map(|model| model.recognise(&clip.views).expect("fits"));
        let mut found: Vec<&String> = few.probabilities.iter().map(|(name, _)| name).collect();
        found.sort();
        assert_eq!(found, ["lie down", "walk"]);
        assert!((few.probabilities.iter().map(|(_, share)| share).sum::<f32>() - 1.0).abs() < 1e-5);
        assert_eq!(few.best(), all.among(&names).best());
        // Sure among two, the clip is known, even if its probability is spread over the other 27.
        sure += usize::from(few.confidence > 0.99);
        assert!(few.confidence < 0.99 || few.outlier_score < 0.5, "{few:?}");
    }
    assert!(sure > 3, "{sure} of {}", clips.len());
    // Undecided between the two: unknown, although the same entropy is small among 29.
    let undecided = few_of(&restricted, &[0.5, 0.5]);
    assert!(undecided > 1.0, "{undecided}");
}

/// Outlier score of a restricted network for these probabilities.
fn few_of(model: &Recogniser, shares: &[f32]) -> f32 {
    let names = model.among.iter().map(|&class| model.activities[class].clone());
    let answer = Answer {
        activity: None,
        confidence: 0.0,
        probabilities: names.zip(shares.iter().copied()).collect(),
        outlier_score: 0.0,
    };
    model.outlier_score_without(&answer, "none of these").expect("a network")
}

#[test]
fn a_shipped_model_is_less_certain_of_an_activity_removed_from_its_answers() {
    let model = Recogniser::from_bytes(SHIPPED[0]).expect("whole");
    let lying = everyday::clips_of(&["lie down"], 700_000, 6, Scaling::default());
    for clip in lying {
        let answer = model.recognise(&clip.views).expect("fits");
        let without = |activity| model.outlier_score_without(&answer, activity).expect("a network");
        assert!(answer.outlier_score < 1.0 && without("lie down") > 2.0 * without("wave one hand"));
        assert!((without("sing") - answer.outlier_score).abs() < 1e-4, "an activity it does not have");
    }
}

fn with_auxiliary_model() -> Experiment {
    let other = Recogniser::from_bytes(SHIPPED[0]).expect("whole");
    let space =
        SpaceSettings { gallery: 400, pattern: PatternKind::Codebook(40), ..SpaceSettings::default() };
    Experiment { second: Some(Arc::new(other)), ..Experiment::codebook(space).fixed() }
}

fn taught_without(left_out: &str, mut clips: Vec<Clip>) -> Recogniser {
    clips.retain(|clip| clip.activity != left_out);
    let trained = Recogniser::train_searched(&clips, &with_auxiliary_model(), Scaling::default(), &Unwatched);
    trained.expect("trained").0
}

#[test]
fn an_auxiliary_model_rejects_untrained_activities_also_from_a_file() {
    let model = taught_without("lie down", few(600, 8));
    let bytes = model.to_bytes().expect("encoded");
    let model = Recogniser::from_bytes(&bytes).expect("decoded");
    let people = few(700, 8);
    let unknown = |strange: bool| {
        let asked = people.iter().filter(|clip| (clip.activity == "lie down") == strange);
        let called: Vec<bool> =
            asked.map(|clip| model.recognise(&clip.views).expect("fits").activity.is_none()).collect();
        called.iter().filter(|unknown| **unknown).count() as f64 / called.len() as f64
    };
    let (strange, known) = (unknown(true), unknown(false));
    // Specification of open sets: 60 % of strangers, 5 % of known clips: one of these 24, and two more by
    // chance.
    assert!(strange >= 0.6 && known <= 0.125, "{strange} {known}");

    let mut nested = model.clone();
    nested.second.as_mut().expect("kept").recogniser = Arc::new(model.clone());
    let error = Recogniser::from_bytes(&nested.to_bytes().expect("encoded")).expect_err("nested without end");
    assert!(error.to_string().contains("auxiliary model"), "{error}");
    let mut cut = model;
    let profiles = &mut cut.second.as_mut().expect("kept").profiles;
    *profiles = profiles.slice(ndarray::s![.., 1..]).to_owned();
    let error = Recogniser::from_bytes(&cut.to_bytes().expect("encoded")).expect_err("too narrow");
    assert!(error.to_string().contains("auxiliary model"), "{error}");
}

#[test]
fn an_activity_that_one_person_taught_does_not_lift_the_limits_of_others() {
    let mut clips = few(600, 12);
    for clip in clips.iter_mut().filter(|clip| clip.activity == "crouch") {
        clip.subject = "one".into();
    }
    let model = taught_without("lie down", clips);
    let limits = model.second.expect("asked for").limits.distances;
    // Nothing in common is a distance of 20; the same activity as seen by the everyday model less than a
    // tenth of that.
    assert!(limits.iter().all(|limit| *limit < 2.0), "{limits:?}");
}

#[test]
fn an_open_set_needs_clips_for_a_limit_and_most_strangers_are_found() {
    let people = few(600, 14);
    let evaluated =
        |clips: &[Clip]| open_set(clips, |_| with_auxiliary_model(), Scaling::default(), &Unwatched);
    let rows = evaluated(&people).expect("seven people teach 21 clips");
    let mean = rows.last().expect("a mean");
    // Four very different activities; half the rate specified for hard ones, for chance.
    assert!(rows.len() == 5 && mean.auroc > 0.9 && mean.unknown_of_strangers > 0.3, "{mean:?}");
    assert!(mean.unknown_of_known < 0.15, "5 % and what chance adds to 42 clips: {mean:?}");
    let few: Vec<Clip> = people.into_iter().take(4 * 12).collect();
    let error = evaluated(&few).expect_err("six people teach 18");
    assert!(
        error.to_string().contains("at least 19 clips") && error.to_string().contains("has 18"),
        "{error}"
    );
}

//! Recognition through the public API: synthetic people, order, speed, damage, models, live use.

use farnear_recognition::auxiliary_model::AuxiliaryModel;
use farnear_recognition::choice::names;
use farnear_recognition::classifier::{ClassifierKind, Family};
use farnear_recognition::clip::Clip;
use farnear_recognition::embedding::descriptor::Scaling;
use farnear_recognition::evaluation::leave_one_out::leave_one_subject_out;
use farnear_recognition::experiment::Experiment;
use farnear_recognition::frames::Mode;
use farnear_recognition::live::{Live, windows};
use farnear_recognition::model::{ModelError, Recogniser, RecogniserSettings};
use farnear_recognition::space::{PatternKind, SpaceSettings};
use farnear_recognition::synthetic::activities::{clips, performance};
use farnear_recognition::unknown::Limits;
use farnear_recognition::watch::Unwatched;
use farnear_silhouettes::mask::Mask;
use farnear_silhouettes::silhouette::view::{Canvas, draw, extent, views_round};
use ndarray::Array2;
use proptest::prelude::*;
use proptest::test_runner::TestRunner;
use std::sync::{Arc, LazyLock};

fn small(mode: Mode) -> SpaceSettings {
    SpaceSettings { gallery: 500, pattern: PatternKind::Codebook(80), mode, ..SpaceSettings::default() }
}

fn experiment(mode: Mode) -> Experiment {
    Experiment {
        sharpness: vec![2.0],
        classifiers: vec![ClassifierKind::Svc(5.0)],
        ..Experiment::codebook(small(mode))
    }
}

/// Right answers per change, leaving out every subject once; one training serves all changes.
fn right(people: &[Clip], mode: Mode, changes: &[fn(&Clip) -> Clip]) -> Vec<f64> {
    let settings = RecogniserSettings { space: small(mode), ..RecogniserSettings::default() };
    let mut right = vec![0_u32; changes.len()];
    for subject in names(people.iter().map(|clip| &clip.subject)) {
        let (held, kept): (Vec<Clip>, Vec<Clip>) =
            people.iter().cloned().partition(|clip| clip.subject == subject);
        let recogniser = Recogniser::train(&kept, &settings).expect("trained");
        for clip in &held {
            for (right, change) in right.iter_mut().zip(changes) {
                let answer = recogniser.recognise(&change(clip).views).expect("fits");
                *right += u32::from(answer.best() == Some(&clip.activity));
            }
        }
    }
    right.into_iter().map(|right| f64::from(right) / people.len() as f64).collect()
}

#[test]
fn unseen_people_are_recognised_and_neither_order_nor_speed_matters_much() {
    let people = clips(6, 1, 8.0, Scaling::KeepAspect);
    let changes: [fn(&Clip) -> Clip; 4] = [
        Clone::clone,
        |clip| clip.select(|n| (0..n).map(|i| (i * 7919 + 3) % n).collect()),
        |clip| clip.select(|n| (0..n).rev().collect()),
        |clip| clip.select(|n| (0..2 * n).map(|i| i / 2).collect()),
    ];
    let found = right(&people, Mode::OrderFree, &changes);
    let [plain, shuffled, reversed, slow] = found[..] else { panic!("four changes: {found:?}") };
    println!("plain {plain:.3}, shuffled {shuffled:.3}, reversed {reversed:.3}, half speed {slow:.3}");
    assert!(plain > 0.75, "{plain}");
    assert_eq!(plain, reversed, "reversing changes nothing");
    assert!((plain - slow).abs() <= 0.05, "{plain} {slow}");
    assert!((shuffled - plain).abs() < 0.2);
    let evaluated =
        |mode: Mode| leave_one_subject_out(&people, &experiment(mode)).expect("an outcome").each.accuracy();
    // Equal trainings and clips: only probabilities that round to a tie may differ, one clip of sixty.
    let free = evaluated(Mode::OrderFree);
    assert!((free - plain).abs() < 0.02, "{free} {plain}");
    let ordered = evaluated(Mode::Ordered);
    assert!(ordered > 0.75, "{ordered}");
}

#[test]
fn activities_of_one_subject_each_have_no_inner_accuracy() {
    let mut people = clips(2, 1, 8.0, Scaling::KeepAspect);
    let searched = Experiment { classifiers: Family::Knn.tried(), ..experiment(Mode::OrderFree) };
    let accuracy = |people: &[Clip]| {
        let trained = Recogniser::train_searched(people, &searched, Scaling::KeepAspect, &Unwatched);
        trained.expect("trained").1
    };
    assert!(accuracy(&people).is_some());
    people.iter_mut().for_each(|clip| clip.subject.clone_from(&clip.activity));
    assert_eq!(accuracy(&people), None);
}

static TRAINED: LazyLock<(Vec<Clip>, Recogniser)> = LazyLock::new(|| {
    let people = clips(4, 1, 8.0, Scaling::KeepAspect);
    let settings = RecogniserSettings { space: small(Mode::OrderFree), ..RecogniserSettings::default() };
    let recogniser = Recogniser::train(&people, &settings).expect("trained");
    (people, recogniser)
});

#[test]
fn models_come_back_from_bytes() {
    let (_, recogniser) = &*TRAINED;
    let bytes = recogniser.to_bytes().expect("encoded");
    assert_eq!(&Recogniser::from_bytes(&bytes).expect("decoded"), recogniser);
}

#[test]
fn clips_that_do_not_fit_are_refused_and_strange_ones_unknown() {
    let (people, recogniser) = &*TRAINED;
    let mut cut_out = people[0].clone();
    cut_out.views[0].boxes = None;
    assert!(matches!(recogniser.recognise(&cut_out.views), Err(ModelError::Clip { found_boxes: false, .. })));
    assert!(matches!(recogniser.recognise(&[]), Err(ModelError::Clip { found: 0, .. })));
    let blank = vec![Mask::default((60, 60)); 20];
    let nothing = farnear_recognition::clip::Track::from_masks(&blank, Scaling::KeepAspect, true);
    assert_eq!(nothing.empty_frames, 20);
    assert_eq!(recogniser.recognise(&[nothing]).expect("an answer").activity, None);
    // A pulsating horizontal slab is not a person.
    let slabs: Vec<Mask> = (0..20)
        .map(|i| {
            Mask::from_shape_fn((200, 300), |(y, x)| (90..100 + 3 * i).contains(&y) && (20..280).contains(&x))
        })
        .collect();
    let slab = farnear_recognition::clip::Track::from_masks(&slabs, Scaling::KeepAspect, true);
    let answer = recogniser.recognise(&[slab]).expect("an answer");
    assert_eq!(answer.activity, None, "{answer:?}");
}

#[test]
fn live_answers_settle_on_what_is_done_and_windows_cover_a_recording() {
    let (people, recogniser) = &*TRAINED;
    let digging = performance(1, 9, 0, 8.0);
    let view = {
        let mut view = views_round(1, 0.0)[0];
        view.gamma_deg += 45.0;
        view
    };
    let mut live = Live::new(recogniser, 60, true);
    let reach: Vec<_> = digging.iter().flat_map(|body| extent(body, &view)).collect();
    let canvas = Canvas::fitting(&reach, 10.0, 2).expect("finite");
    let mut last = None;
    for body in &digging {
        let answer = live.push(&[draw(body, &view, &canvas)]).expect("one view");
        assert!((0.0..=1.0).contains(&answer.confidence));
        last = answer.activity;
    }
    assert_eq!(last.as_deref(), Some("dig"));
    assert!(live.push(&[]).is_err());
    let track = &people[0].views;
    let stretches = windows(recogniser, track, 16, 8).expect("windows");
    assert_eq!((stretches[0].from, stretches.last().map(|s| s.to)), (0, Some(track[0].frames())));
}

fn tampered(bytes: &[u8], places: &[(usize, u8)]) -> Vec<u8> {
    const HEADER: usize = 28;
    let mut bytes = bytes.to_vec();
    for &(at, value) in places {
        let at = HEADER + at % (bytes.len() - HEADER);
        bytes[at] = value;
    }
    let sum = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC).checksum(&bytes[HEADER..]);
    bytes[24..28].copy_from_slice(&sum.to_le_bytes());
    bytes
}

#[test]
fn crafted_models_with_good_checksums_are_refused_or_answer_but_never_panic() {
    let (people, recogniser) = &*TRAINED;
    let classes = recogniser.activities.len();
    let second = AuxiliaryModel {
        recogniser: Arc::new(recogniser.clone()),
        profiles: Array2::from_elem((classes, classes), (1.0 / classes as f32).sqrt()),
        limits: Limits::none(classes),
    };
    let judged = Recogniser { second: Some(second), ..recogniser.clone() };
    let files = [recogniser, &judged].map(|model| model.to_bytes().expect("encoded"));
    assert!(files.iter().all(|bytes| Recogniser::from_bytes(bytes).is_ok()));
    let mut runner = TestRunner::new(ProptestConfig {
        failure_persistence: None,
        ..ProptestConfig::with_cases(farnear_test_data::cases(60))
    });
    // Settings, names and lengths are at the front, where most damage is placed.
    let place = prop_oneof![3 => 0..200_usize, 1 => 0..files[1].len()];
    let damage = proptest::collection::vec((place, any::<u8>()), 1..6);
    runner
        .run(&damage, |places| {
            for bytes in &files {
                if let Ok(model) = Recogniser::from_bytes(&tampered(bytes, &places)) {
                    let _ = model.recognise(&people[0].views);
                }
            }
            Ok(())
        })
        .expect("no panic");
}

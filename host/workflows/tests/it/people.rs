//! Progress of people workflows, and no partial results after cancelling.

use std::{
    fs,
    path::{Path, PathBuf},
    sync::Mutex,
    time::Duration,
};

use farnear_workflows::{
    Cancel, Context, Progress, Result, Unattended, WorkflowError,
    activity::{
        evaluate::{EvaluateFigures, EvaluateRequest},
        method::MethodOptions,
        training::TrainRequest,
    },
    request::Request,
    silhouettes::{
        performances::Drawing,
        synthetic::{self, SyntheticRequest},
        video::{self, SilhouettesVideoRequest},
    },
};

/// Records progress, and may cancel at the first count of a unit.
#[derive(Default)]
struct Listener {
    cancel: Cancel,
    cancel_at: Option<&'static str>,
    heard: Mutex<Vec<String>>,
}

impl Listener {
    fn cancelling(unit: &'static str) -> Self {
        Self { cancel_at: Some(unit), ..Self::default() }
    }

    fn context(&self) -> Context<'_> {
        Context::new(self, &Unattended, self.cancel.clone())
    }

    fn note(&self, what: String) {
        self.heard.lock().expect("no listener panics").push(what);
    }

    fn heard(&self) -> Vec<String> {
        self.heard.lock().expect("no listener panics").clone()
    }
}

impl Progress for Listener {
    fn info(&self, what: &str) {
        self.note(what.into());
    }

    fn time_left(&self, left: Duration) {
        self.note(format!("left {:.3}", left.as_secs_f64()));
    }

    fn advance(&self, unit: &'static str, done: usize, total: Option<usize>) {
        self.note(format!("{done}/{total:?} {unit}"));
        if self.cancel_at == Some(unit) {
            self.cancel.cancel();
        }
    }
}

/// Three people at two activities, small.
fn people(out: PathBuf) -> SyntheticRequest {
    SyntheticRequest {
        subjects: 3,
        activities: vec!["walk".into(), "dig".into()],
        rate_hz: 4.0,
        drawing: Drawing { views: 1, mm_per_px: 40.0, out },
    }
}

fn training(samples: PathBuf, out: PathBuf) -> TrainRequest {
    TrainRequest { samples: Some(samples), out, ..TrainRequest::default() }
}

#[track_caller]
fn assert_cancelled<T: std::fmt::Debug>(result: Result<T>, folder: &Path) {
    let error = result.expect_err("it was cancelled");
    let cancelled = |error: &WorkflowError| matches!(error, WorkflowError::Cancelled { .. });
    let about = matches!(&error, WorkflowError::About { source, .. } if cancelled(source));
    assert!(about || cancelled(&error), "{error}");
    let left: Vec<_> =
        fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("an entry").path()).collect();
    assert!(left.is_empty(), "{left:?}");
}

#[test]
fn drawing_is_counted_and_leaves_nothing_where_it_is_cancelled() {
    let root = tempfile::tempdir().expect("a folder");
    let whole = Listener::default();
    let figures = synthetic::draw(&people(root.path().join("people")), &whole.context()).expect("drawn");
    assert_eq!((figures.performances, figures.subjects, figures.activities), (6, 3, 2));
    let heard = whole.heard();
    for done in 1..=6 {
        assert_eq!(heard[done - 1], format!("{done}/Some(6) performances"));
    }
    assert!(heard[6].starts_with("wrote "), "{heard:?}");

    let stopped = tempfile::tempdir().expect("a folder");
    let listener = Listener::cancelling("performances");
    let drawn = synthetic::draw(&people(stopped.path().join("people")), &listener.context());
    assert_cancelled(drawn, stopped.path());
    assert!(!listener.heard().iter().any(|what| what.starts_with("wrote")), "{:?}", listener.heard());
}

#[test]
fn training_and_evaluation_are_counted_and_stop_in_the_middle() {
    let root = tempfile::tempdir().expect("a folder");
    let people = people(root.path().join("people"));
    synthetic::draw(&people, &Context::unattended()).expect("drawn");
    let samples = people.drawing.out.join("samples.toml");

    let stopped = tempfile::tempdir().expect("a folder");
    let listener = Listener::cancelling("spaces tried");
    let settings = training(samples.clone(), stopped.path().join("model.fnm"));
    assert_cancelled(settings.run(&listener.context()), stopped.path());
    let heard = listener.heard();
    assert_eq!(heard.iter().filter(|what| what.ends_with("samples read")).count(), 6, "{heard:?}");
    assert_eq!(heard.last().map(String::as_str), Some("1/None spaces tried"), "{heard:?}");

    let evaluation = EvaluateRequest {
        samples,
        leave_one_subject_out: true,
        method: MethodOptions { no_search: true, ..MethodOptions::default() },
        out: Some(stopped.path().join("evaluation")),
        ..EvaluateRequest::default()
    };
    let listener = Listener::cancelling("samples read");
    assert_cancelled(evaluation.run(&listener.context()), stopped.path());
    let whole = Listener::default();
    let figures = evaluation.run(&whole.context()).expect("evaluated");
    let EvaluateFigures::Method(figures) = figures else { panic!("{figures:?}") };
    assert_eq!((figures.subjects, figures.clips, figures.answers), (3, 6, 6));
    assert!(whole.heard().contains(&"3/Some(3) folds".into()), "{:?}", whole.heard());

    // A search reports the remaining time from the first space to the end.
    let searched = EvaluateRequest { method: MethodOptions::default(), out: None, ..evaluation };
    let watched = Listener::default();
    searched.run(&watched.context()).expect("evaluated");
    let heard = watched.heard();
    let first = heard.iter().position(|what| what.starts_with("left ")).expect("time left");
    assert_eq!(heard[first + 1], "0/Some(3) folds", "{heard:?}");
    assert!(heard[first] != "left 0.000", "{heard:?}");
    let last = heard.iter().rposition(|what| what.starts_with("left ")).expect("time left");
    assert_eq!(heard[last..last + 2], ["left 0.000", "3/Some(3) folds"], "{heard:?}");
}

#[test]
fn a_video_is_not_begun_after_the_wish_to_stop() {
    let root = tempfile::tempdir().expect("a folder");
    let pictures = tempfile::tempdir().expect("a folder");
    fs::write(pictures.path().join("a.pgm"), b"P5 2 2 255\n\x00\x00\x00\x00").expect("a picture");
    let settings = SilhouettesVideoRequest {
        video: pictures.path().into(),
        out: root.path().join("masks"),
        learning_frames: 0,
        history_frames: 10,
        labels: Some(root.path().join("labels")),
        ..SilhouettesVideoRequest::default()
    };
    let listener = Listener::default();
    listener.cancel.cancel();
    assert_cancelled(video::extract(&settings, &listener.context()), root.path());
}

#[test]
fn parameters_that_cannot_be_are_refused_before_anything_is_done() {
    let root = tempfile::tempdir().expect("a folder");
    let settings = people(root.path().join("people"));
    let drawing = |views, mm_per_px| Drawing { views, mm_per_px, ..settings.drawing.clone() };
    for (wrong, expected) in [
        (SyntheticRequest { subjects: 0, ..settings.clone() }, "subjects 0: expected 1 to 1000"),
        (SyntheticRequest { rate_hz: 0.5, ..settings.clone() }, "frame rate 0.5: expected 1 to 240"),
        (SyntheticRequest { drawing: drawing(73, 10.0), ..settings.clone() }, "views 73: expected 1 to 72"),
        (SyntheticRequest { drawing: drawing(4, 0.0), ..settings.clone() }, "pixel size 0: expected 0.1"),
        (
            SyntheticRequest { activities: vec!["sing".into()], ..settings.clone() },
            "activity sing: expected walk",
        ),
    ] {
        let error = synthetic::draw(&wrong, &Context::unattended()).expect_err(expected);
        assert!(error.is_usage() && error.to_string().starts_with(expected), "{error}");
    }
    assert_eq!(fs::read_dir(root.path()).expect("a folder").count(), 0);
}

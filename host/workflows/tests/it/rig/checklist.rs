//! Checklist results: verdicts, details, and a user who follows the prompts.

use farnear_protocol::message::Alarm;
use farnear_scripted_board::{Faults, Peer, plug_in};
use farnear_workflows::{
    Cancel, Context, Progress, Questions, Result, WorkflowError,
    rig::{
        RigAddress,
        check::{self, CheckRequest, Checklist, Verdict},
    },
};

use super::{Face, camera};

/// A user at the scripted board.
struct Person {
    board: Peer,
    face: Face,
    /// Part of the question that is answered with no.
    denies: Option<&'static str>,
}

impl Progress for Person {
    fn info(&self, what: &str) {
        self.face.info(what);
        let mut board = self.board.board();
        let lens = what.contains("lens stage");
        if what.contains("release it") {
            (board.switches, board.lens_switches, board.emergency_stop) = ([false; 2], [false; 2], false);
        } else if what.contains("press the emergency stop") {
            board.emergency_stop = true;
            board.raise(Alarm::EmergencyStop);
        } else if what.contains("   press the") {
            let pressed = if what.contains("home") { [true, false] } else { [false, true] };
            *(if lens { &mut board.lens_switches } else { &mut board.switches }) = pressed;
        } else if what.contains("turn the motor") {
            let turned = if lens { &mut board.lens } else { &mut board.coarse };
            turned.0 += 60_000;
        }
    }
}

impl Questions for Person {
    fn ask(&self, question: &str, cancel: &Cancel) -> Result<String> {
        let answer = self.face.ask(question, cancel)?;
        Ok(if self.denies.is_some_and(|part| question.contains(part)) { "n\n".into() } else { answer })
    }
}

fn go_through(board: Peer, port: String, hands: bool, resting_only: bool) -> (Checklist, Person) {
    deny(None, board, port, (hands, resting_only))
}

fn deny(
    denies: Option<&'static str>,
    board: Peer,
    port: String,
    (hands, resting_only): (bool, bool),
) -> (Checklist, Person) {
    let images = tempfile::tempdir().unwrap();
    board.board().hello.firmware = env!("CARGO_PKG_VERSION").try_into().unwrap();
    let person = Person { board, face: Face::default(), denies };
    let context = Context::new(&person, &person, Cancel::default());
    let rig = RigAddress::Port(port);
    let settings = CheckRequest { rig, camera: camera(images.path()), resting_only, no_actuation: !hands };
    let list = check::check(&settings, &context).unwrap();
    (list, person)
}

fn verdict(list: &Checklist, step: &str) -> Verdict {
    list.steps.iter().find(|outcome| outcome.step == step).unwrap().verdict
}

#[test]
fn hands_press_turn_and_release_what_the_checklist_says() {
    let (port, board) = plug_in(Faults::default());
    board.board().hello.capabilities.memory = false;
    let (list, person) = go_through(board, port, true, true);
    assert_eq!((list.passed, list.failed, list.passed_over), (6, 0, 1), "{list:?}");
    assert_eq!(verdict(&list, "memory"), Verdict::PassedOver);
    assert_eq!(list.steps[4].detail, "4 switches open and close");
    assert_eq!(list.steps[6].detail, "2 encoders count up on the way away from home");
    assert!(list.check().is_ok());
    assert!(person.face.heard("\n5. end switches by hand"));
    assert!(person.face.heard("then press Enter: "), "the motors had to be disconnected");
    assert_eq!(person.board.board().acts, 0, "nothing moves while the motors rest");
}

#[test]
fn a_failure_ends_the_list_where_the_next_step_would_rest_on_it() {
    let (port, board) = plug_in(Faults::default());
    board.board().hello.capabilities.memory = false;
    // The scripted board ends each move immediately, so a halt is too late.
    let (list, _) = go_through(board, port, false, false);
    let last = list.steps.last().unwrap();
    assert_eq!((last.step, last.verdict), ("halt and its alarm", Verdict::Failed), "{list:?}");
    assert_eq!(list.failed, 1);
    // Each of the three halts latches an alarm; the last one stays.
    let Err(WorkflowError::StepsFailed { failed: 1, alarm: Some(3) }) = list.check() else {
        panic!("{list:?}")
    };
}

#[test]
fn a_latched_alarm_is_reported_and_ends_the_checklist() {
    let (port, board) = plug_in(Faults::default());
    board.board().raise(Alarm::SupplyLow);
    let (list, _) = go_through(board, port, true, false);
    assert_eq!(list.steps.len(), 3);
    assert!(list.steps[2].detail.starts_with("alarm 1 is latched"), "{list:?}");
    assert_eq!(list.alarm, Some(1));
}

#[test]
fn a_speed_that_could_not_be_restored_is_named() {
    let (port, board) = plug_in(Faults { reset_at_move: true, ..Faults::default() });
    board.board().hello.capabilities.memory = false;
    let (list, _) = go_through(board, port, false, false);
    let last = list.steps.last().unwrap();
    assert_eq!((last.step, last.verdict), ("first slow homing", Verdict::Failed), "{list:?}");
    assert!(last.detail.contains("farnear rig settings set coarse_speed_nm_per_s 1000"), "{list:?}");
}

#[test]
fn asks_about_the_piezo_before_anything_moves() {
    for (denies, second_mode, expected) in [
        (Some("amplifier on"), 1, "switch the gauge electronics on"),
        (Some("one resonance only"), 0, "farnear rig settings set piezo_second_mode 1"),
        (None, 0, "one resonance is selected"),
        (Some("one resonance only"), 1, "with a second mode is selected"),
    ] {
        let (port, board) = plug_in(Faults::default());
        board.board().hello.capabilities.memory = false;
        board.board().settings.insert("piezo_second_mode", second_mode);
        let (list, person) = deny(denies, board, port, (true, false));
        let ready = list.steps.iter().find(|outcome| outcome.step == "piezo ready").unwrap();
        assert!(ready.detail.contains(expected), "{list:?}");
        let acts = person.board.board().acts;
        assert_eq!(acts > 0, ready.verdict == Verdict::Passed, "{list:?}");
    }
}

#[test]
fn the_memory_step_restores_its_setting_after_an_error() {
    let (port, board) = plug_in(Faults { no_counters_after_reset: true, ..Faults::default() });
    let (list, person) = go_through(board, port, false, true);
    let last = list.steps.last().unwrap();
    assert_eq!((last.step, last.verdict), ("memory", Verdict::Failed), "{list:?}");
    assert_eq!(person.board.board().settings.get("camera_readout_us"), Some(&1_000), "{list:?}");
}

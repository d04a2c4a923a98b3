//! Each property on a run that breaks it, and on one that does not.

use farnear_protocol::{
    BoardMicros, Call, Event, EventKind, Micros, Nanometres, Request, Response,
    message::{
        Alarm, AlarmRecord, Axis, AxisStatus, DropReason, LinkCounters, PositionState, ProgramState,
        ProgramStatus, ResetCause, SettingKey, Status,
    },
};

use super::*;
use farnear_sim::{
    observer::Truth,
    plant::{ExposureTruth, StageName},
    wiring::{Burst, Shot},
};

const MS: u64 = 1_000_000;

fn asked(at_ms: u64, id: u32, request: Request) -> Sight {
    Sight { at_ns: at_ms * MS, seen: Seen::Asked { id, boot: 1, call: Call { session: 1, request } } }
}

fn told(at_ms: u64, number: u32, kind: EventKind, truth: Truth) -> Sight {
    let event = Event { time: BoardMicros(at_ms * 1000), kind }.into();
    Sight { at_ns: at_ms * MS, seen: Seen::Told { number, boot: 1, event, truth } }
}

fn answered(at_ms: u64, id: u32, response: Response) -> Sight {
    let answer = Box::new(Ok(response));
    Sight { at_ns: at_ms * MS, seen: Seen::Answered { id, boot: 1, answer, truth: Truth::default() } }
}

fn stepped(first_ms: u64, last_ms: u64) -> Sight {
    let (first_ns, last_ns) = (first_ms * MS, last_ms * MS);
    let burst = Burst { stage: StageName::Lens, first_ns, last_ns, steps: 9 };
    Sight { at_ns: last_ns, seen: Seen::Stepped(burst) }
}

fn go() -> Request {
    Request::Move { axis: Axis::Lens, target: Nanometres(5_000), silence: Micros(1_000_000) }
}

fn done(request: u32, measured_nm: i32) -> EventKind {
    EventKind::MoveDone {
        request,
        axis: Axis::Lens,
        asked: Nanometres(5_000),
        measured: Nanometres(measured_nm),
    }
}

fn at(lens_um: f64) -> Truth {
    Truth { lens_um, ..Truth::default() }
}

/// The properties that a run breaks.
fn broken(scenario: &str, sights: &[Sight]) -> Vec<&'static str> {
    let scenario = Scenario::parse(scenario).expect("a scenario");
    let parts = Parts::default();
    check(&Case { scenario: &scenario, parts: &parts, sights }).iter().map(|broken| broken.property).collect()
}

#[test]
fn a_good_run_breaks_nothing() {
    let sights = [
        asked(1, 7, go()),
        answered(2, 7, Response::Accepted),
        stepped(3, 9),
        told(10, 0, done(7, 5_000), at(5.5)),
        told(12, 0, done(7, 5_000), at(5.5)),
    ];
    assert_eq!(broken("", &sights), [""; 0]);
}

#[test]
fn steps_after_an_alarm_or_without_work_are_seen() {
    let record = AlarmRecord { number: 1, boot: 1, time: BoardMicros(5_000), alarm: Alarm::Halt };
    let alarm = told(6, 0, EventKind::Alarm(record), Truth::default());
    let begin = [asked(1, 7, go()), alarm];
    assert_eq!(broken("", &[&begin[..], &[stepped(2, 7)]].concat()), [""; 0]);
    assert_eq!(broken("", &[&begin[..], &[stepped(2, 9)]].concat()), ["step-after-alarm"]);
    let cleared = told(20, 1, EventKind::AlarmCleared { number: 1 }, Truth::default());
    assert_eq!(broken("", &[&begin[..], &[cleared, stepped(30, 40)]].concat()), [""; 0]);
    assert_eq!(broken("", &[stepped(2, 9)]), ["moves-unasked"]);
    let reset = Sight { at_ns: 5 * MS, seen: Seen::Reset };
    assert_eq!(broken("", &[asked(1, 7, go()), reset, stepped(6, 7)]), ["moves-unasked"]);
    // Seed 107727: a memory that died with the power, so that the next boot has the number of the one before and its clock begins anew.
    let reset = Sight { at_ns: 95 * MS, seen: Seen::Reset };
    let (Sight { seen, .. }, at_ns) = (begin[1].clone(), 106 * MS);
    let next_life = [asked(101, 7, go()), Sight { at_ns, seen }];
    let lives =
        [&[asked(1, 6, go()), told(3, 0, done(9, 5_000), at(5.0)), stepped(60, 70), reset], &next_life[..]];
    assert_eq!(broken("", &lives.concat()), [""; 0]);
    assert_eq!(broken("", &[&lives.concat()[..], &[stepped(102, 115)]].concat()), ["step-after-alarm"]);
}

#[test]
fn a_hard_stop_is_seen_and_a_dead_switch_excuses_one_stall() {
    let pressed = |count| told(9, 0, done(7, 0), Truth { pressed: [0, count], ..at(0.0) });
    assert_eq!(broken("", &[asked(1, 7, go()), pressed(1)]), ["hard-stop"]);
    let dead = "[[happens]]\nafter_ms = 0\nwhat = \"home-switch-dead\"\nstage = \"lens\"";
    assert_eq!(broken(dead, &[asked(1, 7, go()), pressed(100)]), [""; 0]);
    assert_eq!(broken(dead, &[asked(1, 7, go()), pressed(1_000)]), ["hard-stop"]);
}

#[test]
fn work_that_ends_twice_and_other_answers_are_seen() {
    let run = asked(1, 7, go());
    let twice = [run.clone(), told(9, 0, done(7, 0), at(0.0)), told(10, 1, done(7, 0), at(0.0))];
    assert_eq!(broken("", &twice), ["acts-twice"]);
    let counters = Response::Counters(farnear_protocol::message::Counters::default());
    assert_eq!(
        broken("", &[run, answered(2, 7, Response::Accepted), answered(3, 7, counters)]),
        ["acts-twice"]
    );
}

#[test]
fn a_position_beside_the_truth_is_seen() {
    assert_eq!(broken("", &[asked(1, 7, go()), told(9, 0, done(7, 5_000), at(19.0))]), ["position"]);
}

#[test]
fn a_piezo_beside_the_truth_is_seen_but_where_a_program_may_have_sent_it_on() {
    let said = |state: ProgramState, measured_nm: i32| {
        let mut status = status(3);
        (status.fine.state, status.fine.measured) = (PositionState::Homed, Nanometres(measured_nm));
        status.program.state = state;
        broken("", &[answered(3, 2, Response::Status(status))])
    };
    // It is at 0.
    assert_eq!(said(ProgramState::Idle, 50), [""; 0]);
    assert_eq!(said(ProgramState::Idle, 5_000), ["position"]);
    assert_eq!(said(ProgramState::Running, 5_000), [""; 0]);
}

fn setting(value: i32) -> Response {
    let key = SettingKey::CameraReadoutUs;
    Response::Setting(farnear_protocol::message::Setting {
        key,
        value,
        default: 10_500,
        min: 0,
        max: 1_000_000,
    })
}

#[test]
fn a_setting_that_is_another_one_is_seen() {
    let key = SettingKey::CameraReadoutUs;
    let written = [asked(1, 1, Request::WriteSetting { key, value: 3 }), answered(2, 1, setting(3))];
    let reset = |ms| Sight { at_ns: ms * MS, seen: Seen::Reset };
    let read = |value| [asked(500, 2, Request::ReadSetting { key }), answered(501, 2, setting(value))];
    let run = |ms, value| broken("", &[&written[..], &[reset(ms)], &read(value)].concat());
    assert_eq!((run(400, 3), run(400, 10_500)), (vec![], vec!["records"]));
    // Right behind the answer the old value may still be there, and nothing else.
    assert_eq!((run(3, 10_500), run(3, 4)), (vec![], vec!["records"]));
}

/// What a board says of itself at a moment at which nothing is homed, armed or wrong.
fn status(made_ms: u64) -> Status {
    let axis = AxisStatus {
        state: PositionState::Unknown,
        asked: Nanometres(0),
        measured: Nanometres(0),
        moving: false,
        request: None,
    };
    Status {
        time: BoardMicros(made_ms * 1000),
        coarse: axis,
        fine: axis,
        lens: axis,
        home_switch: false,
        far_switch: false,
        lens_home_switch: false,
        lens_far_switch: false,
        emergency_stop: false,
        supply_low: false,
        alarm: None,
        program: ProgramStatus { state: ProgramState::Idle, shots: 0, index: 0, exposures: 0 },
        next_event: 1,
        triggers: 0,
        steps: 0,
        link: LinkCounters::default(),
    }
}

/// An answer that was made at a moment, of a board without an alarm.
fn without_alarm(answered_ms: u64, made_ms: u64) -> Sight {
    answered(answered_ms, 2, Response::Status(status(made_ms)))
}

#[test]
fn an_alarm_that_is_gone_is_seen_and_an_answer_from_before_it_is_none() {
    let record = |number| AlarmRecord {
        number,
        boot: 1,
        time: BoardMicros(9_000),
        alarm: Alarm::DriverFault { axis: Axis::Lens },
    };
    let alarm = told(10, 0, EventKind::Alarm(record(1)), Truth::default());
    let cleared = told(11, 1, EventKind::AlarmCleared { number: 1 }, Truth::default());
    assert_eq!(broken("", &[alarm.clone(), without_alarm(12, 12)]), ["records"]);
    assert_eq!(broken("", &[alarm.clone(), without_alarm(12, 8)]), [""; 0]);
    assert_eq!(broken("", &[alarm, cleared, without_alarm(12, 12)]), [""; 0]);
}

#[test]
fn an_exposure_too_many_is_seen_and_one_that_takes_the_place_of_an_unseen_one_is_none() {
    let run = Request::RunContinuously { period: Micros(0), exposures: 1, silence: Micros(1_000_000) };
    let exposed = |ms: u64, id| {
        let (begin_ns, end_ns) = (ms * MS, (ms + 1) * MS);
        let truth = ExposureTruth {
            sensor_mm: 0.0,
            coarse_um: 0.0,
            lens_um: 0.0,
            piezo_um: 0.0,
            piezo_min_um: 0.0,
            piezo_max_um: 0.0,
        };
        Sight {
            at_ns: end_ns,
            seen: Seen::Exposed(Shot { id, board_us: ms * 1000, begin_ns, end_ns, truth }),
        }
    };
    let reason = DropReason::NoStrobe;
    let dropped =
        told(4, 0, EventKind::FrameDropped { request: 7, frame: 0, index: 0, reason }, Truth::default());
    assert_eq!(broken("", &[asked(1, 7, run.clone()), exposed(2, 0), exposed(5, 1)]), ["acts-twice"]);
    assert_eq!(broken("", &[asked(1, 7, run), exposed(2, 0), dropped, exposed(5, 1)]), [""; 0]);
}

#[test]
fn a_boot_that_comes_again_is_seen() {
    let started = |ms| told(ms, 0, EventKind::Started { cause: ResetCause::Pin }, Truth::default());
    let reset = Sight { at_ns: 5 * MS, seen: Seen::Reset };
    assert_eq!(broken("", &[started(1), started(2)]), [""; 0], "told again");
    assert_eq!(broken("", &[started(1), reset, started(9)]), ["records"]);
}

//! Each property on a run that violates it, and on one that does not.

use farnear_protocol::{
    BoardMicros, Call, Event, EventKind, Micros, Nanometres, Request, RequestError, Response,
    message::{
        Alarm, AlarmRecord, Axis, AxisStatus, DropReason, LinkCounters, PositionState, ProgramState,
        ProgramStatus, ResetCause, SettingKey, ShotRecord, Status, TriggerMode,
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

fn reported(at_ms: u64, number: u32, kind: EventKind, truth: Truth) -> Sight {
    let event = Event { time: BoardMicros(at_ms * 1000), kind }.into();
    Sight { at_ns: at_ms * MS, seen: Seen::Reported { number, boot: 1, event, truth } }
}

fn answered(at_ms: u64, id: u32, response: Response) -> Sight {
    let answer = Box::new(Ok(response));
    Sight { at_ns: at_ms * MS, seen: Seen::Answered { id, boot: 1, answer, truth: Truth::default() } }
}

fn refused(at_ms: u64, id: u32) -> Sight {
    let answer = Box::new(Err(RequestError::NotHomed { axis: Axis::Lens, state: PositionState::Unknown }));
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

fn broken(scenario: &str, sights: &[Sight]) -> Vec<&'static str> {
    let scenario = Scenario::parse(scenario).expect("a scenario");
    let parts = Parts::default();
    check(&Case { scenario: &scenario, parts: &parts, sights }).iter().map(|broken| broken.property).collect()
}

#[test]
fn a_good_run_violates_nothing() {
    let sights = [
        asked(1, 7, go()),
        answered(2, 7, Response::Accepted),
        stepped(3, 9),
        reported(10, 0, done(7, 5_000), at(5.5)),
        reported(12, 0, done(7, 5_000), at(5.5)),
    ];
    assert_eq!(broken("", &sights), [""; 0]);
}

#[test]
fn detects_steps_after_an_alarm_or_without_work() {
    let record = AlarmRecord { number: 1, boot: 1, time: BoardMicros(5_000), alarm: Alarm::Halt };
    let alarm = reported(6, 0, EventKind::Alarm(record), Truth::default());
    let begin = [asked(1, 7, go()), alarm];
    assert_eq!(broken("", &[&begin[..], &[stepped(2, 7)]].concat()), [""; 0]);
    assert_eq!(broken("", &[&begin[..], &[stepped(2, 9)]].concat()), ["step-after-alarm"]);
    let cleared = reported(20, 1, EventKind::AlarmCleared { number: 1 }, Truth::default());
    assert_eq!(broken("", &[&begin[..], &[cleared, stepped(30, 40)]].concat()), [""; 0]);
    assert_eq!(broken("", &[stepped(2, 9)]), ["moves-unasked"]);
    let reset = Sight { at_ns: 5 * MS, seen: Seen::Reset };
    assert_eq!(broken("", &[asked(1, 7, go()), reset, stepped(6, 7)]), ["moves-unasked"]);
    // Seed 107727: the memory died with the power, so the next boot has the same number and its clock
    // restarts.
    let reset = Sight { at_ns: 95 * MS, seen: Seen::Reset };
    let (Sight { seen, .. }, at_ns) = (begin[1].clone(), 106 * MS);
    let next_life = [asked(101, 7, go()), Sight { at_ns, seen }];
    let lives = [
        &[asked(1, 6, go()), reported(3, 0, done(9, 5_000), at(5.0)), stepped(60, 70), reset],
        &next_life[..],
    ];
    assert_eq!(broken("", &lives.concat()), [""; 0]);
    assert_eq!(broken("", &[&lives.concat()[..], &[stepped(102, 115)]].concat()), ["step-after-alarm"]);
}

#[test]
fn detects_a_hard_stop_and_permits_one_stall_with_a_dead_switch() {
    let pressed = |count| reported(9, 0, done(7, 0), Truth { pressed: [0, count], ..at(0.0) });
    assert_eq!(broken("", &[asked(1, 7, go()), pressed(1)]), ["hard-stop"]);
    let dead = "[[happens]]\nafter_ms = 0\nwhat = \"home-switch-dead\"\nstage = \"lens\"";
    assert_eq!(broken(dead, &[asked(1, 7, go()), pressed(100)]), [""; 0]);
    assert_eq!(broken(dead, &[asked(1, 7, go()), pressed(1_000)]), ["hard-stop"]);
}

#[test]
fn detects_a_step_of_the_piezo() {
    let stepped = |um| reported(9, 0, done(7, 0), Truth { piezo_step_um: um, ..at(0.0) });
    assert_eq!(broken("", &[asked(1, 7, go()), stepped(50.0)]), [""; 0]);
    assert_eq!(broken("", &[asked(1, 7, go()), stepped(61.0)]), ["piezo-step"]);
}

#[test]
fn detects_work_that_ends_twice_and_changed_answers() {
    let run = asked(1, 7, go());
    let twice = [run.clone(), reported(9, 0, done(7, 0), at(0.0)), reported(10, 1, done(7, 0), at(0.0))];
    assert_eq!(broken("", &twice), ["acts-twice"]);
    let counters = Response::Counters(farnear_protocol::message::Counters::default());
    assert_eq!(
        broken("", &[run, answered(2, 7, Response::Accepted), answered(3, 7, counters)]),
        ["acts-twice"]
    );
}

#[test]
fn detects_a_wrong_position() {
    assert_eq!(broken("", &[asked(1, 7, go()), reported(9, 0, done(7, 5_000), at(19.0))]), ["position"]);
}

#[test]
fn detects_an_axis_that_is_called_homed_without_a_homing() {
    let violations = |answer: Option<Sight>| {
        let mut status = status(3);
        status.lens.state = PositionState::Homed;
        let home = asked(1, 4, Request::Home { axis: Axis::Lens, silence: Micros(1_000_000) });
        let run: Vec<Sight> = [Some(home), answer, Some(answered(3, 5, Response::Status(status)))]
            .into_iter()
            .flatten()
            .collect();
        broken("", &run)
    };
    assert_eq!(violations(Some(answered(2, 4, Response::Accepted))), [""; 0]);
    let homed = EventKind::Homed { request: 4, axis: Axis::Lens, shift: Nanometres(0) };
    assert_eq!(violations(Some(reported(2, 0, homed, Truth::default()))), [""; 0]);
    assert_eq!(violations(Some(refused(2, 4))), ["position"]);
    assert_eq!(violations(None), ["position"]);
}

#[test]
fn detects_a_wrong_piezo_position_unless_a_program_moves_it() {
    let violations = |state: ProgramState, measured_nm: i32| {
        let mut status = status(3);
        (status.fine.state, status.fine.measured) = (PositionState::Homed, Nanometres(measured_nm));
        status.program.state = state;
        broken("", &[answered(3, 2, Response::Status(status))])
    };
    // It is at 0.
    assert_eq!(violations(ProgramState::Idle, 50), [""; 0]);
    assert_eq!(violations(ProgramState::Idle, 5_000), ["position"]);
    assert_eq!(violations(ProgramState::Running, 5_000), [""; 0]);
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
fn detects_a_changed_setting() {
    let key = SettingKey::CameraReadoutUs;
    let written = [asked(1, 1, Request::WriteSetting { key, value: 3 }), answered(2, 1, setting(3))];
    let reset = |ms| Sight { at_ns: ms * MS, seen: Seen::Reset };
    let read = |value| [asked(500, 2, Request::ReadSetting { key }), answered(501, 2, setting(value))];
    let run = |ms, value| broken("", &[&written[..], &[reset(ms)], &read(value)].concat());
    assert_eq!((run(400, 3), run(400, 10_500)), (vec![], vec!["records"]));
    // Shortly after the answer the old value may still be stored, and nothing else.
    assert_eq!((run(3, 10_500), run(3, 4)), (vec![], vec!["records"]));
}

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

/// An answer created at `made_ms` by a board without an alarm.
fn without_alarm(answered_ms: u64, made_ms: u64) -> Sight {
    answered(answered_ms, 2, Response::Status(status(made_ms)))
}

#[test]
fn detects_a_lost_alarm_and_ignores_an_earlier_answer() {
    let record = |number| AlarmRecord {
        number,
        boot: 1,
        time: BoardMicros(9_000),
        alarm: Alarm::DriverFault { axis: Axis::Lens },
    };
    let alarm = reported(10, 0, EventKind::Alarm(record(1)), Truth::default());
    let cleared = reported(11, 1, EventKind::AlarmCleared { number: 1 }, Truth::default());
    assert_eq!(broken("", &[alarm.clone(), without_alarm(12, 12)]), ["records"]);
    assert_eq!(broken("", &[alarm.clone(), without_alarm(12, 8)]), [""; 0]);
    assert_eq!(broken("", &[alarm, cleared, without_alarm(12, 12)]), [""; 0]);
}

/// An exposure of a millisecond.
fn exposed(ms: u64, id: u32) -> Sight {
    let (begin_ns, end_ns) = (ms * MS, (ms + 1) * MS);
    let truth = ExposureTruth {
        sensor_mm: 0.0,
        coarse_um: 0.0,
        lens_um: 0.0,
        piezo_um: 0.0,
        piezo_min_um: 0.0,
        piezo_max_um: 0.0,
    };
    let shot = Shot { id, board_us: ms * 1000, begin_ns, end_ns, truth, light: [0.0; 2] };
    Sight { at_ns: end_ns, seen: Seen::Exposed(shot) }
}

fn accepted(at_ms: u64, id: u32, request: Request) -> [Sight; 2] {
    [asked(at_ms, id, request), answered(at_ms, id, Response::Accepted)]
}

#[test]
fn counts_only_the_exposures_of_the_program_armed_last_in_this_boot() {
    let arm = |id, shots| accepted(1, id, Request::ArmProgram { shots });
    let run = |at_ms| accepted(at_ms, 9, Request::RunProgram { silence: Micros(1_000_000) });
    let armed = [arm(1, 2), arm(2, 1), run(1)].concat();
    assert_eq!(broken("", &[&armed[..], &[exposed(2, 0)]].concat()), [""; 0]);
    assert_eq!(broken("", &[&armed[..], &[exposed(2, 0), exposed(5, 1)]].concat()), ["acts-twice"]);
    let reset = Sight { at_ns: 2 * MS, seen: Seen::Reset };
    let after_reset = [&arm(1, 1)[..], &[reset], &run(3), &[exposed(4, 0)]].concat();
    assert_eq!(broken("", &after_reset), ["acts-twice"]);
}

#[test]
fn detects_wrong_stamps_and_a_wrong_exposure_in_a_record() {
    let shot = farnear_protocol::message::Shot {
        axis: Axis::SensorFine,
        target: Nanometres(0),
        exposure: Micros(1_000),
        settle_window: Nanometres(100),
        settle_dwell: Micros(2_000),
        repeat: 1,
        mode: TriggerMode::Hardware,
    };
    let run = [
        accepted(1, 1, Request::LoadShot { index: 0, shot }),
        accepted(1, 2, Request::ArmProgram { shots: 1 }),
        accepted(1, 3, Request::RunProgram { silence: Micros(1_000_000) }),
    ]
    .concat();
    let violations = |scenario: &str, [start_us, end_us]: [u64; 2], exposure_us: u32| {
        let record = ShotRecord {
            index: 0,
            repeat: 0,
            trigger_number: 0,
            axis: Axis::SensorFine,
            asked: Nanometres(0),
            coarse: Nanometres(0),
            fine: Nanometres(0),
            lens: Nanometres(0),
            settle: Micros(0),
            trigger: BoardMicros(1_980),
            strobe_start: BoardMicros(start_us),
            strobe_end: BoardMicros(end_us),
            exposure: Micros(exposure_us),
        };
        let shot_done = EventKind::ShotDone { request: 3, shot: record };
        let end = [exposed(2, 0), reported(4, 0, shot_done, Truth::default())];
        broken(scenario, &[&run[..], &end].concat())
    };
    assert_eq!(violations("", [2_001, 2_999], 1_000), [""; 0]);
    assert_eq!(violations("", [2_005, 3_000], 1_000), ["exposure"]);
    assert_eq!(violations("", [2_000, 3_005], 1_000), ["exposure"]);
    assert_eq!(violations("", [2_000, 3_000], 5_000), ["exposure"]);
    // The wire was cut during the exposure.
    let cut = "[[happens]]\nafter_ms = 2.95\nwhat = \"strobe-dead\"";
    assert_eq!(violations(cut, [2_000, 2_950], 1_000), [""; 0]);
}

#[test]
fn detects_an_extra_exposure_and_permits_a_repeated_one() {
    let run = Request::RunContinuously { period: Micros(0), exposures: 1, silence: Micros(1_000_000) };
    let reason = DropReason::NoStrobe;
    let dropped =
        reported(4, 0, EventKind::FrameDropped { request: 7, frame: 0, index: 0, reason }, Truth::default());
    let accepted = [asked(1, 7, run.clone()), answered(1, 7, Response::Accepted), exposed(2, 0)];
    assert_eq!(broken("", &accepted), [""; 0]);
    assert_eq!(broken("", &[&accepted[..], &[exposed(5, 1)]].concat()), ["acts-twice"]);
    assert_eq!(broken("", &[&accepted[..], &[dropped, exposed(5, 1)]].concat()), [""; 0]);
    // A refused run, and one that the board did not receive, allow no exposure.
    assert_eq!(broken("", &[asked(1, 7, run.clone()), refused(1, 7), exposed(2, 0)]), ["acts-twice"]);
    assert_eq!(broken("", &[asked(1, 7, run), exposed(2, 0)]), ["acts-twice"]);
}

#[test]
fn detects_a_repeated_boot_number() {
    let started = |ms| reported(ms, 0, EventKind::Started { cause: ResetCause::Pin }, Truth::default());
    let reset = Sight { at_ns: 5 * MS, seen: Seen::Reset };
    assert_eq!(broken("", &[started(1), started(2)]), [""; 0], "reported again");
    assert_eq!(broken("", &[started(1), reset, started(9)]), ["records"]);
}

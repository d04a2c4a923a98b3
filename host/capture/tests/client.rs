//! What the client makes of a bad line and a board in trouble.
#![allow(clippy::unwrap_used)] // a test that panics has failed, which is what it is for

mod peer;

use std::{
    sync::{Arc, atomic::AtomicBool},
    time::{Duration, Instant},
};

use farnear_capture::{Client, ClientError, LogPart, News, Step, Timing};
use farnear_protocol::{
    RequestError, Response,
    message::{Alarm, Axis, EventKind, Failure, ResetCause, SettingKey, Shot, Status, TriggerMode},
    units::{Micros, Nanometres},
};
use peer::{Faults, Peer};
use proptest::prelude::*;

/// Short waits: the peer answers at once or never.
const SHORT: Timing = Timing {
    reply: Duration::from_millis(4),
    retries: 3,
    poll: Duration::from_millis(10),
    work_factor: 0,
    work_slack: Duration::from_millis(80),
    silence: Duration::from_secs(2),
};

const SHOT: Shot = Shot {
    axis: Axis::SensorFine,
    target: Nanometres(10_000),
    exposure: Micros(1_000),
    settle_window: Nanometres(50),
    settle_dwell: Micros(1_000),
    repeat: 1,
    mode: TriggerMode::Hardware,
};

fn connect(faults: Faults) -> (Client, Peer) {
    let peer = Peer::new(faults);
    let client = Client::connect(Box::new(peer.clone()), "scripted").unwrap();
    client.set_timing(SHORT);
    (client, peer)
}

fn connect_error(faults: Faults, change: impl FnOnce(&mut peer::Board)) -> ClientError {
    let peer = Peer::new(faults);
    change(&mut peer.board());
    Client::connect(Box::new(peer), "scripted").err().unwrap()
}

#[test]
fn hello_gives_the_board_and_its_boot() {
    let (client, _) = connect(Faults::default());
    assert_eq!(client.hello().boot, 7);
    assert_eq!(client.hello().board.as_str(), "scripted");
    assert_eq!(client.protocol(), 2);
}

#[test]
fn homing_and_moving_end_with_their_events() {
    let (client, peer) = connect(Faults::default());
    client.home(Axis::SensorCoarse).unwrap();
    let moved = client.move_to(Axis::SensorCoarse, Nanometres(5_000_000)).unwrap();
    assert_eq!((moved.asked.0, moved.measured.0), (5_000_000, 5_000_375));
    assert_eq!(peer.board().acts, 2);
}

#[test]
fn lost_requests_and_lost_answers_are_asked_again_and_act_once() {
    let (client, peer) = connect(Faults::default());
    peer.board().faults.lose_requests = 2;
    client.home(Axis::SensorCoarse).unwrap();
    peer.board().faults.lose_answers = 3;
    client.home(Axis::SensorCoarse).unwrap();
    assert_eq!(peer.board().acts, 2);
}

#[test]
fn a_board_that_falls_silent_is_an_error_after_three_retries() {
    let (client, peer) = connect(Faults::default());
    peer.board().faults.lose_requests = 100;
    let error = client.status().err().unwrap();
    assert!(matches!(error, ClientError::Silent { attempts: 4, bytes: 0, .. }), "{error:?}");
    assert_eq!(peer.board().faults.lose_requests, 96);
}

#[test]
fn answers_that_come_twice_do_not_answer_the_next_request() {
    let (client, _) = connect(Faults { duplicate_answers: true, ..Faults::default() });
    client.home(Axis::SensorCoarse).unwrap();
    for target in [1_000, 2_000, 3_000] {
        client.move_to(Axis::SensorFine, Nanometres(target)).unwrap();
        let Status { fine, .. } = client.status().unwrap();
        assert_eq!(fine.measured.0, target - 2);
    }
}

#[test]
fn what_an_earlier_program_left_on_the_line_is_not_believed() {
    let peer = Peer::new(Faults::default());
    // The hello and status of this session will have the ids 1 and 2; so had those of the last one.
    let mut stale = peer.board().hello.clone();
    stale.boot = 3;
    peer.board().put_stale(1, &Response::Hello(stale));
    peer.board().put_stale(2, &Response::Accepted);
    let client = Client::connect(Box::new(peer), "scripted").unwrap();
    assert_eq!(client.hello().boot, 7);
}

#[test]
fn lost_events_are_read_again() {
    // Event 0 is the start, 1 homed, 2 the move, 3 and 4 the shots, 5 the end of the program.
    for lost in [vec![1], vec![3], vec![5], vec![1, 2, 3, 4, 5]] {
        let (client, peer) = connect(Faults { lose_events: lost.clone(), ..Faults::default() });
        client.home(Axis::SensorCoarse).unwrap();
        client.move_to(Axis::SensorCoarse, Nanometres(1_000)).unwrap();
        let shot = Shot { repeat: 2, ..SHOT };
        let mut seen = Vec::new();
        let exposures = client
            .run_shots(&[shot], |record| {
                seen.push(record.repeat);
                Ok::<(), ClientError>(())
            })
            .unwrap();
        assert_eq!((exposures, seen), (2, vec![0, 1]), "lost {lost:?}");
        assert_eq!(peer.board().acts, 3);
    }
}

#[test]
fn events_that_the_board_forgot_are_an_error() {
    let (client, _) = connect(Faults { lose_events: vec![1], forgetful: true, ..Faults::default() });
    let error = client.home(Axis::SensorCoarse).err().unwrap();
    assert!(matches!(error, ClientError::EventsLost { from: 1, to: 1, .. }), "{error:?}");
}

#[test]
fn work_whose_end_is_never_told_is_an_error() {
    let (client, _) = connect(Faults { end_unsaid: true, ..Faults::default() });
    let error = client.home(Axis::SensorCoarse).err().unwrap();
    assert!(matches!(error, ClientError::NoEnd { .. }), "{error:?}");
}

#[test]
fn work_that_does_not_end_is_stopped_at_its_deadline() {
    let (client, peer) = connect(Faults { never_ends: true, ..Faults::default() });
    let error = client.home(Axis::SensorCoarse).err().unwrap();
    assert!(matches!(error, ClientError::Overdue { .. }), "{error:?}");
    assert_eq!(peer.board().stops, 1);
}

#[test]
fn an_interruption_stops_the_rig() {
    let (mut client, peer) = connect(Faults { never_ends: true, ..Faults::default() });
    let flag = Arc::new(AtomicBool::new(false));
    client.interrupt_by(flag.clone());
    client.set_timing(Timing { work_slack: Duration::from_secs(60), ..SHORT });
    let interrupter = std::thread::spawn(move || {
        std::thread::sleep(Duration::from_millis(20));
        flag.store(true, std::sync::atomic::Ordering::Relaxed);
    });
    let error = client.home(Axis::SensorCoarse).err().unwrap();
    interrupter.join().unwrap();
    assert!(matches!(error, ClientError::Interrupted { .. }), "{error:?}");
    assert_eq!(peer.board().stops, 1);
}

#[test]
fn an_error_in_mid_program_stops_the_rig() {
    let (client, peer) = connect(Faults::default());
    let shot = SHOT;
    let no_image = || ClientError::NoEnd { during: "waiting for the image".into() };
    let error = client.run_shots(&[shot], |_| Err(no_image())).err().unwrap();
    assert!(error.to_string().contains("waiting for the image"), "{error}");
    assert_eq!(peer.board().stops, 1);
}

#[test]
fn a_board_that_asks_is_answered_as_long_as_somebody_holds_the_work() {
    let (client, peer) = connect(Faults { asks_first: 3, ..Faults::default() });
    client.home(Axis::SensorCoarse).unwrap();
    assert_eq!(peer.board().still_there, 3);
    assert_eq!(peer.board().silences, [Micros(2_000_000)]);
    // Held, but not waited for: the thread that owns the port answers.
    let work = client.start_home(Axis::Lens).unwrap();
    let until = Instant::now() + Duration::from_secs(20);
    while peer.board().still_there < 6 && Instant::now() < until {
        std::thread::sleep(Duration::from_millis(1));
    }
    assert_eq!(peer.board().still_there, 6);
    work.homed().unwrap();
    // Nobody holds it: the rig is stopped.
    peer.board().faults = Faults { never_ends: true, ..Faults::default() };
    let stops = peer.board().stops;
    drop(client.start_home(Axis::Lens).unwrap());
    assert_eq!(peer.board().stops, stops + 1);
}

#[test]
fn two_axes_move_at_the_same_time() {
    let (client, peer) = connect(Faults::default());
    for axis in [Axis::SensorCoarse, Axis::Lens] {
        client.home(axis).unwrap();
    }
    let coarse = client.start_move(Axis::SensorCoarse, Nanometres(2_000_000)).unwrap();
    let lens = client.start_move(Axis::Lens, Nanometres(3_000_000)).unwrap();
    assert_eq!(lens.moved().unwrap().measured, Nanometres(3_000_125));
    assert_eq!(coarse.moved().unwrap().measured, Nanometres(2_000_375));
    assert_eq!(peer.board().acts, 4);
}

#[test]
fn handles_are_used_from_many_threads_and_the_port_is_closed_with_the_last() {
    let (client, peer) = connect(Faults::default());
    std::thread::scope(|scope| {
        for thread in 0..4 {
            let client = client.clone();
            scope.spawn(move || {
                for step in 0..20 {
                    client.move_to(Axis::SensorFine, Nanometres(1_000 * thread + step)).unwrap();
                }
            });
        }
    });
    assert_eq!(peer.board().acts, 80);
    let stream = client.events().unwrap();
    client.move_to(Axis::SensorFine, Nanometres(5)).unwrap();
    drop(client);
    // The last handle has gone: the stream ends behind what was still in it.
    let News::Event { event, .. } = stream.into_iter().last().unwrap() else { panic!("an event") };
    assert!(matches!(event.kind, EventKind::MoveDone { asked: Nanometres(5), .. }), "{event:?}");
}

#[test]
fn events_stream_without_gaps_through_a_reset() {
    let (mut client, peer) = connect(Faults { lose_events: vec![2], ..Faults::default() });
    let stream = client.events().unwrap();
    client.home(Axis::SensorCoarse).unwrap();
    client.move_to(Axis::SensorFine, Nanometres(1)).unwrap();
    client.move_to(Axis::SensorFine, Nanometres(2)).unwrap();
    peer.board().reset(ResetCause::BrownOut);
    let wait = Duration::from_secs(20);
    let next = || stream.next_within(wait).unwrap().unwrap();
    for expected in 1..=3 {
        assert!(matches!(next(), News::Event { number, .. } if number == expected));
    }
    let News::Broken(error) = next() else { panic!("the reset is told") };
    assert!(matches!(error, ClientError::Reset { cause: Some(ResetCause::BrownOut), .. }), "{error:?}");
    let News::Joined(hello) = next() else { panic!("the board is back") };
    assert_eq!(hello.boot, 8);
    // The handle has to say that it has understood.
    let error = client.status().err().unwrap();
    assert!(matches!(error, ClientError::Reset { was: 7, now: 8, .. }), "{error:?}");
    client.reopen().unwrap();
    client.home(Axis::SensorCoarse).unwrap();
    assert!(matches!(next(), News::Event { number: 1, .. }));
}

#[test]
fn a_board_that_was_unplugged_is_found_again() {
    let peer = Peer::new(Faults { never_ends: true, ..Faults::default() });
    let mut client = Client::connect_by(peer.connect(), "scripted").unwrap();
    client.set_timing(SHORT);
    let work = client.start_home(Axis::SensorCoarse).unwrap();
    peer.board().gone = true;
    let error = work.homed().err().unwrap();
    assert!(matches!(error, ClientError::Gone { .. }), "{error:?}");
    assert!(error.to_string().contains("went away while homing the sensor's coarse axis"), "{error}");
    assert!(matches!(client.status(), Err(ClientError::Gone { .. })));
    let absent = client.reopen().err().unwrap();
    assert!(matches!(absent, ClientError::Port(_)), "{absent:?}");
    peer.board().gone = false;
    client.reopen_within(Duration::from_secs(20)).unwrap();
    assert_eq!(client.hello().boot, 7, "the board went on");
    client.stop().unwrap();
}

#[test]
fn an_alarm_stops_work_refuses_more_and_is_cleared_by_its_number() {
    let faults = Faults { alarm_at_work: Some(Alarm::HostSilence { request: 2 }), ..Faults::default() };
    let (client, peer) = connect(faults);
    let error = client.home(Axis::SensorCoarse).err().unwrap();
    let ClientError::Failed { alarm: Some(alarm), .. } = &error else { panic!("{error:?}") };
    assert_eq!(alarm.number, 1);
    assert!(error.to_string().contains("was the cable pulled"), "{error}");
    assert!(error.to_string().contains("farnear rig alarms --clear 1"), "{error}");
    peer.board().faults = Faults::default();
    let error = client.home(Axis::SensorCoarse).err().unwrap();
    assert!(error.to_string().contains("alarm 1 is latched"), "{error}");
    let error = client.clear_alarm(7).err().unwrap();
    assert!(error.to_string().contains("the latched alarm is number 1"), "{error}");
    client.clear_alarm(1).unwrap();
    client.home(Axis::SensorCoarse).unwrap();
    client.halt().unwrap();
    let kept: Vec<_> = client.alarms().unwrap().iter().map(|record| record.number).collect();
    assert_eq!((kept, client.status().unwrap().alarm.unwrap().alarm), (vec![2, 1], Alarm::Halt));
}

#[test]
fn settings_are_read_and_changed_within_their_range() {
    let (client, _) = connect(Faults::default());
    let key = SettingKey::CoarseBacklashNm;
    assert_eq!(client.set_setting(key, 4_000).unwrap().value, 4_000);
    assert_eq!(client.setting(key).unwrap().value, 4_000);
    let error = client.set_setting(key, -1).err().unwrap();
    assert!(error.to_string().contains("coarse_backlash_nm must lie between 0 and 20000000"), "{error}");
    assert_eq!(client.counters().unwrap().boots, 7);
}

#[test]
fn a_program_is_armed_once_run_twice_and_told_of_shots_that_the_host_triggers() {
    let (client, peer) = connect(Faults::default());
    let error = client.start_program(&[]).err().unwrap();
    assert!(matches!(error, ClientError::NotArmed), "{error:?}");
    let shot = Shot { repeat: 2, mode: TriggerMode::Software, ..SHOT };
    let error = client.arm(&[shot; 17]).err().unwrap();
    assert!(error.to_string().contains("a program of 17 shots, the board can hold 16"), "{error}");
    client.arm(&[shot]).unwrap();
    for run in 0..2 {
        let mut work = client.start_program(&[shot]).unwrap();
        let mut said = Vec::new();
        let end = loop {
            match work.step().unwrap() {
                Step::Done(kind) => break kind,
                Step::Event(kind) => said.push(matches!(kind, EventKind::ShotReady { .. })),
            }
        };
        assert!(matches!(end, EventKind::ProgramDone { exposures: 2, .. }), "{end:?}");
        assert_eq!(said, [true, false, true, false], "run {run}");
    }
    assert_eq!(peer.board().triggers, 4);
}

#[test]
fn the_log_comes_in_pieces_that_tell_what_is_missing() {
    let (client, peer) = connect(Faults::default());
    let stream = client.logs().unwrap();
    client.status().unwrap(); // the stream is open
    peer.board().log(&[1, 2]);
    peer.board().lose_log();
    peer.board().log(&[3]);
    let wait = Duration::from_secs(20);
    let next = || stream.next_within(wait).unwrap().unwrap();
    assert_eq!(next(), LogPart { number: 0, missing: 0, bytes: vec![1, 2] });
    assert_eq!(next(), LogPart { number: 2, missing: 1, bytes: vec![3] });
}

#[test]
fn refusals_and_failures_say_what_to_do() {
    let (client, peer) = connect(Faults::default());
    let error = client.move_to(Axis::SensorCoarse, Nanometres(5)).err().unwrap();
    assert!(error.to_string().contains("home it first"), "{error}");
    client.home(Axis::SensorCoarse).unwrap();
    let error = client.move_to(Axis::SensorCoarse, Nanometres(14_000_000)).err().unwrap();
    assert!(
        matches!(error, ClientError::Refused { error: RequestError::OutOfRange { .. }, .. }),
        "{error:?}"
    );
    assert!(error.to_string().contains("14000.000 um is outside the limits"), "{error}");
    peer.board().faults.fails_with = Some(Failure::Following { error: Nanometres(12_500) });
    let error = client.move_to(Axis::SensorCoarse, Nanometres(5)).err().unwrap();
    assert!(error.to_string().contains("12.500 um (stall or slip)"), "{error}");
}

#[test]
fn a_reset_in_mid_move_is_seen_whether_it_announces_itself_or_not() {
    for silent_reset in [false, true] {
        let (mut client, peer) = connect(Faults { silent_reset, ..Faults::default() });
        client.home(Axis::SensorCoarse).unwrap();
        peer.board().faults.reset_at_move = true;
        let error = client.move_to(Axis::SensorCoarse, Nanometres(5_000)).err().unwrap();
        let ClientError::Reset { was: 7, now: 8, cause, .. } = &error else { panic!("{error:?}") };
        assert_eq!(*cause, if silent_reset { None } else { Some(ResetCause::Watchdog) });
        assert!(error.to_string().contains("boot 7 became 8"), "{error}");
        client.reopen().unwrap();
        assert_eq!(client.hello().boot, 8);
        client.home(Axis::SensorCoarse).unwrap();
    }
}

#[test]
fn a_reboot_happens_once_though_its_answer_is_lost() {
    let (mut client, peer) = connect(Faults::default());
    peer.board().faults.lose_answers = 1;
    client.reboot().unwrap();
    assert_eq!(client.hello().boot, 8);
}

#[test]
fn a_board_of_another_protocol_is_refused_with_both_versions() {
    let error = connect_error(Faults { other_version: Some(3), ..Faults::default() }, |_| {});
    assert!(matches!(error, ClientError::Version { board_min: 3, host_current: 2, .. }), "{error:?}");
    assert!(
        error.to_string().contains("protocol 3 to 3, this program 2 to 2; use a newer farnear"),
        "{error}"
    );

    let error = connect_error(Faults::default(), |board| {
        board.hello.protocol_min = 3;
        board.hello.protocol_current = 5;
    });
    assert!(matches!(error, ClientError::Version { board_min: 3, board_current: 5, .. }), "{error:?}");
}

#[test]
fn a_newer_board_that_still_speaks_our_version_is_welcome_whatever_its_key() {
    let peer = Peer::new(Faults::default());
    peer.board().hello.protocol_current = 9;
    peer.board().hello.schema_key ^= 1;
    let client = Client::connect(Box::new(peer), "scripted").unwrap();
    assert_eq!(client.protocol(), 2);
}

#[test]
fn another_message_table_under_the_same_number_is_refused_with_both_keys() {
    let error = connect_error(Faults::default(), |board| board.hello.schema_key ^= 0xff);
    let ClientError::Schema { board_key, host_key, .. } = error else { panic!("{error:?}") };
    assert_eq!(board_key, host_key ^ 0xff);
    assert!(error.to_string().contains(&format!("{board_key:016x}")), "{error}");
}

#[test]
fn a_line_that_breaks_in_mid_program_is_named() {
    let (client, _) = connect(Faults { gone_at_program: true, ..Faults::default() });
    let shot = SHOT;
    let error = client.run_shots(&[shot], |_| Ok::<(), ClientError>(())).err().unwrap();
    assert!(matches!(error, ClientError::Gone { .. }), "{error:?}");
    assert!(error.to_string().starts_with("port scripted went away while running the exposure"), "{error}");
}

#[test]
fn a_line_with_noise_and_no_board_is_told_from_a_dead_one() {
    struct Noise;
    impl farnear_capture::Transport for Noise {
        fn receive(&mut self, buffer: &mut [u8], wait: Duration) -> std::io::Result<usize> {
            std::thread::sleep(wait.min(Duration::from_millis(20)));
            buffer[..5].copy_from_slice(b"ab\0cd");
            Ok(5)
        }
        fn send(&mut self, _: &[u8], _: Duration) -> std::io::Result<()> {
            Ok(())
        }
        fn discard_input(&mut self) -> std::io::Result<()> {
            Ok(())
        }
    }
    let error = Client::connect(Box::new(Noise), "scripted").err().unwrap();
    assert!(matches!(error, ClientError::Silent { bad_frames: 1.., .. }), "{error:?}");
    assert!(error.to_string().contains("broken frames came: is it the right port"), "{error}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    /// Garbage that ends with a delimiter costs nothing; without one it costs the frame after it, whose
    /// request is asked again behind a flushing delimiter.
    #[test]
    fn garbage_on_the_line_is_survived(garbage in proptest::collection::vec(any::<u8>(), 0..600)) {
        let mut delimited = garbage;
        delimited.push(0);
        let (client, peer) = connect(Faults { garbage: delimited, ..Faults::default() });
        client.home(Axis::SensorCoarse).unwrap();
        for step in 0..5 {
            client.move_to(Axis::SensorFine, Nanometres(step)).unwrap();
        }
        prop_assert_eq!(peer.board().acts, 6);
    }
}

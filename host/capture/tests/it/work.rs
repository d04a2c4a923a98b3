//! Long work: end, deadline, interruption, lost events.

use std::{
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    time::{Duration, Instant},
};

use farnear_capture::{ClientError, Step, Timing};
use farnear_protocol::{
    Request, RequestError,
    message::{Axis, EventKind, Shot, TriggerMode},
    units::{Micros, Nanometres},
};
use farnear_scripted_board::{Faults, Peer};

use crate::scripted::{OVERDUE_SOON, SHOT, connect, connect_with_gaps, run_shots};

#[test]
fn homing_and_moving_end_with_their_events() {
    let (client, peer) = connect(Faults::default());
    client.home(Axis::SensorCoarse).unwrap();
    let moved = client.move_to(Axis::SensorCoarse, Nanometres(5_000_000)).unwrap();
    assert_eq!((moved.asked.0, moved.measured.0), (5_000_000, 5_000_375));
    assert_eq!(peer.board().acts, 2);
}

#[test]
fn rereads_lost_events() {
    // Event 0 is the start, 1 homed, 2 the move, 3 and 4 the shots, 5 the end of the program.
    for lost in [vec![1], vec![3], vec![5], vec![1, 2, 3, 4, 5]] {
        let (client, peer) = connect(Faults { lose_events: lost.clone(), ..Faults::default() });
        client.home(Axis::SensorCoarse).unwrap();
        client.move_to(Axis::SensorCoarse, Nanometres(1_000)).unwrap();
        let shot = Shot { repeat: 2, ..SHOT };
        let mut seen = Vec::new();
        let exposures = run_shots(&client, &[shot], |record| {
            seen.push(record.repeat);
            Ok::<(), ClientError>(())
        })
        .unwrap();
        assert_eq!((exposures, seen), (2, vec![0, 1]), "lost {lost:?}");
        assert_eq!(peer.board().acts, 3);
    }
}

#[test]
fn a_lost_event_is_reread_after_a_gap_of_the_line() {
    let peer = Peer::new(Faults { lose_events: vec![1], ..Faults::default() });
    let (client, left) = connect_with_gaps(&peer, |request| matches!(request, Request::ReadEvent { .. }));
    left.store(4, Ordering::SeqCst); // a request with its repeats
    client.home(Axis::SensorCoarse).unwrap();
    assert_eq!(left.load(Ordering::SeqCst), 0);
}

#[test]
fn events_that_the_board_forgot_are_an_error() {
    let (client, _) = connect(Faults { lose_events: vec![1], forgetful: true, ..Faults::default() });
    let error = client.home(Axis::SensorCoarse).err().unwrap();
    assert!(matches!(error, ClientError::EventsLost { from: 1, to: 1, .. }), "{error:?}");
}

#[test]
fn work_without_a_final_event_is_an_error() {
    let (client, _) = connect(Faults { end_unsaid: true, ..Faults::default() });
    let error = client.home(Axis::SensorCoarse).err().unwrap();
    assert!(matches!(error, ClientError::NoEnd { .. }), "{error:?}");
}

#[test]
fn stops_endless_work_at_its_deadline() {
    let (client, peer) = connect(Faults { never_ends: true, ..Faults::default() });
    client.set_timing(OVERDUE_SOON);
    let error = client.home(Axis::SensorCoarse).err().unwrap();
    assert!(matches!(error, ClientError::Overdue { .. }), "{error:?}");
    assert_eq!(peer.board().stops, 1);
}

#[test]
fn an_interruption_stops_the_rig() {
    let (mut client, peer) = connect(Faults { never_ends: true, brakes_for: 12, ..Faults::default() });
    let flag = Arc::new(AtomicBool::new(false));
    client.interrupt_by(flag.clone());
    let interrupter = std::thread::spawn({
        let peer = peer.clone();
        move || {
            while peer.board().acts == 0 {
                std::thread::sleep(Duration::from_millis(1));
            }
            flag.store(true, Ordering::Relaxed);
        }
    });
    let error = client.home(Axis::SensorCoarse).err().unwrap();
    interrupter.join().unwrap();
    assert!(matches!(error, ClientError::Interrupted { .. }), "{error:?}");
    let (stops, braking) = {
        let board = peer.board();
        (board.stops, board.braking)
    };
    assert_eq!((stops, braking), (1, 0), "reported at standstill");
}

#[test]
fn work_begins_after_work_that_no_handle_has() {
    let (client, peer) = connect(Faults { brakes_for: 3, ..Faults::default() });
    peer.board().braking = 1_000; // of a program that was killed
    client.home(Axis::SensorCoarse).unwrap();
    let board = peer.board();
    assert_eq!((board.stops, board.acts), (1, 1));
}

#[test]
fn work_that_a_handle_has_is_not_stopped_for_other_work() {
    let (client, peer) = connect(Faults { never_ends: true, ..Faults::default() });
    let held = client.start_home(Axis::SensorCoarse).unwrap();
    peer.board().braking = 1_000;
    let error = client.start_home(Axis::Lens).err().unwrap();
    let busy =
        |error: &RequestError| matches!(error, RequestError::Busy { request } if *request == held.id());
    assert!(matches!(&error, ClientError::Refused { error, .. } if busy(error)), "{error:?}");
    assert_eq!(peer.board().stops, 0);
}

#[test]
fn work_whose_start_is_not_answered_is_stopped() {
    let (client, peer) = connect(Faults::default());
    client.home(Axis::SensorCoarse).unwrap(); // reads the settings
    peer.board().faults = Faults { never_ends: true, lose_answers: 4, ..Faults::default() };
    let error = client.home(Axis::SensorCoarse).err().unwrap();
    assert!(matches!(error, ClientError::Silent { attempts: 4, .. }), "{error:?}");
    let board = peer.board();
    assert_eq!((board.stops, board.acts), (1, 2));
}

#[test]
fn an_error_during_a_program_stops_the_rig() {
    let (client, peer) = connect(Faults::default());
    let shot = SHOT;
    let no_image = || ClientError::NoEnd { during: "waiting for the image".into() };
    let error = run_shots(&client, &[shot], |_| Err(no_image())).err().unwrap();
    assert!(error.to_string().contains("waiting for the image"), "{error}");
    assert_eq!(peer.board().stops, 1);
}

#[test]
fn answers_keep_alives_while_the_work_is_held() {
    let (client, peer) = connect(Faults { asks_first: 3, ..Faults::default() });
    client.home(Axis::SensorCoarse).unwrap();
    assert_eq!(peer.board().still_there, 3);
    assert_eq!(peer.board().keep_alives, [Micros(2_000_000)]);
    // Held without waiting: the port's thread answers.
    let work = client.start_home(Axis::Lens).unwrap();
    let until = Instant::now() + Duration::from_secs(20);
    while peer.board().still_there < 6 && Instant::now() < until {
        std::thread::sleep(Duration::from_millis(1));
    }
    assert_eq!(peer.board().still_there, 6);
    work.homed().unwrap();
    // Dropped: the rig is stopped.
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
fn works_started_together_end_separately_and_one_refusal_stops_all() {
    let (client, peer) = connect(Faults::default());
    let homed = client.start_homing(&[Axis::SensorCoarse, Axis::Lens]).unwrap();
    for work in homed {
        work.homed().unwrap();
    }
    let targets = [(Axis::Lens, Nanometres(3_000_000)), (Axis::SensorCoarse, Nanometres(2_000_000))];
    let ends = client.start_moves(&targets).unwrap().into_iter().map(|work| work.moved().unwrap().measured);
    assert_eq!(ends.collect::<Vec<_>>(), [Nanometres(3_000_125), Nanometres(2_000_375)]);
    assert_eq!(peer.board().acts, 4);
    assert_eq!(peer.board().stops, 0);
    peer.board().faults = Faults { never_ends: true, ..Faults::default() };
    let targets = [(Axis::Lens, Nanometres(1_000_000)), (Axis::SensorCoarse, Nanometres(14_000_000))];
    let error = client.start_moves(&targets).err().unwrap();
    assert!(error.to_string().contains("14000"), "{error}");
    assert_eq!(peer.board().stops, 1);
}

#[test]
fn runs_an_armed_program_twice_and_reports_software_triggered_shots() {
    let (client, peer) = connect(Faults::default());
    let error = client.start_program(&[]).err().unwrap();
    assert!(matches!(error, ClientError::NotArmed), "{error:?}");
    let shot = Shot { repeat: 2, mode: TriggerMode::Software, ..SHOT };
    let error = client.arm(&[shot; 17]).err().unwrap();
    assert!(error.to_string().contains("a program of 17 shots, the board can hold 16"), "{error}");
    client.arm(&[shot]).unwrap();
    for run in 0..2 {
        let mut work = client.start_program(&[shot]).unwrap();
        let mut ready = Vec::new();
        let end = loop {
            match work.step().unwrap() {
                Step::Done(kind) => break kind,
                Step::Event(kind) => ready.push(matches!(kind, EventKind::ShotReady { .. })),
            }
        };
        assert!(matches!(end, EventKind::ProgramDone { exposures: 2, .. }), "{end:?}");
        assert_eq!(ready, [true, false, true, false], "run {run}");
    }
    assert_eq!(peer.board().triggers, 4);
}

#[test]
fn no_work_at_all_ends_immediately() {
    let (client, peer) = connect(Faults::default());
    client.set_timing(Timing::EMULATED);
    let begin = Instant::now();
    assert!(client.start_homing(&[]).unwrap().is_empty());
    assert!(client.start_moves(&[]).unwrap().is_empty());
    assert!(begin.elapsed() < Duration::from_secs(2), "{:?}", begin.elapsed());
    assert_eq!(peer.board().acts, 0);
}

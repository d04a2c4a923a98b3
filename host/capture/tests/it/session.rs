//! Sessions: versions, resets, unplugged boards.

use std::{
    sync::{
        Arc,
        atomic::{AtomicU32, Ordering},
    },
    time::{Duration, Instant},
};

use farnear_capture::{Client, ClientError, Timing, Transport};
use farnear_protocol::{
    Request,
    message::{Axis, EventKind, ResetCause},
    units::Nanometres,
};
use farnear_scripted_board::{Faults, Peer};

use crate::scripted::{OVERDUE_SOON, SHORT, connect, connect_error, connect_with_gaps};

#[test]
fn hello_gives_the_board_and_its_boot() {
    let (client, _) = connect(Faults::default());
    assert_eq!(client.hello().boot, 7);
    assert_eq!(client.hello().board.as_str(), "scripted");
    assert_eq!(client.protocol(), 3);
}

#[test]
fn handles_work_from_many_threads_and_the_last_one_closes_the_port() {
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
    let log = client.logs().unwrap();
    drop(client);
    // The last handle is dropped, and with it the port's thread.
    assert!(log.next_within(Duration::ZERO).is_err());
}

#[test]
fn finds_an_unplugged_board_again() {
    let peer = Peer::new(Faults { never_ends: true, ..Faults::default() });
    let mut client = Client::connect(peer.connect(), "scripted").unwrap();
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
fn a_session_that_could_not_be_opened_is_not_used() {
    let peer = Peer::new(Faults::default());
    let (mut client, left) = connect_with_gaps(&peer, |request| *request == Request::OpenSession);
    peer.board().gone = true;
    assert!(matches!(client.status(), Err(ClientError::Gone { .. })));
    left.store(4, Ordering::SeqCst);
    peer.board().gone = false;
    let unopened = client.clone().reopen().err().unwrap();
    assert!(matches!(unopened, ClientError::Silent { .. }), "{unopened:?}");
    let error = client.status().err().unwrap();
    assert!(matches!(error, ClientError::Gone { .. }), "{error:?}");
    client.reopen_within(Duration::from_secs(20)).unwrap();
    client.status().unwrap();
    assert_eq!(peer.board().connections, 1);
}

#[test]
fn reports_a_board_on_another_port_and_rejects_another_board() {
    struct Named(Box<dyn Transport>, &'static str);
    impl Transport for Named {
        fn receive(&mut self, buffer: &mut [u8], wait: Duration) -> std::io::Result<usize> {
            self.0.receive(buffer, wait)
        }

        fn send(&mut self, bytes: &[u8], wait: Duration) -> std::io::Result<()> {
            self.0.send(bytes, wait)
        }

        fn discard_input(&mut self) -> std::io::Result<()> {
            self.0.discard_input()
        }

        fn port(&self) -> Option<&str> {
            Some(self.1)
        }
    }
    let peer = Peer::new(Faults::default());
    let (mut connect, mut names) = (peer.connect(), ["first", "second"].into_iter());
    let connect =
        move || Ok(Box::new(Named(connect()?, names.next().unwrap_or("third"))) as Box<dyn Transport>);
    let mut client = Client::connect(Box::new(connect), "first").unwrap();
    client.set_timing(SHORT);
    assert_eq!(client.port_note(), None);
    let leave = |client: &Client| {
        peer.board().gone = true;
        assert!(matches!(client.status(), Err(ClientError::Gone { .. })));
        peer.board().gone = false;
    };
    leave(&client);
    client.reopen_within(Duration::from_secs(20)).unwrap();
    let note = client.port_note().unwrap();
    assert!(note.contains("was on first") && note.contains("back on second"), "{note}");

    let id = peer.board().hello.unique_id;
    peer.board().hello.unique_id = [0xab; 12];
    leave(&client);
    let sessions = peer.board().session;
    let until = Instant::now() + Duration::from_secs(20);
    // The owner reconnects on its own and may have found the other board already.
    let error = loop {
        match client.reopen().err().unwrap() {
            ClientError::Gone { .. } if Instant::now() < until => {}
            error => break error,
        }
    };
    assert!(matches!(error, ClientError::OtherBoard { now: [0xab, ..], .. }), "{error:?}");
    assert!(error.to_string().contains("on third now (unique id abababababababababababab)"), "{error}");
    assert!(matches!(client.status(), Err(ClientError::OtherBoard { .. })));
    assert_eq!(peer.board().session, sessions, "no session was opened with it");
    peer.board().hello.unique_id = id;
    client.reopen_within(Duration::from_secs(20)).unwrap();
    client.status().unwrap();
}

#[test]
fn ignores_the_work_of_a_dead_program() {
    // The first program dies during a move: its work continues, with the smallest ids.
    let peer = Peer::new(Faults { never_ends: true, ..Faults::default() });
    let died = Client::connect(peer.connect(), "scripted").unwrap();
    let old = died.start_home(Axis::SensorCoarse).unwrap();
    let (old_id, old_session) = (old.id(), peer.board().session);
    std::mem::forget(old); // a killed program says nothing
    let client = Client::connect(peer.connect(), "scripted").unwrap();
    client.set_timing(OVERDUE_SOON);
    assert_ne!(peer.board().session, old_session);
    let work = client.start_home(Axis::SensorCoarse).unwrap();
    assert!(work.id() > old_id);
    let error = work.homed().err().unwrap();
    assert!(matches!(error, ClientError::Overdue { .. }), "the old work's end is not this one's: {error:?}");
    // Its later requests are refused with the reason.
    let error = died.status().err().unwrap();
    assert!(matches!(error, ClientError::TakenOver { .. }), "{error:?}");
}

#[test]
fn a_board_that_was_taken_over_is_left_alone_until_it_is_taken_back() {
    let (first, peer) = connect(Faults::default());
    let second = Client::connect(peer.connect(), "scripted").unwrap();
    let taken = peer.board().session;
    assert!(matches!(first.status(), Err(ClientError::TakenOver { .. })));
    assert!(matches!(first.status(), Err(ClientError::TakenOver { .. })));
    assert_eq!(peer.board().session, taken, "the client that lost the board opens no new session");
    second.status().unwrap();
    let mut first = first;
    first.reopen().unwrap();
    first.status().unwrap();
    assert_ne!(peer.board().session, taken);
    assert!(matches!(second.status(), Err(ClientError::TakenOver { .. })));
}

#[test]
fn an_unplugged_board_is_not_looked_for_all_the_time() {
    // Attempts are half a second apart.
    const WATCHED: Duration = Duration::from_millis(1_200);
    let peer = Peer::new(Faults::default());
    let attempts = Arc::new(AtomicU32::new(0));
    let (mut connect, counted) = (peer.connect(), Arc::clone(&attempts));
    let connect = move || {
        counted.fetch_add(1, Ordering::SeqCst);
        connect()
    };
    let client = Client::connect(Box::new(connect), "scripted").unwrap();
    client.set_timing(SHORT);
    peer.board().gone = true;
    let lost = Instant::now();
    assert!(matches!(client.status(), Err(ClientError::Gone { .. })));
    std::thread::sleep(WATCHED);
    let tried = attempts.load(Ordering::SeqCst) - 1;
    let due = lost.elapsed().as_millis() / 500;
    assert!(u128::from(tried) <= due, "{tried} attempts where {due} were due");
}

#[test]
fn a_real_board_that_was_unplugged_is_found_again_and_an_emulated_one_is_not() {
    for emulated in [false, true] {
        let peer = Peer::new(Faults::default());
        peer.board().hello.emulated = emulated;
        let client = Client::connect(peer.connect(), "scripted").unwrap();
        client.set_timing(SHORT);
        peer.board().gone = true;
        assert!(matches!(client.status(), Err(ClientError::Gone { .. })));
        let connections = peer.board().connections;
        peer.board().gone = false;
        let until = Instant::now() + Duration::from_secs(if emulated { 1 } else { 20 });
        while peer.board().connections == connections && Instant::now() < until {
            std::thread::sleep(Duration::from_millis(10));
        }
        assert_eq!(
            peer.board().connections == connections,
            emulated,
            "the port may be another program's by now"
        );
    }
}

#[test]
fn work_of_a_board_that_was_reset_ends_when_the_board_is_greeted_again() {
    let (client, peer) = connect(Faults { never_ends: true, ..Faults::default() });
    let work = client.start_home(Axis::SensorCoarse).unwrap();
    peer.board().hello.boot = 8;
    client.clone().reopen().unwrap();
    let error = work.homed().err().unwrap();
    assert!(matches!(error, ClientError::Reset { was: 7, now: 8, .. }), "{error:?}");
}

#[test]
fn ignores_an_end_on_another_axis_or_at_another_position() {
    let (client, peer) = connect(Faults { never_ends: true, ..Faults::default() });
    let work = client.start_move(Axis::SensorFine, Nanometres(5_000)).unwrap();
    let (request, measured) = (work.id(), Nanometres(5_000));
    peer.board().say(EventKind::MoveDone { request, axis: Axis::Lens, asked: measured, measured });
    let error = work.moved().err().unwrap();
    assert!(matches!(error, ClientError::Nonsense { .. }), "{error:?}");
    assert_eq!(peer.board().stops, 1);
}

#[test]
fn reports_a_board_that_dies_during_a_move() {
    let (client, peer) = connect(Faults { never_ends: true, ..Faults::default() });
    client.set_timing(Timing { work_slack: Duration::from_secs(3600), ..SHORT });
    let work = client.start_home(Axis::SensorCoarse).unwrap();
    // Power fails permanently; the adapter stays.
    peer.board().faults.lose_requests = u32::MAX;
    let error = work.homed().err().unwrap();
    assert!(matches!(error, ClientError::Silent { attempts: 8, .. }), "{error:?}");
    assert!(error.to_string().starts_with("no answer from scripted while homing"), "{error}");
    peer.board().faults.lose_requests = 0;
    let mut client = client;
    client.reopen_within(Duration::from_secs(20)).unwrap();
    client.stop().unwrap();
}

#[test]
fn an_emulated_board_that_stands_still_is_asked_once_with_repeats() {
    let peer = Peer::new(Faults { never_ends: true, ..Faults::default() });
    peer.board().hello.emulated = true;
    let client = Client::connect(peer.connect(), "scripted").unwrap();
    client.set_timing(Timing { work_slack: Duration::from_secs(3600), ..SHORT });
    let work = client.start_home(Axis::SensorCoarse).unwrap();
    peer.board().faults.lose_requests = u32::MAX;
    let error = work.homed().err().unwrap();
    assert!(matches!(error, ClientError::Silent { attempts: 4, .. }), "{error:?}");
    assert!(error.to_string().contains("Ctrl-Z"), "{error}");
}

#[test]
fn closes_the_old_port_before_searching_the_board() {
    let peer = Peer::new(Faults { never_ends: true, ..Faults::default() });
    let mut client = Client::connect(peer.connect(), "scripted").unwrap();
    client.set_timing(SHORT);
    let work = client.start_home(Axis::SensorCoarse).unwrap();
    peer.board().gone = true;
    assert!(matches!(work.homed().err().unwrap(), ClientError::Gone { .. }));
    assert!(client.reopen().is_err());
    assert_eq!(peer.board().connections, 0, "a held port would give the returning board another name");
    peer.board().gone = false;
    client.reopen_within(Duration::from_secs(20)).unwrap();
    assert_eq!(peer.board().connections, 1);
}

#[test]
fn an_idle_reset_requires_a_reopen() {
    let (mut client, peer) = connect(Faults::default());
    client.home(Axis::SensorCoarse).unwrap();
    peer.board().reset(ResetCause::BrownOut);
    for _ in 0..2 {
        let error = client.status().err().unwrap();
        assert!(matches!(error, ClientError::Reset { was: 7, now: 8, .. }), "{error:?}");
    }
    client.reopen().unwrap();
    assert_eq!(client.hello().boot, 8);
    client.home(Axis::SensorCoarse).unwrap();
}

#[test]
fn reopening_a_healthy_session_asks_the_board_again_and_keeps_its_work() {
    let (mut client, peer) = connect(Faults::default());
    let work = client.start_home(Axis::SensorCoarse).unwrap();
    client.clone().reopen().unwrap();
    work.homed().unwrap();
    peer.board().hello.boot = 8;
    client.reopen().unwrap();
    assert_eq!(client.hello().boot, 8);
}

#[test]
fn detects_a_reset_during_a_move_with_and_without_event() {
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
fn reboots_once_despite_a_lost_answer() {
    let (mut client, peer) = connect(Faults::default());
    peer.board().faults.lose_answers = 1;
    client.reboot().unwrap();
    assert_eq!(client.hello().boot, 8);
}

#[test]
fn a_board_of_another_protocol_is_refused_with_both_versions() {
    let error = connect_error(Faults { other_version: Some(4), ..Faults::default() }, |_| {});
    assert!(matches!(error, ClientError::Version { board_min: 4, host_current: 3, .. }), "{error:?}");
    assert!(
        error.to_string().contains("protocol 4 to 4, this program 3 to 3; use a newer farnear"),
        "{error}"
    );

    let error = connect_error(Faults::default(), |board| {
        board.hello.protocol_min = 4;
        board.hello.protocol_current = 5;
    });
    assert!(matches!(error, ClientError::Version { board_min: 4, board_current: 5, .. }), "{error:?}");
}

#[test]
fn accepts_a_newer_board_with_a_common_version() {
    let peer = Peer::new(Faults::default());
    peer.board().hello.protocol_current = 9;
    peer.board().hello.schema_key ^= 1;
    let client = Client::connect(peer.connect(), "scripted").unwrap();
    assert_eq!(client.protocol(), 3);
}

#[test]
fn rejects_another_message_table_with_both_keys() {
    let error = connect_error(Faults::default(), |board| board.hello.schema_key ^= 0xff);
    let ClientError::Schema { board_key, host_key, .. } = error else { panic!("{error:?}") };
    assert_eq!(board_key, host_key ^ 0xff);
    assert!(error.to_string().contains(&format!("{board_key:016x}")), "{error}");
}

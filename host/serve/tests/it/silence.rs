//! A board that stops answering in the middle of a job.

use std::time::{Duration, Instant};

use farnear_scripted_board::{Faults, Peer, plug_in};
use farnear_serve::Listen;
use farnear_workflows::rig::RigAddress;

use super::client::{Served, Socket};

/// A server whose board is silent, during a job. The host waits 15 s for each answer of an emulated board.
fn silenced() -> (Served, Socket) {
    let (port, board) = plug_in(Faults { never_ends: true, ..Faults::default() });
    board.board().hello.emulated = true;
    let held: Peer = board.clone();
    let rig = Some(RigAddress::Port(port));
    let served = Served::start(rig, Some(Box::new(held)), |_| Listen::Loopback { port: 0 });
    served.ready();
    let holder = Socket::open(&served);
    let begun = served.post("/api/rig/move", &holder.secret, r#"{"axis":["fine"],"to_um":[50.5]}"#);
    assert_eq!(begun.status, 200, "{begun:?}");
    board.board().faults.lose_requests = u32::MAX;
    std::thread::sleep(Duration::from_millis(300)); // a question is on the way, before any stop
    (served, holder)
}

#[test]
fn a_stop_that_the_board_does_not_answer_is_reported_within_a_second() {
    let (served, _holder) = silenced();
    let stopped = |path: &str| {
        let began = Instant::now();
        let answer = served.post(path, "", "{}");
        assert!(began.elapsed() < Duration::from_secs(2), "{path}: {:?}", began.elapsed());
        assert_eq!(answer.status, 504, "{path}: {answer:?}");
        answer
    };
    stopped("/api/halt");
    let answer = stopped("/api/stop");
    for words in ["has not answered the stop", "keep-alive", "check the rig"] {
        assert!(answer.error().contains(words), "{answer:?}");
    }
    let rig = served.get("/api/state").json()["rig"].clone();
    assert_eq!((&rig["phase"], &rig["error"]), (&"lost".into(), &answer.error().into()), "{rig:#}");
}

#[test]
fn a_stop_over_the_socket_shows_that_the_board_does_not_answer() {
    let (served, mut holder) = silenced();
    let began = Instant::now();
    holder.say(1, br#"{"type":"stop"}"#);
    served.state_when(|state| state["rig"]["error"].as_str().is_some_and(|error| error.contains("the stop")));
    assert!(began.elapsed() < Duration::from_secs(3), "{:?}", began.elapsed());
}

#[test]
fn the_server_ends_within_a_second_also_while_the_board_is_silent() {
    let (served, holder) = silenced();
    let began = Instant::now();
    let folder = served.stop();
    assert!(began.elapsed() < Duration::from_millis(1500), "{:?}", began.elapsed());
    drop((folder, holder));
}

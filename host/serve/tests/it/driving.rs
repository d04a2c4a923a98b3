//! One drives, others watch; and nothing moves once the one who drove has gone.

use farnear_scripted_board::Faults;

use super::client::{Served, Socket};

const FINE: &str = r#"{"targets":[{"axis":"fine","to_um":50}]}"#;

#[test]
fn one_browser_drives_and_hands_over_when_it_is_asked() {
    let served = Served::with_board(Faults::default());
    served.ready();
    let (first, second) = (Socket::open(&served), Socket::open(&served));
    let refused = served.post("/api/rig/move", &second.secret, FINE);
    assert_eq!((refused.status, refused.error().as_str()), (403, "another browser drives the rig"));
    let begun = served.post("/api/rig/move", &first.secret, FINE);
    assert_eq!(begun.status, 200, "{begun:?}");
    let job = served.ended("job", &begun.json()["job"]);
    assert_eq!((&job["phase"], &job["result"]["asked_um"]), (&"done".into(), &50.0.into()), "{job:#}");

    assert_eq!(served.post("/api/seat/ask", "made up", "{}").status, 403);
    assert_eq!(served.post("/api/seat/ask", &second.secret, "{}").status, 200);
    served.state_when(|state| state["seats"]["asking"] == second.seat);
    assert_eq!(served.post("/api/seat/answer", &second.secret, r#"{"give":true}"#).status, 403);
    assert_eq!(served.post("/api/seat/answer", &first.secret, r#"{"give":true}"#).status, 200);
    served.state_when(|state| state["seats"]["driver"] == second.seat);
    assert_eq!(served.post("/api/rig/move", &first.secret, FINE).status, 403);
}

#[test]
fn a_browser_that_goes_away_leaves_nothing_moving() {
    let served = Served::with_board(Faults { never_ends: true, ..Faults::default() });
    served.ready();
    let driver = Socket::open(&served);
    let begun = served.post("/api/rig/move", &driver.secret, FINE).json();
    let busy = served.post("/api/rig/home", &driver.secret, "{}");
    assert_eq!((busy.status, busy.error().as_str()), (409, "busy: Move fine to 50.000 um"));
    drop(driver);
    let job = served.ended("job", &begun["job"]);
    assert_eq!(job["phase"], "stopped", "{job:#}");
    let log = served.get("/api/log").json().to_string();
    assert!(log.contains("the browser that drove has gone: stopping"), "{log}");
    // Who comes next drives: a page that is loaded again goes on.
    let next = Socket::open(&served);
    served.state_when(|state| state["seats"]["driver"] == next.seat);
}

#[test]
fn anybody_may_stop_and_it_does_not_wait_for_the_job() {
    let served = Served::with_board(Faults { never_ends: true, ..Faults::default() });
    served.ready();
    let (driver, mut watcher) = (Socket::open(&served), Socket::open(&served));
    for by_socket in [false, true] {
        let begun = served.post("/api/rig/move", &driver.secret, FINE).json();
        if by_socket {
            watcher.say(1, br#"{"type":"stop"}"#);
        } else {
            assert_eq!(served.post("/api/stop", &watcher.secret, "{}").status, 200);
        }
        let job = served.ended("job", &begun["job"]);
        assert_eq!(job["phase"], "stopped", "{job:#}");
    }
}

#[test]
fn what_cannot_be_is_refused_before_anything_moves() {
    let served = Served::with_board(Faults::default());
    served.ready();
    let driver = Socket::open(&served);
    for (path, body, words) in [
        ("/api/rig/move", r#"{"targets":[]}"#, "one target or more"),
        (
            "/api/rig/move",
            r#"{"targets":[{"axis":"fine","to_um":1},{"axis":"fine","to_um":2}]}"#,
            "at most once",
        ),
        ("/api/rig/move", r#"{"targets":[{"axis":"fine","to_um":1e12}]}"#, "expected a position"),
        ("/api/rig/move", r#"{"targets":[{"axis":"x","to_um":1}]}"#, "unknown variant"),
        ("/api/rig/move", r#"{"targets":"#, "EOF"),
        ("/api/live", r#"{"exposure_us":0}"#, "expected 1 to 1000000"),
        ("/api/live", r#"{"measure":"sharp"}"#, "no focus measure"),
        ("/api/rig/focus", r#"{"range_mm":-1}"#, "range_mm -1"),
        ("/api/captures", r#"{"kind":"series","pairs":0}"#, "pairs 0"),
        ("/api/captures", r#"{"kind":"pair","name":"../x"}"#, "expected a name"),
        (
            "/api/captures",
            r#"{"kind":"stack","axis":"fine","from_um":1,"to_um":2,"steps":100000}"#,
            "expected 1 to 500",
        ),
        ("/api/answer", r#"{"text":""}"#, "nothing was asked"),
    ] {
        let answer = served.post(path, &driver.secret, body);
        assert!((400..500).contains(&answer.status), "{path} {body}: {answer:?}");
        assert!(answer.error().contains(words), "{path} {body}: {}", answer.error());
    }
    assert!(served.get("/api/state").json()["job"].is_null());
}

#[test]
fn a_rig_that_is_not_there_is_said_and_can_be_tried_again() {
    let rig = farnear_workflows::rig::RigAddress::Port("/dev/farnear-no-such-port".into());
    let served = Served::start(Some(rig), None, |_| farnear_serve::Listen::Loopback { port: 0 });
    let state = served.state_when(|state| state["rig"]["phase"] == "lost");
    assert!(state["rig"]["error"].as_str().unwrap().contains("/dev/farnear-no-such-port"), "{state:#}");
    let driver = Socket::open(&served);
    let refused = served.post("/api/rig/home", &driver.secret, "{}");
    assert_eq!(refused.status, 503);
    assert!(refused.json()["hint"].as_str().unwrap().contains("connect again"));
    assert_eq!(served.post("/api/rig/connect", &driver.secret, "{}").status, 200);
}

#[test]
fn a_refusal_of_the_board_reaches_the_page_with_what_to_do() {
    let served = Served::with_board(Faults::default());
    served.ready();
    let driver = Socket::open(&served);
    let coarse = r#"{"targets":[{"axis":"coarse","to_um":100}]}"#;
    let begun = served.post("/api/rig/move", &driver.secret, coarse).json();
    let job = served.ended("job", &begun["job"]);
    assert_eq!((&job["phase"], &job["hint"]), (&"failed".into(), &"Press Home first.".into()), "{job:#}");
    let begun = served.post("/api/rig/home", &driver.secret, "{}").json();
    assert_eq!(served.ended("job", &begun["job"])["phase"], "done");
    let begun = served.post("/api/rig/move", &driver.secret, coarse).json();
    assert_eq!(served.ended("job", &begun["job"])["phase"], "done");
}

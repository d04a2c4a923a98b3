//! One browser has control; nothing moves after it has disconnected.

use std::{
    io::{Read, Write},
    net::TcpStream,
};

use farnear_scripted_board::{Faults, plug_in};
use farnear_workflows::rig::RigAddress;

use super::{
    attacks::{TOKEN, network},
    captures::put,
    client::{Served, Socket},
};

const FINE: &str = r#"{"axis":["fine"],"to_um":[50]}"#;

#[test]
fn one_browser_has_control_and_hands_it_over_on_request() {
    let served = Served::with_board(Faults::default());
    served.ready();
    let (first, second) = (Socket::open(&served), Socket::open(&served));
    let refused = served.post("/api/rig/move", &second.secret, FINE);
    assert_eq!((refused.status, refused.error().as_str()), (403, "another browser has control of the rig"));
    let begun = served.post("/api/rig/move", &first.secret, FINE);
    assert_eq!(begun.status, 200, "{begun:?}");
    let job = served.ended("job", &begun.json()["job"]);
    assert_eq!((&job["phase"], &job["result"]["asked_um"]), (&"done".into(), &50.0.into()), "{job:#}");

    assert_eq!(served.post("/api/control/request", "made up", "{}").status, 403);
    assert_eq!(served.post("/api/control/request", &second.secret, "{}").status, 200);
    served.state_when(|state| state["control"]["requested_by"] == second.client);
    let give = format!(r#"{{"to":{},"give":true}}"#, second.client);
    assert_eq!(served.post("/api/control/answer", &second.secret, &give).status, 403);
    assert_eq!(served.post("/api/control/answer", &first.secret, &give).status, 200);
    served.state_when(|state| state["control"]["holder"] == second.client);
    assert_eq!(served.post("/api/rig/move", &first.secret, FINE).status, 403);
}

#[test]
fn control_that_is_lost_while_a_body_arrives_counts_for_nothing() {
    let served = Served::captures_only();
    put(&served, "pair-001", 0);
    let (first, second) = (Socket::open(&served), Socket::open(&served));
    let body = r#"{"to":"pair-002"}"#;
    let mut slow = TcpStream::connect(&served.address).unwrap();
    let head = format!(
        "POST /api/captures/pair-001/rename HTTP/1.1\r\nhost: {}\r\nconnection: close\r\nx-farnear-client: {}\r\n\
         content-type: application/json\r\ncontent-length: {}\r\n\r\n{}",
        served.address,
        first.secret,
        body.len(),
        &body[..1]
    );
    slow.write_all(head.as_bytes()).unwrap();
    std::thread::sleep(std::time::Duration::from_millis(300)); // the server reads the body
    assert_eq!(served.post("/api/control/request", &second.secret, "{}").status, 200);
    let give = format!(r#"{{"to":{},"give":true}}"#, second.client);
    assert_eq!(served.post("/api/control/answer", &first.secret, &give).status, 200);
    slow.write_all(&body.as_bytes()[1..]).unwrap();
    let mut answer = String::new();
    slow.read_to_string(&mut answer).unwrap();
    assert!(answer.starts_with("HTTP/1.1 403"), "{answer}");
    assert!(served.session.join("pair-001").is_dir());
}

#[test]
fn a_browser_hears_from_the_server_while_nothing_happens() {
    let served = Served::captures_only();
    let mut watching = Socket::open(&served);
    // The server closes a connection that is silent for five seconds: the second message comes before that.
    for _ in 0..2 {
        watching.receive("here");
    }
}

#[test]
fn a_browser_that_disconnects_leaves_nothing_moving() {
    let served = Served::with_board(Faults { never_ends: true, ..Faults::default() });
    served.ready();
    let holder = Socket::open(&served);
    let begun = served.post("/api/rig/move", &holder.secret, FINE).json();
    let busy = served.post("/api/rig/home", &holder.secret, "{}");
    assert_eq!((busy.status, busy.error().as_str()), (409, "busy: Move fine to 50.000 um"));
    drop(holder);
    let job = served.ended("job", &begun["job"]);
    assert_eq!(job["phase"], "stopped", "{job:#}");
    let log = served.get("/api/log").json().to_string();
    assert!(log.contains("the browser that had control has disconnected: stopping"), "{log}");
    assert_eq!(job["error"], "the browser that had control has disconnected", "{job:#}");
    let next = Socket::open(&served);
    served.state_when(|state| state["control"]["holder"] == next.client);
}

#[test]
fn a_reloaded_page_keeps_control_and_its_job_while_another_browser_watches() {
    let served = Served::with_board(Faults { never_ends: true, ..Faults::default() });
    served.ready();
    let (holder, watcher) = (Socket::open(&served), Socket::open(&served));
    let begun = served.post("/api/rig/move", &holder.secret, FINE).json();
    let before = holder.secret.clone();
    drop(holder);
    served.state_when(|state| state["control"]["clients"] == 1);
    let again = Socket::resume(&served, &before);
    served.state_when(|state| state["control"]["holder"] == again.client);
    std::thread::sleep(farnear_serve::control::RESERVED + std::time::Duration::from_millis(500));
    let state = served.get("/api/state").json();
    assert_eq!(
        (&state["job"]["id"], &state["job"]["phase"]),
        (&begun["job"], &"running".into()),
        "{state:#}"
    );
    assert_eq!(served.post("/api/rig/home", &watcher.secret, "{}").status, 403);
    served.post("/api/stop", "", "{}");
}

#[test]
fn control_is_given_to_the_browser_named_in_the_answer() {
    let served = Served::captures_only();
    let [holder, b, c] = [0; 3].map(|_| Socket::open(&served));
    for client in [&b, &c] {
        assert_eq!(served.post("/api/control/request", &client.secret, "{}").status, 200);
    }
    let answer = |to: u64| format!(r#"{{"to":{to},"give":true}}"#);
    assert_eq!(served.post("/api/control/answer", &holder.secret, &answer(99)).status, 409);
    assert_eq!(served.post("/api/control/answer", &holder.secret, &answer(b.client)).status, 200);
    served.state_when(|state| state["control"]["holder"] == b.client);
}

#[test]
fn a_question_stays_until_it_is_answered_or_its_job_is_stopped() {
    let served = Served::with_board(Faults::default());
    served.ready();
    let holder = Socket::open(&served);
    put(&served, "pair-001", 0);
    let series = || {
        let begun = served.post("/api/calibrate/series", &holder.secret, r#"{"distances":[900.5]}"#);
        assert_eq!(begun.status, 200, "{begun:?}");
        let state = served.state_when(|state| !state["question"].is_null());
        assert!(state["question"].as_str().unwrap().contains("900.5 mm"), "{state:#}");
        (begun.json()["job"].clone(), state["questions"].clone())
    };
    let (stopped, first) = series();
    assert_eq!(served.post("/api/stop", "", "{}").status, 200);
    assert_eq!(served.ended("job", &stopped)["phase"], "stopped");
    assert!(served.get("/api/state").json()["question"].is_null());

    let (waiting, second) = series();
    assert_ne!(first, second, "two questions with equal words");
    let computed = served.post("/api/captures/pair-001/depth", &holder.secret, "{}");
    assert_eq!(computed.status, 200, "{computed:?}");
    served.ended("computation", &computed.json()["job"]);
    let state = served.get("/api/state").json();
    assert!(state["question"].is_string(), "of the job that still waits: {state:#}");
    let answered = served.post("/api/answer", &holder.secret, r#"{"text":""}"#);
    assert_eq!(answered.status, 200, "{answered:?}");
    served.state_when(|state| state["question"].is_null());
    served.post("/api/stop", "", "{}");
    served.ended("job", &waiting);
}

#[test]
fn anybody_may_stop_and_it_does_not_wait_for_the_job() {
    let served = Served::with_board(Faults { never_ends: true, ..Faults::default() });
    served.ready();
    let (holder, mut watcher) = (Socket::open(&served), Socket::open(&served));
    for by_socket in [false, true] {
        let begun = served.post("/api/rig/move", &holder.secret, FINE).json();
        if by_socket {
            watcher.say(1, br#"{"type":"stop"}"#);
        } else {
            assert_eq!(served.post("/api/stop", &watcher.secret, "{}").status, 200);
        }
        let job = served.ended("job", &begun["job"]);
        assert_eq!(job["phase"], "stopped", "{job:#}");
    }
}

/// Ten browsers behind one address, with six connections each while they load the page.
#[test]
fn ten_browsers_of_a_lab_see_the_job_that_one_of_them_runs() {
    let (port, board) = plug_in(Faults { never_ends: true, ..Faults::default() });
    let served = Served::start(Some(RigAddress::Port(port)), Some(Box::new(board)), network);
    let cookie = served.cookie(TOKEN);
    let get = |path: &str| served.ask("GET", path, &[("cookie", &cookie)], "");
    while get("/api/state").json()["rig"]["phase"] != "ready" {
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    let mut browsers: Vec<_> = std::thread::scope(|scope| {
        for _ in 0..60 {
            scope.spawn(|| assert_eq!(get("/main.js").status, 200));
        }
        let opened: Vec<_> = (0..10).map(|_| scope.spawn(|| Socket::with_cookie(&served, &cookie))).collect();
        opened.into_iter().map(|browser| browser.join().unwrap()).collect()
    });
    let control = get("/api/state").json()["control"].clone();
    assert_eq!(control["clients"], 10, "{control}");
    let begin = |browser: &Socket| {
        let headers = [("cookie", cookie.as_str()), ("x-farnear-client", &browser.secret)];
        served.ask("POST", "/api/rig/move", &headers, FINE)
    };
    let begun: Vec<_> = browsers.iter().map(|browser| (browser.client, begin(browser))).collect();
    for (client, answer) in &begun {
        assert_eq!(answer.status, if control["holder"] == *client { 200 } else { 403 }, "{answer:?}");
    }
    for phase in ["running", "stopped"] {
        for browser in &mut browsers {
            while browser.receive("state")["state"]["job"]["phase"] != phase {}
        }
        browsers[0].say(1, br#"{"type":"stop"}"#);
    }
}

#[test]
fn impossible_requests_are_rejected_before_any_motion() {
    let served = Served::with_board(Faults::default());
    served.ready();
    let holder = Socket::open(&served);
    for (path, body, words) in [
        ("/api/rig/move", r#"{"axis":[],"to_um":[]}"#, "one for each axis"),
        ("/api/rig/move", r#"{"axis":["fine","fine"],"to_um":[1,2]}"#, "expected each axis once"),
        ("/api/rig/move", r#"{"axis":["fine"],"to_um":[1e12]}"#, "expected a position"),
        ("/api/rig/move", r#"{"axis":["x"],"to_um":[1]}"#, "unknown variant"),
        ("/api/rig/move", r#"{"axis":["fine"]}"#, "needs the field `to_um`"),
        ("/api/rig/move", r#"{"axis":"#, "EOF"),
        ("/api/rig/focus", r#"{"optics":"/etc/passwd"}"#, "no field `optics`"),
        ("/api/live", r#"{"exposure_us":0}"#, "exposure_us 0: expected"),
        ("/api/live", r#"{"exposure_us":1}"#, "exposure_us 1: expected"),
        ("/api/captures", r#"{"kind":"pair","averaged":0}"#, "average 0"),
        ("/api/live", r#"{"measure":"sharp"}"#, "not a focus measure"),
        ("/api/rig/focus", r#"{"range_mm":-1}"#, "range-mm -1"),
        ("/api/captures", r#"{"kind":"series","pairs":0}"#, "pairs 0"),
        (
            "/api/captures",
            r#"{"kind":"series","pairs":2,"interval_s":-1}"#,
            "interval_s -1: expected 0 to 86400",
        ),
        ("/api/captures", r#"{"kind":"pair","name":"../x"}"#, "expected a name"),
        (
            "/api/captures",
            r#"{"kind":"stack","axis":"fine","from_um":1,"to_um":2,"steps":100000}"#,
            "steps 100000: expected 1 to 10000",
        ),
        (
            "/api/captures",
            r#"{"kind":"stack","axis":"fine","from_um":1,"to_um":2,"steps":1}"#,
            "steps 1: a single image is taken at one position",
        ),
        ("/api/answer", r#"{"text":""}"#, "nothing was asked"),
    ] {
        let answer = served.post(path, &holder.secret, body);
        assert!((400..500).contains(&answer.status), "{path} {body}: {answer:?}");
        assert!(answer.error().contains(words), "{path} {body}: {}", answer.error());
    }
    assert!(served.get("/api/state").json()["job"].is_null());
}

#[test]
fn a_missing_rig_is_reported_and_can_be_retried() {
    let rig = farnear_workflows::rig::RigAddress::Port("/dev/farnear-no-such-port".into());
    let served = Served::start(Some(rig), None, |_| farnear_serve::Listen::Loopback { port: 0 });
    let state = served.state_when(|state| state["rig"]["phase"] == "lost");
    assert!(state["rig"]["error"].as_str().unwrap().contains("/dev/farnear-no-such-port"), "{state:#}");
    let holder = Socket::open(&served);
    let refused = served.post("/api/rig/home", &holder.secret, "{}");
    assert_eq!(refused.status, 503);
    assert!(refused.json()["hint"].as_str().unwrap().contains("connect again"));
    assert_eq!(served.post("/api/rig/connect", &holder.secret, "{}").status, 200);
}

#[test]
fn a_refusal_of_the_board_reaches_the_page_with_what_to_do() {
    let served = Served::with_board(Faults::default());
    served.ready();
    let holder = Socket::open(&served);
    let coarse = r#"{"axis":["coarse"],"to_um":[100]}"#;
    let begun = served.post("/api/rig/move", &holder.secret, coarse).json();
    let job = served.ended("job", &begun["job"]);
    assert_eq!((&job["phase"], &job["hint"]), (&"failed".into(), &"Press Home first.".into()), "{job:#}");
    let begun = served.post("/api/rig/home", &holder.secret, "{}").json();
    assert_eq!(served.ended("job", &begun["job"])["phase"], "done");
    let begun = served.post("/api/rig/move", &holder.secret, coarse).json();
    assert_eq!(served.ended("job", &begun["job"])["phase"], "done");
}

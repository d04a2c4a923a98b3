//! Attacks on the API as tables: each case lists the request and the expected answer.

use std::{
    fs,
    io::{Read, Write},
    net::TcpStream,
    path::Path,
    time::{Duration, Instant},
};

use farnear_serve::{Listen, Token};

use super::{
    captures::put,
    client::{Answer, Served, Socket},
};

pub(super) const TOKEN: &str = "0123456789abcdef0123";

pub(super) fn network(folder: &Path) -> Listen {
    let file = folder.join("token");
    fs::write(&file, format!("{TOKEN}\n")).unwrap();
    let (address, token) = ("127.0.0.1:0".parse().unwrap(), Token::read(&file).unwrap());
    Listen::Network { address, token, names: vec!["rig.lab.example".into()] }
}

fn raw(served: &Served, text: &str) -> u16 {
    Answer::parse(&served.exchange(text.as_bytes(), false)).status
}

#[test]
fn hosts_and_origins_of_others_are_refused_in_every_form() {
    let served = Served::captures_only();
    let own = served.address.clone();
    let port = own.rsplit_once(':').unwrap().1.to_owned();
    let hosts = [
        "evil.example",
        "evil.example:80",
        "EVIL.EXAMPLE",
        "localhost.evil.example",
        "127.0.0.1.evil.example",
        "192.168.0.7",
        "10.0.0.1:80",
        "[2001:db8::1]",
        "rig",
        "rig.local",
        "",
        " ",
        "localhost@evil.example",
        "evil.example#localhost",
        "evil.example/localhost",
        "2130706433",
        "0x7f.1",
        "127.0.0.1:80:80",
        "localhost:evil",
        "0.0.0.0",
    ];
    for host in hosts {
        let status =
            raw(&served, &format!("GET /api/state HTTP/1.1\r\nhost: {host}\r\nconnection: close\r\n\r\n"));
        assert!((400..500).contains(&status), "host {host:?}: {status}");
    }
    for (line, host) in [
        ("GET http://evil.example/api/state HTTP/1.1".to_string(), own.as_str()),
        (format!("GET http://{own}/api/state HTTP/1.1"), "evil.example"),
        (format!("GET http://user@{own}/api/state HTTP/1.1"), own.as_str()),
        ("GET http://localhost:1/api/state HTTP/1.1".to_string(), own.as_str()),
        (format!("GET https://evil.example:{port}/ HTTP/1.1"), own.as_str()),
    ] {
        let status = raw(&served, &format!("{line}\r\nhost: {host}\r\nconnection: close\r\n\r\n"));
        assert!((400..500).contains(&status), "{line} with host {host}: {status}");
    }
    for (name, first, second) in [
        ("host", own.as_str(), "evil.example"),
        ("host", "evil.example", own.as_str()),
        ("host", own.as_str(), own.as_str()),
        ("origin", "http://evil.example", ""),
        ("origin", "", "http://evil.example"),
    ] {
        let first = if first.is_empty() { format!("http://{own}") } else { first.to_owned() };
        let second = if second.is_empty() { format!("http://{own}") } else { second.to_owned() };
        let host = if name == "host" { String::new() } else { format!("host: {own}\r\n") };
        let text = format!(
            "GET /api/state HTTP/1.1\r\n{host}{name}: {first}\r\n{name}: {second}\r\nconnection: close\r\n\r\n"
        );
        assert!((400..500).contains(&raw(&served, &text)), "{text}");
    }
    let origins = [
        "http://evil.example",
        "https://evil.example",
        "null",
        "http://localhost",
        "http://localhost:1",
        "file://",
        "http://",
        "http://127.0.0.1.evil.example",
        "chrome-extension://abc",
        "",
        "http://user@localhost",
        "//localhost",
    ];
    for origin in origins {
        assert_eq!(
            served.ask("POST", "/api/stop", &[("origin", origin)], "{}").status,
            403,
            "origin {origin:?}"
        );
        let upgrade = [("origin", origin), ("upgrade", "websocket"), ("connection", "upgrade")];
        assert_eq!(served.ask("GET", "/api/socket", &upgrade, "").status, 403, "socket from {origin:?}");
    }
    for origin in [format!("https://{own}"), own.clone()] {
        let asked = served.ask("POST", "/api/stop", &[("origin", &origin)], "{}");
        assert_eq!(asked.status, 403, "its own host without its scheme: {origin}");
    }
    let status =
        raw(&served, &format!("GET /api/state HTTP/1.1\r\nhost: {own}\r\nconnection: close\r\n\r\n"));
    assert_eq!(status, 200, "its own name");
    let origin = format!("http://{own}");
    assert_eq!(served.ask("POST", "/api/stop", &[("origin", &origin)], "{}").status, 200, "its own page");
}

#[test]
fn no_path_leaves_the_session_or_a_capture() {
    let served = Served::captures_only();
    put(&served, "pair-001", 0);
    fs::write(served.session.parent().unwrap().join("secret"), "private content").unwrap();
    fs::write(served.session.join("secret"), "private content").unwrap();
    fs::write(served.session.join("pair-001/.hidden"), "private content").unwrap();
    fs::create_dir_all(served.session.join("people")).unwrap();
    fs::write(served.session.join("people/private.toml"), "private content").unwrap();
    fs::create_dir_all(served.session.join("pair-001/odd")).unwrap();
    fs::write(served.session.join("pair-001/odd/depth.npy"), "private content").unwrap();
    let climbs = [
        "..",
        "%2e%2e",
        ".%2e",
        "%2e.",
        "..%2f",
        "..%2fsecret",
        "%2e%2e%2fsecret",
        "..%5csecret",
        "..\\secret",
        "%252e%252e",
        ".",
        "%2e",
        "....%2f%2fsecret",
        "%2fetc%2fpasswd",
        "%5c%5chost%5cshare",
        "C:",
        "c:%5csecret",
        "%00",
        "a%00b",
        "%0d%0ax",
        "..%c0%afsecret",
        "%c0%ae%c0%ae",
        "~",
        ".hidden",
        "-",
        "a%2fb",
        "people",
        "recordings",
        "optics.toml",
        "x".repeat(101).leak(),
    ];
    for climb in climbs {
        for path in [
            format!("/api/captures/{climb}"),
            format!("/api/captures/{climb}/files/private.toml"),
            format!("/api/captures/pair-001/files/{climb}"),
            format!("/api/captures/pair-001/variants/{climb}/depth.npy"),
            format!("/api/people/shadows/{climb}/masks/a.png"),
        ] {
            let answer = served.get(&path);
            // A client may resolve `..`: then the route does not exist.
            assert!((400..500).contains(&answer.status), "{path}: {answer:?}");
            assert!(!answer.body.windows(15).any(|part| part == b"private content"), "{path}");
        }
    }
    for path in ["/api/captures/pair-001/variants/odd/depth.npy", "/api/captures/people/files/private.toml"] {
        assert_eq!(served.get(path).status, 404, "{path}");
    }
}

#[test]
fn links_fifos_and_devices_are_neither_served_nor_followed_nor_waited_for() {
    let served = Served::captures_only();
    let secret = served.session.parent().unwrap().join("secret");
    fs::create_dir_all(&secret).unwrap();
    fs::write(secret.join("depth.npy"), "secret").unwrap();
    for name in ["linked", "fifo", "record", "whole"] {
        put(&served, name, 0);
    }
    let session = &served.session;
    let link = |target: &Path, at: &Path| std::os::unix::fs::symlink(target, at).unwrap();
    link(&secret.join("depth.npy"), &session.join("linked/depth.npy"));
    link(&session.join("whole"), &session.join("link-to-capture"));
    link(&secret, &session.join("link-out"));
    let fifo =
        |path: &Path| assert!(std::process::Command::new("mkfifo").arg(path).status().unwrap().success());
    fifo(&session.join("fifo/note.toml"));
    fs::remove_file(session.join("record/capture.toml")).unwrap();
    fifo(&session.join("record/capture.toml"));
    fs::create_dir_all(session.join("recordings")).unwrap();
    fifo(&session.join("recordings/live-001.pairs"));
    let began = Instant::now();
    let list = served.get("/api/captures").json();
    let listed: Vec<_> = list["captures"].as_array().unwrap().iter().collect();
    assert_eq!(listed.len(), 4, "{list:#}");
    for one in listed {
        assert_eq!(one["broken"].is_null(), one["name"] == "whole", "{one:#}");
    }
    for path in [
        "/api/captures/linked/files/depth.npy",
        "/api/captures/linked/zip",
        "/api/captures/linked/mesh.ply",
        "/api/captures/linked",
        "/api/captures/linked/difference/whole",
        "/api/captures/link-to-capture",
        "/api/captures/link-to-capture/files/far.png",
        "/api/captures/link-out/files/depth.npy",
        "/api/captures/fifo",
        "/api/captures/fifo/files/note.toml",
        "/api/captures/fifo/zip",
        "/api/captures/fifo/report.html",
        "/api/captures/record",
        "/api/captures/record/files/capture.toml",
    ] {
        let answer = served.get(path);
        assert!(answer.status >= 400, "{path}: {}", answer.status);
    }
    assert_eq!(served.get("/api/recordings").json()["recordings"].as_array().unwrap().len(), 0);
    assert!(began.elapsed() < Duration::from_secs(10), "nothing waits for a FIFO");
    assert_eq!(served.get("/api/captures/whole/files/far.png").status, 200);
}

#[test]
fn links_and_fifos_among_videos_masks_and_recordings_are_refused() {
    let served = Served::captures_only();
    let holder = Socket::open(&served);
    let secret = served.session.parent().unwrap().join("secret");
    fs::create_dir_all(secret.join("with-shadow")).unwrap();
    let file = secret.join("with-shadow/a.png");
    fs::write(&file, "secret").unwrap();
    let (people, recordings) = (served.session.join("people"), served.session.join("recordings"));
    let masks = people.join("shadow-001/with-shadow");
    fs::create_dir_all(&masks).unwrap();
    fs::create_dir_all(&recordings).unwrap();
    let link = |target: &Path, at: &Path| std::os::unix::fs::symlink(target, at).unwrap();
    let fifo =
        |path: &Path| assert!(std::process::Command::new("mkfifo").arg(path).status().unwrap().success());
    for name in ["whole.y4m", ".whole.y4m.Xy1.part"] {
        fs::write(people.join(name), "a video").unwrap();
    }
    fs::write(masks.join("whole.png"), "a mask").unwrap();
    for at in [people.join("linked.y4m"), masks.join("linked.png"), recordings.join("linked.pairs")] {
        link(&file, &at);
    }
    for at in [people.join("fifo.y4m"), masks.join("fifo.png"), recordings.join("fifo.pairs")] {
        fifo(&at);
    }
    link(&secret, &people.join("shadow-002"));
    link(&secret.join("with-shadow"), &people.join("shadow-001/linked"));
    let shown = served.get("/api/people/shadows/shadow-001/with-shadow/whole.png");
    assert_eq!((shown.status, shown.body.as_slice()), (200, b"a mask".as_slice()));
    for mask in [
        "shadow-001/with-shadow/linked.png",
        "shadow-001/with-shadow/fifo.png",
        "shadow-001/linked/a.png",
        "shadow-002/with-shadow/a.png",
    ] {
        assert_eq!(served.get(&format!("/api/people/shadows/{mask}")).status, 404, "{mask}");
    }
    for name in ["linked", "fifo"] {
        let video = format!(r#"{{"video":"{name}.y4m"}}"#);
        assert_eq!(served.post("/api/people/recognise", &holder.secret, &video).status, 404, "{name}");
        let recording = format!(r#"{{"recording":"{name}.pairs"}}"#);
        assert_eq!(served.post("/api/recordings/play", &holder.secret, &recording).status, 404, "{name}");
    }
    let listed = served.get("/api/people").json();
    assert_eq!(listed["videos"], serde_json::json!(["whole.y4m"]), "{listed:#}");

    for folder in [&people, &recordings] {
        fs::remove_dir_all(folder).unwrap();
        link(&secret, folder);
    }
    for path in ["/api/people", "/api/recordings", "/api/people/shadows/with-shadow/with-shadow/a.png"] {
        let refused = served.get(path);
        assert!(refused.status == 409 && refused.error().contains("is a link"), "{path}: {refused:?}");
    }
    let client = [("x-farnear-client", holder.secret.as_str())];
    assert_eq!(served.ask("PUT", "/api/people/videos/a.y4m", &client, "a video").status, 409);
    assert!(!secret.join("a.y4m").exists());
}

#[test]
fn a_watcher_changes_nothing_and_its_body_is_not_read() {
    let served = Served::captures_only();
    let (holder, watcher) = (Socket::open(&served), Socket::open(&served));
    put(&served, "pair-001", 0);
    let before = fs::read(served.session.join("pair-001/capture.toml")).unwrap();
    for variant in
        ["note.toml", "far.png", "capture.toml", "..", "../x", "a/b", "", ".", "x.y", "people", "a b", "%2e"]
    {
        let body = serde_json::json!({ "variant": variant }).to_string();
        assert_eq!(
            served.post("/api/captures/pair-001/depth", &watcher.secret, &body).status,
            403,
            "{variant}"
        );
        if variant != "people" {
            assert_eq!(
                served.post("/api/captures/pair-001/depth", &holder.secret, &body).status,
                400,
                "{variant}"
            );
        }
    }
    assert_eq!(fs::read(served.session.join("pair-001/capture.toml")).unwrap(), before);
    let document = served.get("/openapi.json").json();
    let mut refused = 0;
    for (path, methods) in document["paths"].as_object().unwrap() {
        for (method, operation) in methods.as_object().unwrap() {
            let about = operation["parameters"].to_string();
            if !about.contains("client that has control") {
                continue;
            }
            let path = path.replace("{capture}", "pair-001").replace("{video}", "a.y4m");
            // The body is announced and never sent: control is checked first.
            let text = format!(
                "{} {path} HTTP/1.1\r\nhost: {}\r\nx-farnear-client: {}\r\ncontent-type: application/json\r\ncontent-length: 200000000\r\n\r\n",
                method.to_uppercase(),
                served.address,
                watcher.secret
            );
            let mut stream = TcpStream::connect(&served.address).unwrap();
            stream.set_read_timeout(Some(Duration::from_secs(5))).unwrap();
            stream.write_all(text.as_bytes()).unwrap();
            let mut start = [0; 12];
            stream.read_exact(&mut start).unwrap_or_else(|error| panic!("{method} {path}: {error}"));
            assert_eq!(&start, b"HTTP/1.1 403", "{method} {path}");
            refused += 1;
        }
    }
    assert!(refused > 20, "{refused} routes need control");
}

#[test]
fn reserved_taken_and_odd_capture_names_are_refused() {
    let served = Served::with_board(farnear_scripted_board::Faults::default());
    served.ready();
    let holder = Socket::open(&served);
    put(&served, "taken", 0);
    for name in [
        "quality.toml",
        "optics.toml",
        "correction.toml",
        "people",
        "People",
        "recordings",
        "flat-series",
        "taken",
        "",
        ".",
        "..",
        "../x",
        "a/b",
        "a\\b",
        ".x",
        "x.",
        "a.b",
        " a",
        "a ",
        "a\nb",
        "a\u{0}b",
        "a:b",
        "a*b",
        "a?b",
        "a\"b",
        "a<b",
        "a|b",
        "CON",
        "nul",
    ] {
        let body = serde_json::json!({ "kind": "pair", "name": name }).to_string();
        let answer = served.post("/api/captures", &holder.secret, &body);
        assert_eq!(answer.status, 400, "{name:?}: {answer:?}");
    }
}

#[test]
fn a_form_of_another_site_cannot_change_anything() {
    let served = Served::captures_only();
    let holder = Socket::open(&served);
    for media in [
        "text/plain",
        "application/x-www-form-urlencoded",
        "multipart/form-data; boundary=x",
        "",
        "text/plain; application/json",
    ] {
        let text = format!(
            "POST /api/stop HTTP/1.1\r\nhost: {}\r\nx-farnear-client: {}\r\nconnection: close\r\ncontent-type: {media}\r\ncontent-length: 2\r\n\r\n{{}}",
            served.address, holder.secret
        );
        assert_eq!(raw(&served, &text), 415, "{media:?}");
    }
    for path in ["/", "/main.js", "/api/state", "/api/captures", "/nothing"] {
        let headers = served.get(path).headers;
        assert!(headers.contains("cross-origin-resource-policy: same-origin"), "{path}: {headers}");
        assert!(headers.contains("x-content-type-options: nosniff"), "{path}: {headers}");
    }
    for text in [
        "GET / HTTP/1.1\r\nhost : x\r\n\r\n",
        "GET  / HTTP/1.1\r\n\r\n",
        "\0\0\0\0",
        "GET / HTTP/9.9\r\n\r\n",
        "POST /api/stop HTTP/1.1\r\nhost: localhost\r\ncontent-length: 2\r\ncontent-length: 3\r\n\r\n{}",
    ] {
        let status = raw(&served, text);
        assert!(status == 0 || (400..600).contains(&status), "{text:?}: {status}");
    }
}

/// Sends a wrong token by login or as a bearer.
fn guess(address: &str, by_login: bool) -> TcpStream {
    let guess = "0123456789abcdef0124";
    let (line, body) = match by_login {
        true => (
            "POST /login HTTP/1.1\r\ncontent-type: application/json".to_owned(),
            format!(r#"{{"token":"{guess}"}}"#),
        ),
        false => (format!("GET /api/state HTTP/1.1\r\nauthorization: Bearer {guess}"), String::new()),
    };
    let length = body.len();
    let text =
        format!("{line}\r\nhost: {address}\r\nconnection: close\r\ncontent-length: {length}\r\n\r\n{body}");
    let mut stream = TcpStream::connect(address).unwrap();
    stream.write_all(text.as_bytes()).unwrap();
    stream
}

#[test]
fn wrong_tokens_are_answered_slowly_and_a_right_cookie_or_bearer_is_not_delayed() {
    let served = Served::start(None, None, network);
    let began = Instant::now();
    let refused = std::thread::scope(|scope| {
        let guesses: Vec<_> = (0..60)
            .map(|at| {
                let address = &served.address;
                scope.spawn(move || {
                    let mut stream = guess(address, at % 2 == 0);
                    let mut answer = Vec::new();
                    let _ = stream.read_to_end(&mut answer); // a reset ends it as well
                    Answer::parse(&answer).status
                })
            })
            .collect();
        guesses.into_iter().map(|guess| guess.join().unwrap()).collect::<Vec<_>>()
    });
    let answered = refused.iter().filter(|status| **status == 401).count();
    assert!(refused.iter().all(|status| [401, 429].contains(status)), "{refused:?}");
    let took = began.elapsed();
    assert!(answered as f64 <= 2.0 + took.as_secs_f64(), "{answered} of 60 guesses in {took:?}");
    let (cookie, bearer) = (served.cookie(TOKEN), format!("Bearer {TOKEN}"));
    let login = format!(r#"{{"token":"{TOKEN}"}}"#);
    // A guess waits for a second: on a busy computer the first login may come too late.
    let refused = (0..20).any(|_| {
        let waiting = guess(&served.address, false);
        std::thread::sleep(Duration::from_millis(50));
        for (name, value) in [("cookie", &cookie), ("authorization", &bearer)] {
            assert_eq!(served.ask("GET", "/api/state", &[(name, value.as_str())], "").status, 200, "{name}");
        }
        assert_eq!(served.get("/").status, 401, "the form is shown without delay");
        let status = served.post("/login", "", &login).status;
        drop(waiting);
        status == 429
    });
    assert!(refused, "login takes no token while a wrong one of its address waits");
}

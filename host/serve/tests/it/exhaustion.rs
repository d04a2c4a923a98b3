//! Attacks that use up connections, memory or disk.

use std::{
    fs,
    io::{Read, Write},
    net::TcpStream,
    path::PathBuf,
    time::{Duration, Instant},
};

use farnear_serve::{Limits, Listen};

use super::{
    attacks::{TOKEN, network},
    captures::put,
    client::{Answer, Served, Socket},
};

fn memory_mb() -> u64 {
    let status = fs::read_to_string("/proc/self/status").unwrap();
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).unwrap();
    line.split_whitespace().next().unwrap().parse::<u64>().unwrap() / 1024
}

/// Time until the server closes a connection that sends `bytes`, then one byte each 100 ms.
fn closed_after(address: &str, bytes: &[u8], drip: bool) -> Duration {
    let began = Instant::now();
    let mut stream = TcpStream::connect(address).unwrap();
    stream.set_read_timeout(Some(Duration::from_millis(100))).unwrap();
    stream.write_all(bytes).unwrap();
    let mut buffer = [0; 4096];
    loop {
        match stream.read(&mut buffer) {
            Ok(0) => return began.elapsed(),
            Ok(_) => {}
            Err(error)
                if [std::io::ErrorKind::WouldBlock, std::io::ErrorKind::TimedOut].contains(&error.kind()) => {
            }
            Err(_) => return began.elapsed(),
        }
        assert!(began.elapsed() < Duration::from_secs(20), "never closed");
        if drip && stream.write_all(b"x").is_err() {
            return began.elapsed();
        }
    }
}

#[test]
fn slow_headers_half_bodies_and_idle_connections_are_closed() {
    let second = Duration::from_secs(1);
    let limits =
        Limits { header_timeout: second, body_timeout: second, idle_timeout: second, ..Limits::default() };
    let served = Served::limited(None, None, |_| Listen::Loopback { port: 0 }, limits);
    let own = &served.address;
    let cases = [
        ("nothing", String::new(), false),
        ("a request line without an end", "GET / HTTP/1.1\r\nhost: local".into(), false),
        ("headers byte by byte", "GET / HTTP/1.1\r\nhost: local".into(), true),
        (
            "half a body",
            format!(
                "POST /api/stop HTTP/1.1\r\nhost: {own}\r\ncontent-type: application/json\r\ncontent-length: 99\r\n\r\n{{"
            ),
            false,
        ),
        (
            "a body byte by byte",
            format!(
                "POST /api/stop HTTP/1.1\r\nhost: {own}\r\ncontent-type: application/json\r\ncontent-length: 9999\r\n\r\n{{"
            ),
            true,
        ),
        ("nothing after an answer", format!("GET /api/state HTTP/1.1\r\nhost: {own}\r\n\r\n"), false),
        (
            "half a request after an answer",
            format!("GET /api/state HTTP/1.1\r\nhost: {own}\r\n\r\nGET"),
            false,
        ),
    ];
    std::thread::scope(|scope| {
        for (what, bytes, drip) in &cases {
            scope.spawn(move || {
                let after = closed_after(own, bytes.as_bytes(), *drip);
                assert!(after < Duration::from_secs(8), "{what}: {after:?}");
            });
        }
    });
    let mut socket = Socket::open(&served);
    std::thread::sleep(2 * second);
    socket.say(10, b"");
    assert_eq!(served.get("/api/state").json()["control"]["clients"], 1, "a WebSocket is not closed");
}

#[test]
fn eleven_hundred_idle_connections_leave_the_owner_at_work() {
    let served = Served::start(None, None, network);
    let cookie = served.cookie(TOKEN);
    let owner = [("cookie", cookie.as_str())];
    let before = memory_mb();
    let mut idle = Vec::new();
    for count in 0..1100 {
        // A process may have 1,024 descriptors here, so the client's end of closed connections is dropped.
        if idle.len() >= 400 {
            idle.remove(0);
        }
        idle.push(TcpStream::connect(&served.address).unwrap());
        if count % 100 == 99 {
            assert_eq!(served.ask("GET", "/api/state", &owner, "").status, 200, "after {count}");
        }
    }
    let log = served.ask("GET", "/api/log", &owner, "").json().to_string();
    assert!(log.contains("has 128 connections, the limit"), "{log}");
    assert!(memory_mb() <= before + 100, "{} MB, {before} MB before", memory_mb());
}

#[test]
fn sixty_archives_that_are_not_read_take_no_memory() {
    let served = Served::captures_only();
    put(&served, "pair-001", 0);
    fs::write(served.session.join("pair-001/large.tiff"), vec![7; 24 << 20]).unwrap();
    let before = memory_mb();
    let clients: Vec<_> = (0..60)
        .map(|_| {
            let mut stream = TcpStream::connect(&served.address).unwrap();
            let text = format!("GET /api/captures/pair-001/zip HTTP/1.1\r\nhost: {}\r\n\r\n", served.address);
            stream.write_all(text.as_bytes()).unwrap();
            stream
        })
        .collect();
    std::thread::sleep(Duration::from_secs(2));
    let after = memory_mb();
    assert_eq!(served.get("/api/state").status, 200);
    assert!(after.saturating_sub(before) <= 100, "{before} to {after} MB");
    drop(clients);
    let whole = served.get("/api/captures/pair-001/zip");
    assert!(whole.body.len() > 24 << 20 && whole.status == 200);
}

#[test]
fn an_upload_above_the_quota_leaves_nothing() {
    let limits = Limits { upload_quota_bytes: 1 << 20, ..Limits::default() };
    let served = Served::limited(None, None, |_| Listen::Loopback { port: 0 }, limits);
    let holder = Socket::open(&served);
    let client = [("x-farnear-client", holder.secret.as_str())];
    let put = |name: &str, bytes: usize| {
        served.ask("PUT", &format!("/api/people/videos/{name}"), &client, &"x".repeat(bytes)).status
    };
    assert_eq!(put("small.y4m", 600 << 10), 200);
    assert_eq!(put("second.y4m", 600 << 10), 413);
    assert_eq!(put("third.y4m", 300 << 10), 200);
    assert_eq!(put("small.y4m", 700 << 10), 200, "the space of a replaced video is free");
    let names: Vec<_> = fs::read_dir(served.session.join("people"))
        .unwrap()
        .map(|entry| entry.unwrap().file_name())
        .collect();
    assert_eq!(names.len(), 2, "{names:?}");
}

#[test]
fn an_empty_upload_and_a_bad_name_are_refused() {
    let served = Served::captures_only();
    let holder = Socket::open(&served);
    let client = [("x-farnear-client", holder.secret.as_str())];
    let put = |name: &str, body: &str| {
        let answer = served.ask("PUT", &format!("/api/people/videos/{name}"), &client, body);
        (answer.status, answer.error())
    };
    let empty = put("walk.y4m", "");
    assert!(empty.0 == 400 && empty.1.contains("walk.y4m has 0 bytes"), "{empty:?}");
    assert_eq!(fs::read_dir(served.session.join("people")).unwrap().count(), 0);
    let bad = put("..%2Fx.mp4", "x");
    assert!(bad.0 == 400 && bad.1.starts_with("video ../x.mp4: expected a name"), "{bad:?}");
}

/// An upload of `length` bytes, of which the server has written `begin`; and its unfinished file.
fn upload(served: &Served, client: &str, name: &str, length: usize, begin: &[u8]) -> (TcpStream, PathBuf) {
    let mut stream = TcpStream::connect(&served.address).unwrap();
    let head = format!(
        "PUT /api/people/videos/{name} HTTP/1.1\r\nhost: {}\r\nconnection: close\r\nx-farnear-client: {client}\r\n\
         content-length: {length}\r\n\r\n",
        served.address
    );
    stream.write_all(&[head.as_bytes(), begin].concat()).unwrap();
    let people = served.session.join("people");
    let began = Instant::now();
    loop {
        let entries = fs::read_dir(&people).into_iter().flatten().flatten();
        let part = entries.map(|entry| entry.path()).find(|path| {
            let hidden = path.file_name().unwrap().to_string_lossy().starts_with('.');
            hidden && fs::metadata(path).is_ok_and(|file| file.len() == begin.len() as u64)
        });
        if let Some(part) = part {
            return (stream, part);
        }
        assert!(began.elapsed() < Duration::from_secs(20), "no file is being written");
        std::thread::sleep(Duration::from_millis(10));
    }
}

/// Sends the rest of an upload and returns the answer's status.
fn rest(mut upload: TcpStream, rest: &[u8]) -> u16 {
    let _ = upload.write_all(rest); // the server may have refused it
    let mut answer = Vec::new();
    let _ = upload.read_to_end(&mut answer);
    Answer::parse(&answer).status
}

#[test]
fn two_uploads_of_one_name_leave_one_of_them_whole() {
    let served = Served::captures_only();
    let holder = Socket::open(&served);
    let (slow, part) = upload(&served, &holder.secret, "walk.y4m", 2000, &[b'a'; 1000]);
    let client = [("x-farnear-client", holder.secret.as_str())];
    let second = served.ask("PUT", "/api/people/videos/walk.y4m", &client, &"b".repeat(1500));
    assert_eq!(second.status, 200, "{second:?}");
    let video = served.session.join("people/walk.y4m");
    assert_eq!(fs::read(&video).unwrap(), [b'b'; 1500]);
    assert_eq!(fs::read(&part).unwrap(), [b'a'; 1000]);
    assert_eq!(rest(slow, &[b'a'; 1000]), 200);
    assert_eq!(fs::read(&video).unwrap(), [b'a'; 2000]);
    assert_eq!(fs::read_dir(served.session.join("people")).unwrap().count(), 1);
}

#[test]
fn simultaneous_uploads_share_the_quota() {
    let limits = Limits { upload_quota_bytes: 1 << 20, ..Limits::default() };
    let served = Served::limited(None, None, |_| Listen::Loopback { port: 0 }, limits);
    let holder = Socket::open(&served);
    let (first, _) = upload(&served, &holder.secret, "a.y4m", 600 << 10, &vec![0; 500 << 10]);
    let client = [("x-farnear-client", holder.secret.as_str())];
    let second = served.ask("PUT", "/api/people/videos/b.y4m", &client, &"x".repeat(600 << 10));
    assert!(second.status == 413 && second.error().contains("the space left"), "{second:?}");
    assert_eq!(rest(first, &vec![0; 100 << 10]), 200);
    assert_eq!(fs::metadata(served.session.join("people/a.y4m")).unwrap().len(), 600 << 10);
    assert!(!served.session.join("people/b.y4m").exists());
}

#[test]
fn an_upload_under_way_when_the_server_stops_leaves_nothing() {
    let served = Served::captures_only();
    let holder = Socket::open(&served);
    let (_stream, part) = upload(&served, &holder.secret, "walk.y4m", 99, b"half");
    let folder = served.stop();
    assert!(!part.exists() && folder.path().join("session/people").exists(), "{}", part.display());
}

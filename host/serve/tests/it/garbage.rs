//! Ten thousand invalid messages: each is answered or ends its connection, and the page is still served.

use farnear_scripted_board::Faults;

use super::client::{Served, Socket};

const HTTP: usize = 4_000;
/// Each connection takes a few of them.
const SOCKET: usize = 6_000;

/// Repeatable random numbers (xorshift).
struct Dice(u64);

impl Dice {
    fn below(&mut self, end: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 % end as u64) as usize
    }

    fn bytes(&mut self, longest: usize) -> Vec<u8> {
        (0..self.below(longest + 1)).map(|_| self.below(256) as u8).collect()
    }

    /// A valid request with some bytes changed, dropped or doubled.
    fn spoiled(&mut self, request: &str) -> Vec<u8> {
        let mut bytes = request.as_bytes().to_vec();
        for _ in 0..=self.below(4) {
            let at = self.below(bytes.len().max(1));
            if bytes.is_empty() {
                break;
            }
            match self.below(4) {
                0 => bytes[at] = self.below(256) as u8,
                1 => drop(bytes.remove(at)),
                2 => bytes.insert(at, bytes[at]),
                _ => bytes.truncate(at.max(1)),
            }
        }
        bytes
    }
}

#[test]
fn ten_thousand_malformed_messages_change_nothing() {
    let served = Served::with_board(Faults::default());
    served.ready();
    let mut dice = Dice(0x5eed);
    let paths =
        ["/api/rig/move", "/api/captures", "/api/stop", "/api/live", "/api/optics/calculate", "/login", "/x"];
    let bodies = [r#"{"axis":["fine"],"to_um":[20]}"#, r#"{"kind":"pair"}"#, "{}", r#"{"mode":"off"}"#];
    for count in 0..HTTP {
        let (path, body) = (paths[dice.below(paths.len())], bodies[dice.below(bodies.len())]);
        let length = body.len();
        let request = format!(
            "POST {path} HTTP/1.1\r\nhost: {}\r\nconnection: close\r\ncontent-type: application/json\r\n\
             content-length: {length}\r\n\r\n{body}",
            served.address
        );
        let bytes = if count % 4 == 0 { dice.bytes(300) } else { dice.spoiled(&request) };
        let answer = served.raw(&bytes);
        assert!(answer.is_empty() || answer.starts_with(b"HTTP/1."), "{bytes:?}: {answer:?}");
        assert!(!answer.starts_with(b"HTTP/1.1 500"), "{}", String::from_utf8_lossy(&answer));
    }
    let stop = r#"{"type":"stop"}"#;
    for _ in 0..SOCKET / 60 {
        let mut socket = Socket::open(&served);
        for _ in 0..60 {
            let payload = if dice.below(2) == 0 { dice.bytes(100) } else { dice.spoiled(stop) };
            socket.say([1, 2, 9, 10][dice.below(4)], &payload);
        }
    }
    // No request had control, so nothing was begun; a new client is served.
    served.state_when(|state| state["control"]["clients"] == 0);
    let state = served.get("/api/state").json();
    assert!(state["job"].is_null(), "{state:#}");
    assert_eq!(state["rig"]["phase"], "ready");
    let holder = Socket::open(&served);
    served.state_when(|state| state["control"]["holder"] == holder.client);
    // Some payloads are still a stop; what they began ends before this one.
    assert_eq!(served.post("/api/stop", "", "{}").status, 200);
    let targets = r#"{"axis":["fine"],"to_um":[20]}"#;
    let begun = served.post("/api/rig/move", &holder.secret, targets).json();
    let ended = served.ended("job", &begun["job"]);
    assert_eq!(ended["phase"], "done", "{ended:#}");
}

//! The link's session: bytes in, requests out; answers in, frames out.
//!
//! A request acts once. Its id and the request itself are remembered with the answer for the last
//! [`REMEMBERED`] requests; the same again is answered from memory, the same id with another request is refused.
//! Hello opens a session and forgets what was before, unless it is the retry of the hello that opened this one:
//! on a serial line a retry never overtakes, so it comes before any other request of its session.
//!
//! Answers wait in a queue of their own, so no burst of events can push one out; where that queue is full the next
//! request is dropped unseen, and the host's retry finds room.
//!
//! RAM: about 4.5 KiB, most of it remembered answers.

use farnear_protocol::frame::{self, Decoder, Encoded, Header, Kind, Packet};
use farnear_protocol::message::{LinkCounters, Request, RequestError, Response};
use farnear_protocol::{PROTOCOL_CURRENT, PROTOCOL_MIN};
use heapless::Deque;

/// Answers remembered for retries.
pub const REMEMBERED: usize = 8;
/// Answers that may wait for the UART.
const WAITING: usize = 4;

/// A request that was answered.
#[derive(Clone, Debug)]
struct Answered {
    id: u32,
    request: Request,
    reply: Encoded,
}

/// A request to be carried out and answered with [`Session::answer`].
#[derive(Clone, PartialEq, Eq, Debug)]
pub(crate) struct Incoming {
    pub(crate) id: u32,
    pub(crate) request: Request,
}

/// The board's end of the link.
#[derive(Clone, Debug)]
pub(crate) struct Session {
    boot: u32,
    decoder: Decoder,
    answered: Deque<Answered, REMEMBERED>,
    waiting: Deque<Encoded, WAITING>,
    counters: LinkCounters,
}

impl Session {
    pub(crate) const fn new(boot: u32) -> Self {
        Self {
            boot,
            decoder: Decoder::new(),
            answered: Deque::new(),
            waiting: Deque::new(),
            counters: LinkCounters { frames: 0, bad_frames: 0, repeated: 0 },
        }
    }

    /// What the link has seen.
    pub(crate) const fn counters(&self) -> LinkCounters {
        self.counters
    }

    /// Takes a byte; gives a request that is new and was made for this boot.
    pub(crate) fn receive(&mut self, byte: u8) -> Option<Incoming> {
        match self.decoder.push(byte)? {
            Ok(packet) if packet.header.kind == Kind::Request => {
                self.counters.frames = self.counters.frames.wrapping_add(1);
                self.admit(&packet)
            }
            // A whole frame of another kind is no request either: an echo of what this board sent.
            Ok(_) | Err(_) => {
                self.counters.bad_frames = self.counters.bad_frames.wrapping_add(1);
                None
            }
        }
    }

    fn admit(&mut self, packet: &Packet) -> Option<Incoming> {
        if self.waiting.is_full() {
            return None;
        }
        let Header { version, id, boot, .. } = packet.header;
        if !(PROTOCOL_MIN..=PROTOCOL_CURRENT).contains(&version) {
            self.refuse(id, &RequestError::Version { min: PROTOCOL_MIN, current: PROTOCOL_CURRENT });
            return None;
        }
        let request: Option<Request> = packet.message();
        let unknown_boot_allowed = boot == 0 && matches!(request, Some(Request::Hello));
        if boot != self.boot && !unknown_boot_allowed {
            self.refuse(id, &RequestError::Boot { current: self.boot });
            return None;
        }
        let Some(request) = request else {
            self.refuse(id, &RequestError::Malformed);
            return None;
        };
        if request == Request::Hello
            && self.answered.back().is_none_or(|last| (last.id, &last.request) != (id, &request))
        {
            self.answered.clear();
        }
        match self.answered.iter().find(|answered| answered.id == id) {
            None => Some(Incoming { id, request }),
            Some(answered) if answered.request == request => {
                self.counters.repeated = self.counters.repeated.wrapping_add(1);
                let _ = self.waiting.push_back(answered.reply.clone()); // not full, see above
                None
            }
            Some(_) => {
                self.refuse(id, &RequestError::IdReused);
                None
            }
        }
    }

    /// Answers a request and remembers the answer.
    pub(crate) fn answer(&mut self, incoming: Incoming, answer: &Result<Response, RequestError>) {
        let reply = match answer {
            Ok(response) => frame::encode(self.header(Kind::Response, incoming.id), response),
            Err(error) => frame::encode(self.header(Kind::Error, incoming.id), error),
        };
        // Every message fits a frame (the protocol crate tests it).
        let Some(reply) = reply else { return };
        let _ = self.waiting.push_back(reply.clone()); // there was room when the request was admitted
        if self.answered.is_full() {
            self.answered.pop_front();
        }
        let _ = self.answered.push_back(Answered { id: incoming.id, request: incoming.request, reply });
    }

    /// Refuses without remembering: nothing was done, and the same will be refused again.
    fn refuse(&mut self, id: u32, error: &RequestError) {
        if let Some(reply) = frame::encode(self.header(Kind::Error, id), error) {
            let _ = self.waiting.push_back(reply); // not full, see `admit`
        }
    }

    /// The header of a frame of this boot.
    pub(crate) const fn header(&self, kind: Kind, id: u32) -> Header {
        Header { version: PROTOCOL_CURRENT, kind, id, boot: self.boot }
    }

    /// The next answer to send.
    pub(crate) fn send(&mut self) -> Option<Encoded> {
        self.waiting.pop_front()
    }

    /// Whether answers wait to be sent.
    pub(crate) fn all_sent(&self) -> bool {
        self.waiting.is_empty()
    }
}

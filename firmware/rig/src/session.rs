//! Link session: bytes to requests, answers to frames.
//!
//! A request acts once. Ids increase over the boot (`ids`); the last [`REMEMBERED`] requests are stored with their
//! answers. An equal repeat is answered from memory; another request with the same id and older ids are rejected. A
//! request names its session; only the open one is accepted, so only the latest host is served. Hello belongs to none
//! and changes nothing. Steps, one per tick: a frame arrives; it is checked and executed; its answer is encoded; that
//! is sent.
//!
//! Answers have their own queue, so bursts of events cannot displace them. With the promised number of frames and
//! answers pending, requests are rejected with `QueueFull`, for which only ids are queued. Longer bursts are counted.
//! RAM: about 8 KiB, mostly stored answers.

mod ids;

use farnear_protocol::frame::{self, Decoder, Encoded, Header, Kind, Packet};
use farnear_protocol::message::{Call, LinkCounters, NO_SESSION, Request, RequestError, Response};
use farnear_protocol::{PROTOCOL_CURRENT, PROTOCOL_MIN};
use heapless::Deque;

use self::ids::Ids;

/// Size of a [`Call`] without fields: session and request number.
const BARE_CALL: usize = 5;
pub const REMEMBERED: usize = 8;
/// Answers that may wait for the UART: [`farnear_protocol::message::Hello::outstanding`].
pub const OUTSTANDING: usize = 8;
/// Rejections that may wait, several ticks' worth: 10 small requests and as many rejections take a millisecond.
const REFUSED: usize = 64;

// A repeat of the oldest outstanding request must find its answer.
const _: () = assert!(OUTSTANDING <= REMEMBERED && REMEMBERED <= ids::IDS as usize);

#[derive(Clone, Debug)]
struct Answered {
    id: u32,
    request: Request,
    reply: Encoded,
}

#[derive(Clone, PartialEq, Eq, Debug)]
pub(crate) struct Incoming {
    pub(crate) id: u32,
    pub(crate) request: Request,
}

#[derive(Clone, Debug)]
pub(crate) struct Session {
    boot: u32,
    decoder: Decoder,
    /// Open session, or [`NO_SESSION`].
    number: u32,
    ids: Ids,
    frames: Deque<Packet, OUTSTANDING>,
    /// An executed request with its unencoded answer.
    done: Option<(Incoming, Result<Response, RequestError>)>,
    answered: Deque<Answered, REMEMBERED>,
    waiting: Deque<Encoded, OUTSTANDING>,
    refused: Deque<u32, REFUSED>,
    counters: LinkCounters,
    heard: u32,
}

impl Session {
    pub(crate) const fn is_open(&self) -> bool {
        self.number != NO_SESSION
    }

    pub(crate) const fn new(boot: u32) -> Self {
        let counters = LinkCounters { frames: 0, bad_frames: 0, repeated: 0, stale: 0, overflowed: 0 };
        Self {
            boot,
            decoder: Decoder::new(),
            number: NO_SESSION,
            ids: Ids::new(),
            frames: Deque::new(),
            done: None,
            answered: Deque::new(),
            waiting: Deque::new(),
            refused: Deque::new(),
            counters,
            heard: 0,
        }
    }

    pub(crate) const fn counters(&self) -> LinkCounters {
        self.counters
    }

    pub(crate) const fn last_id(&self) -> u32 {
        self.ids.last()
    }

    /// Requests of the open session's host; others do not count.
    pub(crate) const fn heard(&self) -> u32 {
        self.heard
    }

    /// Accepts a byte; complete requests wait for [`Self::next_request`].
    pub(crate) fn receive(&mut self, byte: u8) {
        match self.decoder.push(byte) {
            None => {}
            Some(Ok(packet)) if packet.header.kind == Kind::Request => {
                count(&mut self.counters.frames);
                let owed = self.frames.len() + usize::from(self.done.is_some()) + self.waiting.len();
                let id = packet.header.id;
                if owed >= OUTSTANDING || self.frames.push_back(packet).is_err() {
                    count(&mut self.counters.overflowed);
                    let _ = self.refused.push_back(id); // without room for that either, being counted is all
                }
            }
            // Frames of another kind, such as echoes, are not requests.
            Some(Ok(_) | Err(_)) => count(&mut self.counters.bad_frames),
        }
    }

    pub(crate) fn has_request(&self) -> bool {
        !self.frames.is_empty()
    }

    /// Whether a stop request waits. It has no fields, so only the shortest frames are checked, at little cost.
    pub(crate) fn stop_waits(&self) -> bool {
        let short = self.frames.iter().filter(|packet| packet.body.len() == BARE_CALL);
        short
            .filter_map(Packet::message)
            .any(|call: Call| matches!(call.request, Request::Stop | Request::Halt))
    }

    /// Checks the next request; returns it if new and for this boot and session. Guarantees room for its answer.
    pub(crate) fn next_request(&mut self) -> Option<Incoming> {
        let packet = self.frames.pop_front()?;
        let id = packet.header.id;
        match self.admit(&packet) {
            Ok(incoming) => incoming,
            Err(error) => {
                if matches!(error, RequestError::NotInSession | RequestError::IdNotNew { .. }) {
                    count(&mut self.counters.stale);
                }
                // Not stored: nothing was done, and a repeat is refused again.
                if let Some(reply) = frame::encode(self.header(Kind::Error, id), &error) {
                    let _ = self.waiting.push_back(reply); // not full, see `receive`
                }
                None
            }
        }
    }

    /// A request to execute; `None` for a repeat, which is answered.
    fn admit(&mut self, packet: &Packet) -> Result<Option<Incoming>, RequestError> {
        let Header { version, id, boot, .. } = packet.header;
        if !(PROTOCOL_MIN..=PROTOCOL_CURRENT).contains(&version) {
            return Err(RequestError::Version { min: PROTOCOL_MIN, current: PROTOCOL_CURRENT });
        }
        let call: Option<Call> = packet.message();
        let is_hello = call.as_ref().is_some_and(|call| call.request == Request::Hello);
        if boot != self.boot && !(is_hello && boot == 0) {
            return Err(RequestError::Boot { current: self.boot });
        }
        let Some(Call { session, request }) = call else { return Err(RequestError::Malformed) };
        if is_hello {
            return Ok(Some(Incoming { id, request }));
        }
        let is_new = self.ids.is_new(id);
        if request == Request::OpenSession && session != NO_SESSION {
            if is_new {
                self.number = session;
                self.answered.clear();
                self.ids.begin(id);
            } else if session != self.number {
                return Err(RequestError::IdNotNew { last: self.ids.last() });
            }
        } else if session != self.number || session == NO_SESSION {
            return Err(RequestError::NotInSession);
        }
        if is_new {
            self.ids.take(id);
            self.heard = self.heard.wrapping_add(1);
            return Ok(Some(Incoming { id, request }));
        }
        self.repeat(id, &request)?;
        Ok(None)
    }

    fn repeat(&mut self, id: u32, request: &Request) -> Result<(), RequestError> {
        match self.answered.iter().find(|answered| answered.id == id) {
            Some(answered) if answered.request == *request => {
                count(&mut self.counters.repeated);
                self.heard = self.heard.wrapping_add(1);
                let _ = self.waiting.push_back(answered.reply.clone()); // not full, see `receive`
                Ok(())
            }
            Some(_) => Err(RequestError::IdReused),
            None => Err(RequestError::IdNotNew { last: self.ids.last() }),
        }
    }

    /// Answers a request; sent by [`Self::put_answer`].
    pub(crate) fn answer(&mut self, incoming: Incoming, answer: Result<Response, RequestError>) {
        self.done = Some((incoming, answer));
    }

    pub(crate) fn has_work(&self) -> bool {
        self.has_answer() || self.has_request()
    }

    pub(crate) const fn has_answer(&self) -> bool {
        self.done.is_some()
    }

    pub(crate) fn put_answer(&mut self) {
        let Some((incoming, answer)) = self.done.take() else { return };
        let reply = match &answer {
            Ok(response) => frame::encode(self.header(Kind::Response, incoming.id), response),
            Err(error) => frame::encode(self.header(Kind::Error, incoming.id), error),
        };
        // Every message fits a frame (tested in the protocol crate).
        let Some(reply) = reply else { return };
        let _ = self.waiting.push_back(reply.clone()); // there was room when the request was admitted
        if incoming.request == Request::Hello {
            return;
        }
        if self.answered.is_full() {
            self.answered.pop_front();
        }
        let _ = self.answered.push_back(Answered { id: incoming.id, request: incoming.request, reply });
    }

    pub(crate) const fn header(&self, kind: Kind, id: u32) -> Header {
        Header { version: PROTOCOL_CURRENT, kind, id, boot: self.boot }
    }

    pub(crate) fn send(&mut self) -> Option<Encoded> {
        if let Some(reply) = self.waiting.pop_front() {
            return Some(reply);
        }
        let id = self.refused.pop_front()?;
        let error = RequestError::QueueFull { outstanding: OUTSTANDING as u8 };
        frame::encode(self.header(Kind::Error, id), &error)
    }

    pub(crate) fn all_sent(&self) -> bool {
        let looked_at = self.frames.is_empty() && self.done.is_none();
        looked_at && self.waiting.is_empty() && self.refused.is_empty()
    }
}

fn count(counter: &mut u32) {
    *counter = counter.wrapping_add(1);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_is_sent_when_no_request_waits_and_no_answer() {
        let mut session = Session::new(7);
        assert!(session.all_sent());
        let header = Header { version: PROTOCOL_CURRENT, kind: Kind::Request, id: 1, boot: 7 };
        let call = Call { session: 5, request: Request::OpenSession };
        let frame = frame::encode(header, &call).expect("every request fits");
        frame::delimited(&frame).iter().for_each(|byte| session.receive(*byte));
        assert!(session.has_request() && !session.all_sent(), "a request waits");
        let incoming = session.next_request().expect("a new request");
        session.answer(incoming, Ok(Response::Accepted));
        assert!(!session.all_sent(), "its answer waits to be encoded");
        session.put_answer();
        assert!(!session.all_sent(), "its answer waits to be sent");
        assert!(session.send().is_some() && session.all_sent());
    }

    #[test]
    fn requests_beyond_the_promised_number_are_refused_at_any_stage_of_the_others() {
        let mut session = Session::new(7);
        let mut id = 0;
        let mut ask = |session: &mut Session, request| {
            id += 1;
            let header = Header { version: PROTOCOL_CURRENT, kind: Kind::Request, id, boot: 7 };
            let frame = frame::encode(header, &Call { session: 5, request }).expect("every request fits");
            frame::delimited(&frame).iter().for_each(|byte| session.receive(*byte));
            session.counters().overflowed
        };
        assert_eq!(ask(&mut session, Request::OpenSession), 0);
        assert!((1..OUTSTANDING).all(|_| ask(&mut session, Request::Status) == 0));
        assert_eq!(ask(&mut session, Request::Status), 1, "eight frames wait");
        let incoming = session.next_request().expect("a new request");
        session.answer(incoming, Ok(Response::Accepted));
        assert_eq!(ask(&mut session, Request::Status), 2, "seven frames and a result");
        session.put_answer();
        assert_eq!(ask(&mut session, Request::Status), 3, "seven frames and an answer");
        assert!(session.send().is_some());
        assert_eq!(ask(&mut session, Request::Status), 3, "seven frames");
    }

    #[test]
    fn a_repeat_of_the_sessions_host_is_heard_and_another_host_is_not() {
        let mut session = Session::new(7);
        let ask = |session: &mut Session, number, request| {
            let header = Header { version: PROTOCOL_CURRENT, kind: Kind::Request, id: 1, boot: 7 };
            let call = Call { session: number, request };
            let frame = frame::encode(header, &call).expect("every request fits");
            frame::delimited(&frame).iter().for_each(|byte| session.receive(*byte));
            let incoming = session.next_request();
            let is_new = incoming.is_some();
            if let Some(incoming) = incoming {
                session.answer(incoming, Ok(Response::Accepted));
                session.put_answer();
            }
            (is_new, session.heard())
        };
        assert_eq!(ask(&mut session, 5, Request::OpenSession), (true, 1));
        assert_eq!(ask(&mut session, 5, Request::OpenSession), (false, 2), "a retry");
        assert_eq!(ask(&mut session, 6, Request::OpenSession), (false, 2), "an old id");
        assert_eq!(ask(&mut session, 6, Request::Status), (false, 2));
        assert_eq!(ask(&mut session, 5, Request::Status), (false, 2), "the id of another request");
        let counters = LinkCounters { frames: 5, bad_frames: 0, repeated: 1, stale: 2, overflowed: 0 };
        assert_eq!(session.counters(), counters);
    }
}

//! The link's session: bytes in, requests out; answers in, frames out.
//!
//! A request acts once. Ids only grow, over the whole boot (`ids`); with the last [`REMEMBERED`] requests their
//! answers are remembered: the same again is answered from memory, the same id with another request is refused, and so is
//! everything older. A request also names its host's session: one that belongs to another session than the one that is
//! open is refused, so that of two hosts only the one that came last is heard. Hello belongs to none and changes nothing.
//!
//! What takes long is done in steps, of which a control tick takes one: a frame's bytes come, and it waits; it is looked at and
//! carried out; its answer is put into a frame; that is sent.
//!
//! Answers wait in a queue of their own, so no burst of events can push one out. Where frames and answers together are as many as are promised,
//! a request is not looked at but refused with `QueueFull`; of the refusals only the ids wait, so that there is room for many. A burst that
//! is too long even for that is counted.
//!
//! RAM: about 8 KiB, most of it remembered answers.

mod ids;

use farnear_protocol::frame::{self, Decoder, Encoded, Header, Kind, Packet};
use farnear_protocol::message::{Call, LinkCounters, NO_SESSION, Request, RequestError, Response};
use farnear_protocol::{PROTOCOL_CURRENT, PROTOCOL_MIN};
use heapless::Deque;

use self::ids::Ids;

/// Bytes of a [`Call`] whose request has no fields: the session and the request's number.
const BARE_CALL: usize = 5;
/// Answers remembered for retries.
pub const REMEMBERED: usize = 8;
/// Answers that may wait for the UART: what [`farnear_protocol::message::Hello::outstanding`] promises.
pub const OUTSTANDING: usize = 8;
/// Requests without room that may wait for being told so. At the link's speed 10 small requests arrive in the
/// millisecond in which as many refusals leave: this is several ticks' worth.
const REFUSED: usize = 64;

// A host that repeats the oldest of its outstanding requests must meet its answer.
const _: () = assert!(OUTSTANDING <= REMEMBERED && REMEMBERED <= ids::IDS as usize);

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
    /// The open session's number, or [`NO_SESSION`].
    number: u32,
    ids: Ids,
    /// Requests whose frames are whole, and that nobody has looked at.
    frames: Deque<Packet, OUTSTANDING>,
    /// A request that was carried out, and its answer, not in a frame yet.
    done: Option<(Incoming, Result<Response, RequestError>)>,
    answered: Deque<Answered, REMEMBERED>,
    waiting: Deque<Encoded, OUTSTANDING>,
    refused: Deque<u32, REFUSED>,
    counters: LinkCounters,
    /// Requests of the open session, repeated ones too.
    heard: u32,
}

impl Session {
    /// Whether a host has opened a session since the start.
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

    /// What the link has seen.
    pub(crate) const fn counters(&self) -> LinkCounters {
        self.counters
    }

    /// The largest request id so far.
    pub(crate) const fn last_id(&self) -> u32 {
        self.ids.last()
    }

    /// How often the open session's host was heard: whoever speaks for another session, or for none, does not count.
    pub(crate) const fn heard(&self) -> u32 {
        self.heard
    }

    /// Takes a byte; at the end of a request it waits for [`Self::next_request`].
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
            // A whole frame of another kind is no request either: an echo of what this board sent.
            Some(Ok(_) | Err(_)) => count(&mut self.counters.bad_frames),
        }
    }

    /// Whether a request waits to be looked at.
    pub(crate) fn has_request(&self) -> bool {
        !self.frames.is_empty()
    }

    /// Whether a request to stop waits to be looked at. It has no fields, so its frame is among the shortest, and looking into those costs
    /// next to nothing.
    pub(crate) fn stop_waits(&self) -> bool {
        let short = self.frames.iter().filter(|packet| packet.body.len() == BARE_CALL);
        short
            .filter_map(Packet::message)
            .any(|call: Call| matches!(call.request, Request::Stop | Request::Halt))
    }

    /// Looks at the next request; gives it where it is new and was made for this boot and this session. What it is answered has
    /// room, and so has its refusal.
    pub(crate) fn next_request(&mut self) -> Option<Incoming> {
        let packet = self.frames.pop_front()?;
        let id = packet.header.id;
        match self.admit(&packet) {
            Ok(incoming) => incoming,
            Err(error) => {
                if matches!(error, RequestError::NotInSession | RequestError::IdNotNew { .. }) {
                    count(&mut self.counters.stale);
                }
                // Without being remembered: nothing was done, and the same will be refused again.
                if let Some(reply) = frame::encode(self.header(Kind::Error, id), &error) {
                    let _ = self.waiting.push_back(reply); // not full, see `receive`
                }
                None
            }
        }
    }

    /// A request to be carried out; nothing where it repeats one, whose answer is on its way then.
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

    /// Gives the remembered answer again.
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

    /// Answers a request: with the next [`Self::put_answer`].
    pub(crate) fn answer(&mut self, incoming: Incoming, answer: Result<Response, RequestError>) {
        self.done = Some((incoming, answer));
    }

    /// Whether a step is to be taken for the host.
    pub(crate) fn has_work(&self) -> bool {
        self.has_answer() || self.has_request()
    }

    /// Whether an answer waits to be put into a frame.
    pub(crate) const fn has_answer(&self) -> bool {
        self.done.is_some()
    }

    /// Puts the answer into a frame and remembers it.
    pub(crate) fn put_answer(&mut self) {
        let Some((incoming, answer)) = self.done.take() else { return };
        let reply = match &answer {
            Ok(response) => frame::encode(self.header(Kind::Response, incoming.id), response),
            Err(error) => frame::encode(self.header(Kind::Error, incoming.id), error),
        };
        // Every message fits a frame (the protocol crate tests it).
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

    /// The header of a frame of this boot.
    pub(crate) const fn header(&self, kind: Kind, id: u32) -> Header {
        Header { version: PROTOCOL_CURRENT, kind, id, boot: self.boot }
    }

    /// The next answer to send.
    pub(crate) fn send(&mut self) -> Option<Encoded> {
        if let Some(reply) = self.waiting.pop_front() {
            return Some(reply);
        }
        let id = self.refused.pop_front()?;
        let error = RequestError::QueueFull { outstanding: OUTSTANDING as u8 };
        frame::encode(self.header(Kind::Error, id), &error)
    }

    /// Whether no answers wait to be sent.
    pub(crate) fn all_sent(&self) -> bool {
        let looked_at = self.frames.is_empty() && self.done.is_none();
        looked_at && self.waiting.is_empty() && self.refused.is_empty()
    }
}

fn count(counter: &mut u32) {
    *counter = counter.wrapping_add(1);
}

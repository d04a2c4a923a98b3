//! Decides when virtual time may pass in lockstep: only while the board has an answer, the terminal event of
//! long work or its first event after a reset outstanding, or a motor brakes. Time also stops while the board
//! waits for its host (keep-alive, camera trigger). A run therefore repeats to the byte.
//!
//! The decision uses only frames on the line. A lost request expires after a virtual timeout. A repeat of a
//! request that is still being answered is dropped, because a slow host may time out while time is stopped.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use farnear_protocol::{
    Call, Event, EventKind, Request, Response,
    frame::{Decoder, Kind, Packet},
};

/// An unanswered request expires after this; the board answers within milliseconds.
const ANSWER_NS: u64 = 60_000_000;
/// Limit of long work, above the longest program; in a continuous run it counts from the last frame.
const WORK_NS: u64 = 600_000_000_000;
/// From the answer to the new link rate: one control tick and a margin.
const RATE_NS: u64 = 1_000_000;
pub const BOOT_NS: u64 = 2_000_000_000;
/// Remembered ended requests; more than the board remembers answers.
const ENDED: usize = 256;

#[derive(Debug, Default)]
pub struct Lockstep {
    to_board: Decoder,
    from_board: Decoder,
    /// Unanswered requests in the order of sending. An id may occur twice: the board answers each frame.
    asked: Vec<Asked>,
    running: BTreeMap<u32, u64>,
    /// Ended requests; a repeated answer to one starts nothing.
    ended: VecDeque<u32>,
    /// Virtual time at which the wait for a start after a reset ends.
    starting: Option<u64>,
    boots: BTreeSet<u32>,
    paused: Option<u32>,
    /// The board expects an answer of its host.
    waits_for_host: bool,
}

#[derive(Debug)]
struct Asked {
    id: u32,
    work: Work,
    until_ns: u64,
    body: Vec<u8>,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Work {
    Done,
    /// Ends with a terminal event.
    Long,
    Resume,
    Reset,
    /// Changes the link rate once the answer has left.
    Rate,
}

impl Work {
    /// No wildcard: time would stop for a new request that starts long work.
    fn of(request: &Request) -> Self {
        match request {
            Request::Home { .. }
            | Request::Move { .. }
            | Request::RunProgram { .. }
            | Request::RunContinuously { .. }
            | Request::Calibrate { .. } => Self::Long,
            Request::ResumeProgram => Self::Resume,
            Request::Reboot => Self::Reset,
            Request::SetLinkRate { .. } => Self::Rate,
            Request::Hello
            | Request::OpenSession
            | Request::Status
            | Request::Stop
            | Request::Halt
            | Request::LoadShot { .. }
            | Request::SetLights { .. }
            | Request::SetShotLight { .. }
            | Request::ArmProgram { .. }
            | Request::PauseProgram
            | Request::ReadEvent { .. }
            | Request::ReadAlarm { .. }
            | Request::ClearAlarm { .. }
            | Request::ReadSetting { .. }
            | Request::WriteSetting { .. }
            | Request::ReadCounters
            | Request::Sun(_)
            | Request::OpenCorrection(_)
            | Request::LoadCorrection
            | Request::StoreCorrection
            | Request::PutCoefficients { .. }
            | Request::GetCoefficients { .. }
            | Request::FitSamples { .. }
            | Request::SolveFit
            | Request::PutRow { .. }
            | Request::CorrectRow { .. }
            | Request::GetRow { .. } => Self::Done,
        }
    }
}

impl Lockstep {
    pub fn new() -> Self {
        Self { starting: Some(BOOT_NS), ..Self::default() }
    }

    pub fn sent(&mut self, bytes: &[u8], now_ns: u64) {
        self.host_answered();
        for byte in bytes {
            let Some(Ok(packet)) = self.to_board.push(*byte) else { continue };
            if packet.header.kind == Kind::Request {
                // Anything but a request of this version is only refused.
                let work = packet.message().map_or(Work::Done, |call: Call| Work::of(&call.request));
                let (id, body) = (packet.header.id, packet.body.to_vec());
                let until_ns = now_ns + ANSWER_NS;
                // A later repeat takes the place of its request, which may have been lost.
                self.asked.retain(|old| old.id != id || old.body != body || old.until_ns == until_ns);
                self.asked.push(Asked { id, work, until_ns, body });
            }
        }
    }

    /// Whether this frame repeats an unanswered request.
    pub fn repeats(&self, frame: &[u8]) -> bool {
        let mut decoder = Decoder::new();
        let packets: Vec<Packet> = frame.iter().filter_map(|byte| decoder.push(*byte)?.ok()).collect();
        let [packet] = packets.as_slice() else { return false };
        let id = packet.header.id;
        packet.header.kind == Kind::Request
            && self.asked.iter().any(|asked| asked.id == id && asked.body == packet.body.as_slice())
    }

    /// Removes the oldest request with this id; returns its work.
    fn answered(&mut self, id: u32) -> Option<Work> {
        let at = self.asked.iter().position(|asked| asked.id == id)?;
        Some(self.asked.remove(at).work)
    }

    /// The host has answered or timed out: time may pass.
    pub fn host_answered(&mut self) {
        self.waits_for_host = false;
    }

    pub fn is_asked(&self) -> bool {
        !self.asked.is_empty()
    }

    pub fn waits_for_host(&self) -> bool {
        self.waits_for_host
    }

    pub fn received(&mut self, bytes: &[u8], now_ns: u64) {
        for byte in bytes {
            if let Some(Ok(packet)) = self.from_board.push(*byte) {
                self.packet(&packet, now_ns);
            }
        }
    }

    fn packet(&mut self, packet: &Packet, now_ns: u64) {
        let id = packet.header.id;
        match packet.header.kind {
            Kind::Response => {
                let work = self.answered(id);
                match packet.message::<Response>() {
                    Some(Response::Accepted) if work == Some(Work::Long) && !self.ended.contains(&id) => {
                        self.running.insert(id, now_ns + WORK_NS);
                    }
                    Some(Response::Accepted) if work == Some(Work::Rate) => {
                        self.running.insert(id, now_ns + RATE_NS);
                    }
                    Some(Response::Accepted) if work == Some(Work::Resume) => self.paused = None,
                    Some(Response::Accepted) if work == Some(Work::Reset) => self.reset(now_ns),
                    _ => {}
                }
            }
            Kind::Error => {
                self.answered(id);
            }
            Kind::Event => {
                if let Some(event) = packet.message::<Event>() {
                    self.event(&event, packet.header.boot, now_ns);
                }
            }
            Kind::Request | Kind::Log => {}
        }
    }

    fn event(&mut self, event: &Event, boot: u32, now_ns: u64) {
        let ended = match event.kind {
            EventKind::Started { .. } => {
                // Only a new boot ends the wait: the old started event may be requested again.
                if self.boots.insert(boot) {
                    self.starting = None;
                    self.running.clear();
                }
                return;
            }
            EventKind::StillThere { .. } | EventKind::ShotReady { .. } => {
                self.waits_for_host = true;
                return;
            }
            EventKind::Paused { request, .. } => {
                self.paused = Some(request);
                return;
            }
            EventKind::FrameTaken { request, .. } | EventKind::FrameDropped { request, .. } => {
                if let Some(until_ns) = self.running.get_mut(&request) {
                    *until_ns = now_ns + WORK_NS;
                }
                return;
            }
            _ => match event.kind.ended() {
                Some(request) => request,
                None => return,
            },
        };
        self.running.remove(&ended);
        self.paused = self.paused.filter(|paused| *paused != ended);
        if self.ended.len() == ENDED {
            self.ended.pop_front();
        }
        self.ended.push_back(ended);
    }

    pub fn reset(&mut self, now_ns: u64) {
        self.running.clear();
        self.asked.clear();
        self.ended.clear();
        self.paused = None;
        self.waits_for_host = false;
        // Repeated resets before the start do not extend the timeout.
        self.starting.get_or_insert(now_ns + BOOT_NS);
    }

    pub fn is_busy(&mut self, now_ns: u64) -> bool {
        self.asked.retain(|asked| asked.until_ns > now_ns);
        self.running.retain(|_, until| *until > now_ns);
        self.starting = self.starting.filter(|until| *until > now_ns);
        let runs = self.running.keys().any(|request| Some(*request) != self.paused);
        !self.asked.is_empty() || runs || self.starting.is_some()
    }

    /// Whether the board has ever reported its start.
    pub fn has_started(&self) -> bool {
        !self.boots.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use farnear_protocol::{
        BoardMicros, Micros, Nanometres, PROTOCOL_CURRENT, RequestError,
        frame::{Header, encode},
        message::{Axis, ResetCause},
    };

    use super::*;

    fn frame<T: serde::Serialize>(kind: Kind, id: u32, message: &T) -> Vec<u8> {
        encode(Header { version: PROTOCOL_CURRENT, kind, id, boot: 1 }, message).expect("fits").to_vec()
    }

    fn request(id: u32, request: Request) -> Vec<u8> {
        frame(Kind::Request, id, &Call { session: 1, request })
    }

    fn event(kind: EventKind) -> Vec<u8> {
        frame(Kind::Event, 0, &Event { time: BoardMicros(0), kind })
    }

    fn started() -> Lockstep {
        let mut lockstep = Lockstep::new();
        assert!(lockstep.is_busy(0));
        lockstep.received(&event(EventKind::Started { cause: ResetCause::PowerOn }), 1);
        assert!(!lockstep.is_busy(1));
        lockstep
    }

    #[test]
    fn time_passes_until_a_move_ends_and_a_repeat_adds_nothing() {
        let mut lockstep = started();
        let asked = Nanometres(5);
        let silence = Micros(1_000_000);
        let body = Request::Move { axis: Axis::SensorFine, target: asked, silence };
        let request = request(7, body);
        let accepted = frame(Kind::Response, 7, &Response::Accepted);
        lockstep.sent(&request, 10);
        assert!(lockstep.is_busy(11));
        assert!(lockstep.repeats(&request) && !lockstep.repeats(&accepted));
        lockstep.received(&accepted, 12);
        assert!(!lockstep.repeats(&request), "it was answered");
        assert!(lockstep.is_busy(13) && lockstep.is_busy(ANSWER_NS * 2));
        let done = EventKind::MoveDone { request: 7, axis: Axis::SensorFine, asked, measured: asked };
        lockstep.received(&event(done), 14);
        assert!(!lockstep.is_busy(15));
        lockstep.sent(&request, 20);
        lockstep.received(&accepted, 21);
        assert!(!lockstep.is_busy(22));
    }

    #[test]
    fn a_used_id_and_a_repeat_in_the_same_write_are_answered_each() {
        let mut lockstep = started();
        let body =
            Request::Move { axis: Axis::SensorFine, target: Nanometres(5), silence: Micros(1_000_000) };
        let (request_7, other) = (request(7, body), request(7, Request::Status));
        lockstep.sent(&[request_7.clone(), request_7, other].concat(), 10);
        let accepted = frame(Kind::Response, 7, &Response::Accepted);
        lockstep.received(&accepted, 11);
        assert!(lockstep.is_asked(), "the repeat and the other request are not answered");
        lockstep.received(&accepted, 12);
        lockstep.received(&frame(Kind::Error, 7, &RequestError::IdReused), 13);
        assert!(!lockstep.is_asked());
        assert!(lockstep.is_busy(ANSWER_NS * 2), "the move runs");
    }

    #[test]
    fn time_stops_while_the_board_waits_for_its_host() {
        let mut lockstep = started();
        lockstep.received(&event(EventKind::StillThere { request: 7 }), 5);
        assert!(lockstep.waits_for_host());
        lockstep.sent(&request(8, Request::Status), 5);
        assert!(!lockstep.waits_for_host());
    }

    #[test]
    fn a_paused_program_stops_time_until_it_resumes() {
        let mut lockstep = started();
        let run = Request::RunProgram { silence: Micros(1_000_000) };
        let accepted = |id| frame(Kind::Response, id, &Response::Accepted);
        lockstep.sent(&request(3, run), 0);
        lockstep.received(&accepted(3), 1);
        lockstep.received(&event(EventKind::Paused { request: 3, index: 1 }), 2);
        assert!(!lockstep.is_busy(3));
        lockstep.sent(&request(4, Request::ResumeProgram), 4);
        lockstep.received(&accepted(4), 5);
        assert!(lockstep.is_busy(6));
        lockstep.received(&event(EventKind::ProgramDone { request: 3, exposures: 2 }), 7);
        assert!(!lockstep.is_busy(8));
    }

    #[test]
    fn a_lost_request_times_out() {
        let mut lockstep = started();
        lockstep.sent(&request(1, Request::Status), 0);
        assert!(lockstep.is_busy(ANSWER_NS - 1) && !lockstep.is_busy(ANSWER_NS));
    }

    #[test]
    fn garbage_does_not_keep_time_running() {
        let mut lockstep = started();
        lockstep.sent(&[1, 2, 3, 0, 255, 0], 0);
        assert!(!lockstep.is_busy(1));
    }
}

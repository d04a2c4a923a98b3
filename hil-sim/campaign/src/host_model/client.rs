//! Client half of the protocol: ids, sessions, repeats, keep-alives.

use farnear_protocol::{
    Call, Event, EventKind, PROTOCOL_CURRENT, Request, RequestError, Response,
    frame::{Header, Kind, delimited, encode},
    message::{Failure, NO_SESSION, ProgramState, SettingKey, Status},
};

use farnear_sim::{EmulatedRig, SimError};

/// Board time between polls for an answer or the end of work.
const LOOK_US: u64 = 500;
const WAIT_US: u64 = 2_000;
/// Timeout of an answer, and number of repeats.
const ANSWER_US: u64 = 20_000;
const ATTEMPTS: u32 = 4;
/// Interval of status requests during work.
const STATUS_US: u64 = 300_000;
const WORK_US: u64 = 40_000_000;

pub type Answer = Result<Response, RequestError>;

#[derive(Clone, PartialEq, Debug)]
pub enum Ended {
    Done,
    Failed(Failure),
    /// The board no longer lists it: the event was missed, or the board was reset.
    Gone,
}

#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Counts {
    pub answered: u64,
    /// Long work that ended with and without success.
    pub done: u32,
    pub failed: u32,
    pub alarms: u32,
    pub exposures: u32,
}

pub struct Client {
    pub rig: EmulatedRig,
    pub counts: Counts,
    pub written: Vec<SettingKey>,
    boot: u32,
    session: u32,
    last_id: u32,
    /// Received ends of work that have not been queried.
    ends: Vec<(u32, Ended)>,
    /// A keep-alive request is pending.
    asked: bool,
    answers: Vec<(u32, Answer)>,
}

impl Client {
    pub fn new(rig: EmulatedRig) -> Self {
        Self {
            rig,
            counts: Counts::default(),
            written: Vec::new(),
            boot: 0,
            session: NO_SESSION,
            last_id: 0,
            ends: Vec::new(),
            asked: false,
            answers: Vec::new(),
        }
    }

    fn frame(&self, id: u32, request: &Request) -> Vec<u8> {
        let hello = *request == Request::Hello;
        let boot = if hello { 0 } else { self.boot };
        let session = if hello { NO_SESSION } else { self.session };
        let header = Header { version: PROTOCOL_CURRENT, kind: Kind::Request, id, boot };
        // All requests of a scenario fit; one that did not would not be sent.
        encode(header, &Call { session, request: request.clone() })
            .map(|frame| delimited(&frame).to_vec())
            .unwrap_or_default()
    }

    fn pass(&mut self, micros: u64) -> Result<(), SimError> {
        self.rig.advance_us(micros)?;
        for packet in self.rig.take_frames() {
            match packet.header.kind {
                Kind::Response => {
                    self.answers.extend(packet.message().map(|answer| (packet.header.id, Ok(answer))));
                }
                Kind::Error => {
                    self.answers.extend(packet.message().map(|answer| (packet.header.id, Err(answer))));
                }
                Kind::Event => {
                    if let Some(event) = packet.message::<Event>() {
                        self.receive(&event);
                    }
                }
                Kind::Request | Kind::Log => {}
            }
        }
        Ok(())
    }

    fn receive(&mut self, event: &Event) {
        let mut end = Ended::Done;
        match &event.kind {
            EventKind::StillThere { .. } => self.asked = true,
            EventKind::Alarm(_) => self.counts.alarms += 1,
            EventKind::ShotDone { .. } | EventKind::FrameTaken { .. } => self.counts.exposures += 1,
            EventKind::Failed { reason, .. } => end = Ended::Failed(*reason),
            _ => {}
        }
        let Some(request) = event.kind.ended() else { return };
        match end {
            Ended::Done => self.counts.done += 1,
            Ended::Failed(_) | Ended::Gone => self.counts.failed += 1,
        }
        self.ends.push((request, end));
    }

    /// `None` without an answer. After a reset it joins the new boot without repeating the request.
    pub fn ask(&mut self, request: &Request) -> Result<Option<(u32, Answer)>, SimError> {
        self.last_id += 1;
        let id = self.last_id;
        let frame = self.frame(id, request);
        for _ in 0..ATTEMPTS {
            self.rig.send(&frame)?;
            for _ in 0..ANSWER_US / LOOK_US {
                self.pass(LOOK_US)?;
                let Some(place) = self.answers.iter().position(|(answered, _)| *answered == id) else {
                    continue;
                };
                let (_, answer) = self.answers.swap_remove(place);
                self.answers.clear();
                self.counts.answered += 1;
                if matches!(answer, Err(RequestError::QueueFull { .. })) {
                    break; // not executed: repeat
                }
                if matches!(answer, Err(RequestError::Boot { .. } | RequestError::NotInSession)) {
                    self.join()?;
                }
                if let Err(RequestError::IdNotNew { last }) = answer {
                    self.last_id = self.last_id.max(last);
                }
                return Ok(Some((id, answer)));
            }
        }
        Ok(None)
    }

    /// Returns whether the board answers.
    pub fn join(&mut self) -> Result<bool, SimError> {
        let Some((_, Ok(Response::Hello(hello)))) = self.ask(&Request::Hello)? else { return Ok(false) };
        self.boot = hello.boot;
        self.last_id = self.last_id.max(hello.last_id);
        self.session = self.session.wrapping_add(0x9e37_79b9).max(1);
        self.last_id += 1;
        let id = self.last_id;
        let frame = self.frame(id, &Request::OpenSession);
        for _ in 0..ATTEMPTS {
            self.rig.send(&frame)?;
            for _ in 0..ANSWER_US / LOOK_US {
                self.pass(LOOK_US)?;
                if let Some((_, answer)) = self.answers.iter().find(|(answered, _)| *answered == id) {
                    return Ok(*answer == Ok(Response::Accepted));
                }
            }
        }
        Ok(false)
    }

    pub fn status(&mut self) -> Result<Option<Status>, SimError> {
        Ok(match self.ask(&Request::Status)? {
            Some((_, Ok(Response::Status(status)))) => Some(status),
            _ => None,
        })
    }

    pub fn wait_us(&mut self, micros: u64) -> Result<(), SimError> {
        let mut left_us = micros;
        while left_us > 0 {
            let now_us = left_us.min(WAIT_US);
            self.pass(now_us)?;
            left_us -= now_us;
            if std::mem::take(&mut self.asked) {
                self.status()?;
            }
        }
        Ok(())
    }

    fn take_end(&mut self, id: u32) -> Option<Ended> {
        let place = self.ends.iter().position(|(ended, _)| *ended == id)?;
        Some(self.ends.swap_remove(place).1)
    }

    pub fn wait_for_ends(&mut self, ids: &[u32]) -> Result<Vec<Ended>, SimError> {
        let mut ends: Vec<Option<Ended>> = vec![None; ids.len()];
        let mut waited_us = 0;
        let boot = self.boot;
        while waited_us < WORK_US {
            for (end, id) in ends.iter_mut().zip(ids) {
                if end.is_none() {
                    *end = self.take_end(*id);
                }
            }
            if ends.iter().all(Option::is_some) {
                break;
            }
            self.wait_us(WAIT_US)?;
            waited_us += WAIT_US;
            if waited_us % STATUS_US < WAIT_US {
                let status = self.status()?;
                let still = status.is_some_and(|status| is_at_work(&status, ids));
                if !still || self.boot != boot {
                    break;
                }
            }
        }
        Ok(ends
            .into_iter()
            .zip(ids)
            .map(|(end, id)| end.or_else(|| self.take_end(*id)).unwrap_or(Ended::Gone))
            .collect())
    }
}

fn is_at_work(status: &Status, ids: &[u32]) -> bool {
    let axes = [&status.coarse, &status.fine, &status.lens];
    let on_an_axis = axes.iter().any(|axis| axis.request.is_some_and(|request| ids.contains(&request)));
    on_an_axis || matches!(status.program.state, ProgramState::Running)
}

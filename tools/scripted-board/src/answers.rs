//! Answers of the scripted board.

use farnear_protocol::{
    PROTOCOL_CURRENT, Request, RequestError, Response,
    frame::{Header, Kind, Packet, encode},
    message::{Call, EventKind, Failure, ResetCause},
};
use serde::Serialize;

use crate::Board;

impl Board {
    pub(super) fn answer(&mut self, id: u32, answer: Result<Response, RequestError>) {
        let boot = self.hello.boot;
        let frame = match &answer {
            Ok(response) => frame(boot, Kind::Response, id, response),
            Err(error) => frame(boot, Kind::Error, id, error),
        };
        self.remembered.insert(id, frame);
        self.resend(id);
    }

    pub(super) fn resend(&mut self, id: u32) {
        if self.faults.lose_answers > 0 {
            self.faults.lose_answers -= 1;
            return;
        }
        let frame = self.remembered[&id].clone();
        for _ in 0..1 + u8::from(self.faults.duplicate_answers) {
            self.send(&frame);
        }
    }

    pub(super) fn receive(&mut self, packet: &Packet) {
        if self.faults.lose_requests > 0 {
            self.faults.lose_requests -= 1;
            return;
        }
        let id = packet.header.id;
        if let Some(version) = self.faults.other_version {
            let error = RequestError::Version { min: version, current: version };
            return self.put(Kind::Error, id, &error);
        }
        let Call { session, request } = packet.message().unwrap();
        if request == Request::Hello {
            self.answer(id, Ok(Response::Hello(self.hello.clone())));
            self.remembered.remove(&id);
            return;
        }
        if packet.header.boot != self.hello.boot {
            let error = RequestError::Boot { current: self.hello.boot };
            return self.put(Kind::Error, id, &error);
        }
        if request != Request::OpenSession && session != self.session {
            return self.put(Kind::Error, id, &RequestError::NotInSession);
        }
        if self.remembered.contains_key(&id) {
            return self.resend(id);
        }
        if id <= self.hello.last_id {
            return self.put(Kind::Error, id, &RequestError::IdNotNew { last: self.hello.last_id });
        }
        self.hello.last_id = id;
        if request == Request::OpenSession {
            self.session = session;
            self.remembered.clear();
        }
        self.carry_out(id, request);
    }

    pub(super) fn carry_out(&mut self, id: u32, request: Request) {
        match request {
            Request::Hello => {}
            Request::OpenSession => {
                self.answer(id, Ok(Response::Accepted));
                self.end_by_stop();
            }
            Request::Status => {
                let status = self.status();
                self.braking = self.braking.saturating_sub(1);
                self.answer(id, Ok(Response::Status(status)));
                self.hear_from_host();
            }
            Request::ReadEvent { number } => {
                let next = self.events.len() as u32;
                let answer = match self.events.get(number as usize) {
                    Some(event) if !self.faults.forgetful => Ok(Response::Event(event.clone())),
                    _ => Err(RequestError::EventGone { oldest: next, next }),
                };
                self.answer(id, answer);
            }
            Request::Stop => {
                self.stops += 1;
                self.braking = self.faults.brakes_for;
                self.answer(id, Ok(Response::Accepted));
                self.end_by_stop();
            }
            Request::SetLinkRate { .. } if self.faults.one_rate => {
                self.answer(id, Err(RequestError::Malformed));
            }
            Request::SetLinkRate { .. } if self.faults.busy => {
                self.rate_requests += 1;
                self.answer(id, Err(RequestError::Busy { request: 1 }));
            }
            Request::SetLinkRate { rate } => {
                self.rate_requests += 1;
                self.answer(id, Ok(Response::Accepted));
                self.change_rate(rate);
            }
            Request::Reboot => {
                self.answer(id, Ok(Response::Accepted));
                self.reset(ResetCause::Software);
            }
            Request::Home { .. }
            | Request::Move { .. }
            | Request::RunProgram { .. }
            | Request::RunContinuously { .. }
            | Request::Calibrate { .. } => self.work(id, request),
            Request::LoadShot { .. }
            | Request::ArmProgram { .. }
            | Request::PauseProgram
            | Request::ResumeProgram => self.prepare(id, request),
            other => self.keep(id, other),
        }
    }

    pub(super) fn end_by_stop(&mut self) {
        if let Some((request, _)) = self.active.take() {
            self.event(EventKind::Failed { request, axis: None, reason: Failure::Stopped });
        }
    }
}

pub(super) fn frame<T: Serialize>(boot: u32, kind: Kind, id: u32, message: &T) -> Vec<u8> {
    encode(Header { version: PROTOCOL_CURRENT, kind, id, boot }, message).unwrap().to_vec()
}

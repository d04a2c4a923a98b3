//! Long work: homing, moves and exposure programs, from the request to the event that ends it.
//!
//! Every wait has a deadline computed from the work ([`crate::timing`]); at the deadline, and when the user
//! interrupts, the board is told to stop before the error is returned.

use std::time::{Duration, Instant};

use farnear_protocol::message::{Axis, EventKind, Shot, ShotRecord};
use farnear_protocol::units::Nanometres;
use farnear_protocol::{Event, Request, Response};

use crate::client::{Client, nonsense};
use crate::describe::{axis_name, um};
use crate::error::ClientError;
use crate::timing::{homing_time, move_time, program_time};

/// Longest wait for a reset board to answer again.
const RESTART: Duration = Duration::from_secs(5);

/// How a move ended.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Moved {
    /// Where the axis was sent.
    pub asked: Nanometres,
    /// Where its encoder or gauge says it is.
    pub measured: Nanometres,
}

impl Client {
    /// Homes an axis. Gives how far the encoder's old zero was from the new one.
    pub fn home(&mut self, axis: Axis) -> Result<Nanometres, ClientError> {
        let during = format!("homing the {}", axis_name(axis));
        let work = homing_time(&self.hello().limits);
        match self.carry_out(&Request::Home { axis }, work, &during, &mut |_| Ok(()))? {
            EventKind::Homed { shift, .. } => Ok(shift),
            other => Err(wrong_end(&during, &other)),
        }
    }

    /// Moves an axis to an absolute position.
    pub fn move_to(&mut self, axis: Axis, target: Nanometres) -> Result<Moved, ClientError> {
        let during = format!("moving the {} to {:.3} um", axis_name(axis), um(target));
        let status = self.status()?;
        let distance = match axis {
            Axis::SensorCoarse => status.coarse.measured.0.abs_diff(target.0),
            Axis::SensorFine => 0,
        };
        let work = move_time(u64::from(distance));
        match self.carry_out(&Request::Move { axis, target }, work, &during, &mut |_| Ok(()))? {
            EventKind::MoveDone { asked, measured, .. } => Ok(Moved { asked, measured }),
            other => Err(wrong_end(&during, &other)),
        }
    }

    /// Stops all motion and ends a running program.
    pub fn stop(&mut self) -> Result<(), ClientError> {
        self.expect_accepted(&Request::Stop, "stopping").map(|_| ())
    }

    /// Loads and runs an exposure program. `on_shot` is called for each exposure as soon as the board tells of
    /// it; an error from it stops the board and is returned.
    pub fn run_program<E: From<ClientError>>(
        &mut self,
        shots: &[Shot],
        mut on_shot: impl FnMut(&ShotRecord) -> Result<(), E>,
    ) -> Result<u16, E> {
        let during = "running the exposure program";
        for (index, shot) in shots.iter().enumerate() {
            let request = Request::LoadShot { index: index as u8, shot: *shot };
            self.expect_accepted(&request, &format!("loading shot {index}"))?;
        }
        let mut at = self.status()?.coarse.measured;
        let mut way = 0;
        for shot in shots.iter().filter(|shot| shot.axis == Axis::SensorCoarse) {
            way += u64::from(at.0.abs_diff(shot.target.0));
            at = shot.target;
        }
        let mut refused = None;
        let request = Request::RunProgram { shots: shots.len() as u8 };
        let end = self.carry_out(&request, program_time(shots, way), during, &mut |event| {
            if let EventKind::ShotDone { shot, .. } = event {
                on_shot(shot).map_err(|error| refused = Some(error))?;
            }
            Ok(())
        });
        match (refused, end) {
            (Some(error), _) => Err(error),
            (None, Ok(EventKind::ProgramDone { exposures, .. })) => Ok(exposures),
            (None, Ok(other)) => Err(wrong_end(during, &other).into()),
            (None, Err(error)) => Err(error.into()),
        }
    }

    /// Resets the board and says hello to it again.
    pub fn reboot(&mut self) -> Result<(), ClientError> {
        let during = "rebooting";
        let before = self.hello().boot;
        match self.expect_accepted(&Request::Reboot, during) {
            // The answer was lost and a retry met the next boot: it has rebooted.
            Ok(_) | Err(ClientError::Reset { .. }) => {}
            Err(error) => return Err(error),
        }
        let until = Instant::now() + self.timing().allowance(RESTART);
        loop {
            let opened = self.reopen();
            if opened.is_ok() && self.hello().boot != before {
                return Ok(());
            }
            if Instant::now() >= until {
                opened?;
                return Err(ClientError::Overdue { during: during.into(), allowed: RESTART });
            }
        }
    }

    fn expect_accepted(&mut self, request: &Request, during: &str) -> Result<u32, ClientError> {
        match self.request(request, during)? {
            (id, Response::Accepted) => Ok(id),
            (_, other) => Err(nonsense(during, &other)),
        }
    }

    /// Sends a request that starts work and waits for the event that ends it; `on_event` sees the events in
    /// between and may break off, whereupon the board is stopped.
    fn carry_out(
        &mut self,
        request: &Request,
        work: Duration,
        during: &str,
        on_event: &mut dyn FnMut(&EventKind) -> Result<(), ()>,
    ) -> Result<EventKind, ClientError> {
        if self.interrupted() {
            return Err(ClientError::Interrupted { during: during.into() });
        }
        let id = self.expect_accepted(request, during)?;
        let allowed = self.timing().allowance(work);
        let mut until = Instant::now() + allowed;
        let mut poll = Instant::now() + self.timing().poll;
        loop {
            if self.interrupted() {
                self.stop()?;
                return Err(ClientError::Interrupted { during: during.into() });
            }
            let now = Instant::now();
            if now >= until {
                self.stop()?;
                return Err(ClientError::Overdue { during: during.into(), allowed });
            }
            let wait = poll.min(until).saturating_duration_since(now);
            if let Some((_, event)) = self.next_event(wait, during)? {
                poll = Instant::now() + self.timing().poll;
                match end_of(id, event) {
                    Ending::Done(kind) => return Ok(kind),
                    Ending::Failed(axis, reason) => {
                        return Err(ClientError::Failed { during: during.into(), axis, reason });
                    }
                    Ending::NotYet(kind) => {
                        let begin = Instant::now();
                        if on_event(&kind).is_err() {
                            self.stop()?;
                            return Err(ClientError::Interrupted { during: during.into() });
                        }
                        // Time that the caller took, for fetching an image say, is not the board's.
                        until += begin.elapsed();
                        poll += begin.elapsed();
                    }
                }
            } else if Instant::now() >= poll {
                poll = Instant::now() + self.timing().poll;
                self.look_for_lost_events(id, during)?;
            }
        }
    }

    /// After a silence: an event that got lost is fetched. Where the board is not working on the request any
    /// more and no event is left, its end is unknown.
    fn look_for_lost_events(&mut self, id: u32, during: &str) -> Result<(), ClientError> {
        let status = self.status()?;
        if self.has_event_waiting() {
            return Ok(());
        }
        if status.next_event > self.due_event() {
            return self.fetch_due_event(during);
        }
        if status.active == Some(id) {
            return Ok(());
        }
        Err(ClientError::NoEnd { during: during.into() })
    }
}

enum Ending {
    Done(EventKind),
    Failed(Option<Axis>, farnear_protocol::message::Failure),
    NotYet(EventKind),
}

fn end_of(id: u32, event: Event) -> Ending {
    match event.kind {
        EventKind::Failed { request, axis, reason } if request == id => Ending::Failed(axis, reason),
        EventKind::Homed { request, .. }
        | EventKind::MoveDone { request, .. }
        | EventKind::ProgramDone { request, .. }
            if request == id =>
        {
            Ending::Done(event.kind)
        }
        kind => Ending::NotYet(kind),
    }
}

fn wrong_end(during: &str, kind: &EventKind) -> ClientError {
    ClientError::Nonsense { during: during.into(), answer: format!("{kind:?}") }
}

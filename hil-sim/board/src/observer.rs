//! Records a run for the invariants of a campaign; frames are recorded before line faults.

use farnear_protocol::{
    Call, Event, EventKind, RequestError, Response,
    frame::{Decoder, Kind, Packet},
    message::ProgramState,
};

use crate::{
    faults::Moment,
    plant::{Plant, StageName},
    wiring::{Burst, Shot},
};

#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Truth {
    /// Sensor stage, from its true home edge.
    pub coarse_um: f64,
    pub lens_um: f64,
    pub piezo_um: f64,
    /// Microsteps against a hard stop, per stage.
    pub pressed: [u64; 2],
    /// Largest step of the piezo's command so far.
    pub piezo_step_um: f64,
}

impl Truth {
    pub fn of(plant: &Plant) -> Self {
        let (sensor, lens) = (plant.stage(StageName::Sensor), plant.stage(StageName::Lens));
        Self {
            coarse_um: sensor.position_um(),
            lens_um: lens.position_um(),
            piezo_um: plant.piezo().position_um(),
            pressed: [sensor.pressed(), lens.pressed()],
            piezo_step_um: plant.piezo().largest_step_um(),
        }
    }
}

#[derive(Clone, PartialEq, Debug)]
pub enum Seen {
    Asked {
        id: u32,
        boot: u32,
        call: Call,
    },
    Answered {
        id: u32,
        boot: u32,
        answer: Box<Result<Response, RequestError>>,
        /// Positions at that time.
        truth: Truth,
    },
    Reported {
        number: u32,
        boot: u32,
        event: Box<Event>,
        truth: Truth,
    },
    /// A burst of STEP pulses that ended 20 ms ago.
    Stepped(Burst),
    Exposed(Shot),
    Reset,
    Powered(bool),
    Happened {
        what: &'static str,
        reverts: bool,
    },
    /// All faults are reverted; later requests must succeed.
    Healed,
}

#[derive(Clone, PartialEq, Debug)]
pub struct Sight {
    pub at_ns: u64,
    pub seen: Seen,
}

#[derive(Default)]
pub struct Observer {
    keeps: bool,
    to_board: Decoder,
    from_board: Decoder,
    sights: Vec<Sight>,
    /// Boot of the last start.
    boot: Option<u32>,
    next_exposure: Option<u32>,
}

impl Observer {
    /// `keeps` records observations; otherwise only moments are reported.
    pub fn new(keeps: bool) -> Self {
        Self { keeps, ..Self::default() }
    }

    pub fn note(&mut self, at_ns: u64, seen: Seen) {
        if self.keeps {
            self.sights.push(Sight { at_ns, seen });
        }
    }

    pub fn take(&mut self) -> Vec<Sight> {
        std::mem::take(&mut self.sights)
    }

    /// Bytes sent to the board; returns the number of requests in them.
    pub fn sent(&mut self, at_ns: u64, bytes: &[u8]) -> usize {
        let mut requests = 0;
        for byte in bytes {
            let Some(Ok(packet)) = self.to_board.push(*byte) else { continue };
            if packet.header.kind == Kind::Request
                && let Some(call) = packet.message::<Call>()
            {
                requests += 1;
                let (id, boot) = (packet.header.id, packet.header.boot);
                self.note(at_ns, Seen::Asked { id, boot, call });
            }
        }
        requests
    }

    /// Bytes received from the board; returns the moments in them.
    pub fn received(&mut self, at_ns: u64, bytes: &[u8], truth: Truth) -> Vec<Moment> {
        let mut moments = Vec::new();
        for byte in bytes {
            let Some(Ok(packet)) = self.from_board.push(*byte) else { continue };
            if let Some((moment, seen)) = read(&packet, truth) {
                if moment == Some(Moment::Started) {
                    self.boot = Some(packet.header.boot);
                }
                // Frames of the boot before may still be under way.
                if self.boot == Some(packet.header.boot) {
                    self.next_exposure = next_exposure(&seen).or(self.next_exposure);
                }
                moments.extend(moment);
                self.note(at_ns, seen);
            }
        }
        moments
    }

    /// The board's number of its next exposure, if it has reported one since the last call.
    pub fn take_next_exposure(&mut self) -> Option<u32> {
        self.next_exposure.take()
    }

    /// Drops the unfinished frame.
    pub fn reset(&mut self) {
        self.from_board = Decoder::new();
        (self.boot, self.next_exposure) = (None, None);
    }
}

fn next_exposure(seen: &Seen) -> Option<u32> {
    match seen {
        Seen::Reported { event, .. } => match &event.kind {
            EventKind::ShotReady { trigger_number, .. } => Some(trigger_number.wrapping_add(1)),
            EventKind::ShotDone { shot, .. } | EventKind::FrameTaken { shot, .. } => {
                Some(shot.trigger_number.wrapping_add(1))
            }
            _ => None,
        },
        Seen::Answered { answer, .. } => match &**answer {
            // Otherwise the pulse of the last exposure may be still to come.
            Ok(Response::Status(status))
                if matches!(status.program.state, ProgramState::Idle | ProgramState::Armed) =>
            {
                Some(status.triggers)
            }
            _ => None,
        },
        _ => None,
    }
}

fn read(packet: &Packet, truth: Truth) -> Option<(Option<Moment>, Seen)> {
    let (id, boot) = (packet.header.id, packet.header.boot);
    let answer = match packet.header.kind {
        Kind::Response => Ok(packet.message()?),
        Kind::Error => Err(packet.message()?),
        Kind::Event => {
            let event: Event = packet.message()?;
            let moment = match event.kind {
                EventKind::Started { .. } => Some(Moment::Started),
                EventKind::Homed { .. } => Some(Moment::Homed),
                EventKind::MoveDone { .. } => Some(Moment::MoveDone),
                EventKind::Alarm(_) => Some(Moment::Alarm),
                _ => None,
            };
            return Some((moment, Seen::Reported { number: id, boot, event: event.into(), truth }));
        }
        Kind::Request | Kind::Log => return None,
    };
    Some((Some(Moment::Answer), Seen::Answered { id, boot, answer: answer.into(), truth }))
}

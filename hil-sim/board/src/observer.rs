//! Sees everything in a run: what crosses the line (as the board said it, before the line could spoil it), where the
//! mechanics really are when it does, each burst of STEP pulses, each exposure, each reset, each injected fault. The invariants
//! of a campaign (`farnear-campaign`) compare them.

use farnear_protocol::{
    Call, Event, EventKind, RequestError, Response,
    frame::{Decoder, Kind, Packet},
};

use crate::{
    faults::Moment,
    plant::{Plant, StageName},
    wiring::{Burst, Shot},
};

/// Where the mechanics are.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Truth {
    /// The sensor's stage, micrometres from its true home edge.
    pub coarse_um: f64,
    /// The lens' stage likewise.
    pub lens_um: f64,
    /// The piezo, micrometres.
    pub piezo_um: f64,
    /// Microsteps against a hard stop so far: the sensor's stage, the lens'.
    pub pressed: [u64; 2],
}

impl Truth {
    pub fn of(plant: &Plant) -> Self {
        let (sensor, lens) = (plant.stage(StageName::Sensor), plant.stage(StageName::Lens));
        Self {
            coarse_um: sensor.position_um(),
            lens_um: lens.position_um(),
            piezo_um: plant.piezo().position_um(),
            pressed: [sensor.pressed(), lens.pressed()],
        }
    }
}

/// Something that was seen.
#[derive(Clone, PartialEq, Debug)]
pub enum Seen {
    /// A good frame with a request goes on the line to the board.
    Asked {
        id: u32,
        /// The boot that it is for.
        boot: u32,
        /// The request, with its session.
        call: Call,
    },
    /// The board has given an answer.
    Answered {
        id: u32,
        boot: u32,
        answer: Box<Result<Response, RequestError>>,
        /// Where everything was then.
        truth: Truth,
    },
    /// The board has told of an event.
    Told {
        number: u32,
        boot: u32,
        event: Box<Event>,
        /// Where everything was then.
        truth: Truth,
    },
    /// A motor was given pulses, the last of them 20 ms ago.
    Stepped(Burst),
    /// The camera has taken a picture.
    Exposed(Shot),
    Reset,
    /// Its power went, or came back.
    Powered(bool),
    /// Something happened to the rig, or was taken back.
    Happened {
        what: &'static str,
        mends: bool,
    },
    /// Everything is mended; what comes now has to work.
    Healed,
}

/// Something that was seen, and when.
#[derive(Clone, PartialEq, Debug)]
pub struct Sight {
    /// Virtual time, nanoseconds.
    pub at_ns: u64,
    pub seen: Seen,
}

#[derive(Default)]
pub struct Observer {
    keeps: bool,
    to_board: Decoder,
    from_board: Decoder,
    sights: Vec<Sight>,
}

impl Observer {
    /// One that keeps what it sees, or only tells of moments.
    pub fn new(keeps: bool) -> Self {
        Self { keeps, ..Self::default() }
    }

    pub fn note(&mut self, at_ns: u64, seen: Seen) {
        if self.keeps {
            self.sights.push(Sight { at_ns, seen });
        }
    }

    /// What was seen since the last call.
    pub fn take(&mut self) -> Vec<Sight> {
        std::mem::take(&mut self.sights)
    }

    /// Bytes go on the line to the board; gives how many requests are among them.
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

    /// Bytes have come from the board; gives the moments that they are.
    pub fn received(&mut self, at_ns: u64, bytes: &[u8], truth: Truth) -> Vec<Moment> {
        let mut moments = Vec::new();
        for byte in bytes {
            let Some(Ok(packet)) = self.from_board.push(*byte) else { continue };
            if let Some((moment, seen)) = read(&packet, truth) {
                moments.extend(moment);
                self.note(at_ns, seen);
            }
        }
        moments
    }

    /// The board was reset: what it was saying is cut off.
    pub fn reset(&mut self) {
        self.from_board = Decoder::new();
    }
}

/// What a frame from the board is.
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
            return Some((moment, Seen::Told { number: id, boot, event: event.into(), truth }));
        }
        Kind::Request | Kind::Log => return None,
    };
    Some((Some(Moment::Answer), Seen::Answered { id, boot, answer: answer.into(), truth }))
}

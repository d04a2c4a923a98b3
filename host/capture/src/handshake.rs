//! Hello: who is there, and which protocol version both speak; and the session that follows.

use std::time::Duration;

use farnear_protocol::{
    PROTOCOL_CURRENT, PROTOCOL_MIN, Request, RequestError, Response,
    frame::{Kind, Packet},
    message::{Hello, SCHEMA_KEY},
};

use crate::{error::ClientError, link::Link, timing::Timing};

/// How often hello is asked, the wait doubling each time from [`Timing::REAL`]'s: 3 s altogether. The board
/// may still be starting, and whether it is an emulated one is not known yet.
const ATTEMPTS: u32 = 6;
const DURING: &str = "asking the board who it is";
/// The session of an emulated board: a number drawn at random would make the run another one. Two programs that use it one
/// after the other are told apart by their request ids.
const EMULATED_SESSION: u32 = 0x5eed_0001;

/// Cleans the line, asks who is there and agrees on a version. A board that is known to be emulated is given its
/// own time: hello asked twice, because this computer is slow, would make the run another one.
pub(crate) fn shake_hands(link: &mut Link, known_emulated: bool) -> Result<(Hello, u8), ClientError> {
    link.drain(DURING)?;
    let waits: Vec<Duration> = if known_emulated {
        vec![Timing::EMULATED.reply; Timing::EMULATED.retries as usize + 1]
    } else {
        (0..ATTEMPTS).map(|attempt| Timing::REAL.reply * (1 << attempt)).collect()
    };
    // Events of this boot are not lost by being passed over here: the status that follows tells where their
    // numbers stand.
    let (_, packet) = link.ask((PROTOCOL_CURRENT, 0), &Request::Hello, &waits, DURING, &mut |_| Ok(()))?;
    let hello = read_answer(&packet)?;
    let version = agree(&hello)?;
    Ok((hello, version))
}

/// Opens a session: what another host had begun on this board ends, and its requests are refused from now on.
pub(crate) fn open_session(link: &mut Link, (hello, version): (&Hello, u8)) -> Result<(), ClientError> {
    let during = "opening a session";
    let number = if hello.emulated { EMULATED_SESSION } else { random_session() };
    link.begin_session(number, hello.last_id);
    let timing = if hello.emulated { Timing::EMULATED } else { Timing::REAL };
    let waits = vec![timing.reply; timing.retries as usize + 1];
    let address = (version, hello.boot);
    // What the events say of the session before is nobody's business here.
    let (_, packet) = link.ask(address, &Request::OpenSession, &waits, during, &mut |_| Ok(()))?;
    if packet.header.kind == Kind::Response {
        return Ok(());
    }
    let during = during.into();
    Err(match packet.message() {
        // It was reset between hello and this.
        Some(RequestError::Boot { current }) => {
            ClientError::Reset { during, was: hello.boot, now: current, cause: None }
        }
        Some(error) => ClientError::Refused { during, error },
        None => ClientError::Nonsense { during, answer: format!("{:02x?}", packet.body.as_slice()) },
    })
}

/// A number that no other host has: 0 means none.
fn random_session() -> u32 {
    // Where the system has no random numbers, the process and the time tell hosts apart as well.
    let chance = getrandom::u32().unwrap_or_else(|_| {
        let now = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).unwrap_or_default();
        std::process::id() ^ now.subsec_nanos()
    });
    chance.max(1)
}

fn read_answer(packet: &Packet) -> Result<Hello, ClientError> {
    let nonsense = |answer: String| ClientError::Nonsense { during: DURING.into(), answer };
    let unreadable = || {
        nonsense(format!(
            "{} bytes in protocol {} that this farnear cannot read; flash the firmware built from the same sources",
            packet.body.len(),
            packet.header.version
        ))
    };
    if packet.header.kind == Kind::Error {
        return Err(match packet.message() {
            Some(RequestError::Version { min, current }) => version_error(min, current),
            Some(error) => ClientError::Refused { during: DURING.into(), error },
            None => unreadable(),
        });
    }
    match packet.message() {
        Some(Response::Hello(hello)) => Ok(hello),
        Some(other) => Err(nonsense(format!("{other:?}"))),
        None => Err(unreadable()),
    }
}

/// The version to talk in: the newest that both know. The schema key is that of the board's newest version,
/// so it can be compared where that is this program's too.
fn agree(hello: &Hello) -> Result<u8, ClientError> {
    let version = hello.protocol_current.min(PROTOCOL_CURRENT);
    if version < hello.protocol_min || version < PROTOCOL_MIN {
        return Err(version_error(hello.protocol_min, hello.protocol_current));
    }
    if hello.protocol_current == PROTOCOL_CURRENT && hello.schema_key != SCHEMA_KEY {
        return Err(ClientError::Schema {
            version,
            firmware: hello.firmware.as_str().into(),
            host: env!("CARGO_PKG_VERSION"),
            board_key: hello.schema_key,
            host_key: SCHEMA_KEY,
        });
    }
    Ok(version)
}

fn version_error(board_min: u8, board_current: u8) -> ClientError {
    ClientError::Version { board_min, board_current, host_min: PROTOCOL_MIN, host_current: PROTOCOL_CURRENT }
}

//! Hello, protocol version and session.

use std::time::Duration;

use farnear_protocol::{
    PROTOCOL_CURRENT, PROTOCOL_MIN, Request, RequestError, Response,
    frame::{Kind, Packet},
    message::{Hello, LinkRate, SCHEMA_KEY},
};

use crate::{error::ClientError, link::Link, timing::Timing};

/// Timeouts of hello, 3 s in total: at the link's rate, at its other rates, and once more for a board that is starting or
/// emulated, the longest at the rate after a reset.
const FIRST_MS: [u64; 4] = [50, 100, 200, 400];
const OTHER_RATE_MS: [u64; 2] = [50, 50];
const LAST_MS: [[u64; 1]; 2] = [[800], [1500]];
const DURING: &str = "asking the board who it is";
/// Fixed session of an emulated board: a random one would change the run. Programs differ by request ids.
const EMULATED_SESSION: u32 = 0x5eed_0001;

/// Drains the line, identifies the board, selects a version. Emulated: long timeout, as a repeat changes the run.
pub(crate) fn shake_hands(link: &mut Link, known_emulated: bool) -> Result<(Hello, u8), ClientError> {
    link.drain(DURING)?;
    let millis = |waits: &[u64]| waits.iter().map(|ms| Duration::from_millis(*ms)).collect::<Vec<_>>();
    let (first, other, last) = if known_emulated {
        let patient = Timing::EMULATED.reply;
        (vec![patient; Timing::EMULATED.retries as usize + 1], vec![patient], [Vec::new(), Vec::new()])
    } else {
        (millis(&FIRST_MS), millis(&OTHER_RATE_MS), LAST_MS.map(|waits| millis(&waits)))
    };
    let present = link.rate();
    let others = LinkRate::ALL.into_iter().filter(|rate| *rate != present).map(|rate| (rate, other.clone()));
    let rounds = std::iter::once((present, first))
        .chain(others)
        .chain([present, LinkRate::START].into_iter().zip(last));
    let packet = say_hello(link, rounds)?;
    let hello = read_answer(&packet)?;
    let version = agree(&hello)?;
    Ok((hello, version))
}

/// Tries these timeouts at one rate after the other; the rate that is answered becomes the link's.
fn say_hello(
    link: &mut Link,
    rounds: impl Iterator<Item = (LinkRate, Vec<Duration>)>,
) -> Result<Packet, ClientError> {
    let mut silent: Option<ClientError> = None;
    for (rate, waits) in rounds {
        link.set_rate(rate, DURING)?;
        // Skipped events are not lost: the following status has their number.
        match link.ask((PROTOCOL_CURRENT, 0), &Request::Hello, &waits, DURING, &mut |_| Ok(())) {
            Ok((_, packet)) => return Ok(packet),
            Err(error @ ClientError::Silent { .. }) => silent = Some(both(silent, error)),
            Err(error) => return Err(error),
        }
    }
    Err(silent.unwrap_or_else(|| ClientError::Nonsense { during: DURING.into(), answer: "no rate".into() }))
}

fn both(before: Option<ClientError>, now: ClientError) -> ClientError {
    match (before, now) {
        (
            Some(ClientError::Silent { attempts: a, waited: w, bad_frames: f, bytes: b, .. }),
            ClientError::Silent { port, during, attempts, waited, bad_frames, bytes },
        ) => ClientError::Silent {
            port,
            during,
            attempts: attempts + a,
            waited: waited + w,
            bad_frames: bad_frames + f,
            bytes: bytes + b,
        },
        (_, now) => now,
    }
}

/// Opens a session: another host's work ends and its requests are refused.
pub(crate) fn open_session(link: &mut Link, (hello, version): (&Hello, u8)) -> Result<(), ClientError> {
    let during = "opening a session";
    let number = if hello.emulated { EMULATED_SESSION } else { random_session() };
    link.begin_session(number, hello.last_id);
    let timing = if hello.emulated { Timing::EMULATED } else { Timing::REAL };
    let waits = vec![timing.reply; timing.retries as usize + 1];
    let address = (version, hello.boot);
    // Events of the previous session are ignored.
    let (_, packet) = link.ask(address, &Request::OpenSession, &waits, during, &mut |_| Ok(()))?;
    if packet.header.kind == Kind::Response {
        return Ok(());
    }
    let during = during.into();
    Err(match packet.message() {
        // The board was reset in between.
        Some(RequestError::Boot { current }) => {
            ClientError::Reset { during, was: hello.boot, now: current, cause: None }
        }
        Some(error) => ClientError::Refused { during, error },
        None => ClientError::Nonsense { during, answer: format!("{:02x?}", packet.body.as_slice()) },
    })
}

fn random_session() -> u32 {
    // Fallback without system random numbers: process id and time.
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

/// The newest common version. The schema key is compared only if the board's newest version equals this program's.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn silence_at_several_rates_is_added_up() {
        let silent = |attempts, seconds, bad_frames, bytes| ClientError::Silent {
            port: "port".into(),
            during: DURING.into(),
            attempts,
            waited: Duration::from_secs(seconds),
            bad_frames,
            bytes,
        };
        let sum = both(Some(silent(2, 1, 3, 5)), silent(4, 7, 11, 13));
        let ClientError::Silent { attempts, waited, bad_frames, bytes, .. } = sum else { panic!("{sum:?}") };
        assert_eq!((attempts, waited, bad_frames, bytes), (6, Duration::from_secs(8), 14, 18));
        assert!(matches!(both(None, silent(2, 1, 3, 5)), ClientError::Silent { attempts: 2, .. }));
    }
}

//! Changes the link rate, with fallback to the old one.

use std::{thread::sleep, time::Duration};

use farnear_protocol::{
    Request, RequestError, Response,
    frame::Kind,
    message::{LINK_TRIAL, LinkRate},
};

use crate::{error::ClientError, link::Link, owner::nonsense, timing::Timing};

const DURING: &str = "changing the link's rate";
/// From the answer to the new rate: one control tick and the adapter's latency.
const CHANGE: Duration = Duration::from_millis(20);
/// Polls and their interval while another host's motion brakes.
const LOOKS: u32 = 20;
const LOOK: Duration = Duration::from_millis(100);

/// Changes the link rate. Keeps the old rate if the request is unknown, the board moves, or it is silent at the new one.
pub(crate) fn change(
    link: &mut Link,
    address: (u8, u32),
    wanted: LinkRate,
    timing: Timing,
) -> Result<(), ClientError> {
    let kept = link.rate();
    if wanted == kept {
        return Ok(());
    }
    let waits = vec![timing.reply; timing.retries as usize + 1];
    if !is_granted(link, address, wanted, &waits)? {
        return Ok(());
    }
    sleep(CHANGE);
    link.set_rate(wanted, DURING)?;
    match link.ask(address, &Request::Status, &waits, DURING, &mut |_| Ok(())) {
        Err(ClientError::Silent { .. }) => {}
        other => return other.map(|_| ()),
    }
    link.set_rate(kept, DURING)?;
    sleep(Duration::from_micros(u64::from(LINK_TRIAL.0)));
    link.ask(address, &Request::Status, &waits, DURING, &mut |_| Ok(())).map(|_| ())
}

/// Whether the board accepts; `false` if it does not know the request, or if its motion does not end.
fn is_granted(
    link: &mut Link,
    address: (u8, u32),
    rate: LinkRate,
    waits: &[Duration],
) -> Result<bool, ClientError> {
    for look in 1.. {
        let request = Request::SetLinkRate { rate };
        let (_, packet) = link.ask(address, &request, waits, DURING, &mut |_| Ok(()))?;
        let during = || DURING.to_owned();
        if packet.header.kind == Kind::Response {
            return match packet.message() {
                Some(Response::Accepted) => Ok(true),
                Some(other) => Err(nonsense(DURING, &other)),
                None => {
                    Err(ClientError::Nonsense { during: during(), answer: "an unreadable answer".into() })
                }
            };
        }
        match packet.message() {
            Some(RequestError::Busy { .. }) if look < LOOKS => sleep(LOOK),
            Some(RequestError::Malformed | RequestError::Busy { .. }) => return Ok(false),
            Some(error) => return Err(ClientError::Refused { during: during(), error }),
            None => {
                return Err(ClientError::Nonsense { during: during(), answer: "an unreadable error".into() });
            }
        }
    }
    Ok(false)
}

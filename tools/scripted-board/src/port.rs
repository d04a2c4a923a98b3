//! The scripted board behind a pseudo-terminal.

use std::{
    fs::File,
    io::{Read, Write},
    thread,
    time::Duration,
};

use farnear_capture::Transport;
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};

use crate::{Faults, Peer};

/// Puts a scripted board behind a pseudo-terminal; returns its name. [`crate::Board::gone`] closes the port.
pub fn plug_in(faults: Faults) -> (String, Peer) {
    // Not serialport's pair: programs started by tests would inherit its ends and keep the line open.
    let far_end = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC).expect("a pty");
    grantpt(&far_end).and_then(|()| unlockpt(&far_end)).expect("a pty");
    let port = ptsname(&far_end, Vec::new()).expect("a pty's name").into_string().expect("a plain name");
    let near_end = File::options().read(true).write(true).open(&port).expect("the other end");
    let mut far_end = File::from(far_end);
    let peer = Peer::new(faults);
    let mut board = peer.connection();
    thread::spawn(move || {
        let _near_end = near_end; // held, so that clients may come and go
        let mut bytes = [0; 512];
        while let Ok(count) = far_end.read(&mut bytes) {
            if board.send(&bytes[..count], Duration::ZERO).is_err() {
                return;
            }
            loop {
                match board.receive(&mut bytes, Duration::ZERO) {
                    Ok(0) => break,
                    Ok(count) => far_end.write_all(&bytes[..count]).expect("a line"),
                    Err(_) => return, // unplugged
                }
            }
        }
    });
    (port, peer)
}

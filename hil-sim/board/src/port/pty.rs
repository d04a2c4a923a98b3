use std::{
    io::{self, Read, Write},
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
        mpsc::Receiver,
    },
};

use serialport::{SerialPort, TTYPort};

use super::{End, LOOK, PATIENCE, read, spawn};
use crate::{command::Command, error::SimError};

struct Master(TTYPort);

impl Read for Master {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.0.read(buffer)
    }
}

impl End for Master {
    /// The client's rate can be read at this end of a pty.
    fn baud(&self) -> Option<u32> {
        self.0.baud_rate().ok()
    }

    fn survives(&self, _: &io::Error) -> bool {
        true
    }
}

pub(super) fn open(
    to_client: Receiver<Vec<u8>>,
    from_client: impl Fn(Command) -> bool + Send + 'static,
) -> Result<String, SimError> {
    let (mut writer, slave) = TTYPort::pair()?;
    let name = slave.name().unwrap_or_default();
    let mut reader = Master(writer.try_clone_native()?);
    reader.0.set_timeout(LOOK)?;
    writer.set_timeout(PATIENCE)?;
    let unplugged = Arc::new(AtomicBool::new(false));
    let seen = unplugged.clone();
    spawn("port out", move || {
        for bytes in to_client {
            // Without a reader the bytes are lost.
            let _ = writer.write_all(&bytes);
        }
        unplugged.store(true, Ordering::Relaxed);
        // Kept open so that clients may reconnect.
        drop(slave);
    })?;
    spawn("port in", move || read(&mut reader, &seen, &from_client))?;
    Ok(name)
}

#[cfg(test)]
mod tests {
    use std::{sync::mpsc::channel, thread};

    use super::*;

    #[test]
    fn bytes_written_together_stay_together() {
        let (mut client, port) = TTYPort::pair().expect("a pty");
        let mut port = Master(port);
        port.0.set_timeout(LOOK).expect("a timeout");
        let (heard, commands) = channel();
        let unplugged = Arc::new(AtomicBool::new(false));
        let seen = unplugged.clone();
        let reader = thread::spawn(move || read(&mut port, &seen, &|command| heard.send(command).is_ok()));
        for parts in [&[[1, 2, 0, 3, 4, 0].as_slice()][..], &[&[1, 2, 0, 3], &[4, 0]]] {
            for part in parts {
                client.write_all(part).expect("room");
                thread::sleep(LOOK / 10); // the operating system may pause within a write
            }
            let bytes = commands.iter().find_map(|command| match command {
                Command::Bytes(bytes) => Some(bytes),
                _ => None,
            });
            assert_eq!(bytes, Some(vec![1, 2, 0, 3, 4, 0]));
        }
        // A frame that never ends delays others only briefly.
        client.write_all(&[5, 6, 0, 7]).expect("room");
        let first = commands.recv_timeout(10 * LOOK);
        assert!(matches!(first, Ok(Command::Bytes(bytes)) if bytes == [5, 6, 0]));
        unplugged.store(true, Ordering::Relaxed);
        reader.join().expect("an orderly end");
    }
}

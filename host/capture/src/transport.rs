//! Byte pipes to a board: the trait [`Transport`] and its serial port. Every operation has a timeout.

mod tcp;

use std::{
    io,
    time::{Duration, Instant},
};

use farnear_protocol::message::LinkRate;
use serialport::{ClearBuffer, SerialPort, SerialPortInfo, SerialPortType};

use crate::{error::PortError, find};

pub(crate) use tcp::SCHEME;
pub use tcp::TcpTransport;

pub trait Transport: Send {
    /// Waits at most `wait` for the first byte. `Ok(0)` is a timeout; an error means that the pipe has ended.
    fn receive(&mut self, buffer: &mut [u8], wait: Duration) -> io::Result<usize>;

    fn send(&mut self, bytes: &[u8], wait: Duration) -> io::Result<()>;

    fn discard_input(&mut self) -> io::Result<()>;

    /// Changes the baud rate; ignored by pipes without one.
    fn set_rate(&mut self, _: LinkRate) -> io::Result<()> {
        Ok(())
    }

    /// Reapplies the settings of the line, which another program may have changed.
    fn renew(&mut self, _: LinkRate) -> io::Result<()> {
        Ok(())
    }

    /// Port name, if it may differ from the requested one.
    fn port(&self) -> Option<&str> {
        None
    }
}

/// A serial port, held exclusively: a second program gets [`PortError::Busy`].
pub struct SerialTransport {
    /// `None` only while it is reopened.
    port: Option<Box<dyn SerialPort>>,
    name: String,
}

impl SerialTransport {
    /// Opens the port at the board's initial rate, 8 data bits, no parity, no flow control.
    pub fn open(path: &str) -> Result<Self, PortError> {
        refuse_what_is_no_port(path)?;
        let port = serialport::new(path, LinkRate::START.baud())
            .timeout(Duration::from_millis(50))
            .open()
            .map_err(|error| explain(path, error))?;
        Ok(Self { port: Some(port), name: path.into() })
    }

    fn open_port(&mut self) -> io::Result<&mut dyn SerialPort> {
        match &mut self.port {
            Some(port) => Ok(port.as_mut()),
            None => Err(io::ErrorKind::NotConnected.into()),
        }
    }
}

/// Finds a board under another port name: by its USB adapter's serial number, else name, else the only unnumbered one
/// of that make. `/dev/serial/by-id` links are stable names. The caller must verify the identity.
#[derive(Clone, Debug)]
pub(crate) struct Place {
    name: String,
    adapter: Option<Adapter>,
    known: bool,
}

#[derive(Clone, PartialEq, Eq, Debug)]
struct Adapter {
    maker: u16,
    product: u16,
    serial: Option<String>,
}

impl Adapter {
    /// `None` unless on USB.
    fn of(port: &SerialPortInfo) -> Option<Self> {
        let SerialPortType::UsbPort(usb) = &port.port_type else { return None };
        let serial = usb.serial_number.clone().filter(|number| !number.is_empty());
        Some(Self { maker: usb.vid, product: usb.pid, serial })
    }
}

impl Place {
    pub(crate) fn new(name: &str) -> Self {
        Self { name: name.into(), adapter: None, known: false }
    }

    /// Remembers the port's adapter.
    pub(crate) fn open(&mut self) -> Result<Box<dyn Transport>, PortError> {
        if self.name.starts_with(SCHEME) {
            return Ok(Box::new(TcpTransport::open(&self.name)?));
        }
        let present = find::present();
        let name = self.find(&present).unwrap_or(&self.name).to_owned();
        let opened = SerialTransport::open(&name).map_err(|error| match error {
            PortError::Absent { port, present } if self.known => PortError::NotBack { port, present },
            other => other,
        })?;
        self.known = true;
        if self.adapter.is_none() {
            self.adapter = present.iter().find(|port| port.port_name == name).and_then(Adapter::of);
        }
        Ok(Box::new(opened))
    }

    /// Present port of the board, by its adapter.
    fn find<'a>(&self, present: &'a [SerialPortInfo]) -> Option<&'a str> {
        let wanted = self.adapter.as_ref()?;
        let is_wanted = |port: &&SerialPortInfo| Adapter::of(port).as_ref() == Some(wanted);
        let mut found = present.iter().filter(is_wanted).filter(|port| !find::is_call_in(port, present));
        let (first, another) = (found.next()?, found.next());
        let has_name = present.iter().any(|port| port.port_name == self.name);
        match (&wanted.serial, another) {
            // A multi-port adapter has one number for all ports: the name decides.
            (Some(_), Some(_)) if has_name => None,
            (Some(_), _) => Some(&first.port_name),
            // Without a number the name decides while present; two of a make are ambiguous.
            (None, Some(_)) => None,
            (None, None) if has_name => None,
            (None, None) => Some(&first.port_name),
        }
    }
}

/// Rejects files that are not character devices, whose ioctl error ("Not a typewriter") explains nothing.
#[cfg(unix)]
fn refuse_what_is_no_port(path: &str) -> Result<(), PortError> {
    use std::os::unix::fs::FileTypeExt;
    match std::fs::metadata(path) {
        Ok(found) if !found.file_type().is_char_device() => Err(PortError::NoPort { port: path.into() }),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Err(absent(path)),
        _ => Ok(()),
    }
}

#[cfg(not(unix))]
fn refuse_what_is_no_port(_: &str) -> Result<(), PortError> {
    Ok(())
}

/// Separates port and link rate: `/dev/ttyACM0@921600`. An existing file name has no rate.
pub(crate) fn with_rate(given: &str) -> Result<(&str, Option<LinkRate>), PortError> {
    let is_number = |rate: &str| !rate.is_empty() && rate.bytes().all(|byte| byte.is_ascii_digit());
    let parts = given.rsplit_once('@').filter(|(_, rate)| is_number(rate));
    let Some((port, rate)) = parts.filter(|_| !std::path::Path::new(given).exists()) else {
        return Ok((given, None));
    };
    if port.starts_with(SCHEME) {
        return Err(PortError::TcpRate { port: port.into() });
    }
    let known = rate.parse().ok().and_then(LinkRate::of);
    let rate = known.ok_or_else(|| PortError::Rate { port: port.into(), rate: rate.into() })?;
    Ok((port, Some(rate)))
}

/// USB serial ports, which may have a board.
pub fn ports() -> Vec<String> {
    let present = find::present();
    let on_usb = present.into_iter().filter(|port| matches!(port.port_type, SerialPortType::UsbPort(_)));
    on_usb.map(|port| port.port_name).collect()
}

fn absent(path: &str) -> PortError {
    let present = find::present().into_iter().map(|port| port.port_name).collect();
    match path {
        "" => PortError::Nameless { present },
        _ => PortError::Absent { port: path.into(), present },
    }
}

fn explain(path: &str, error: serialport::Error) -> PortError {
    use serialport::ErrorKind;
    match error.kind() {
        ErrorKind::Io(io::ErrorKind::NotFound) => absent(path),
        ErrorKind::Io(io::ErrorKind::PermissionDenied) => PortError::Denied { port: path.into() },
        // The crate returns this kind for a busy and for a missing port.
        ErrorKind::NoDevice if is_present(path, &find::present()) => PortError::Busy { port: path.into() },
        ErrorKind::NoDevice => absent(path),
        _ => PortError::Open { port: path.into(), reason: error.to_string() },
    }
}

/// Whether the port is a file, or listed: Windows does not show a port that another program holds as a file.
fn is_present(path: &str, listed: &[SerialPortInfo]) -> bool {
    let name = path.trim_start_matches(r"\\.\");
    std::path::Path::new(path).exists() || listed.iter().any(|port| port.port_name.eq_ignore_ascii_case(name))
}

/// Sends by `write`, which gets the rest and the time left.
fn send_all(
    bytes: &[u8],
    wait: Duration,
    mut write: impl FnMut(&[u8], Duration) -> io::Result<usize>,
) -> io::Result<()> {
    let until = Instant::now() + wait;
    let mut rest = bytes;
    while !rest.is_empty() {
        let left = until.saturating_duration_since(Instant::now());
        if left.is_zero() {
            return Err(io::ErrorKind::TimedOut.into());
        }
        match write(rest, left) {
            // A serial port of Windows takes nothing within the time, without an error.
            Ok(count) => rest = &rest[count..],
            Err(error) if matches!(error.kind(), io::ErrorKind::Interrupted | io::ErrorKind::WouldBlock) => {}
            Err(error) => return Err(error),
        }
    }
    Ok(())
}

impl Transport for SerialTransport {
    fn receive(&mut self, buffer: &mut [u8], wait: Duration) -> io::Result<usize> {
        let port = self.open_port()?;
        port.set_timeout(wait.max(Duration::from_millis(1)))?;
        match port.read(buffer) {
            // Readable without bytes: the other side has closed.
            Ok(0) => Err(io::ErrorKind::UnexpectedEof.into()),
            Ok(count) => Ok(count),
            Err(error) if matches!(error.kind(), io::ErrorKind::TimedOut | io::ErrorKind::Interrupted) => {
                Ok(0)
            }
            Err(error) => Err(error),
        }
    }

    fn send(&mut self, bytes: &[u8], wait: Duration) -> io::Result<()> {
        send_all(bytes, wait, |rest, left| {
            let port = self.open_port()?;
            // Windows counts whole milliseconds, and without one a write has no end.
            port.set_timeout(left.max(Duration::from_millis(1)))?;
            port.write(rest)
        })
    }

    fn discard_input(&mut self) -> io::Result<()> {
        Ok(self.open_port()?.clear(ClearBuffer::Input)?)
    }

    fn set_rate(&mut self, rate: LinkRate) -> io::Result<()> {
        Ok(self.open_port()?.set_baud_rate(rate.baud())?)
    }

    fn renew(&mut self, rate: LinkRate) -> io::Result<()> {
        self.port = None; // it is held exclusively, also against this program
        let mut anew = Self::open(&self.name).map_err(io::Error::other)?;
        if rate != LinkRate::START {
            anew.set_rate(rate)?;
        }
        *self = anew;
        Ok(())
    }

    fn port(&self) -> Option<&str> {
        Some(&self.name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_port_can_include_the_link_rate() {
        assert_eq!(with_rate("/dev/ttyACM0").unwrap(), ("/dev/ttyACM0", None));
        assert_eq!(with_rate("/dev/ttyACM0@921600").unwrap(), ("/dev/ttyACM0", Some(LinkRate::Baud921600)));
        for other in ["/dev/usb@left", "/dev/usb@"] {
            assert_eq!(with_rate(other).unwrap(), (other, None));
        }
        let error = with_rate("tcp:lab:5000@921600").err().unwrap().to_string();
        assert!(error.contains("serial server"), "{error}");
        let error = with_rate("/dev/ttyACM0@115200").err().unwrap().to_string();
        assert!(error.contains("115200") && error.contains("2000000 or 921600"), "{error}");
    }

    #[test]
    fn a_port_of_windows_that_another_program_holds_is_present() {
        let port = |name: &str| SerialPortInfo { port_name: name.into(), port_type: SerialPortType::Unknown };
        let listed = ["COM3", "COM10"].map(port);
        let present = ["COM10", "com3", r"\\.\COM10", "COM1"].map(|name| is_present(name, &listed));
        assert_eq!(present, [true, true, true, false]);
    }

    #[test]
    fn a_line_that_takes_nothing_is_a_timeout() {
        let stuck = |_: &[u8], left: Duration| {
            std::thread::sleep(left);
            Ok(0)
        };
        let error = send_all(&[1], Duration::from_millis(5), stuck).unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::TimedOut);
    }

    #[test]
    fn an_absent_port_is_named() {
        let error = SerialTransport::open("/dev/farnear-no-such-port").err().unwrap();
        assert!(matches!(error, PortError::Absent { .. }), "{error:?}");
        assert!(error.to_string().contains("/dev/farnear-no-such-port"), "{error}");
    }

    #[test]
    fn finds_a_renamed_board_by_its_serial_number() {
        let port = |name: &str, serial: Option<&str>| SerialPortInfo {
            port_name: name.into(),
            port_type: serial.map_or(SerialPortType::Unknown, |serial| {
                SerialPortType::UsbPort(serialport::UsbPortInfo {
                    vid: 0x0483,
                    pid: 0x374b,
                    serial_number: Some(serial.into()),
                    manufacturer: None,
                    product: None,
                })
            }),
        };
        let adapter = |serial: Option<&str>| {
            Some(Adapter { maker: 0x0483, product: 0x374b, serial: serial.map(str::to_owned) })
        };
        let place = |serial| Place { name: "/dev/ttyACM0".into(), adapter: adapter(serial), known: true };
        let board = place(Some("066AFF"));
        let others = [port("/dev/ttyACM0", Some("077BEE")), port("/dev/ttyS0", None)];
        assert_eq!(board.find(&others), None, "another board has its name now");
        let back = [&others[..], &[port("/dev/ttyACM1", Some("066AFF"))]].concat();
        assert_eq!(board.find(&back), Some("/dev/ttyACM1"));
        let two = [port("/dev/ttyACM0", Some("066AFF")), port("/dev/ttyACM1", Some("066AFF"))];
        assert_eq!(board.find(&two), None, "two ports of one adapter: the name decides");
        assert_eq!(Place::new("/dev/ttyACM0").find(&back), None, "a board that was never there");
    }

    #[test]
    fn finds_an_unnumbered_adapter_if_unambiguous() {
        let port = |name: &str, serial: Option<&str>| SerialPortInfo {
            port_name: name.into(),
            port_type: SerialPortType::UsbPort(serialport::UsbPortInfo {
                vid: 0x1a86,
                pid: 0x7523,
                serial_number: serial.map(str::to_owned),
                manufacturer: None,
                product: None,
            }),
        };
        let adapter = Adapter::of(&port("", Some("")));
        let board = Place { name: "/dev/ttyUSB0".into(), adapter, known: true };
        let (same, other) = (port("/dev/ttyUSB0", None), port("/dev/ttyUSB1", None));
        let numbered = port("/dev/ttyUSB2", Some("7"));
        let find = |present: &[SerialPortInfo]| board.find(present).map(str::to_owned);
        assert_eq!(find(&[other.clone(), numbered.clone()]).as_deref(), Some("/dev/ttyUSB1"));
        assert_eq!(find(&[numbered]), None, "another adapter");
        assert_eq!(find(&[same, other.clone()]), None, "its name is there");
        assert_eq!(find(&[other, port("/dev/ttyUSB3", None)]), None, "two of a make: a guess");
        let [call_in, call_out] = ["/dev/tty.usb4", "/dev/cu.usb4"].map(|name| port(name, None));
        assert_eq!(find(&[call_in, call_out]).as_deref(), Some("/dev/cu.usb4"), "one port of macOS");
    }

    #[cfg(unix)]
    #[test]
    fn follows_a_changed_link_and_reports_a_missing_port() {
        let folder = tempfile::tempdir().unwrap();
        // Links, because the system may reuse a pseudo-terminal's name immediately.
        let [link, name] = ["board", "port"].map(|name| folder.path().join(name));
        let (first, old) = serialport::TTYPort::pair().unwrap();
        let (_second, new) = serialport::TTYPort::pair().unwrap();
        let (old, new) = (old.name().unwrap(), new.name().unwrap());
        for path in [&link, &name] {
            std::os::unix::fs::symlink(&old, path).unwrap();
        }
        let mut linked = Place::new(link.to_str().unwrap());
        let mut named = Place::new(name.to_str().unwrap());
        drop(linked.open().unwrap());
        drop(named.open().unwrap());
        drop(first); // and with it the port
        for path in [&link, &name] {
            std::fs::remove_file(path).unwrap();
        }
        let error = linked.open().err().unwrap();
        assert!(matches!(error, PortError::NotBack { .. }), "{error:?}");
        std::os::unix::fs::symlink(&new, &link).unwrap();
        assert_eq!(linked.open().unwrap().port(), link.to_str(), "the name that stays");
        let error = named.open().err().unwrap();
        assert!(error.to_string().contains("has not come back"), "{error}");
        assert!(error.to_string().contains("/dev/serial/by-id"), "what to do: {error}");
    }

    #[cfg(unix)]
    #[test]
    fn rejects_a_plain_file_as_port() {
        let error = SerialTransport::open(concat!(env!("CARGO_MANIFEST_DIR"), "/Cargo.toml")).err().unwrap();
        assert!(matches!(error, PortError::NoPort { .. }), "{error:?}");
    }

    #[cfg(unix)]
    #[test]
    fn a_held_port_is_busy_and_a_closed_one_is_gone() {
        let (master, slave) = serialport::TTYPort::pair().unwrap();
        let path = slave.name().unwrap();
        let mut first = SerialTransport::open(&path).unwrap();
        let error = SerialTransport::open(&path).err().unwrap();
        assert!(matches!(error, PortError::Busy { .. }), "{error:?}");

        let mut buffer = [0; 8];
        assert_eq!(first.receive(&mut buffer, Duration::from_millis(5)).unwrap(), 0);
        drop(master);
        assert!(first.receive(&mut buffer, Duration::from_millis(5)).is_err());
    }

    #[test]
    fn an_empty_name_is_said_to_be_empty() {
        let error = SerialTransport::open("").err().unwrap();
        assert!(matches!(error, PortError::Nameless { .. }), "{error}");
    }
}

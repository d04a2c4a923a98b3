//! GigE Vision server for the emulated camera, from public protocol descriptions. Unlike Aravis' fake camera:
//! - the hardware trigger is the emulated board's trigger line; software triggers and free running work, too;
//! - frames are stamped in rig time, in leader and chunks, and counted from the start of the acquisition;
//! - lost packets are resent on request, and can be lost on purpose;
//! - gain (a factor), black level, region and pixel format are applied after the converter.
//!
//! [`control`]: control channel (GVCP, UDP port 3956); [`registers`]: memory; [`features`]: registers and
//! GenICam nodes for the [`description`]; [`stream`]: frames as packets (GVSP); [`pace`]: packet timing.

pub mod control;
pub mod description;
pub mod device;
pub mod features;
pub mod pace;
pub mod registers;
pub mod stream;

use std::{
    io::ErrorKind,
    net::{Ipv4Addr, SocketAddrV4, UdpSocket},
    sync::{Arc, Mutex, MutexGuard, PoisonError, mpsc::Receiver},
    thread,
    time::{Duration, Instant},
};

use farnear_protocol::camera::{Control, FrameHeader};
use thiserror::Error;

use device::{Device, Sending};
use pace::Pace;

const CONTROL_PORT: u16 = 3956;
/// Interval of heartbeat checks.
const LOOK: Duration = Duration::from_millis(100);
/// Longest wait for rendering before time passes, so that slow computers do not send old pictures.
const RENDERING: Duration = Duration::from_secs(20);
const PATIENCE: Duration = Duration::from_millis(500);

#[derive(Clone, Debug)]
pub struct GigeConfig {
    pub address: Ipv4Addr,
    /// Seed of the serial number and of packet loss.
    pub seed: u64,
    pub lost_per_thousand: u32,
    pub sensor_px: (u16, u16),
    pub bits: u8,
}

/// Parses `lo` or an IPv4 address of this computer.
pub fn interface(text: &str) -> Result<Ipv4Addr, String> {
    match text {
        "lo" => Ok(Ipv4Addr::LOCALHOST),
        _ => text.parse().map_err(|_| {
            format!("expected lo or an IPv4 address of this computer, e.g. 192.168.7.1; found {text:?}")
        }),
    }
}

#[derive(Clone, PartialEq, Debug)]
pub struct Picture {
    pub begin_ns: u64,
    pub header: FrameHeader,
    /// Rows of 16-bit values, little-endian.
    pub pixels: Vec<u8>,
}

#[derive(Debug, Error)]
#[error("{what}")]
pub struct OpenError {
    pub what: String,
    pub source: std::io::Error,
}

type Shared = Arc<Mutex<Device>>;

fn lock(device: &Shared) -> MutexGuard<'_, Device> {
    device.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Opens the camera and returns its identification. `pictures` go to the controlling client, requests of its
/// host to `ask`; `now` returns rig time in ns. Fails if the address is not local or the port is taken.
pub fn open(
    config: &GigeConfig,
    pictures: Receiver<Picture>,
    ask: impl Fn(Control) + Send + Clone + 'static,
    now: impl Fn() -> u64 + Send + 'static,
) -> Result<String, OpenError> {
    let bind = |port: u16| {
        let address = SocketAddrV4::new(config.address, port);
        UdpSocket::bind(address).map_err(|source| {
            let what = match source.kind() {
                ErrorKind::AddrInUse => format!(
                    "a GigE Vision camera answers at {} already (port {port} is taken): end that one, or use another interface",
                    config.address
                ),
                ErrorKind::AddrNotAvailable => format!("no network interface here has the address {}", config.address),
                _ => format!("cannot open the GigE Vision camera at {address}"),
            };
            OpenError { what, source }
        })
    };
    let failed = |source| OpenError { what: "cannot open the GigE Vision camera".into(), source };
    let (control, stream) = (bind(CONTROL_PORT)?, bind(0)?);
    control.set_read_timeout(Some(LOOK)).map_err(failed)?;
    let device = Device::new(config);
    let id = device.id();
    let device: Shared = Arc::new(Mutex::new(device));
    let spawn = |name: &str, work: Box<dyn FnOnce() + Send>| {
        thread::Builder::new().name(name.into()).spawn(work).map_err(failed)
    };
    // Discovery is broadcast; unicast packets to this address arrive at the other socket.
    match UdpSocket::bind((Ipv4Addr::BROADCAST, CONTROL_PORT)) {
        Ok(shouts) => {
            let (device, answers) = (Arc::clone(&device), control.try_clone().map_err(failed)?);
            spawn("GigE discovery", Box::new(move || discover(&shouts, &answers, &device)))?;
        }
        Err(error) => eprintln!(
            "the GigE Vision camera receives no broadcasts ({error}); clients find it by its address only"
        ),
    }
    let (obeying, sending) = (Arc::clone(&device), stream.try_clone().map_err(failed)?);
    let heard = ask.clone();
    spawn("GigE control", Box::new(move || obey(&control, &sending, &obeying, &heard, &now)))?;
    let showing = Arc::clone(&device);
    spawn("GigE stream", Box::new(move || show(&pictures, &stream, &showing)))?;
    spawn("GigE free run", Box::new(move || run_freely(&device, &ask)))?;
    Ok(id)
}

fn discover(shouts: &UdpSocket, answers: &UdpSocket, device: &Shared) {
    let mut bytes = [0; control::PACKET_MAX];
    while let Ok((length, from)) = shouts.recv_from(&mut bytes) {
        // Ignore broadcasts from other networks: frames could not get there.
        let reachable =
            from.ip().is_loopback() == answers.local_addr().is_ok_and(|own| own.ip().is_loopback());
        if reachable && let Some(answer) = control::discovery(&bytes[..length], lock(device).registers()) {
            let _ = answers.send_to(&answer, from); // the client may have disconnected
        }
    }
}

fn obey(
    control: &UdpSocket,
    stream: &UdpSocket,
    device: &Shared,
    ask: &impl Fn(Control),
    now: &impl Fn() -> u64,
) {
    let mut bytes = [0; control::PACKET_MAX];
    let mut pace = Pace::new(Instant::now());
    loop {
        let received = control.recv_from(&mut bytes);
        // Checked on every packet, because other clients may be active.
        lock(device)
            .look_for_controller(Instant::now(), received.as_ref().ok().map(|(_, from)| *from))
            .into_iter()
            .for_each(ask);
        // Errors: timeout, or an answer that was refused.
        if let Ok((length, from)) = received {
            // The time is read before locking the device: the rig may wait for a picture to be fetched.
            let starts = control::starts_acquisition(&bytes[..length]);
            let now_ns = if starts { now() } else { 0 };
            let done = lock(device).obey(&bytes[..length], from, Instant::now(), now_ns);
            for asked in done.asks {
                carry_out(asked, ask, now);
            }
            if let Some(answer) = done.answer {
                let _ = control.send_to(&answer, from); // the client may have disconnected
            }
            if let Some(again) = done.again {
                send(stream, &again, &mut pace);
            }
        }
    }
}

/// After free running ends, waits for the last exposure, so that the next trigger is accepted.
fn carry_out(asked: Control, ask: &impl Fn(Control), now: &impl Fn() -> u64) {
    let ends = match asked {
        Control::FreeRun { period, exposure } if period.0 == 0 => Some(exposure),
        _ => None,
    };
    ask(asked);
    let Some(exposure) = ends else { return };
    let micros = u64::from(exposure.0) + u64::from(device::BETWEEN_EXPOSURES_US);
    let (until_ns, begin) = (now() + 1000 * micros, Instant::now());
    ask(Control::AdvanceMicros(micros));
    while now() < until_ns && begin.elapsed() < PATIENCE {
        thread::sleep(Duration::from_millis(1));
    }
}

fn show(pictures: &Receiver<Picture>, stream: &UdpSocket, device: &Shared) {
    let mut pace = Pace::new(Instant::now());
    for picture in pictures {
        let frame = lock(device).frame(&picture);
        if let Some(frame) = frame {
            send(stream, &frame, &mut pace);
        }
    }
}

fn send(stream: &UdpSocket, sending: &Sending, pace: &mut Pace) {
    for packet in &sending.packets {
        pace.hold(packet.len(), sending.gap);
        let _ = stream.send_to(packet, sending.to); // packets may be lost unnoticed
    }
}

/// Time is stopped in an idle rig; free running advances it by one picture at a time.
fn run_freely(device: &Shared, ask: &impl Fn(Control)) {
    loop {
        let (period, frames) = {
            let device = lock(device);
            (device.free_period(), device.frames())
        };
        let Some(period) = period else {
            thread::sleep(LOOK);
            continue;
        };
        ask(Control::AdvanceMicros(u64::from(period.0)));
        let begin = Instant::now();
        thread::sleep(Duration::from_micros(u64::from(period.0)));
        let waits = |device: &Device| device.frames() == frames && device.free_period().is_some();
        while waits(&lock(device)) && begin.elapsed() < RENDERING {
            thread::sleep(Duration::from_millis(1));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parses_interfaces_and_rejects_others() {
        assert_eq!(interface("lo"), Ok(Ipv4Addr::LOCALHOST));
        assert_eq!(interface("127.0.0.7"), Ok(Ipv4Addr::new(127, 0, 0, 7)));
        let error = interface("eth7").unwrap_err();
        assert!(error.contains("eth7") && error.contains("IPv4"), "{error}");
    }
}

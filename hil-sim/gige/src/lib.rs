//! # farnear-gige
//!
//! A GigE Vision server for the emulated camera: a client can test its whole path from trigger to depth without buying a camera.
//!
//! Written from the protocol's public descriptions (packet layouts and register addresses as Aravis' headers give them), because Aravis' own
//! fake camera has no line that triggers it, stamps its frames by the wall clock, and takes pictures from a C callback only. Here:
//!
//! - the hardware trigger is the emulated board's trigger line; software triggers and free running work, too;
//! - frames are stamped in the emulated rig's time, in the leader and as chunks, and counted from the start of the acquisition;
//! - lost packets are sent again when asked for, and can be lost on purpose;
//! - gain (a factor), black level, region and pixel format are applied to the finished picture, as digital cameras do behind the converter.
//!
//! [`control`]: the control channel (GVCP, UDP port 3956); [`registers`]: what can be read and written; [`features`]: the camera's features, one
//! table from which registers and the GenICam [`description`] are made; [`stream`]: frames as packets (GVSP); [`pace`]: when they leave; [`device`]: what
//! the camera does.

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

/// Where cameras listen, by the standard.
const CONTROL_PORT: u16 = 3956;
/// From one look at the heartbeat to the next.
const LOOK: Duration = Duration::from_millis(100);
/// A camera that runs freely waits so long for its picture to be rendered before time passes for the next: without that, a slow computer would
/// render pictures of long ago.
const RENDERING: Duration = Duration::from_secs(20);
/// Longest wait for the rig's time to pass, by the wall clock.
const PATIENCE: Duration = Duration::from_millis(500);

/// What a GigE Vision camera is made of.
#[derive(Clone, Debug)]
pub struct GigeConfig {
    /// Address of the network interface on which it answers.
    pub address: Ipv4Addr,
    /// Its serial number is made of it, and which packets are lost.
    pub seed: u64,
    /// So many of 1000 packets are lost.
    pub lost_per_thousand: u32,
    /// Size of the sensor: width, height.
    pub sensor_px: (u16, u16),
    /// Bits of its converter.
    pub bits: u8,
}

/// The address that a user names: `lo`, or an IPv4 address of this computer.
///
/// # Errors
/// Anything else, in words.
pub fn interface(text: &str) -> Result<Ipv4Addr, String> {
    match text {
        "lo" => Ok(Ipv4Addr::LOCALHOST),
        _ => text.parse().map_err(|_| {
            format!("expected lo or an IPv4 address of this computer, e.g. 192.168.7.1; it is {text:?}")
        }),
    }
}

/// An exposure of the emulated camera.
#[derive(Clone, PartialEq, Debug)]
pub struct Picture {
    /// Start of the exposure, virtual nanoseconds.
    pub begin_ns: u64,
    pub header: FrameHeader,
    /// Row by row, 16 bits each, the lower byte first.
    pub pixels: Vec<u8>,
}

/// The camera cannot open its sockets or threads.
#[derive(Debug, Error)]
#[error("{what}: {source}")]
pub struct OpenError {
    pub what: String,
    /// The system's error.
    pub source: std::io::Error,
}

type Shared = Arc<Mutex<Device>>;

fn lock(device: &Shared) -> MutexGuard<'_, Device> {
    device.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Opens the camera: `pictures` go to whoever has it under control, and what its host asks of it to `ask`; `now` is the emulated rig's time in
/// ns. Gives its identification, by which clients open it.
///
/// # Errors
/// [`OpenError`] where the address is not this computer's, or another camera has the port.
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
    // Whoever looks for cameras shouts to all; what is sent to this computer's own address arrives by the other socket.
    match UdpSocket::bind((Ipv4Addr::BROADCAST, CONTROL_PORT)) {
        Ok(shouts) => {
            let (device, answers) = (Arc::clone(&device), control.try_clone().map_err(failed)?);
            spawn("GigE discovery", Box::new(move || discover(&shouts, &answers, &device)))?;
        }
        Err(error) => eprintln!(
            "the GigE Vision camera does not hear broadcasts ({error}); clients find it by its address only"
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

/// Answers those who look for cameras.
fn discover(shouts: &UdpSocket, answers: &UdpSocket, device: &Shared) {
    let mut bytes = [0; control::PACKET_MAX];
    while let Ok((length, from)) = shouts.recv_from(&mut bytes) {
        // A shout in another network is heard here, too; a camera would not hear it, and its frames would not get there.
        let reachable =
            from.ip().is_loopback() == answers.local_addr().is_ok_and(|own| own.ip().is_loopback());
        if reachable && let Some(answer) = control::discovery(&bytes[..length], lock(device).registers()) {
            let _ = answers.send_to(&answer, from); // who asked may have gone
        }
    }
}

/// Does what comes by the control channel.
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
        // Each time, not in silence only: others may be talking all the while.
        lock(device)
            .look_for_controller(Instant::now(), received.as_ref().ok().map(|(_, from)| *from))
            .into_iter()
            .for_each(ask);
        // Without: nothing came, or an answer that nobody took came back as an error.
        if let Ok((length, from)) = received {
            // The time is asked for before the device is held: the rig may be waiting for a picture to be taken.
            let starts = control::starts_acquisition(&bytes[..length]);
            let now_ns = if starts { now() } else { 0 };
            let done = lock(device).obey(&bytes[..length], from, Instant::now(), now_ns);
            for asked in done.asks {
                carry_out(asked, ask, now);
            }
            if let Some(answer) = done.answer {
                let _ = control.send_to(&answer, from); // who asked may have gone
            }
            if let Some(again) = done.again {
                send(stream, &again, &mut pace);
            }
        }
    }
}

/// Asks the rig; a camera that runs freely no more has ended its last exposure when this returns, so that it hears the next trigger.
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

/// Sends pictures as frames while there is an acquisition.
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
        let _ = stream.send_to(packet, sending.to); // the line tells of nothing that is lost
    }
}

/// A rig at which nothing happens stands still in time; a camera that runs freely lets it pass, a picture's worth at a time.
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
    fn interfaces_are_named_or_refused() {
        assert_eq!(interface("lo"), Ok(Ipv4Addr::LOCALHOST));
        assert_eq!(interface("127.0.0.7"), Ok(Ipv4Addr::new(127, 0, 0, 7)));
        let error = interface("eth7").unwrap_err();
        assert!(error.contains("eth7") && error.contains("IPv4"), "{error}");
    }
}

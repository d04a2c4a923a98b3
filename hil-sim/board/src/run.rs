//! The program: emulated rigs behind a port and a camera endpoint.

use std::{
    net::SocketAddr,
    sync::{
        Arc, OnceLock,
        mpsc::{self, Sender},
    },
    thread::JoinHandle,
    time::Duration,
};

use farnear_gige::{self as gige, GigeConfig};
use farnear_protocol::camera::Control;

use crate::{
    command::{AnotherPort, CameraOrder, Command, Outlets},
    config::RigConfig,
    endpoint,
    error::SimError,
    imager::{self, Imager},
    pictures::Pictures,
    port::PortKind,
    rig::launch,
};

/// Timeout for the board's time; after it the rig has ended.
const ANSWER: Duration = Duration::from_secs(2);

pub struct ServedRig {
    pub port: String,
    pub camera: SocketAddr,
    pub second_camera: Option<SocketAddr>,
    pub gige: Option<String>,
    commands: Sender<Command>,
    thread: JoinHandle<Result<(), SimError>>,
}

impl ServedRig {
    /// Starts the rig with a port of this kind and its camera. `second` is a camera behind a half mirror; `gige` also serves
    /// the first camera. `renamed` receives the new name when a scenario renames the port.
    pub fn start(
        config: &RigConfig,
        kind: PortKind,
        first: Imager,
        second: Option<Imager>,
        gige: Option<&GigeConfig>,
        renamed: impl Fn(&str) + Send + 'static,
    ) -> Result<Self, SimError> {
        let (bytes_out, bytes) = mpsc::channel();
        let (shots_out, shots) = mpsc::channel();
        let pictures = Arc::new(Pictures::default());
        // Set after the board exists; ports opened later use it.
        let to_board = Arc::new(OnceLock::new());
        let outlets = Outlets {
            bytes: Some(bytes_out),
            another_port: Some(another_port(kind, Arc::clone(&to_board), renamed)),
            shots: shots_out,
            pictures: Some(Arc::clone(&pictures)),
        };
        let (commands, thread) = launch(config, outlets, None)?;
        let _ = to_board.set(commands.clone()); // set only here
        let ask = asker(&commands);
        let (gige, frames_to_gige) = match gige {
            Some(gige) => {
                let (frames, pictures) = mpsc::sync_channel(1);
                (Some(gige::open(gige, pictures, ask.clone(), clock(&commands))?), Some(frames))
            }
            None => (None, None),
        };
        let mut cameras = Vec::new();
        let mut door = |imager: Imager| {
            // One picture at a time: an unfetched one blocks the imager, and the imager blocks the board.
            let (frames_out, frames) = mpsc::sync_channel(1);
            let at = cameras.len();
            cameras.push((imager, frames_out));
            // With two endpoints a camera cannot tell whether both clients have left.
            let alone = (at > 0 || frames_to_gige.is_none()).then(|| Arc::clone(&pictures));
            let left = move || alone.iter().for_each(|pictures| pictures.forget(at));
            endpoint::open(frames, ask.clone(), left)
        };
        let camera = door(first)?;
        let second_camera = second.map(door).transpose()?;
        imager::watch(cameras, shots, frames_to_gige, pictures)?;
        let to_board = commands.clone();
        let port = kind.open(bytes, move |command| to_board.send(command).is_ok())?;
        Ok(Self { port, camera, second_camera, gige, commands, thread })
    }

    pub fn stopper(&self) -> impl Fn() + Send + 'static {
        let commands = self.commands.clone();
        move || {
            let _ = commands.send(Command::End); // it may have ended already
        }
    }

    /// Waits for the end of the rig; returns its error unless the end was requested.
    pub fn wait(self) -> Result<(), SimError> {
        self.thread.join().unwrap_or_else(|_| Err(SimError::Emulator("it panicked".into())))
    }
}

fn another_port(
    kind: PortKind,
    to_board: Arc<OnceLock<Sender<Command>>>,
    renamed: impl Fn(&str) + Send + 'static,
) -> AnotherPort {
    Box::new(move || {
        let to_board = to_board.get()?.clone();
        let (bytes_out, bytes) = mpsc::channel();
        let name = kind.another().open(bytes, move |command| to_board.send(command).is_ok()).ok()?;
        renamed(&name);
        Some(bytes_out)
    })
}

fn asker(commands: &Sender<Command>) -> impl Fn(Control) + Send + Clone + 'static {
    let commands = commands.clone();
    move |asked| {
        let command = match asked {
            // Does not wait: bytes from the host are held until the time has passed.
            Control::AdvanceMicros(micros) => {
                Command::Advance { nanos: micros.saturating_mul(1000), done: mpsc::channel().0 }
            }
            Control::Expose { shot_id, exposure } => {
                Command::Camera(CameraOrder::Expose { exposure_us: u64::from(exposure.0), id: shot_id })
            }
            Control::FreeRun { period, exposure } => Command::Camera(CameraOrder::FreeRun {
                period_us: u64::from(period.0),
                exposure_us: u64::from(exposure.0),
            }),
        };
        let _ = commands.send(command); // the rig may have ended
    }
}

fn clock(commands: &Sender<Command>) -> impl Fn() -> u64 + Send + 'static {
    let commands = commands.clone();
    move || {
        let (send, receive) = mpsc::channel();
        let look = Box::new(move |rig: &mut crate::RigAccess<'_, '_>| {
            let _ = send.send(rig.now_ns()); // the caller may have timed out
        });
        let _ = commands.send(Command::Access(look)); // the rig may have ended
        receive.recv_timeout(ANSWER).unwrap_or(0)
    }
}

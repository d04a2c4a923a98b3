//! The program: an emulated rig behind a pty and a camera endpoint, or several.

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
    port,
    rig::launch,
};

/// The board is asked for its time; one that does not answer by then has ended.
const ANSWER: Duration = Duration::from_secs(2);

/// A rig that clients can open.
pub struct ServedRig {
    pub port: String,
    /// Address of the camera endpoint.
    pub camera: SocketAddr,
    /// Address of the second camera's endpoint, where there is a half mirror.
    pub second_camera: Option<SocketAddr>,
    /// Identification of its GigE Vision camera, where it has one.
    pub gige: Option<String>,
    commands: Sender<Command>,
    thread: JoinHandle<Result<(), SimError>>,
}

impl ServedRig {
    /// Starts the rig and opens its two doors; behind a half mirror a `second` camera has a door of its own, and with `gige` the first
    /// camera has another one.
    ///
    /// `renamed` hears the new name of a pty that a scenario gives another one.
    pub fn start(
        config: &RigConfig,
        first: Imager,
        second: Option<Imager>,
        gige: Option<&GigeConfig>,
        renamed: impl Fn(&str) + Send + 'static,
    ) -> Result<Self, SimError> {
        let (bytes_out, bytes) = mpsc::channel();
        let (shots_out, shots) = mpsc::channel();
        let pictures = Arc::new(Pictures::default());
        // The way to the board, for the ports to come: there is none before the board.
        let to_board = Arc::new(OnceLock::new());
        let outlets = Outlets {
            bytes: Some(bytes_out),
            another_port: Some(another_port(Arc::clone(&to_board), renamed)),
            shots: shots_out,
            pictures: Some(Arc::clone(&pictures)),
        };
        let (commands, thread) = launch(config, outlets, None)?;
        let _ = to_board.set(commands.clone()); // nobody else sets it
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
            // One picture at a time is handed on: what is not fetched holds the imager up, and the imager the board.
            let (frames_out, frames) = mpsc::sync_channel(1);
            let at = cameras.len();
            cameras.push((imager, frames_out));
            // Of a camera with two doors nobody knows whether both clients have left.
            let alone = (at > 0 || frames_to_gige.is_none()).then(|| Arc::clone(&pictures));
            let left = move || alone.iter().for_each(|pictures| pictures.forget(at));
            endpoint::open(frames, ask.clone(), left)
        };
        let camera = door(first)?;
        let second_camera = second.map(door).transpose()?;
        imager::watch(cameras, shots, frames_to_gige, pictures)?;
        let to_board = commands.clone();
        let port = port::open(bytes, move |command| to_board.send(command).is_ok())?;
        Ok(Self { port, camera, second_camera, gige, commands, thread })
    }

    /// A way to end the rig from elsewhere.
    pub fn stopper(&self) -> impl Fn() + Send + 'static {
        let commands = self.commands.clone();
        move || {
            let _ = commands.send(Command::End); // it may have ended already
        }
    }

    /// Waits until the rig has ended.
    ///
    /// # Errors
    /// What ended it, if it was not asked to.
    pub fn wait(self) -> Result<(), SimError> {
        self.thread.join().unwrap_or_else(|_| Err(SimError::Emulator("it panicked".into())))
    }
}

/// Opens a pty with another name. Without a way to the board, or without a pty, there is none.
fn another_port(
    to_board: Arc<OnceLock<Sender<Command>>>,
    renamed: impl Fn(&str) + Send + 'static,
) -> AnotherPort {
    Box::new(move || {
        let to_board = to_board.get()?.clone();
        let (bytes_out, bytes) = mpsc::channel();
        let name = port::open(bytes, move |command| to_board.send(command).is_ok()).ok()?;
        renamed(&name);
        Some(bytes_out)
    })
}

/// Hands on what the camera's host asks of it.
fn asker(commands: &Sender<Command>) -> impl Fn(Control) + Send + Clone + 'static {
    let commands = commands.clone();
    move |asked| {
        let command = match asked {
            // Nobody waits for the end: what comes from the host meanwhile is held until the time has passed.
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

/// Tells the rig's time in ns.
fn clock(commands: &Sender<Command>) -> impl Fn() -> u64 + Send + 'static {
    let commands = commands.clone();
    move || {
        let (tell, told) = mpsc::channel();
        let look = Box::new(move |rig: &mut crate::RigAccess<'_, '_>| {
            let _ = tell.send(rig.now_ns()); // whoever asked may have given up
        });
        let _ = commands.send(Command::Access(look)); // the rig may have ended
        told.recv_timeout(ANSWER).unwrap_or(0)
    }
}

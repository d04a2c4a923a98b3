//! The program: an emulated rig behind a pty and a camera endpoint.

use std::{
    net::SocketAddr,
    sync::{
        Arc,
        atomic::AtomicUsize,
        mpsc::{self, Sender},
    },
    thread::JoinHandle,
};

use farnear_protocol::camera::Control;

use crate::{
    command::{CameraOrder, Command, Outlets},
    config::RigConfig,
    endpoint,
    error::SimError,
    imager::Imager,
    port,
    rig::launch,
};

/// A rig that clients can open.
pub struct ServedRig {
    /// Name of the pty.
    pub port: String,
    /// Address of the camera endpoint.
    pub camera: SocketAddr,
    commands: Sender<Command>,
    thread: JoinHandle<Result<(), SimError>>,
}

impl ServedRig {
    /// Starts the rig and opens its two doors.
    ///
    /// # Errors
    /// [`SimError`].
    pub fn start(config: &RigConfig, imager: Imager) -> Result<Self, SimError> {
        let (bytes_out, bytes) = mpsc::channel();
        let (shots_out, shots) = mpsc::channel();
        let pictures = Arc::new(AtomicUsize::new(0));
        let outlets =
            Outlets { bytes: Some(bytes_out), shots: shots_out, pictures: Some(Arc::clone(&pictures)) };
        let (commands, thread) = launch(config, outlets, None)?;
        // One picture at a time is handed on: what is not fetched holds the imager up, and the imager the board.
        let (frames_out, frames) = mpsc::sync_channel(1);
        imager.watch(shots, frames_out, pictures)?;
        let control = commands.clone();
        let camera = endpoint::open(frames, move |asked| {
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
            let _ = control.send(command); // the rig may have ended
        })?;
        let to_board = commands.clone();
        let port = port::open(bytes, move |frame| to_board.send(Command::Bytes(frame)).is_ok())?;
        Ok(Self { port, camera, commands, thread })
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

//! The emulated rig on its own thread; calls block. [`EmulatedRig::advance_us`] and [`EmulatedRig::settle`] pass time.

use std::{
    sync::mpsc::{self, Receiver, Sender},
    thread::JoinHandle,
};

use farnear_protocol::frame::{Decoder, Packet};
use rigless::{
    emulator::{Start, run},
    image::Image,
    session::Session,
    time::VirtualNanos,
};

use crate::{
    access::RigAccess,
    board::{NOTHING, RigBoard},
    camera::Camera,
    chips::SharedPlant,
    command::{Command, Outlets},
    config::RigConfig,
    driver::Driver,
    error::SimError,
    firmware,
    lockstep::BOOT_NS,
    memory_file,
    observer::Sight,
    plant::Plant,
    processor::Costs,
    replay::Script,
    report::Report,
    serial::Line,
    trace::Trace,
    wiring::{Shot, Wiring},
};

pub struct EmulatedRig {
    commands: Sender<Command>,
    thread: Option<JoinHandle<Result<(), SimError>>>,
    bytes: Receiver<Vec<u8>>,
    shots: Receiver<Shot>,
    decoder: Decoder,
}

impl EmulatedRig {
    /// Builds the rig and runs the firmware to its first idle moment.
    pub fn new(config: &RigConfig) -> Result<Self, SimError> {
        let (bytes_out, bytes) = mpsc::channel();
        let (shots_out, shots) = mpsc::channel();
        let outlets =
            Outlets { bytes: Some(bytes_out), another_port: None, shots: shots_out, pictures: None };
        let (commands, thread) = launch(config, outlets, None)?;
        Ok(Self { commands, thread: Some(thread), bytes, shots, decoder: Decoder::new() })
    }

    /// The bytes travel when time passes.
    pub fn send(&mut self, bytes: &[u8]) -> Result<(), SimError> {
        self.commands.send(Command::Bytes(bytes.to_vec())).map_err(|_| SimError::Stopped)
    }

    /// Bytes pass only if the board has the same rate.
    pub fn set_host_rate(&mut self, baud: u32) -> Result<(), SimError> {
        self.commands.send(Command::HostRate(baud)).map_err(|_| SimError::Stopped)
    }

    /// Fails with [`SimError::Stopped`] if the emulation has ended.
    pub fn advance_us(&mut self, micros: u64) -> Result<Report, SimError> {
        self.ask(|done| Command::Advance { nanos: micros * 1000, done })
    }

    /// Runs until no answer or terminal event is outstanding.
    pub fn settle(&mut self) -> Result<Report, SimError> {
        self.ask(|done| Command::Settle { done })
    }

    pub fn heal(&mut self) -> Result<(), SimError> {
        self.commands.send(Command::Heal).map_err(|_| SimError::Stopped)
    }

    /// Observations since the last call ([`RigConfig::observe`]).
    pub fn take_sights(&mut self) -> Result<Vec<Sight>, SimError> {
        let (done, wait) = mpsc::channel();
        self.commands.send(Command::Sights { done }).map_err(|_| SimError::Stopped)?;
        wait.recv().map_err(|_| SimError::Stopped)
    }

    pub fn report(&mut self) -> Result<Report, SimError> {
        self.advance_us(0)
    }

    pub fn access(
        &mut self,
        work: impl FnOnce(&mut RigAccess<'_, '_>) + Send + 'static,
    ) -> Result<(), SimError> {
        self.commands.send(Command::Access(Box::new(work))).map_err(|_| SimError::Stopped)
    }

    fn ask(&mut self, command: impl FnOnce(Sender<Report>) -> Command) -> Result<Report, SimError> {
        let (done, wait) = mpsc::channel();
        self.commands.send(command(done)).map_err(|_| SimError::Stopped)?;
        wait.recv().map_err(|_| SimError::Stopped)
    }

    pub fn take_bytes(&mut self) -> Vec<u8> {
        self.bytes.try_iter().flatten().collect()
    }

    pub fn take_frames(&mut self) -> Vec<Packet> {
        let bytes = self.take_bytes();
        bytes.into_iter().filter_map(|byte| self.decoder.push(byte)?.ok()).collect()
    }

    pub fn take_shots(&mut self) -> Vec<Shot> {
        self.shots.try_iter().collect()
    }

    /// Returns the error that ended the rig earlier.
    pub fn stop(mut self) -> Result<(), SimError> {
        self.end()
    }

    fn end(&mut self) -> Result<(), SimError> {
        // It may have ended already.
        let _ = self.commands.send(Command::End);
        let Some(thread) = self.thread.take() else { return Ok(()) };
        thread.join().unwrap_or_else(|_| Err(SimError::Emulator("it panicked".into())))
    }
}

impl Drop for EmulatedRig {
    fn drop(&mut self) {
        // Errors are reported by `stop`.
        let _ = self.end();
    }
}

type Launched = (Sender<Command>, JoinHandle<Result<(), SimError>>);

/// Starts the rig's thread and the board up to its first idle moment; replays a `script` to its end.
pub fn launch(config: &RigConfig, outlets: Outlets, script: Option<Script>) -> Result<Launched, SimError> {
    let script_given = script.is_some();
    let path = firmware::find(config.firmware.as_deref())?;
    let unusable = |reason: String| SimError::Firmware { path: path.clone(), reason };
    let image = Image::read(&path, None).map_err(|error| unusable(error.to_string()))?;
    let emulator = |error: &dyn std::fmt::Display| SimError::Emulator(error.to_string());

    let plant = SharedPlant::new(Plant::new(config.seed, &config.parts, config.scenario.start_um).into());
    let line = Line::default();
    let costs = if config.costs_by_kind {
        Costs::by_kind(image.bytes()).ok_or_else(|| unusable("it has no program in the flash".into()))?
    } else {
        Costs::Average(config.parts.processor)
    };
    let fingerprint = firmware::fingerprint(image.bytes());
    let mut board = RigBoard::new(&plant, line.clone(), (config.seed, fingerprint), &config.parts, costs)
        .map_err(|error| emulator(&error))?;
    let kept = config.memory.as_deref().map(memory_file::Kept::read).transpose()?;
    if let Some(contents) = kept.as_ref().and_then(memory_file::Kept::before)
        && !script_given
        && let Some(memory) = board.chip.memory()
    {
        memory.set_contents(contents);
    }
    if let Some(contents) = script.as_ref().and_then(|script| script.memory.as_deref())
        && let Some(memory) = board.chip.memory()
    {
        memory.set_contents(contents);
    }
    let wiring =
        Wiring::new(plant.clone(), Camera::new(config.seed), &mut board.chip, (config.seed, &config.parts));
    let trace = match script {
        Some(_) => None,
        None => config.trace.as_deref().map(|path| Trace::create(path, config, fingerprint)).transpose()?,
    };
    let (commands, receiver) = mpsc::channel();
    let mut driver = Driver::new(config, receiver, outlets, plant, line, wiring, trace);
    driver.keep(kept);
    if let Some(script) = script {
        if script.firmware != fingerprint {
            let reason = "the run was made with another firmware".into();
            return Err(SimError::Firmware { path, reason });
        }
        driver.follow(script);
    }
    let mut session = Session::new(Box::new(board), 0, VirtualNanos(0)).map_err(|error| emulator(&error))?;
    session.fail_next(NOTHING.start, NOTHING.end);

    let thread = std::thread::Builder::new()
        .name("emulator".into())
        .spawn(move || {
            let images = [image];
            match run(session, &Start::new(&images), driver) {
                Ok(finished) => finished.driver.finish(),
                Err(error) => Err(SimError::Emulator(error.to_string())),
            }
        })
        .map_err(|source| SimError::Io { what: "cannot start the emulator's thread".into(), source })?;

    if script_given {
        return Ok((commands, thread));
    }
    let (done, wait) = mpsc::channel();
    // A scenario may cut the power before the start; that is not a firmware error.
    let runs = |report: Report| report.started || !report.powered;
    if commands.send(Command::Settle { done }).is_ok() && wait.recv().is_ok_and(runs) {
        return Ok((commands, thread));
    }
    let _ = commands.send(Command::End); // it may have ended already
    match thread.join() {
        Ok(Err(SimError::Emulator(reason))) => Err(SimError::Firmware { path, reason }),
        Ok(Err(error)) => Err(error),
        _ => Err(SimError::NotStarted { path, millis: BOOT_NS / 1_000_000 }),
    }
}

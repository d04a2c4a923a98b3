//! Lets the emulator run when it may, and joins it to the plant and the outside.

use std::{
    sync::mpsc::{Receiver, RecvTimeoutError, Sender},
    time::{Duration, Instant},
};

use rigless::{
    emulator::{self, AccessKind, Host, Settled, Stop},
    session::Session,
    time::VirtualNanos,
};

use crate::{
    board::RigBoard,
    chips::{SharedPlant, with_plant},
    error::SimError,
    faults::{Faults, NoisyLine},
    hands::{Hands, Happening, forget},
    lockstep::Lockstep,
    memory::MemoryChip,
    plant::StageName,
    rig::{Outlets, RigConfig},
    serial::Line,
    trace::Trace,
    wiring::Wiring,
};

/// Virtual time between two looks at line, commands and the right to go on.
const QUANTUM_NS: u64 = 100_000;
/// SPI4's registers: the memory hangs there, and its supply may be set to fail in the middle of a write.
const SPI4: std::ops::Range<u64> = 0x4001_3400..0x4001_3800;
/// The same when time follows the wall clock.
const REALTIME_QUANTUM_NS: u64 = 1_000_000;

/// So long by the wall clock time stands for a host that the board waits for; then it is taken for gone.
const HOST_PATIENCE: Duration = Duration::from_secs(1);

/// How virtual time passes.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Pace {
    /// Only as long as it is told to.
    #[default]
    Told,
    /// While the board owes an answer or an event, and when told to.
    Lockstep,
    /// With the wall clock.
    Realtime,
}

/// What the rig can be asked.
pub enum Command {
    /// Put bytes on the line to the board.
    Bytes(Vec<u8>),
    /// Let this much time pass.
    Advance {
        /// How much.
        nanos: u64,
        /// Told when it has passed.
        done: Sender<Report>,
    },
    /// Let time pass until the board owes nothing.
    Settle {
        /// Told then.
        done: Sender<Report>,
    },
    /// Do something with the rig between two instructions.
    ReachIn(Box<dyn FnOnce(&mut Hands<'_, '_>) + Send>),
    /// Something that the camera's host asks of the camera; the host of the rig has spoken.
    Camera(Box<dyn FnOnce(&mut Hands<'_, '_>) + Send>),
    /// End.
    End,
}

/// How a stage is.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct StageReport {
    /// Where it really is, micrometres from its true home edge.
    pub position_um: f64,
    /// Where its driver's sequencer stands, microsteps from the true home edge: exactly what STEP and DIR said.
    pub microsteps: i64,
    /// That, less where the rotor is.
    pub lost_microsteps: f64,
    /// Rising edges on its STEP pin since power-on.
    pub step_edges: u64,
    /// When the last of them was.
    pub last_step_ns: u64,
}

/// How the rig is.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Report {
    /// Virtual time since power-on, nanoseconds.
    pub now_ns: u64,
    /// The firmware has said that it started.
    pub started: bool,
    /// Resets of the chip since power-on.
    pub resets: usize,
    /// Whether the chip has power.
    pub powered: bool,
    /// The sensor's stage.
    pub coarse: StageReport,
    /// The lens' stage.
    pub lens: StageReport,
    /// Where the piezo really is, micrometres.
    pub piezo_um: f64,
    /// Triggers since the board's reset.
    pub triggers: u32,
    /// Triggers that the camera was too busy to hear.
    pub missed_triggers: u32,
    /// Bits that the line flipped, both directions.
    pub flipped_bits: u64,
}

impl Report {
    /// Rising edges on both STEP pins since power-on.
    pub fn step_edges(&self) -> u64 {
        self.coarse.step_edges + self.lens.step_edges
    }

    /// When the last of them was.
    pub fn last_step_ns(&self) -> u64 {
        self.coarse.last_step_ns.max(self.lens.last_step_ns)
    }
}

/// See the module.
pub struct Driver {
    pace: Pace,
    commands: Receiver<Command>,
    outlets: Outlets,
    plant: SharedPlant,
    line: Line,
    wiring: Wiring,
    lockstep: Lockstep,
    to_board: NoisyLine,
    to_host: NoisyLine,
    faults: Faults,
    happens: Vec<Happening>,
    trace: Option<Trace>,
    told_ns: u64,
    held: Vec<u8>,
    told: Vec<Sender<Report>>,
    settling: Vec<Sender<Report>>,
    resets: usize,
    powered: bool,
    wall: Option<(Instant, u64)>,
    failed: Option<SimError>,
}

impl Driver {
    /// A driver for a board that has not run yet.
    pub fn new(
        config: &RigConfig,
        commands: Receiver<Command>,
        outlets: Outlets,
        plant: SharedPlant,
        line: Line,
        wiring: Wiring,
        trace: Option<Trace>,
    ) -> Self {
        let rate = config.faults.bit_error_rate;
        let mut driver = Self {
            pace: config.pace,
            commands,
            outlets,
            plant,
            line,
            wiring,
            lockstep: Lockstep::new(),
            to_board: NoisyLine::new(rate, config.seed, "line to the board"),
            to_host: NoisyLine::new(rate, config.seed, "line to the host"),
            faults: config.faults.clone(),
            happens: config.faults.happens.clone(),
            trace,
            told_ns: 0,
            held: Vec::new(),
            told: Vec::new(),
            settling: Vec::new(),
            resets: 0,
            powered: true,
            wall: None,
            failed: None,
        };
        driver.hand_out(config.faults.garbage.clone());
        driver
    }

    fn hand_out(&mut self, bytes: Vec<u8>) {
        if let Some(outlet) = self.outlets.bytes.as_ref().filter(|_| !bytes.is_empty()) {
            let _ = outlet.send(bytes); // whoever listened may have gone
        }
    }

    /// After the run: writes what is left.
    ///
    /// # Errors
    /// What went wrong during the run.
    pub fn finish(self) -> Result<(), SimError> {
        self.trace.map_or(Ok(()), Trace::finish)?;
        self.failed.map_or(Ok(()), Err)
    }

    fn report(&self, now_ns: u64) -> Report {
        Report {
            now_ns,
            started: self.lockstep.has_started(),
            resets: self.resets,
            powered: self.powered,
            coarse: self.stage_report(StageName::Sensor),
            lens: self.stage_report(StageName::Lens),
            piezo_um: with_plant(&self.plant, |plant| plant.piezo().position_um()),
            triggers: self.wiring.camera().triggers(),
            missed_triggers: self.wiring.camera().missed(),
            flipped_bits: self.to_board.flipped() + self.to_host.flipped(),
        }
    }

    fn stage_report(&self, name: StageName) -> StageReport {
        let (position_um, microsteps, lost_microsteps) = with_plant(&self.plant, |plant| {
            let stage = plant.stage(name);
            (stage.position_um(), stage.microsteps(), stage.lost_microsteps())
        });
        StageReport {
            position_um,
            microsteps,
            lost_microsteps,
            step_edges: self.wiring.step_edges(name),
            last_step_ns: self.wiring.last_step_ns(name),
        }
    }

    /// Brings everything outside the chip to this moment.
    fn exchange(&mut self, now_ns: u64) {
        let mut bytes = self.line.take();
        self.lockstep.received(&bytes, now_ns);
        self.to_host.carry(&mut bytes);
        self.hand_out(bytes);
        if self.faults.unplug_after_ms.is_some_and(|ms| now_ns >= ms.saturating_mul(1_000_000)) {
            self.outlets.bytes = None;
        }
        let shots = self.wiring.take_shots();
        with_plant(&self.plant, |plant| {
            plant.advance(now_ns);
            if let Some(trace) = &mut self.trace {
                trace.tick(now_ns, plant, &self.wiring);
                shots.iter().for_each(|shot| trace.shot(shot, plant, &self.wiring));
            }
        });
        for shot in shots {
            let _ = self.outlets.shots.send(shot);
        }
    }

    /// Carries out a command; `false` ends the run.
    fn carry_out(
        &mut self,
        command: Command,
        session: &mut Session<RigBoard>,
        stop: Stop,
        host: &mut dyn Host,
    ) -> bool {
        match command {
            Command::Bytes(bytes) => {
                // What comes while time passes on request comes after it, however fast the host is.
                self.held.extend(bytes);
                if stop.at.0 >= self.told_ns {
                    self.send_held(stop.at.0);
                }
            }
            Command::Advance { nanos, done } => {
                self.told_ns = self.told_ns.max(stop.at.0 + nanos);
                self.told.push(done);
            }
            Command::Settle { done } => self.settling.push(done),
            Command::ReachIn(work) => self.reach_in(work, session, stop, host),
            Command::Camera(work) => {
                self.lockstep.host_spoke();
                self.reach_in(work, session, stop, host);
            }
            Command::End => return false,
        }
        true
    }

    fn reach_in(
        &mut self,
        work: impl FnOnce(&mut Hands<'_, '_>),
        session: &mut Session<RigBoard>,
        stop: Stop,
        host: &mut dyn Host,
    ) {
        work(&mut Hands { session, host, stop, plant: &self.plant, wiring: &mut self.wiring });
        self.note_resets(session, stop.at);
        self.wiring.put(&mut session.board_mut().chip, stop.at);
        session.pause_at(self.wiring.next_ns().map(VirtualNanos));
    }

    /// Lets happen what is due.
    fn happen(&mut self, session: &mut Session<RigBoard>, stop: Stop, host: &mut dyn Host) {
        let now_ns = stop.at.0;
        let is_due = |after_ms: u64| now_ns >= after_ms.saturating_mul(1_000_000);
        let (mut due, later): (Vec<_>, Vec<_>) =
            self.happens.drain(..).partition(|happening| is_due(happening.after_ms));
        self.happens = later;
        due.sort_by_key(|happening| happening.after_ms);
        for happening in due {
            self.reach_in(|hands| hands.happen(&happening), session, stop, host);
        }
    }

    /// Puts on the line what came for the board.
    fn send_held(&mut self, now_ns: u64) {
        let mut bytes = std::mem::take(&mut self.held);
        if self.outlets.bytes.is_some() {
            if self.pace == Pace::Lockstep {
                let mut fresh = Vec::new();
                for frame in bytes.split_inclusive(|byte| *byte == 0) {
                    if !self.lockstep.repeats(frame) {
                        fresh.extend(frame);
                    }
                }
                bytes = fresh;
            }
            self.lockstep.sent(&bytes, now_ns);
            self.to_board.carry(&mut bytes);
            self.line.send(&bytes);
        }
    }

    /// Whether the chip was reset since the last look.
    fn note_resets(&mut self, session: &Session<RigBoard>, at: VirtualNanos) {
        let resets = session.resets().len();
        if self.powered == session.unpowered() {
            self.powered = !session.unpowered();
            self.wiring.board_reset(at);
            self.lockstep.reset(at.0);
        }
        if resets != self.resets {
            self.resets = resets;
            self.wiring.board_reset(at);
            self.lockstep.reset(at.0);
        }
    }

    /// Answers who waits, and says whether time may pass.
    fn may_pass(&mut self, now_ns: u64) -> bool {
        if now_ns >= self.told_ns && !self.held.is_empty() {
            self.send_held(now_ns);
        }
        let report = self.report(now_ns);
        let answer = |waiting: &mut Vec<Sender<Report>>| {
            for done in waiting.drain(..) {
                let _ = done.send(report); // whoever asked may have gone
            }
        };
        if now_ns >= self.told_ns {
            answer(&mut self.told);
        }
        let busy = self.lockstep.is_busy(now_ns) || self.line.is_sending();
        if !busy {
            answer(&mut self.settling);
        }
        now_ns < self.told_ns
            || match self.pace {
                Pace::Told => busy && !self.settling.is_empty(),
                Pace::Lockstep => busy && !self.lockstep.waits_for_host(),
                Pace::Realtime => true,
            }
    }

    /// Waits for a command while time stands; `None` where the host has let the board wait for too long.
    fn wait(&mut self) -> Option<Command> {
        // Nobody left who could command: end.
        if !self.lockstep.waits_for_host() {
            return Some(self.commands.recv().unwrap_or(Command::End));
        }
        match self.commands.recv_timeout(HOST_PATIENCE) {
            Ok(command) => Some(command),
            Err(RecvTimeoutError::Timeout) => {
                self.lockstep.host_spoke();
                None
            }
            Err(RecvTimeoutError::Disconnected) => Some(Command::End),
        }
    }

    /// Waits until the wall clock has caught up with virtual time; a command ends the wait.
    fn keep_pace(&mut self, now_ns: u64) -> Option<Command> {
        let (wall, virtual_ns) = *self.wall.get_or_insert((Instant::now(), now_ns));
        let due = wall + Duration::from_nanos(now_ns - virtual_ns);
        let wait = due.saturating_duration_since(Instant::now());
        if wait.is_zero() {
            // Too slow a host: the wall clock is followed from here, not chased.
            if due + Duration::from_millis(100) < Instant::now() {
                self.wall = None;
            }
            return self.commands.try_recv().ok();
        }
        match self.commands.recv_timeout(wait) {
            Ok(command) => Some(command),
            Err(RecvTimeoutError::Timeout) => None,
            Err(RecvTimeoutError::Disconnected) => Some(Command::End),
        }
    }
}

impl emulator::Driver<RigBoard> for Driver {
    fn on_settled(&mut self, session: &mut Session<RigBoard>, host: &mut dyn Host, settled: Settled) {
        let at = match settled {
            Settled::Access { access, .. } if SPI4.contains(&access.address) => {
                let chip = &mut session.board_mut().chip;
                if chip.memory().is_some_and(MemoryChip::take_failure) {
                    chip.power(access.virtual_time, false);
                    forget(host);
                }
                return;
            }
            Settled::Access { access, .. }
                if access.kind == AccessKind::Write && Wiring::watches(access.address) =>
            {
                access.virtual_time
            }
            Settled::Stop(stop) => stop.at,
            _ => return,
        };
        self.note_resets(session, at);
        self.wiring.look(&mut session.board_mut().chip, at);
        session.pause_at(self.wiring.next_ns().map(VirtualNanos));
    }

    fn on_stop(
        &mut self,
        session: &mut Session<RigBoard>,
        stop: Stop,
        host: &mut dyn Host,
    ) -> Option<VirtualNanos> {
        let now_ns = stop.at.0;
        if let Some(error) = session.take_error() {
            self.failed = Some(SimError::Emulator(error.to_string()));
            return None;
        }
        self.note_resets(session, stop.at);
        self.exchange(now_ns);
        self.wiring.put(&mut session.board_mut().chip, stop.at);
        session.board_mut().chip.join_breaks(stop.at);
        self.happen(session, stop, host);
        loop {
            while let Ok(command) = self.commands.try_recv() {
                if !self.carry_out(command, session, stop, host) {
                    return None;
                }
            }
            let command = if !self.may_pass(now_ns) {
                match self.wait() {
                    Some(command) => Some(command),
                    None => continue,
                }
            } else if self.pace == Pace::Realtime && now_ns >= self.told_ns {
                self.keep_pace(now_ns)
            } else {
                None
            };
            let Some(command) = command else { break };
            if !self.carry_out(command, session, stop, host) {
                return None;
            }
        }
        let quantum = if self.pace == Pace::Realtime { REALTIME_QUANTUM_NS } else { QUANTUM_NS };
        let until = now_ns + quantum;
        Some(VirtualNanos(if self.told_ns > now_ns { until.min(self.told_ns) } else { until }))
    }
}

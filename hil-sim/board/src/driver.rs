//! Lets the emulator run when it may, and joins it to the plant and the outside.

use std::{
    sync::mpsc::{Receiver, RecvTimeoutError, Sender},
    time::{Duration, Instant},
};

use rigless::{
    device::Level,
    emulator::{self, AccessKind, Host, Settled, Stop},
    session::Session,
    time::VirtualNanos,
};

use crate::{
    board::{DIAG, RigBoard, SpiChip},
    chips::{SharedPlant, with_plant},
    error::SimError,
    faults::{Faults, NoisyLine},
    lockstep::Lockstep,
    plant::Plant,
    rig::{Outlets, RigConfig},
    serial::Line,
    trace::Trace,
    wiring::Wiring,
};

/// Virtual time between two looks at line, commands and the right to go on.
const QUANTUM_NS: u64 = 100_000;
/// The same when time follows the wall clock.
const REALTIME_QUANTUM_NS: u64 = 1_000_000;

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
    /// End.
    End,
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
    /// Rising edges on the STEP pin since power-on.
    pub step_edges: u64,
    /// When the last of them was.
    pub last_step_ns: u64,
    /// Where the coarse stage really is, micrometres from the true home edge.
    pub coarse_um: f64,
    /// Where the piezo really is, micrometres.
    pub piezo_um: f64,
    /// Triggers since the board's reset.
    pub triggers: u32,
    /// Triggers that the camera was too busy to hear.
    pub missed_triggers: u32,
    /// Bits that the line flipped, both directions.
    pub flipped_bits: u64,
}

/// The inside of the rig, for tests that break it.
pub struct Hands<'a, 'h> {
    session: &'a mut Session<RigBoard>,
    host: &'a mut (dyn Host + 'h),
    stop: Stop,
    plant: &'a SharedPlant,
}

impl Hands<'_, '_> {
    /// Works on the plant.
    pub fn plant<T>(&mut self, work: impl FnOnce(&mut Plant) -> T) -> T {
        with_plant(self.plant, work)
    }

    /// Presses the reset button.
    pub fn press_reset(&mut self) {
        self.session.reset_by_pin(self.stop.at, self.stop.instruction_count, self.host);
    }

    /// The stepper driver reports a fault on DIAG, or takes it back.
    pub fn set_driver_fault(&mut self, fault: bool) {
        self.session.board_mut().chip.drive_pin(self.stop.at, DIAG, Level::from(fault));
    }

    /// Cuts the data lines of a chip, or mends them.
    pub fn disconnect(&mut self, chip: SpiChip, cut: bool) {
        self.session.board_mut().chip.disconnect(chip, cut);
    }

    /// Writes a register of the chip behind the firmware's back, as a stray pointer would.
    pub fn write_register(&mut self, address: u64, value: u64) {
        use rigless::{mcu::Operate, soc::Width};
        // An address without a register is what a stray pointer may have, too.
        let _ = Operate::write(&mut self.session.board_mut().chip, self.stop.at, address, Width::W32, value);
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
    trace: Option<Trace>,
    told_ns: u64,
    held: Vec<u8>,
    told: Vec<Sender<Report>>,
    settling: Vec<Sender<Report>>,
    resets: usize,
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
            trace,
            told_ns: 0,
            held: Vec::new(),
            told: Vec::new(),
            settling: Vec::new(),
            resets: 0,
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
        let (coarse_um, piezo_um) =
            with_plant(&self.plant, |plant| (plant.screw().position_um(), plant.piezo().position_um()));
        Report {
            now_ns,
            started: self.lockstep.has_started(),
            resets: self.resets,
            step_edges: self.wiring.step_edges(),
            last_step_ns: self.wiring.last_step_ns(),
            coarse_um,
            piezo_um,
            triggers: self.wiring.camera().triggers(),
            missed_triggers: self.wiring.camera().missed(),
            flipped_bits: self.to_board.flipped() + self.to_host.flipped(),
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
            Command::ReachIn(work) => {
                work(&mut Hands { session, host, stop, plant: &self.plant });
                self.note_resets(session, stop.at);
                self.wiring.put_switches(&mut session.board_mut().chip, stop.at);
            }
            Command::End => return false,
        }
        true
    }

    /// Puts on the line what came for the board.
    fn send_held(&mut self, now_ns: u64) {
        let mut bytes = std::mem::take(&mut self.held);
        if self.outlets.bytes.is_some() {
            self.lockstep.sent(&bytes, now_ns);
            self.to_board.carry(&mut bytes);
            self.line.send(&bytes);
        }
    }

    /// Whether the chip was reset since the last look.
    fn note_resets(&mut self, session: &Session<RigBoard>, at: VirtualNanos) {
        let resets = session.resets().len();
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
                Pace::Lockstep => busy,
                Pace::Realtime => true,
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
    fn on_settled(&mut self, session: &mut Session<RigBoard>, _host: &mut dyn Host, settled: Settled) {
        let at = match settled {
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
        self.exchange(now_ns);
        loop {
            while let Ok(command) = self.commands.try_recv() {
                if !self.carry_out(command, session, stop, host) {
                    return None;
                }
            }
            let command = if !self.may_pass(now_ns) {
                // Nobody left who could command: end.
                self.commands.recv().ok().or(Some(Command::End))
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

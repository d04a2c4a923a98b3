//! Connects the emulator to the plant: runs when the firmware touches a pin and when the emulator stops.

mod scenario;

use std::{
    sync::mpsc::{Receiver, RecvTimeoutError},
    time::Duration,
};

use rigless::{
    emulator::{self, AccessKind, Host, Settled, Stop},
    session::Session,
    time::VirtualNanos,
};

use crate::{
    access::{RigAccess, forget},
    adapter::Adapter,
    board::{Chip, NOTHING, RigBoard},
    chips::{SharedPlant, with_plant},
    command::{CameraOrder, Command, Outlets},
    config::RigConfig,
    error::SimError,
    faults::{Lines, Moment, Schedule},
    link_rates::LinkRates,
    memory::MemoryChip,
    memory_file::Kept,
    observer::{Observer, Seen, Truth},
    pacing::Pacing,
    parts::Parts,
    pictures::Patience,
    plant::{Noise, StageName},
    replay::Script,
    report::{Report, StageReport},
    scenario::Scenario,
    serial::Line,
    trace::{Trace, vcd::Vcd},
    wiring::Wiring,
};

/// SPI4's registers: the memory's supply may fail in the middle of a write.
const SPI4: std::ops::Range<u64> = 0x4001_3400..0x4001_3800;

const PICTURE: Duration = Duration::from_millis(2);

#[derive(Debug, Default)]
struct Last {
    /// STEP edges of both motors, and the time of the last one.
    step_edges: [(u64, u64); 2],
    exposures: u64,
    /// Bytes written to the memory, and when.
    memory: (u64, u64),
}

pub struct Driver {
    commands: Receiver<Command>,
    outlets: Outlets,
    plant: SharedPlant,
    line: Line,
    wiring: Wiring,
    pacing: Pacing,
    patience: Patience,
    lines: Lines,
    rates: LinkRates,
    scenario: Scenario,
    parts: Parts,
    schedule: Schedule,
    observer: Observer,
    last: Last,
    trace: Option<Trace>,
    script: Option<Script>,
    looks_at_ns: Option<u64>,
    /// File and final contents of the memory.
    memory: Option<(Kept, Vec<u8>)>,
    adapter: Adapter,
    /// Bytes for the board that arrived during a requested advance.
    held: Vec<u8>,
    resets: usize,
    powered: bool,
    failed: Option<SimError>,
}

impl Driver {
    pub fn new(
        config: &RigConfig,
        commands: Receiver<Command>,
        outlets: Outlets,
        plant: SharedPlant,
        line: Line,
        wiring: Wiring,
        trace: Option<Trace>,
    ) -> Self {
        let patience = Patience::new(outlets.pictures.clone());
        let mut driver = Self {
            commands,
            outlets,
            plant,
            line,
            wiring,
            pacing: Pacing::new(config.pace),
            patience,
            lines: Lines::new(config.scenario.bit_error_rate, config.seed),
            rates: LinkRates::new(),
            scenario: config.scenario.clone(),
            parts: config.parts.clone(),
            schedule: Schedule::new(&config.scenario.happens, config.seed),
            observer: Observer::new(config.observe),
            last: Last::default(),
            trace,
            script: None,
            looks_at_ns: None,
            memory: None,
            adapter: Adapter::default(),
            held: Vec::new(),
            resets: 0,
            powered: true,
            failed: None,
        };
        driver.hand_out(config.scenario.garbage.clone());
        driver
    }

    fn hand_out(&mut self, bytes: Vec<u8>) {
        if let Some(outlet) = self.outlets.bytes.as_ref().filter(|_| !bytes.is_empty()) {
            let _ = outlet.send(bytes); // the receiver may have gone
        }
    }

    /// Writes the remaining outputs; returns the first error of the run.
    pub fn finish(self) -> Result<(), SimError> {
        self.trace.map_or(Ok(()), Trace::finish)?;
        if let Some((kept, contents)) = self.memory.filter(|(_, contents)| !contents.is_empty()) {
            kept.write(&contents)?;
        }
        self.failed.map_or(Ok(()), Err)
    }

    fn report(&self, now_ns: u64) -> Report {
        Report {
            now_ns,
            started: self.pacing.lockstep.has_started(),
            resets: self.resets,
            powered: self.powered,
            coarse: self.stage_report(StageName::Sensor),
            lens: self.stage_report(StageName::Lens),
            piezo_um: with_plant(&self.plant, |plant| plant.piezo().position_um()),
            piezo_pulled_um: with_plant(&self.plant, |plant| plant.piezo().pulled_um()),
            triggers: self.wiring.camera().triggers(),
            missed_triggers: self.wiring.camera().missed(),
            flipped_bits: self.lines.to_board.flipped() + self.lines.to_host.flipped(),
        }
    }

    fn stage_report(&self, name: StageName) -> StageReport {
        let driver_violations = self.wiring.driver_violations(name);
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
            driver_violations,
        }
    }

    fn exchange(&mut self, now_ns: u64) {
        let mut bytes = self.line.take();
        self.pacing.lockstep.received(&bytes, now_ns);
        let truth = with_plant(&self.plant, |plant| {
            plant.advance(now_ns);
            Truth::of(plant)
        });
        for moment in self.observer.received(now_ns, &bytes, truth) {
            if matches!(moment, Moment::Alarm | Moment::Answer) {
                // Pulses before and after the event are separate bursts.
                for burst in self.wiring.take_bursts(now_ns, true) {
                    self.observer.note(burst.last_ns, Seen::Stepped(burst));
                }
            }
            self.schedule.notice(moment, now_ns);
        }
        if let Some(next) = self.observer.take_next_exposure() {
            self.wiring.camera_mut().board_numbers(next);
        }
        if let Some(vcd) = self.vcd() {
            vcd.received(now_ns, &bytes);
        }
        self.rates.carry(&mut bytes);
        self.lines.to_host.carry(&mut bytes);
        let bytes = self.adapter.pass(bytes, now_ns, self.lines.latency_ns);
        self.hand_out(bytes);
        if self.scenario.unplug_after_ms.is_some_and(|ms| now_ns >= ms.saturating_mul(1_000_000)) {
            self.outlets.bytes = None;
        }
        let shots = self.wiring.take_shots();
        with_plant(&self.plant, |plant| {
            plant.advance(now_ns);
            if let Some(trace) = &mut self.trace {
                trace.look(now_ns, plant, &mut self.wiring, &shots);
            }
        });
        for shot in shots {
            self.schedule.notice(Moment::ExposureEnds, now_ns);
            self.observer.note(shot.end_ns, Seen::Exposed(shot));
            if self.patience.expose() {
                let _ = self.outlets.shots.send(shot); // the receiver may have gone
            }
        }
    }

    /// Executes a command; `false` ends the run.
    fn carry_out(
        &mut self,
        command: Command,
        session: &mut Session<RigBoard>,
        stop: Stop,
        host: &mut dyn Host,
    ) -> bool {
        let now_ns = stop.at.0;
        self.pacing.note_activity();
        match command {
            Command::Bytes(bytes) => {
                // Bytes that arrive during a requested advance follow it, independent of the host's speed.
                self.held.extend(bytes);
                self.send_held(now_ns);
            }
            Command::HostRate(baud) => self.rates.set_host(baud),
            Command::Advance { nanos, done } => self.pacing.advance(now_ns, nanos, done),
            Command::Settle { done } => self.pacing.settle(done),
            Command::Access(work) => {
                if let Some(vcd) = self.vcd() {
                    vcd.touched(now_ns);
                }
                self.access(work, session, stop, host);
            }
            Command::Camera(order) => {
                self.pacing.lockstep.host_answered();
                self.order(order, session, stop, host);
            }
            Command::Heal => self.heal(session, stop, host),
            Command::Sights { done } => {
                for burst in self.wiring.take_bursts(now_ns, true) {
                    self.observer.note(burst.last_ns, Seen::Stepped(burst));
                }
                let _ = done.send(self.observer.take()); // the caller may have gone
            }
            Command::End => return false,
        }
        true
    }

    fn access(
        &mut self,
        work: impl FnOnce(&mut RigAccess<'_, '_>),
        session: &mut Session<RigBoard>,
        stop: Stop,
        host: &mut dyn Host,
    ) {
        let Self { plant, wiring, line, lines, parts, .. } = self;
        work(&mut RigAccess { session, host, stop, plant, wiring, line, lines, parts });
        self.note_resets(session, stop.at);
        self.wiring.put(&mut session.board_mut().chip, stop.at);
        session.pause_at(self.wiring.next_ns().map(VirtualNanos));
    }

    fn vcd(&mut self) -> Option<&mut Vcd> {
        self.trace.as_mut().and_then(Trace::vcd)
    }

    fn order(
        &mut self,
        order: CameraOrder,
        session: &mut Session<RigBoard>,
        stop: Stop,
        host: &mut dyn Host,
    ) {
        if let Some(vcd) = self.vcd() {
            vcd.ordered(stop.at.0, order);
        }
        self.access(|rig| order.give(rig), session, stop, host);
        if matches!(order, CameraOrder::FreeRun { period_us: 0, .. }) {
            self.patience.end_free_run();
        }
    }

    fn send_held(&mut self, now_ns: u64) {
        if self.held.is_empty() || self.pacing.is_advancing(now_ns) || self.is_braking(now_ns) {
            return;
        }
        let mut bytes = std::mem::take(&mut self.held);
        if self.outlets.bytes.is_some() {
            if self.pacing.is_lockstep() {
                let lockstep = &self.pacing.lockstep;
                let frames = bytes.split_inclusive(|byte| *byte == 0);
                bytes = frames.filter(|frame| !lockstep.repeats(frame)).flatten().copied().collect();
            }
            self.put_on_the_line(bytes, now_ns);
        }
    }

    fn put_on_the_line(&mut self, mut bytes: Vec<u8>, now_ns: u64) {
        self.pacing.lockstep.sent(&bytes, now_ns);
        self.rates.carry(&mut bytes);
        if let Some(vcd) = self.vcd() {
            vcd.sent(now_ns, &bytes);
        }
        self.lines.to_board.carry(&mut bytes);
        for _ in 0..self.observer.sent(now_ns, &bytes) {
            self.schedule.notice(Moment::Request, now_ns);
        }
        self.line.send(&bytes);
    }

    /// Whether time passes only for a braking motor. Host bytes wait until it stops.
    fn is_braking(&mut self, now_ns: u64) -> bool {
        self.pacing.is_lockstep()
            && self.wiring.is_stepping(now_ns)
            && !self.line.is_sending()
            && !self.pacing.lockstep.is_busy(now_ns)
    }

    /// Time of the next stop; records it where a caller requested an advance.
    fn next_look_ns(&mut self, now_ns: u64) -> u64 {
        let look_ns = self.pacing.next_look_ns(now_ns);
        if look_ns < now_ns + self.pacing.quantum_ns() {
            self.looks_at_ns = Some(look_ns);
        }
        look_ns
    }

    fn has_pending(&self) -> bool {
        self.wiring.next_ns().is_some() || !self.schedule.is_over() || self.scenario.unplug_after_ms.is_some()
    }

    /// Without the resistors of docs/rig.md: what noise does to the pins while the chip is reset.
    fn float(&mut self, chip: &mut Chip, at: VirtualNanos) {
        let mut noise = Noise::new(at.0, "floating pins");
        let code = noise.bits() as u16;
        with_plant(&self.plant, |plant| plant.disturb_dac(at.0, code));
        if let Some(memory) = chip.memory() {
            memory.disturb(noise.bits());
        }
        self.wiring.camera_mut().trigger(at.0, true);
        self.wiring.camera_mut().trigger(at.0, false);
    }

    fn note_resets(&mut self, session: &mut Session<RigBoard>, at: VirtualNanos) {
        let (resets, powered) = (session.resets().len(), !session.unpowered());
        if (resets, powered) == (self.resets, self.powered) {
            return;
        }
        let power = (powered != self.powered).then_some(powered);
        if let Some(vcd) = self.vcd() {
            vcd.reset(at.0, power);
        }
        if resets != self.resets {
            self.observer.note(at.0, Seen::Reset);
        }
        if powered != self.powered {
            self.observer.note(at.0, Seen::Powered(powered));
            self.line.lose();
        }
        if powered != self.powered && !powered && session.board_mut().chip.is_cut() {
            // The DAC's output drops with its supply; the amplifier stays on.
            with_plant(&self.plant, |plant| plant.disturb_dac(at.0, 0));
        } else if !self.parts.wires.resistors {
            self.float(&mut session.board_mut().chip, at);
        }
        self.observer.reset();
        (self.resets, self.powered) = (resets, powered);
        self.wiring.board_reset(at);
        self.rates.reset();
        self.pacing.lockstep.reset(at.0);
    }

    /// Whether time stops for waiting pictures. Requests are still answered.
    fn stands_for_pictures(&mut self, now_ns: u64) -> bool {
        !self.pacing.is_advancing(now_ns) && !self.pacing.lockstep.is_asked() && self.patience.is_asked()
    }

    fn serve(&mut self, session: &mut Session<RigBoard>, stop: Stop, host: &mut dyn Host) -> bool {
        let now_ns = stop.at.0;
        loop {
            while let Ok(command) = self.commands.try_recv() {
                if !self.carry_out(command, session, stop, host) {
                    return false;
                }
            }
            self.send_held(now_ns);
            // Time passes until sent bytes have arrived and motion has stopped, even without a host.
            let at_work = self.line.is_sending()
                || !self.adapter.is_empty()
                || self.wiring.is_stepping(now_ns)
                || self.pacing.is_realtime() && self.has_pending();
            let waiting = self.pacing.take_waiting(now_ns, at_work);
            if !waiting.is_empty() {
                let report = self.report(now_ns);
                for done in waiting {
                    let _ = done.send(report); // the caller may have gone
                }
            }
            let command = if self.stands_for_pictures(now_ns) {
                match self.commands.recv_timeout(PICTURE) {
                    Ok(command) => command,
                    Err(RecvTimeoutError::Timeout) => continue,
                    Err(RecvTimeoutError::Disconnected) => Command::End,
                }
            } else if self.pacing.may_pass(now_ns, at_work) {
                let Some(command) = self.pacing.keep_pace(now_ns, &self.commands) else { return true };
                command
            } else {
                let Some(command) = self.pacing.wait(&self.commands) else { continue };
                command
            };
            if !self.carry_out(command, session, stop, host) {
                return false;
            }
        }
    }
}

impl emulator::Driver<RigBoard> for Driver {
    fn on_settled(&mut self, session: &mut Session<RigBoard>, host: &mut dyn Host, settled: Settled) {
        let (at, written) = match settled {
            Settled::Access { access, .. } if NOTHING.contains(&access.address) => {
                // The emulator fails one access only, so the failure is set again.
                session.fail_next(NOTHING.start, NOTHING.end);
                return;
            }
            Settled::Access { access, .. } if SPI4.contains(&access.address) => {
                let chip = &mut session.board_mut().chip;
                if chip.memory().is_some_and(MemoryChip::take_failure) {
                    chip.power(access.virtual_time, false);
                    forget(host);
                }
                return;
            }
            Settled::Access { access, .. }
                if access.kind == AccessKind::Write && LinkRates::watches(access.address) =>
            {
                // These registers have 16 bits.
                self.rates.write(access.address, access.value as u32);
                return;
            }
            Settled::Access { access, .. }
                if access.kind == AccessKind::Write && Wiring::watches(access.address) =>
            {
                (access.virtual_time, Some(access.address))
            }
            Settled::Stop(stop) => (stop.at, None),
            _ => return,
        };
        self.note_resets(session, at);
        self.wiring.look(&mut session.board_mut().chip, at, written);
        session.pause_at(self.wiring.next_ns().map(VirtualNanos));
    }

    fn on_stop(
        &mut self,
        session: &mut Session<RigBoard>,
        stop: Stop,
        host: &mut dyn Host,
    ) -> Option<VirtualNanos> {
        if let Some(error) = session.take_error() {
            self.failed = Some(SimError::Emulator(error.to_string()));
            return None;
        }
        self.note_resets(session, stop.at);
        self.exchange(stop.at.0);
        self.rates.settle();
        self.wiring.put(&mut session.board_mut().chip, stop.at);
        session.board_mut().chip.join_breaks(stop.at);
        self.happen(session, stop, host);
        if let Some(vcd) = self.trace.as_mut().and_then(Trace::vcd)
            && let Some(at_ns) = self.looks_at_ns.take_if(|at_ns| *at_ns <= stop.at.0)
        {
            vcd.looked(stop.at.0, at_ns);
        }
        let runs = match &self.script {
            Some(_) => self.next_of_script(session, stop, host),
            None => self.serve(session, stop, host).then(|| self.next_look_ns(stop.at.0)),
        };
        if let Some(look_ns) = runs {
            // Stop exactly at the next scheduled fault.
            let next_ns = self.schedule.next_ns().map_or(look_ns, |due_ns| look_ns.min(due_ns));
            return Some(VirtualNanos(next_ns.max(stop.at.0 + 1)));
        }
        if let (Some((_, kept)), Some(memory)) = (&mut self.memory, session.board_mut().chip.memory()) {
            *kept = memory.contents().to_vec();
        }
        None
    }
}

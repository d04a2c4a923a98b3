//! Whether virtual time may pass, and for how long the emulator's thread waits where it may not.

use std::{
    sync::mpsc::{Receiver, RecvTimeoutError, Sender},
    time::{Duration, Instant},
};

use crate::{command::Command, config::Pace, lockstep::Lockstep, report::Report};

/// Virtual time between two looks at line, commands and the right to go on.
const QUANTUM_NS: u64 = 100_000;
/// The same when time follows the wall clock.
const REALTIME_QUANTUM_NS: u64 = 1_000_000;
/// So long by the wall clock time stands for a host that the board waits for; then it is taken for gone.
const HOST_PATIENCE: Duration = Duration::from_secs(1);
/// With the wall clock time passes for so long after somebody has said something, and as long as the board is at work; then
/// a rig that nobody asks anything takes no processor time.
const AWAKE: Duration = Duration::from_millis(200);
/// A machine that is this far behind follows the wall clock from where it is.
const BEHIND: Duration = Duration::from_millis(100);

pub struct Pacing {
    pace: Pace,
    pub lockstep: Lockstep,
    /// Until when time passes because somebody said so.
    told_ns: u64,
    /// Who waits for that moment.
    told: Vec<Sender<Report>>,
    /// Who waits for a board that owes nothing.
    settling: Vec<Sender<Report>>,
    /// A moment of the wall clock, and the virtual one that goes with it.
    wall: Option<(Instant, u64)>,
    /// When somebody said something, by the wall clock.
    spoken: Instant,
}

impl Pacing {
    /// Of a board that has just got power.
    pub fn new(pace: Pace) -> Self {
        Self {
            pace,
            lockstep: Lockstep::new(),
            told_ns: 0,
            told: Vec::new(),
            settling: Vec::new(),
            wall: None,
            spoken: Instant::now(),
        }
    }

    /// Time follows the wall clock.
    pub fn is_realtime(&self) -> bool {
        self.pace == Pace::Realtime
    }

    /// Somebody has said something.
    pub fn hear(&mut self) {
        self.spoken = Instant::now();
    }

    /// Time passes only while the board owes something.
    pub fn is_lockstep(&self) -> bool {
        self.pace == Pace::Lockstep
    }

    /// Lets `nanos` pass from now on, and tells `done` then.
    pub fn advance(&mut self, now_ns: u64, nanos: u64, done: Sender<Report>) {
        self.told_ns = self.told_ns.max(now_ns.saturating_add(nanos));
        self.told.push(done);
    }

    /// Lets time pass until the board owes nothing, and tells `done` then.
    pub fn settle(&mut self, done: Sender<Report>) {
        self.settling.push(done);
    }

    /// Whether time passes because somebody said how much of it is to pass.
    pub fn is_told(&self, now_ns: u64) -> bool {
        now_ns < self.told_ns
    }

    /// Whether the board owes something. `at_work`: bytes are on their way to it, or a motor is.
    fn is_busy(&mut self, now_ns: u64, at_work: bool) -> bool {
        self.lockstep.is_busy(now_ns) || at_work
    }

    /// Who has waited for this moment, to be told how the rig is now.
    pub fn take_waiting(&mut self, now_ns: u64, at_work: bool) -> Vec<Sender<Report>> {
        let mut waiting = Vec::new();
        if !self.is_told(now_ns) {
            waiting.append(&mut self.told);
        }
        if !self.settling.is_empty() && !self.is_busy(now_ns, at_work) {
            waiting.append(&mut self.settling);
        }
        waiting
    }

    /// Whether time may pass.
    pub fn may_pass(&mut self, now_ns: u64, at_work: bool) -> bool {
        self.is_told(now_ns)
            || match self.pace {
                Pace::Told => !self.settling.is_empty() && self.is_busy(now_ns, at_work),
                Pace::Lockstep => self.is_busy(now_ns, at_work) && !self.lockstep.waits_for_host(),
                Pace::Realtime => self.is_busy(now_ns, at_work) || self.spoken.elapsed() < AWAKE,
            }
    }

    /// Waits for a command while time stands; `None` where the host has let the board wait for too long.
    pub fn wait(&mut self, commands: &Receiver<Command>) -> Option<Command> {
        // When time passes again, the clock on the wall is followed from then on.
        self.wall = None;
        // Nobody left who could command: end.
        if !self.lockstep.waits_for_host() {
            return Some(commands.recv().unwrap_or(Command::End));
        }
        match commands.recv_timeout(HOST_PATIENCE) {
            Ok(command) => Some(command),
            Err(RecvTimeoutError::Timeout) => {
                self.lockstep.host_spoke();
                None
            }
            Err(RecvTimeoutError::Disconnected) => Some(Command::End),
        }
    }

    /// Where time follows the wall clock: waits until that has caught up; a command ends the wait.
    pub fn keep_pace(&mut self, now_ns: u64, commands: &Receiver<Command>) -> Option<Command> {
        if !self.is_realtime() || self.is_told(now_ns) {
            return None;
        }
        let (wall, virtual_ns) = *self.wall.get_or_insert((Instant::now(), now_ns));
        let due = wall + Duration::from_nanos(now_ns - virtual_ns);
        let wait = due.saturating_duration_since(Instant::now());
        if wait.is_zero() {
            // Too slow a host: the wall clock is followed from here, not chased.
            if due + BEHIND < Instant::now() {
                self.wall = None;
            }
            return commands.try_recv().ok();
        }
        match commands.recv_timeout(wait) {
            Ok(command) => Some(command),
            Err(RecvTimeoutError::Timeout) => None,
            Err(RecvTimeoutError::Disconnected) => Some(Command::End),
        }
    }

    /// Until when the emulator runs where nobody asked for less.
    pub fn quantum_ns(&self) -> u64 {
        if self.is_realtime() { REALTIME_QUANTUM_NS } else { QUANTUM_NS }
    }

    /// Until when the emulator may run before it is asked again.
    pub fn next_look_ns(&self, now_ns: u64) -> u64 {
        let until = now_ns + self.quantum_ns();
        if self.is_told(now_ns) { until.min(self.told_ns) } else { until }
    }
}

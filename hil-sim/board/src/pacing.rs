//! Decides whether virtual time passes, and how long the emulator's thread waits otherwise.

use std::{
    sync::mpsc::{Receiver, RecvTimeoutError, Sender},
    time::{Duration, Instant},
};

use crate::{command::Command, config::Pace, lockstep::Lockstep, report::Report};

/// Virtual time between two checks of line and commands.
const QUANTUM_NS: u64 = 100_000;
const REALTIME_QUANTUM_NS: u64 = 1_000_000;
/// Wall-clock timeout for a host that the board waits for.
const HOST_PATIENCE: Duration = Duration::from_secs(1);
/// In real time the clock runs this long after activity, so that an idle rig uses no processor time.
const AWAKE: Duration = Duration::from_millis(200);
/// A machine that is this late restarts the pace from now.
const BEHIND: Duration = Duration::from_millis(100);

pub struct Pacing {
    pace: Pace,
    pub lockstep: Lockstep,
    advance_until_ns: u64,
    advancing: Vec<Sender<Report>>,
    settling: Vec<Sender<Report>>,
    /// Wall-clock time and the matching virtual time.
    wall: Option<(Instant, u64)>,
    last_activity: Instant,
}

impl Pacing {
    pub fn new(pace: Pace) -> Self {
        Self {
            pace,
            lockstep: Lockstep::new(),
            advance_until_ns: 0,
            advancing: Vec::new(),
            settling: Vec::new(),
            wall: None,
            last_activity: Instant::now(),
        }
    }

    pub fn is_realtime(&self) -> bool {
        self.pace == Pace::Realtime
    }

    pub fn note_activity(&mut self) {
        self.last_activity = Instant::now();
    }

    pub fn is_lockstep(&self) -> bool {
        self.pace == Pace::Lockstep
    }

    pub fn advance(&mut self, now_ns: u64, nanos: u64, done: Sender<Report>) {
        self.advance_until_ns = self.advance_until_ns.max(now_ns.saturating_add(nanos));
        self.advancing.push(done);
    }

    pub fn settle(&mut self, done: Sender<Report>) {
        self.settling.push(done);
    }

    pub fn is_advancing(&self, now_ns: u64) -> bool {
        now_ns < self.advance_until_ns
    }

    /// `at_work`: bytes are in transit or a motor moves.
    fn is_busy(&mut self, now_ns: u64, at_work: bool) -> bool {
        self.lockstep.is_busy(now_ns) || at_work
    }

    pub fn take_waiting(&mut self, now_ns: u64, at_work: bool) -> Vec<Sender<Report>> {
        let mut waiting = Vec::new();
        if !self.is_advancing(now_ns) {
            waiting.append(&mut self.advancing);
        }
        if !self.settling.is_empty() && !self.is_busy(now_ns, at_work) {
            waiting.append(&mut self.settling);
        }
        waiting
    }

    pub fn may_pass(&mut self, now_ns: u64, at_work: bool) -> bool {
        self.is_advancing(now_ns)
            || match self.pace {
                Pace::OnRequest => !self.settling.is_empty() && self.is_busy(now_ns, at_work),
                Pace::Lockstep => self.is_busy(now_ns, at_work) && !self.lockstep.waits_for_host(),
                Pace::Realtime => self.is_busy(now_ns, at_work) || self.last_activity.elapsed() < AWAKE,
            }
    }

    pub fn wait(&mut self, commands: &Receiver<Command>) -> Option<Command> {
        // When time continues, the pace restarts from then.
        self.wall = None;
        // No caller is left: end.
        if !self.lockstep.waits_for_host() {
            return Some(commands.recv().unwrap_or(Command::End));
        }
        match commands.recv_timeout(HOST_PATIENCE) {
            Ok(command) => Some(command),
            Err(RecvTimeoutError::Timeout) => {
                self.lockstep.host_answered();
                None
            }
            Err(RecvTimeoutError::Disconnected) => Some(Command::End),
        }
    }

    /// In real time: waits for the wall clock; a command ends the wait.
    pub fn keep_pace(&mut self, now_ns: u64, commands: &Receiver<Command>) -> Option<Command> {
        if !self.is_realtime() || self.is_advancing(now_ns) {
            return None;
        }
        let (wall, virtual_ns) = *self.wall.get_or_insert((Instant::now(), now_ns));
        let due = wall + Duration::from_nanos(now_ns - virtual_ns);
        let wait = due.saturating_duration_since(Instant::now());
        if wait.is_zero() {
            // Too slow: restart the pace instead of catching up.
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

    pub fn quantum_ns(&self) -> u64 {
        if self.is_realtime() { REALTIME_QUANTUM_NS } else { QUANTUM_NS }
    }

    pub fn next_look_ns(&self, now_ns: u64) -> u64 {
        let until = now_ns + self.quantum_ns();
        if self.is_advancing(now_ns) { until.min(self.advance_until_ns) } else { until }
    }
}

//! Executes a scenario's faults or a recorded run.

use rigless::{
    emulator::{Host, Stop},
    session::Session,
};

use super::{Driver, Last};
use crate::{
    board::RigBoard,
    faults::Moment,
    memory_file::Kept,
    observer::Seen,
    plant::StageName,
    replay::{Entry, Script},
    trace::{Trace, vcd::Vcd},
};

/// A step after this pause starts a new motion.
const MOTION_GAP_NS: u64 = 20_000_000;
const WRITE_GAP_NS: u64 = 5_000_000;

impl Driver {
    pub fn keep(&mut self, memory: Option<Kept>) {
        self.memory = memory.map(|kept| (kept, Vec::new()));
    }

    pub fn follow(&mut self, mut script: Script) {
        let comparer = std::mem::take(&mut script.comparer);
        self.trace = Some(Trace::Vcd(Box::new(Vcd::compare(comparer))));
        self.script = Some(script);
    }

    /// Executes the entries that are due; returns the time of the next stop, `None` at the end.
    pub(super) fn next_of_script(
        &mut self,
        session: &mut Session<RigBoard>,
        stop: Stop,
        host: &mut dyn Host,
    ) -> Option<u64> {
        let now_ns = stop.at.0;
        while let Some(entry) = self.script.as_mut().and_then(|script| script.take_due(now_ns)) {
            match entry {
                Entry::Sent(bytes) => self.put_on_the_line(bytes, now_ns),
                Entry::Ordered(order) => self.order(order, session, stop, host),
                Entry::Healed => self.heal(session, stop, host),
                Entry::Looked { asked_ns } => {
                    if let Some(vcd) = self.vcd() {
                        vcd.looked(now_ns, asked_ns);
                    }
                }
            }
        }
        let departs = self.vcd().is_some_and(|vcd| vcd.departs());
        let next_ns = self.script.as_ref()?.next_ns(now_ns).filter(|_| !departs)?;
        Some(next_ns.min(now_ns + self.pacing.quantum_ns()))
    }

    pub(super) fn heal(&mut self, session: &mut Session<RigBoard>, stop: Stop, host: &mut dyn Host) {
        if let Some(vcd) = self.vcd() {
            vcd.healed(stop.at.0);
        }
        for due in self.schedule.end() {
            self.access(|rig| due.happen(rig), session, stop, host);
        }
        self.observer.note(stop.at.0, Seen::Healed);
    }

    pub(super) fn happen(&mut self, session: &mut Session<RigBoard>, stop: Stop, host: &mut dyn Host) {
        let now_ns = stop.at.0;
        self.notice(session, now_ns);
        for due in self.schedule.take_due(now_ns) {
            let what = due.happening.what.name;
            if let Some(vcd) = self.vcd() {
                vcd.happened(now_ns, what, due.reverts);
            }
            self.observer.note(now_ns, Seen::Happened { what, reverts: due.reverts });
            self.access(|rig| due.happen(rig), session, stop, host);
        }
        if std::mem::take(&mut self.lines.renamed) {
            self.rename_port();
        }
        // Bytes on the line let time pass, and a board that stays without power never takes them.
        if !self.powered && self.schedule.is_over() {
            self.line.lose();
        }
    }

    /// The new port is opened first, because it would get the old name otherwise.
    fn rename_port(&mut self) {
        if let Some(open) = &mut self.outlets.another_port {
            self.outlets.bytes = open();
            self.held.clear();
        }
    }

    /// Detects run events that no frame reports.
    fn notice(&mut self, session: &mut Session<RigBoard>, now_ns: u64) {
        for burst in self.wiring.take_bursts(now_ns, false) {
            self.observer.note(burst.last_ns, Seen::Stepped(burst));
        }
        let Last { step_edges, exposures, memory } = &mut self.last;
        for (edges, stage) in step_edges.iter_mut().zip([StageName::Sensor, StageName::Lens]) {
            let (before, now) = (*edges, self.wiring.step_edges(stage));
            *edges = (now, if now == before.0 { before.1 } else { now_ns });
            if now != before.0 && (before.0 == 0 || now_ns > before.1 + MOTION_GAP_NS) {
                self.schedule.notice(Moment::MotionBegins, now_ns);
            }
        }
        for _ in *exposures..self.wiring.exposures_begun() {
            self.schedule.notice(Moment::ExposureBegins, now_ns);
        }
        *exposures = self.wiring.exposures_begun();
        let written = session.board_mut().chip.memory().map_or(0, |memory| memory.written());
        if written != memory.0 {
            if now_ns > memory.1 + WRITE_GAP_NS {
                self.schedule.notice(Moment::MemoryWrite, now_ns);
            }
            *memory = (written, now_ns);
        }
    }
}

use farnear_protocol::BoardMicros;
use farnear_protocol::frame::{self, Encoded, Kind};
use farnear_protocol::message::{
    Alarm, Axis, Counters, EventKind, Failure, LinkRate, RecordName, ResetCause,
};

use crate::alarms::{self, Alarms};
use crate::camera::Camera;
use crate::correction::Correction;
use crate::events::Events;
use crate::identity::{Identity, LastWords};
use crate::io::{Inputs, MEMORY_BYTES, MemoryWrite, MotorOutputs, Outputs};
use crate::light::Lights;
use crate::link_rate::LinkSpeed;
use crate::memory::contents::{Contents, Restored};
use crate::memory::record::{self, Found, RECORDS};
use crate::memory::store::Store;
use crate::motion::since;
use crate::motion::stage::Stage;
use crate::notes::{Note, Notes};
use crate::program::Shots;
use crate::session::Session;
use crate::settings::{Settings, Values};
use crate::silence::{Silence, Verdict};
use crate::work::Works;

#[derive(Clone, Copy, Debug)]
pub(crate) struct Reboot {
    pub(crate) request: u32,
    /// Start of the deadline: the request, or the end of the motion.
    pub(crate) waiting_since: BoardMicros,
    /// Start of the idle time with nothing to send or write.
    pub(crate) quiet_since: Option<BoardMicros>,
}

#[derive(Clone, Debug)]
pub struct Rig {
    pub(crate) identity: Identity,
    pub(crate) boot: u32,
    /// Settings of the parts, values by key, and both combined.
    pub(crate) parts: Settings,
    pub(crate) values: Values,
    pub(crate) settings: Settings,
    pub(crate) stage: Stage,
    pub(crate) camera: Camera,
    pub(crate) shots: Shots,
    pub(crate) works: Works,
    pub(crate) alarms: Alarms,
    pub(crate) silence: Silence,
    pub(crate) lights: Lights,
    pub(crate) correction: Correction,
    pub(crate) events: Events,
    pub(crate) session: Session,
    pub(crate) link_speed: LinkSpeed,
    pub(crate) notes: Notes,
    pub(crate) reboot: Option<Reboot>,
    pub(crate) store: Store,
    /// Counts at the start of this boot; later ones are added.
    pub(crate) counters: Counters,
    /// Bit per axis that may be moving: intended in memory, and actual.
    in_motion: u8,
    in_motion_stored: u8,
    pub(crate) emergency_stop: bool,
    pub(crate) supply_low: bool,
    wrote: bool,
    rested: bool,
    pending: Option<Pending>,
}

#[derive(Clone, Copy, Debug)]
struct Pending {
    found: Option<[Found; RECORDS]>,
    in_motion: u8,
}

/// RAM limit of the rig.
const _: () = assert!(size_of::<Rig>() <= 36 * 1024);

impl Rig {
    /// The rig of `docs/rig.md` after a reset at `now`: 25 KiB, for static memory. `memory` is the FRAM, if it answers.
    pub fn new(identity: Identity, memory: Option<&[u8; MEMORY_BYTES]>, now: BoardMicros) -> Self {
        Self::with_parts(identity, Settings::DEFAULT, memory, now)
    }

    pub fn with_parts(
        identity: Identity,
        parts: Settings,
        memory: Option<&[u8; MEMORY_BYTES]>,
        now: BoardMicros,
    ) -> Self {
        let Restored { mut counters, in_motion, alarms, values, shots, correction } =
            memory.map_or_else(Restored::nothing, |memory| Restored::from(memory, &parts));
        // Both increase; after a power loss only the memory's counts, without memory only the other.
        let boot = counters.boots.saturating_add(1).max(identity.boot);
        counters.boots = boot;
        let settings = parts.with(&values);
        let mut events = Events::new();
        events.push(now, EventKind::Started { cause: identity.reset_cause });
        let mut store = memory.map_or_else(Store::absent, Store::new);
        store.mark(RecordName::Counters);
        // Built in place to save stack.
        Self {
            identity,
            boot,
            parts,
            values,
            settings,
            stage: Stage::new(&settings, identity.piezo_code),
            camera: Camera::new(settings.camera),
            shots,
            works: Works::new(),
            alarms,
            silence: Silence::new(now),
            lights: Lights::new(),
            correction: Correction::new(correction),
            events,
            session: Session::new(boot),
            link_speed: LinkSpeed::new(),
            notes: Notes::new(),
            reboot: None,
            store,
            counters,
            in_motion: 0,
            in_motion_stored: 0,
            emergency_stop: false,
            supply_low: false,
            wrote: false,
            rested: false,
            pending: Some(Pending { found: memory.map(record::find_all), in_motion }),
        }
    }

    /// Writes before sending or receiving, until `None`: a power loss could repeat a reported boot number.
    pub fn keep_boot(&mut self) -> Option<MemoryWrite> {
        if !self.store.is_marked(RecordName::Counters) {
            return None;
        }
        let contents = Contents {
            counters: self.counters(),
            // Moving axes stay recorded until their alarm is stored.
            in_motion: self.pending.map_or(self.in_motion, |pending| pending.in_motion),
            alarms: &self.alarms,
            values: &self.values,
            shots: &self.shots,
            correction: self.correction.stored(),
        };
        let (write, _) = self.store.tick(|record, index| contents.block(record, index))?;
        Some(write)
    }

    pub(crate) const fn has_session(&self) -> bool {
        self.session.is_open()
    }

    /// Reports the last boot's end and the memory's state first.
    fn begin(&mut self, now: BoardMicros) {
        let Some(Pending { found, in_motion }) = self.pending.take() else { return };
        if found.is_none() && self.parts.memory {
            self.alarm(Alarm::MemoryMissing, now);
        }
        if self.identity.own_clock {
            self.alarm(Alarm::ClockLost, now);
        }
        for (record, found) in record::ALL.into_iter().zip(found.into_iter().flatten()) {
            self.tell_of_record(record, found, now);
        }
        self.tell_of_last_boot(in_motion, now);
    }

    fn tell_of_record(&mut self, record: RecordName, found: Found, now: BoardMicros) {
        match found {
            Found::Good { sequence, repaired: true, .. } => {
                self.counters.repaired = self.counters.repaired.saturating_add(1);
                self.store.mark(RecordName::Counters);
                self.events.push(now, EventKind::RecordRepaired { record, sequence });
            }
            Found::Lost => {
                self.store.mark(record);
                self.alarm(Alarm::RecordLost { record }, now);
            }
            Found::Good { .. } | Found::Blank => {}
        }
    }

    /// Latches the cause of the last boot's end.
    fn tell_of_last_boot(&mut self, in_motion: u8, now: BoardMicros) {
        let cause = match (self.identity.last_words, self.identity.reset_cause) {
            (Some(LastWords::StackOverflow), _) => Some(Alarm::StackOverflow),
            (Some(LastWords::Panic), _) => Some(Alarm::Panic),
            (None, ResetCause::Watchdog) => Some(Alarm::Watchdog),
            (None, ResetCause::BrownOut) => Some(Alarm::BrownOut),
            (None, _) => None,
        };
        if let Some(alarm) = cause {
            self.alarm(alarm, now);
        }
        for axis in Axis::ALL {
            if in_motion & bit(axis) != 0
                && let Some(stepper) = self.stage.stepper_mut(axis)
            {
                stepper.was_interrupted();
                self.alarm(Alarm::MotionInterrupted { axis }, now);
            }
        }
    }

    pub const fn identity(&self) -> &Identity {
        &self.identity
    }

    pub fn shot(&self, index: u8) -> Option<&farnear_protocol::message::Shot> {
        self.shots.get(index)
    }

    pub const fn boot(&self) -> u32 {
        self.boot
    }

    /// Accepts a byte; complete requests wait for [`Self::serve`].
    pub fn receive(&mut self, byte: u8) {
        self.session.receive(byte);
    }

    /// A request or answer waits for [`Self::serve`].
    pub(crate) fn has_work(&self) -> bool {
        self.session.has_work()
    }

    pub(crate) fn stop_waits(&self) -> bool {
        self.session.stop_waits()
    }

    /// Valid or not; wraps.
    pub(crate) const fn frames_received(&self) -> u32 {
        let link = self.session.counters();
        link.frames.wrapping_add(link.bad_frames)
    }

    /// A step for the host: encodes an answer for [`Self::transmit`], or executes a request. `false` if idle.
    pub fn serve(&mut self, now: BoardMicros) -> bool {
        if self.session.has_answer() {
            self.session.put_answer();
            return true;
        }
        if !self.session.has_request() {
            return false;
        }
        self.begin(now);
        let heard = self.session.heard();
        let incoming = self.session.next_request();
        if self.session.heard() != heard {
            self.silence.hear(now);
        }
        if let Some(incoming) = incoming {
            let answer = self.carry_out(&incoming, now);
            if let Err(error) = &answer {
                self.notes.add(Note::Refused { request: incoming.id, error: error.clone() });
            }
            self.session.answer(incoming, answer);
        }
        true
    }

    pub(crate) fn take_note(&mut self) -> Option<Note> {
        self.notes.take()
    }

    /// The new link rate, when it changes. `sent`: all frames have left.
    pub(crate) fn link_rate_due(
        &mut self,
        now: BoardMicros,
        sent: impl FnOnce() -> bool,
    ) -> Option<LinkRate> {
        let (session, requests) = (&self.session, self.session.counters().frames);
        let rate = self.link_speed.due(now, requests, || session.all_sent() && sent())?;
        self.notes.add(Note::LinkRate(rate));
        Some(rate)
    }

    /// The next frame, answers before events; call until `None`.
    pub fn transmit(&mut self) -> Option<Encoded> {
        if let Some(answer) = self.session.send() {
            return Some(answer);
        }
        let (number, event) = self.events.send()?;
        frame::encode(self.session.header(Kind::Event, number), event)
    }

    /// One control tick, [`crate::io::TICK_HZ`] times a second; apply the outputs immediately.
    pub fn tick(&mut self, inputs: &Inputs) -> Outputs {
        let now = inputs.now;
        self.begin(now);
        let sinks = inputs.supply_low && !self.supply_low;
        (self.emergency_stop, self.supply_low) = (inputs.emergency_stop, inputs.supply_low);
        // First: an open circuit has cut the pulses, which is not a timer fault.
        self.watch_inputs(inputs);
        if sinks {
            self.stage.fine.release();
        }
        self.stage.sense(inputs, core::mem::take(&mut self.rested));
        let stage = &self.stage;
        self.notes.look(|axis| stage.state(axis));
        self.camera.sense(inputs);
        self.watch(now);
        self.advance(now);
        self.remember_motion();
        self.lights.tick(self.silence.time(now), now);
        let mut outputs = Outputs {
            piezo_dac: None,
            coarse: MotorOutputs::default(),
            lens: MotorOutputs::default(),
            lights: self.lights.levels(),
            cancel_flash: self.lights.take_cancel(),
            listen: self.camera.is_listening(),
            trigger: self.camera.take_order(),
            memory: None,
            reset: self.reset_is_due(now),
        };
        self.stage.act(inputs, &mut outputs);
        outputs.memory = self.write();
        outputs
    }

    /// Whether the next tick may follow after [`crate::io::REST_TICKS`]: nothing is active, and all inputs are steady.
    pub(crate) fn rest(&mut self) -> bool {
        let all_sent = self.session.all_sent() && self.events.all_sent() && self.link_speed.is_settled();
        let idle = self.works.any().is_none() && self.reboot.is_none() && self.camera.is_idle();
        self.rested =
            all_sent && idle && self.store.is_idle() && !self.supply_low && self.stage.is_settled_idle();
        self.rested
    }

    fn watch_inputs(&mut self, inputs: &Inputs) {
        let now = inputs.now;
        if inputs.emergency_stop {
            self.alarm(Alarm::EmergencyStop, now);
            // Without their supply the drivers forget the microstep, so rotors at rest snap by up to half a period afterwards.
            self.stage.coarse.lose();
            self.stage.lens.lose();
        }
        if inputs.supply_low {
            self.alarm(Alarm::SupplyLow, now);
        }
        if inputs.memory_failed {
            self.alarm(Alarm::MemoryMissing, now);
        }
        if inputs.link_overflow {
            self.alarm(Alarm::QueueOverflow, now);
        }
    }

    fn watch(&mut self, now: BoardMicros) {
        for axis in Axis::ALL {
            let fault = self.stage.stepper_mut(axis).and_then(|stepper| stepper.take_fault());
            if let Some(alarm) = fault.and_then(|fault| alarms::of_fault(axis, fault)) {
                self.alarm(alarm, now);
            }
        }
        if self.stage.fine.take_failure() {
            self.alarm(Alarm::Gauge, now);
        }
        match self.silence.check(now, self.works.shortest_silence()) {
            Verdict::Fine => {}
            Verdict::Remind(request) => self.events.push(now, EventKind::StillThere { request }),
            Verdict::Expired(request) => self.alarm(Alarm::HostSilence { request }, now),
        }
    }

    /// Stops everything, latches and reports the cause; no effect if it is latched.
    pub(crate) fn alarm(&mut self, alarm: Alarm, now: BoardMicros) {
        let Some(record) = self.alarms.raise(alarm, self.boot, now) else { return };
        self.counters.alarms = self.counters.alarms.saturating_add(1);
        self.notes.add(Note::Alarm(record));
        self.events.push(now, EventKind::Alarm(record));
        self.store.mark(RecordName::Alarms);
        self.store.mark(RecordName::Counters);
        self.stage.abort();
        self.camera.give_up();
        self.lights.off();
        let number = record.number;
        let own = alarms::as_failure(&alarm);
        for axis in Axis::ALL {
            let reason = own.filter(|(of, _)| *of == axis).map(|(_, reason)| reason);
            self.works.end(axis, reason.unwrap_or(Failure::Alarm { number }));
        }
        match own {
            Some((axis, reason)) => self.works.end_whole(Some(axis), reason),
            None => self.works.end_whole(None, Failure::Alarm { number }),
        }
    }

    /// Records axes that may move before they do.
    fn remember_motion(&mut self) {
        let mut in_motion = 0;
        for axis in Axis::ALL {
            if self.works.is_on(axis) || !self.stage.is_still(axis) {
                in_motion |= bit(axis);
            }
        }
        if in_motion != self.in_motion {
            self.in_motion = in_motion;
            self.store.mark(RecordName::Counters);
        }
        for axis in Axis::ALL {
            let known = !self.store.is_fitted() || self.in_motion_stored & bit(axis) != 0;
            if let Some(stepper) = self.stage.stepper_mut(axis) {
                stepper.permit(known);
            }
        }
    }

    fn write(&mut self) -> Option<MemoryWrite> {
        // A tick has time for a write or the host, in turns; with a sinking supply only the write counts.
        let all_sent = self.session.all_sent() && self.events.all_sent();
        let gives_way = self.wrote && !self.supply_low && !all_sent;
        self.wrote = false;
        if gives_way || self.store.is_idle() {
            return None;
        }
        let contents = Contents {
            counters: self.counters(),
            in_motion: self.in_motion,
            alarms: &self.alarms,
            values: &self.values,
            shots: &self.shots,
            correction: self.correction.stored(),
        };
        let (write, done) = self.store.tick(|record, index| contents.block(record, index))?;
        if done == Some(RecordName::Counters) {
            // A change restarts the record, so the written state is current.
            self.in_motion_stored = self.in_motion;
        }
        self.wrote = true;
        Some(write)
    }

    pub(crate) fn counters(&self) -> Counters {
        let base = &self.counters;
        Counters {
            triggers: base.triggers + u64::from(self.camera.triggers()),
            coarse_steps: base.coarse_steps + self.stage.coarse.total_pulses(),
            lens_steps: base.lens_steps + self.stage.lens.total_pulses(),
            ..*base
        }
    }

    /// Everything is at rest, and sent and written, or that took too long. A stepper brakes as long as its ramp.
    fn reset_is_due(&mut self, now: BoardMicros) -> bool {
        let all_sent = self.session.all_sent() && self.events.all_sent();
        let quiet = self.works.any().is_none() && all_sent && self.store.is_idle();
        let moving = !self.stage.steppers_still();
        let link = &self.settings.link;
        let Some(reboot) = &mut self.reboot else { return false };
        if moving {
            reboot.waiting_since = now;
        }
        if !quiet {
            reboot.quiet_since = None;
            return since(reboot.waiting_since, now) > link.reset_deadline;
        }
        let quiet_since = *reboot.quiet_since.get_or_insert(now);
        since(quiet_since, now) >= link.reset_drain
    }
}

/// A stepper's bit in memory; the piezo's absolute gauge needs none.
const fn bit(axis: Axis) -> u8 {
    match axis {
        Axis::SensorCoarse => 1,
        Axis::Lens => 2,
        Axis::SensorFine => 0,
    }
}

//! A fake board: the bench's hardware behind the loop's trait, with a record of the loop's calls.

use std::collections::VecDeque;

use farnear_protocol::message::LinkRate;
use farnear_protocol::{BoardMicros, Log, Request};
use farnear_rig::control::{Board, Note};
use farnear_rig::io::{ExposureEdges, MotorInputs, Outputs, StrobeEdges, TICK_US};

use crate::bench::hardware::Hardware;
use crate::bench::{BOOT, SESSION, request_frame};

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Call {
    Now,
    Receive,
    SampleGauge,
    Gauge,
    Coarse,
    Lens,
    EmergencyStop,
    SupplyLow,
    Exposure,
    Strobe,
    Apply,
    Send,
    SetLinkRate,
    TakeLog,
    FeedWatchdog,
    Reset,
}

pub struct Fake {
    pub hardware: Hardware,
    pub now: u64,
    pub calls: Vec<Call>,
    pub hangs_after: Option<usize>,
    /// The emergency stop opens just before this call.
    pub opens_before: Option<Call>,
    pub dry: bool,
    received: VecDeque<u8>,
    next_id: u32,
    /// Frames that fit the link in a tick, and those sent in this one.
    pub room: usize,
    taken: usize,
    /// Ticks until the last frame has left.
    pub sending: usize,
    pub sent: Vec<Vec<u8>>,
    pub rates: Vec<(u64, LinkRate)>,
    pub logs: VecDeque<Log>,
    log_number: u32,
    pub notes: Vec<Note>,
    pub fed: usize,
    pub resets: usize,
    pub reset_at: u64,
}

impl Fake {
    /// Stage A at `position_um` from its home switch.
    pub fn new(position_um: f64) -> Self {
        Self {
            hardware: Hardware::new(position_um),
            now: 0,
            calls: Vec::new(),
            hangs_after: None,
            opens_before: None,
            dry: false,
            received: VecDeque::new(),
            next_id: 1,
            room: 4,
            taken: 0,
            sending: 0,
            sent: Vec::new(),
            rates: Vec::new(),
            logs: VecDeque::new(),
            log_number: 0,
            notes: Vec::new(),
            fed: 0,
            resets: 0,
            reset_at: 0,
        }
    }

    pub fn ask(&mut self, request: &Request) {
        if self.next_id == 1 {
            self.received.extend(request_frame(1, BOOT, SESSION, &Request::OpenSession));
            self.next_id = 2;
        }
        self.received.extend(request_frame(self.next_id, BOOT, SESSION, request));
        self.next_id += 1;
    }

    pub fn hear(&mut self, bytes: &[u8]) {
        self.received.extend(bytes);
    }

    pub fn pass(&mut self) {
        self.now += u64::from(TICK_US);
        self.sending = self.sending.saturating_sub(1);
        self.taken = 0;
    }

    fn did(&mut self, call: Call) {
        if self.opens_before == Some(call) {
            self.opens_before = None;
            self.hardware.open_circuit();
        }
        assert!(self.hangs_after != Some(self.calls.len()), "the board hangs");
        self.calls.push(call);
    }
}

impl Board for Fake {
    fn now(&mut self) -> BoardMicros {
        self.did(Call::Now);
        BoardMicros(self.now)
    }

    fn receive(&mut self, take: impl FnMut(u8)) -> bool {
        self.did(Call::Receive);
        self.received.drain(..).for_each(take);
        self.hardware.faults.link_overflow
    }

    fn sample_gauge(&mut self) {
        self.did(Call::SampleGauge);
    }

    fn gauge(&mut self) -> Option<u32> {
        self.did(Call::Gauge);
        self.hardware.gauge()
    }

    fn coarse(&mut self) -> MotorInputs {
        self.did(Call::Coarse);
        let mut inputs = self.hardware.coarse.inputs(1e-3 * self.hardware.piezo_nm);
        inputs.stepper.underrun |= self.dry;
        inputs
    }

    fn lens(&mut self) -> MotorInputs {
        self.did(Call::Lens);
        self.hardware.lens.inputs(0.0)
    }

    fn emergency_stop(&mut self) -> bool {
        self.did(Call::EmergencyStop);
        self.hardware.faults.emergency_stop
    }

    fn supply_low(&mut self) -> bool {
        self.did(Call::SupplyLow);
        self.hardware.faults.supply_low
    }

    fn memory_failed(&mut self) -> bool {
        false
    }

    fn exposure(&mut self, now: BoardMicros) -> Option<ExposureEdges> {
        self.did(Call::Exposure);
        self.hardware.exposure(now)
    }

    fn strobe(&mut self, now: BoardMicros) -> Option<StrobeEdges> {
        self.did(Call::Strobe);
        self.hardware.strobe(now)
    }

    fn apply(&mut self, outputs: &Outputs) {
        self.did(Call::Apply);
        self.hardware.run(outputs, self.now);
    }

    fn has_room(&self) -> bool {
        self.taken < self.room
    }

    fn send(&mut self, bytes: &[u8]) {
        assert!(self.has_room(), "a frame without room");
        self.did(Call::Send);
        self.taken += 1;
        self.sent.push(bytes.to_vec());
    }

    fn all_sent(&self) -> bool {
        self.sending == 0
    }

    fn set_link_rate(&mut self, rate: LinkRate) {
        self.did(Call::SetLinkRate);
        self.rates.push((self.now, rate));
    }

    fn take_log(&mut self) -> Option<(u32, Log)> {
        self.did(Call::TakeLog);
        let log = self.logs.pop_front()?;
        self.log_number += 1;
        Some((self.log_number - 1, log))
    }

    fn note(&mut self, note: Note) {
        self.notes.push(note);
    }

    fn feed_watchdog(&mut self) {
        self.did(Call::FeedWatchdog);
        self.fed += 1;
    }

    fn reset(&mut self) {
        self.did(Call::Reset);
        (self.resets, self.reset_at) = (self.resets + 1, self.now);
    }
}

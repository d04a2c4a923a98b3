//! Wires between board and plant: pins to plant and plant to pins.

use rigless::{
    device::Level,
    mcu::Operate,
    soc::{Width, st::tim::Channel},
    time::VirtualNanos,
};

use crate::{
    board::{Chip, PinName, STROBE, TIM2, TRIGGER, pins},
    camera::{Camera, Edge},
    chips::{SharedPlant, with_plant},
    lights::Lights,
    parts::{DriverParts, Parts},
    plant::{Contact, ExposureTruth, Noise, StageName},
    stop_wire::StopWire,
};

/// Alternate functions of TIM2, and of TIM3 and TIM4 (DS9405, table 12); other pins are disconnected.
pub const TIM2_FUNCTION: u8 = 1;
const ENCODER_FUNCTION: u8 = 2;
/// TIM2's counter: lower 32 bits of the firmware's microseconds.
const TIM2_CNT: u64 = 0x4000_0024;
/// Registers that affect watched pins: TIM2, TIM1 and TIM8, port F.
const WATCHED: [std::ops::Range<u64>; 3] = [0x4000_0000..0x4000_0400, 0x4001_0000..0x4001_0800, DRIVER_PORT];
const DRIVER_PORT: std::ops::Range<u64> = 0x4002_1400..0x4002_1800;

/// Standstill time. The first step of the slowest permitted ramp comes after 10 ms.
const STANDS_NS: u64 = 20_000_000;

#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Shot {
    /// Trigger number since the board's reset, from 0, or the id given by the camera's host.
    pub id: u32,
    pub board_us: u64,
    pub begin_ns: u64,
    pub end_ns: u64,
    pub truth: ExposureTruth,
    pub light: [f64; 2],
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Burst {
    pub stage: StageName,
    pub first_ns: u64,
    pub last_ns: u64,
    pub steps: u64,
}

#[derive(Debug)]
struct StageWires {
    name: StageName,
    step: bool,
    driver: DriverWires,
    /// Home and far switch, and the time of the next spontaneous change.
    contacts: [Contact; 2],
    due_ns: u64,
    counts: i64,
    /// Encoder counts without motion, and whether the wires are cut.
    slip: i64,
    cut: bool,
    burst: Option<Burst>,
    step_edges: u64,
    last_step_ns: u64,
    record: Option<Vec<u64>>,
}

#[derive(Debug)]
pub struct Wiring {
    plant: SharedPlant,
    camera: Camera,
    stages: [StageWires; 2],
    /// Contacts of the emergency stop.
    stops: [StopWire; 2],
    stops_due_ns: u64,
    lights: Lights,
    trigger: bool,
    strobe_cut: bool,
    exposures_begun: u64,
    begun: Option<(u32, u64, u64)>,
    shots: Vec<Shot>,
    /// Time of the board's last reset.
    reset_ns: u64,
}

pub fn channel(number: u8) -> Channel {
    Channel::new(number).unwrap_or_else(|| unreachable!("timers have channels 1 to 4"))
}

#[derive(Debug)]
struct DriverWires {
    parts: DriverParts,
    enabled_ns: Option<u64>,
    away: bool,
    direction_ns: u64,
    /// No motion since it was switched on.
    fresh: bool,
    violations: u64,
}

impl DriverWires {
    fn look(&mut self, chip: &mut Chip, name: StageName, (at_ns, last_step_ns): (u64, u64)) {
        let enabled = chip.level(pins(name).enable) == Level::Low;
        if enabled != self.enabled_ns.is_some() {
            self.enabled_ns = enabled.then_some(at_ns);
            self.fresh = true;
        }
        let away = chip.level(pins(name).direction) == Level::High;
        if away != std::mem::replace(&mut self.away, away) {
            self.direction_ns = at_ns;
            let held_ns = at_ns.saturating_sub(last_step_ns);
            self.violations += u64::from(last_step_ns > 0 && held_ns < self.parts.direction_hold_ns);
        }
    }

    /// Whether the driver accepts the edge; records timing violations.
    fn step(&mut self, at_ns: u64) -> bool {
        let Some(enabled_ns) = self.enabled_ns else { return false };
        let too_early = at_ns.saturating_sub(self.direction_ns) < self.parts.direction_setup_ns;
        let stood_ns = at_ns.saturating_sub(enabled_ns);
        let not_tuned = self.fresh && stood_ns < self.parts.standstill_ms.saturating_mul(1_000_000);
        self.violations += u64::from(too_early) + u64::from(not_tuned);
        self.fresh = false;
        true
    }
}

impl StageWires {
    fn new(plant: &SharedPlant, name: StageName, (seed, parts): (u64, &Parts)) -> Self {
        let (counts, home, far) = with_plant(plant, |plant| {
            let stage = plant.stage(name);
            (stage.encoder_counts(), stage.home_closed(), stage.far_closed())
        });
        let purposes = match name {
            StageName::Sensor => ["home contact", "far contact"],
            StageName::Lens => ["lens home contact", "lens far contact"],
        };
        let contact = |purpose, actuated| Contact::new(parts.switches, Noise::new(seed, purpose), actuated);
        let driver = DriverWires {
            parts: parts.driver,
            enabled_ns: None,
            away: false,
            direction_ns: 0,
            fresh: true,
            violations: 0,
        };
        Self {
            name,
            step: false,
            driver,
            contacts: [contact(purposes[0], home), contact(purposes[1], far)],
            due_ns: 0,
            counts,
            slip: 0,
            cut: false,
            burst: None,
            step_edges: 0,
            last_step_ns: 0,
            record: None,
        }
    }

    /// Reads STEP, and after a write DIR and EN.
    fn look(&mut self, plant: &SharedPlant, chip: &mut Chip, at: VirtualNanos, driver_written: bool) {
        if driver_written {
            self.driver.look(chip, self.name, (at.0, self.last_step_ns));
        }
        if driver_written || self.due_ns <= at.0 {
            self.put(plant, chip, at);
        }
        let (pin, timer, function) = pins(self.name).step;
        let step = is_high(chip, pin, function, |chip| {
            let (timer, registers) = chip.part().advanced_timer(timer);
            timer.output(channel(1), registers)
        });
        if step == std::mem::replace(&mut self.step, step) || !step {
            return;
        }
        self.step_edges += 1;
        self.last_step_ns = at.0;
        let (stage, first_ns) = (self.name, at.0);
        let burst = self.burst.get_or_insert(Burst { stage, first_ns, last_ns: first_ns, steps: 0 });
        (burst.last_ns, burst.steps) = (at.0, burst.steps + 1);
        if let Some(record) = &mut self.record {
            record.push(at.0);
        }
        if !self.driver.step(at.0) {
            return;
        }
        let away = self.driver.away;
        with_plant(plant, |plant| plant.step_edge(at.0, self.name, away));
        self.put(plant, chip, at);
    }

    fn put(&mut self, plant: &SharedPlant, chip: &mut Chip, at: VirtualNanos) {
        let (counts, home, far) = with_plant(plant, |plant| {
            let stage = plant.stage(self.name);
            (stage.encoder_counts(), stage.home_closed(), stage.far_closed())
        });
        if self.cut {
            self.slip = self.counts - counts;
        }
        let counts = counts + self.slip;
        let ([a, b], _) = pins(self.name).encoder;
        if self.counts != counts {
            let connected = [a, b].iter().all(|pin| chip.function(*pin) == Some(ENCODER_FUNCTION));
            while self.counts != counts {
                self.counts += (counts - self.counts).signum();
                if connected {
                    self.put_encoder(chip, at);
                }
            }
        }
        // Normally closed to ground: an actuated switch opens, and the pull-up makes the pin high.
        let driven = self.driver.enabled_ns.is_some();
        let wires = [(pins(self.name).home, home), (pins(self.name).far, far)];
        for (contact, (pin, actuated)) in self.contacts.iter_mut().zip(wires) {
            chip.drive_pin(at, pin, Level::from(contact.level(at.0, actuated, driven)));
        }
        let due = self.contacts.iter().map(|contact| contact.next_ns(at.0, driven)).min();
        self.due_ns = due.unwrap_or(u64::MAX);
    }

    /// Quadrature; A leads B when the count rises.
    fn put_encoder(&self, chip: &mut Chip, at: VirtualNanos) {
        let (_, timer) = pins(self.name).encoder;
        let phase = self.counts.rem_euclid(4);
        chip.drive_timer(at, timer, channel(1), Level::from(phase == 1 || phase == 2));
        chip.drive_timer(at, timer, channel(2), Level::from(phase >= 2));
    }
}

impl Wiring {
    /// Connects board and plant at power-on; `seed` sets the contact bounce.
    pub fn new(plant: SharedPlant, camera: Camera, chip: &mut Chip, parts: (u64, &Parts)) -> Self {
        let stages = [StageName::Sensor, StageName::Lens].map(|name| StageWires::new(&plant, name, parts));
        let mut wiring = Self {
            plant,
            camera,
            stages,
            stops: ["stop contact", "lens stop contact"]
                .map(|purpose| StopWire::new(&parts.1.wires, Noise::new(parts.0, purpose))),
            stops_due_ns: u64::MAX,
            lights: Lights::default(),
            trigger: false,
            strobe_cut: false,
            exposures_begun: 0,
            begun: None,
            shots: Vec::new(),
            reset_ns: 0,
        };
        for stage in &mut wiring.stages {
            stage.put_encoder(chip, VirtualNanos(0));
            stage.put(&wiring.plant, chip, VirtualNanos(0));
        }
        wiring
    }

    pub fn watches(address: u64) -> bool {
        Lights::watches(address) || WATCHED.iter().any(|range| range.contains(&address))
    }

    /// Reads the pins after a register was `written` (if any), and executes due camera events.
    pub fn look(&mut self, chip: &mut Chip, at: VirtualNanos, written: Option<u64>) {
        let driver_written = written.is_some_and(|address| DRIVER_PORT.contains(&address));
        if written.is_some_and(Lights::watches) {
            self.lights.look(chip, at);
        }
        while let Some((at_ns, edge)) = self.camera.due(at.0) {
            self.expose(chip, at, at_ns, edge);
        }
        for stage in &mut self.stages {
            stage.look(&self.plant, chip, at, driver_written);
        }
        if self.stops_due_ns <= at.0 {
            self.put_stops(chip, at);
        }
        let trigger = is_high(chip, TRIGGER, TIM2_FUNCTION, |chip| {
            let (timer, registers) = chip.part().timer(TIM2);
            timer.output(channel(3), registers)
        });
        if trigger != self.trigger {
            self.trigger = trigger;
            self.camera.trigger(at.0, trigger);
        }
    }

    /// Updates encoders and switches; a rotor also turns between two steps.
    pub fn put(&mut self, chip: &mut Chip, at: VirtualNanos) {
        for stage in &mut self.stages {
            stage.put(&self.plant, chip, at);
        }
        self.put_stops(chip, at);
    }

    /// `pressed` opens the contacts; takes effect at the next [`Self::put`].
    pub fn press_stop(&mut self, pressed: bool) {
        self.stops.iter_mut().for_each(|stop| stop.press(pressed));
    }

    fn put_stops(&mut self, chip: &mut Chip, at: VirtualNanos) {
        for (stop, stage) in self.stops.iter_mut().zip([StageName::Sensor, StageName::Lens]) {
            chip.drive_pin(at, pins(stage).stop.0, Level::from(stop.is_high(at.0)));
        }
        self.stops_due_ns = self.stops.iter().map(|stop| stop.next_ns(at.0)).min().unwrap_or(u64::MAX);
        chip.join_breaks(at);
    }

    fn expose(&mut self, chip: &mut Chip, at: VirtualNanos, at_ns: u64, edge: Edge) {
        match edge {
            Edge::Begin(id) => {
                self.exposures_begun += 1;
                self.lights.begin_exposure(at_ns);
                with_plant(&self.plant, |plant| plant.begin_exposure(at_ns));
                let low = Operate::peek(chip, at, TIM2_CNT, Width::W32).unwrap_or(0);
                let since_reset_us = at_ns.saturating_sub(self.reset_ns) / 1000;
                self.begun = Some((id, board_us(since_reset_us, low as u32), at_ns));
            }
            Edge::End => {
                let truth = with_plant(&self.plant, |plant| plant.end_exposure(at_ns));
                if let (Some(truth), Some((id, board_us, begin_ns))) = (truth, self.begun.take()) {
                    let light = self.lights.end_exposure(at_ns, at_ns - begin_ns);
                    self.shots.push(Shot { id, board_us, begin_ns, end_ns: at_ns, truth, light });
                }
            }
        }
        self.put_strobe(chip, at);
    }

    pub fn next_ns(&self) -> Option<u64> {
        let switches_ns = self.stages.iter().map(|stage| stage.due_ns).min();
        self.camera
            .next_ns()
            .into_iter()
            .chain(switches_ns)
            .chain([self.stops_due_ns])
            .min()
            .filter(|at| *at < u64::MAX)
    }

    /// STEP too soon after DIR or enable, DIR too soon after STEP.
    pub fn driver_violations(&self, name: StageName) -> u64 {
        self.stage(name).driver.violations
    }

    pub fn take_shots(&mut self) -> Vec<Shot> {
        std::mem::take(&mut self.shots)
    }

    fn stage(&self, name: StageName) -> &StageWires {
        match name {
            StageName::Sensor => &self.stages[0],
            StageName::Lens => &self.stages[1],
        }
    }

    /// Rising STEP edges since power-on, whether or not the driver was on.
    pub fn step_edges(&self, name: StageName) -> u64 {
        self.stage(name).step_edges
    }

    pub fn last_step_ns(&self, name: StageName) -> u64 {
        self.stage(name).last_step_ns
    }

    /// Whether a motor moves: steps of the slowest ramp are closer than `STANDS_NS`.
    pub fn is_stepping(&self, now_ns: u64) -> bool {
        self.stages.iter().any(|stage| stage.step_edges > 0 && now_ns < stage.last_step_ns + STANDS_NS)
    }

    /// Takes the completed bursts, or (`all`) also current ones.
    pub fn take_bursts(&mut self, now_ns: u64, all: bool) -> Vec<Burst> {
        let ended = |burst: &mut Burst| all || now_ns >= burst.last_ns + STANDS_NS;
        self.stages.iter_mut().filter_map(|stage| stage.burst.take_if(ended)).collect()
    }

    pub fn begun_ns(&self) -> Option<u64> {
        self.begun.map(|(_, _, at_ns)| at_ns)
    }

    pub fn exposures_begun(&self) -> u64 {
        self.exposures_begun
    }

    /// A resistor holds a cut wire low.
    pub fn cut_strobe(&mut self, chip: &mut Chip, at: VirtualNanos, cut: bool) {
        self.strobe_cut = cut;
        self.put_strobe(chip, at);
    }

    fn put_strobe(&mut self, chip: &mut Chip, at: VirtualNanos) {
        let level = Level::from(self.begun.is_some() && !self.strobe_cut);
        chip.drive_pin(at, STROBE, level);
        // The timer's input is low unless the pin is switched to it, also after a reset.
        let connected = chip.function(STROBE) == Some(TIM2_FUNCTION);
        let input = if connected { level } else { Level::Low };
        chip.drive_timer(at, TIM2, channel(4), input);
    }

    fn stage_mut(&mut self, name: StageName) -> &mut StageWires {
        match name {
            StageName::Sensor => &mut self.stages[0],
            StageName::Lens => &mut self.stages[1],
        }
    }

    pub fn slip_encoder(&mut self, name: StageName, counts: i64) {
        self.stage_mut(name).slip += counts;
    }

    pub fn cut_encoder(&mut self, name: StageName, cut: bool) {
        self.stage_mut(name).cut = cut;
    }

    pub fn set_glitches_per_s(&mut self, now_ns: u64, name: StageName, per_s: f64) {
        for contact in &mut self.stage_mut(name).contacts {
            contact.set_glitches_per_s(now_ns, per_s);
        }
    }

    /// Starts recording STEP edges, unless active.
    pub fn record_steps_once(&mut self) {
        for stage in &mut self.stages {
            stage.record.get_or_insert_default();
        }
    }

    pub fn record_steps(&mut self) {
        self.stages.iter_mut().for_each(|stage| stage.record = Some(Vec::new()));
    }

    /// Stages A and B, virtual nanoseconds; recording continues.
    pub fn take_steps(&mut self) -> [Vec<u64>; 2] {
        self.stages.each_mut().map(|stage| stage.record.as_mut().map(std::mem::take).unwrap_or_default())
    }

    pub fn lights(&mut self) -> &mut Lights {
        &mut self.lights
    }

    pub fn camera_mut(&mut self) -> &mut Camera {
        &mut self.camera
    }

    pub fn camera(&self) -> &Camera {
        &self.camera
    }

    pub fn board_reset(&mut self, at: VirtualNanos) {
        self.reset_ns = at.0;
        for stage in &mut self.stages {
            // A resistor holds EN while the chip's pins float.
            (stage.step, stage.driver.enabled_ns) = (false, None);
        }
        self.lights.board_reset(at.0);
        if std::mem::take(&mut self.trigger) {
            self.camera.trigger(at.0, false);
        }
        self.camera.board_reset();
    }
}

/// The board time with these lower 32 bits nearest to the time since the reset: the firmware's clock starts a moment later.
fn board_us(since_reset_us: u64, low: u32) -> u64 {
    let behind_us = (since_reset_us as u32).wrapping_sub(low) as i32;
    since_reset_us.saturating_add_signed(-i64::from(behind_us))
}

pub fn is_high(
    chip: &mut Chip,
    name: PinName,
    function: u8,
    read: impl FnOnce(&mut Chip) -> Option<Level>,
) -> bool {
    read(chip) == Some(Level::High) && chip.function(name) == Some(function)
}

#[cfg(test)]
mod tests {
    use super::board_us;

    #[test]
    fn board_time_counts_from_the_reset_beyond_the_counters_period() {
        const PERIOD_US: u64 = 1 << 32;
        // The firmware's clock started 0.2 s after the reset.
        for board in [0, 5_000_000, PERIOD_US - 1, PERIOD_US, PERIOD_US + 100_000, 5 * PERIOD_US + 7] {
            assert_eq!(board_us(board + 200_000, board as u32), board);
        }
        assert_eq!(board_us(PERIOD_US, 3), PERIOD_US + 3, "a clock that is slightly ahead");
        assert_eq!(board_us(0, 3), 3);
    }
}

//! The wires between board and rig: what the plant sees of the pins, and what the pins see of the plant.

use rigless::{
    device::Level,
    mcu::Operate,
    soc::{Width, st::tim::Channel},
    time::VirtualNanos,
};

use crate::{
    board::{
        self, Chip, DIR, ENABLE, ENCODER_A, ENCODER_B, FAR, HOME, STEP, STROBE, TIM1, TIM2, TIM4, TRIGGER,
    },
    camera::{Camera, Edge},
    chips::{SharedPlant, with_plant},
    plant::ExposureTruth,
};

/// Alternate functions of TIM1 and TIM2, and of TIM4, on their pins (DS9405, table 12). A pin that the firmware
/// has not switched to its timer is not connected to it.
const TIM1_TIM2_FUNCTION: u8 = 1;
const TIM4_FUNCTION: u8 = 2;
/// TIM2's counter, which the firmware keeps at the lower 32 bits of its microseconds.
const TIM2_CNT: u64 = 0x4000_0024;
/// Addresses of the registers whose writes can move one of the watched pins: TIM2, TIM1, port F.
const WATCHED: [(u64, u64); 3] =
    [(0x4000_0000, 0x4000_0400), (0x4001_0000, 0x4001_0400), (0x4002_1400, 0x4002_1800)];

/// One exposure, as it really was.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Shot {
    /// Running number of the trigger since the board's reset, from 0.
    pub id: u32,
    /// Start of the exposure in the board's microseconds.
    pub board_us: u64,
    /// Start of the exposure, virtual nanoseconds.
    pub begin_ns: u64,
    /// End of the exposure, virtual nanoseconds.
    pub end_ns: u64,
    /// Where the sensor was.
    pub truth: ExposureTruth,
}

/// The wires, with the levels they had when last looked at.
#[derive(Debug)]
pub struct Wiring {
    plant: SharedPlant,
    camera: Camera,
    step: bool,
    trigger: bool,
    counts: i64,
    step_edges: u64,
    last_step_ns: u64,
    begun: Option<(u32, u64, u64)>,
    shots: Vec<Shot>,
}

fn channel(number: u8) -> Channel {
    Channel::new(number).unwrap_or_else(|| unreachable!("timers have channels 1 to 4"))
}

impl Wiring {
    /// Connects the board to the plant at power-on.
    pub fn new(plant: SharedPlant, camera: Camera, chip: &mut Chip) -> Self {
        let counts = with_plant(&plant, |plant| plant.screw().encoder_counts());
        let mut wiring = Self {
            plant,
            camera,
            step: false,
            trigger: false,
            counts,
            step_edges: 0,
            last_step_ns: 0,
            begun: None,
            shots: Vec::new(),
        };
        wiring.put_encoder(chip, VirtualNanos(0), counts);
        wiring.put_switches(chip, VirtualNanos(0));
        wiring
    }

    /// Whether a write to this address can move a watched pin.
    pub fn watches(address: u64) -> bool {
        WATCHED.iter().any(|(from, to)| (*from..*to).contains(&address))
    }

    /// Looks at the pins at a moment, and lets what is due at the camera happen.
    pub fn look(&mut self, chip: &mut Chip, at: VirtualNanos) {
        while let Some((at_ns, edge)) = self.camera.due(at.0) {
            self.expose(chip, at, at_ns, edge);
        }
        let step = output(chip, STEP, |chip| {
            let (timer, registers) = chip.part().advanced_timer(TIM1);
            timer.output(channel(1), registers)
        });
        if step != self.step {
            self.step = step;
            if step {
                self.step(chip, at);
            }
        }
        let trigger = output(chip, TRIGGER, |chip| {
            let (timer, registers) = chip.part().timer(TIM2);
            timer.output(channel(3), registers)
        });
        if trigger != self.trigger {
            self.trigger = trigger;
            self.camera.trigger(at.0, trigger);
        }
    }

    fn step(&mut self, chip: &mut Chip, at: VirtualNanos) {
        self.step_edges += 1;
        self.last_step_ns = at.0;
        if chip.level(ENABLE) == Level::High {
            return;
        }
        let away = chip.level(DIR) == Level::High;
        let counts = with_plant(&self.plant, |plant| {
            plant.step_edge(at.0, away);
            plant.screw().encoder_counts()
        });
        let connected = [ENCODER_A, ENCODER_B].iter().all(|pin| chip.function(*pin) == Some(TIM4_FUNCTION));
        while self.counts != counts {
            self.counts += (counts - self.counts).signum();
            if connected {
                self.put_encoder(chip, at, self.counts);
            }
        }
        self.put_switches(chip, at);
    }

    /// Quadrature: A leads B when the count rises.
    fn put_encoder(&mut self, chip: &mut Chip, at: VirtualNanos, counts: i64) {
        let phase = counts.rem_euclid(4);
        chip.drive_timer(at, TIM4, channel(1), Level::from(phase == 1 || phase == 2));
        chip.drive_timer(at, TIM4, channel(2), Level::from(phase >= 2));
    }

    /// Puts the switches' levels on their pins.
    pub fn put_switches(&mut self, chip: &mut Chip, at: VirtualNanos) {
        let (home, far) = with_plant(&self.plant, |plant| {
            let screw = plant.screw();
            (screw.home_closed(), screw.far_closed())
        });
        // Normally closed to ground: an actuated switch opens, and the pull-up makes the pin high.
        chip.drive_pin(at, HOME, Level::from(home));
        chip.drive_pin(at, FAR, Level::from(far));
    }

    fn expose(&mut self, chip: &mut Chip, at: VirtualNanos, at_ns: u64, edge: Edge) {
        match edge {
            Edge::Begin => {
                with_plant(&self.plant, |plant| plant.begin_exposure(at_ns));
                let low = Operate::peek(chip, at, TIM2_CNT, Width::W32).unwrap_or(0);
                // The counter has the lower 32 bits of about the virtual time; a run has few of their periods.
                let high = (at_ns / 1000) & !0xffff_ffff;
                self.begun = Some((self.camera.triggers().wrapping_sub(1), high | low, at_ns));
            }
            Edge::End => {
                let truth = with_plant(&self.plant, |plant| plant.end_exposure(at_ns));
                if let (Some(truth), Some((id, board_us, begin_ns))) = (truth, self.begun.take()) {
                    self.shots.push(Shot { id, board_us, begin_ns, end_ns: at_ns, truth });
                }
            }
        }
        let level = Level::from(edge == Edge::Begin);
        chip.drive_pin(at, STROBE, level);
        if chip.function(STROBE) == Some(TIM1_TIM2_FUNCTION) {
            chip.drive_timer(at, TIM2, channel(4), level);
        }
    }

    /// When the camera needs attention next.
    pub fn next_ns(&self) -> Option<u64> {
        self.camera.next_ns()
    }

    /// Takes the exposures that have ended.
    pub fn take_shots(&mut self) -> Vec<Shot> {
        std::mem::take(&mut self.shots)
    }

    /// Rising edges on the STEP pin since power-on, whether or not the driver was on.
    pub fn step_edges(&self) -> u64 {
        self.step_edges
    }

    /// When the last of them was.
    pub fn last_step_ns(&self) -> u64 {
        self.last_step_ns
    }

    /// The camera.
    pub fn camera(&self) -> &Camera {
        &self.camera
    }

    /// The board was reset.
    pub fn board_reset(&mut self, at: VirtualNanos) {
        self.step = false;
        if std::mem::take(&mut self.trigger) {
            self.camera.trigger(at.0, false);
        }
        self.camera.board_reset();
    }
}

/// The level of a timer's pin: high only where the pin is switched to the timer.
fn output(chip: &mut Chip, name: board::PinName, read: impl FnOnce(&mut Chip) -> Option<Level>) -> bool {
    read(chip) == Some(Level::High) && chip.function(name) == Some(TIM1_TIM2_FUNCTION)
}

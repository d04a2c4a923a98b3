//! Runs `farnear-board-test`, the test of a real board, on the emulated one: jumper wires take the place of the rig.

use std::path::Path;

use rigless::{
    chip::{Timeline, spi::Peer},
    device::Level,
    emulator::{self, AccessKind, Host, Settled, Start, Stop, run},
    image::Image,
    session::Session,
    snapshot::Store,
    soc::st::tim::Channel,
    time::VirtualNanos,
};

use crate::{
    board::{NOTHING, PinName, RigBoard, STROBE, TIM2, TIM4, TRIGGER, pins},
    chips::SharedPlant,
    error::SimError,
    firmware,
    parts::Parts,
    plant::{Plant, StageName},
    processor::Costs,
    serial::Line,
    wiring::{TIM2_FUNCTION, Wiring, channel, is_high},
};

/// Name, without extension, of the ELF in the firmware's folder.
pub const PROGRAM: &str = "farnear-board-test";
/// Longer than both resets, all checks and a report at each link rate.
const PATIENCE_NS: u64 = 10_000_000_000;
const LOOK_NS: u64 = 1_000_000;
/// Bytes that the host sends after each `listen` line.
const PATTERN: std::ops::RangeInclusive<u8> = 0..=255;
/// Link rates, each with its report.
const REPORTS: usize = 2;

/// Data out to data in.
#[derive(Debug)]
struct Loop;

impl Peer for Loop {
    fn transfer(&mut self, mosi: u32, _bits: u8, _context: &mut Timeline<'_, '_>) -> u32 {
        mosi
    }
}

impl Store for Loop {}

struct Jumpers {
    line: Line,
    wired: bool,
    text: Vec<u8>,
    listened: usize,
}

impl Jumpers {
    fn look(&self, board: &mut RigBoard, at: VirtualNanos) {
        if !self.wired {
            return;
        }
        let chip = &mut board.chip;
        let (pin, timer, function) = pins(StageName::Sensor).step;
        let step = is_high(chip, pin, function, |chip| {
            let (timer, registers) = chip.part().advanced_timer(timer);
            timer.output(channel(1), registers)
        });
        chip.drive_timer(at, TIM4, channel(1), Level::from(step));
        let trigger = is_high(chip, TRIGGER, TIM2_FUNCTION, |chip| {
            let (timer, registers) = chip.part().timer(TIM2);
            timer.output(channel(3), registers)
        });
        copy(chip, at, trigger, STROBE, (TIM2, channel(4)));
        let enable = chip.level(pins(StageName::Sensor).enable);
        chip.drive_pin(at, pins(StageName::Sensor).stop.0, enable);
        chip.join_breaks(at);
    }

    fn lines(&self, word: &str) -> usize {
        let text = String::from_utf8_lossy(&self.text);
        text.split_inclusive('\n').filter(|line| line.starts_with(word) && line.ends_with('\n')).count()
    }
}

fn copy(
    chip: &mut crate::board::Chip,
    at: VirtualNanos,
    high: bool,
    pin: PinName,
    (timer, channel): (usize, Channel),
) {
    chip.drive_pin(at, pin, Level::from(high));
    let connected = chip.function(pin) == Some(TIM2_FUNCTION);
    chip.drive_timer(at, timer, channel, Level::from(high && connected));
}

impl emulator::Driver<RigBoard> for Jumpers {
    fn on_settled(&mut self, session: &mut Session<RigBoard>, _host: &mut dyn Host, settled: Settled) {
        match settled {
            Settled::Access { access, .. } if NOTHING.contains(&access.address) => {
                session.fail_next(NOTHING.start, NOTHING.end);
            }
            Settled::Access { access, .. }
                if access.kind == AccessKind::Write && Wiring::watches(access.address) =>
            {
                self.look(session.board_mut(), access.virtual_time);
            }
            Settled::Stop(stop) => self.look(session.board_mut(), stop.at),
            _ => {}
        }
    }

    fn on_stop(
        &mut self,
        session: &mut Session<RigBoard>,
        stop: Stop,
        _host: &mut dyn Host,
    ) -> Option<VirtualNanos> {
        self.look(session.board_mut(), stop.at);
        self.text.extend(self.line.take());
        if self.lines("listen\t") > self.listened {
            self.listened += 1;
            self.line.send(&PATTERN.collect::<Vec<u8>>());
        }
        let ended = self.lines("end\t") >= REPORTS;
        (!ended && stop.at.0 < PATIENCE_NS).then_some(VirtualNanos(stop.at.0 + LOOK_NS))
    }
}

/// Returns the report; without the wires (`wired` false) the checks that need them fail.
pub fn report(path: &Path, wired: bool) -> Result<String, SimError> {
    let unusable = |reason: String| SimError::Firmware { path: path.into(), reason };
    let image = Image::read(path, None).map_err(|error| unusable(error.to_string()))?;
    let parts = Parts::default();
    let plant = SharedPlant::new(Plant::new(1, &parts, None).into());
    let emulator = |error: &dyn std::fmt::Display| SimError::Emulator(error.to_string());
    let (line, costs) = (Line::default(), Costs::Average(parts.processor));
    let program = firmware::fingerprint(image.bytes());
    let mut board =
        RigBoard::new(&plant, line.clone(), (1, program), &parts, costs).map_err(|error| emulator(&error))?;
    if wired {
        board.chip.loop_converter_bus(Loop);
    }
    let mut session = Session::new(Box::new(board), 0, VirtualNanos(0)).map_err(|error| emulator(&error))?;
    session.fail_next(NOTHING.start, NOTHING.end);
    let jumpers = Jumpers { line, wired, text: Vec::new(), listened: 0 };
    let finished = run(session, &Start::new(&[image]), jumpers).map_err(|error| emulator(&error))?;
    Ok(String::from_utf8_lossy(&finished.driver.text).into_owned())
}

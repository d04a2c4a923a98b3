//! Draws a random scenario: rig, host steps and faults.

use farnear_protocol::message::{Axis, SettingKey};

use farnear_sim::{
    faults::{Happening, KINDS, Kind, Moment, When},
    plant::{Noise, StageName},
    scenario::{
        Scenario, Step,
        host::{Deed, Program},
    },
};

/// Kinds that only revert another one; a duration does this.
const TAKES_BACK: [&str; 5] =
    ["emergency-stop-released", "power-return", "supply-normal", "driver-fine", "motor-free"];
/// Not drawn: no board can detect gauge drift, and a scenario with its own host has no port to rename.
const LEFT_OUT: [&str; 2] = ["gauge-drifts", "link-renamed"];
const RECORDS_END: u64 = 8_192;

fn below(noise: &mut Noise, end: u64) -> u64 {
    noise.bits() % end.max(1)
}

fn happens(noise: &mut Noise, probability: f64) -> bool {
    noise.uniform() < probability
}

fn one_of<T: Copy>(noise: &mut Noise, list: &[T]) -> T {
    list[below(noise, list.len() as u64) as usize]
}

fn over_orders(noise: &mut Noise, low: f64, high: f64) -> f64 {
    low * libm::pow(high / low, noise.uniform())
}

/// Rounded to three decimals, to keep files readable.
fn rounded(value: f64) -> f64 {
    libm::round(value * 1e3) / 1e3
}

pub fn draw(seed: u64) -> Scenario {
    let mut noise = Noise::new(seed, "campaign");
    let noise = &mut noise;
    // Near the switches, so that homing is short; sometimes anywhere, or on the switch.
    let start_um = happens(noise, 0.9).then(|| [0; 2].map(|_| rounded(noise.between(-20.0, 400.0))));
    let mut host = Vec::new();
    if happens(noise, 0.9) {
        host.push(Step { deed: Deed::Home(None), goes_on_after_ms: goes_on(noise, 0.1) });
    }
    for _ in 0..2 + below(noise, 6) {
        host.push(step(noise));
    }
    let count = 1 + below(noise, 6);
    let happens = (0..count).map(|_| happening(noise)).collect();
    Scenario { seed: Some(seed), start_um, parts: parts(noise), happens, host, ..Scenario::default() }
}

fn goes_on(noise: &mut Noise, probability: f64) -> Option<f64> {
    happens(noise, probability).then(|| rounded(over_orders(noise, 1.0, 800.0)))
}

/// Occasionally another rig: slower processor, other memory, more bounce, uncalibrated gauge.
fn parts(noise: &mut Noise) -> toml::Table {
    let mut text = String::new();
    if happens(noise, 0.3) {
        text += "[processor]\ncycles_per_instruction = 1.9\n";
    }
    if happens(noise, 0.1) {
        text += "[memory]\nmake = \"FM25V02\"\n";
    }
    if happens(noise, 0.2) {
        let bounce_us = 100 + below(noise, 2_000);
        text += &format!("[switches]\nbounce_us = {bounce_us}\nglitches_per_s = 20.0\n");
    }
    if happens(noise, 0.1) {
        let (gain, offset_um) = (noise.between(0.98, 1.02), noise.between(-1.0, 1.0));
        text += &format!("[gauge]\ngain = {gain:.4}\noffset_um = {offset_um:.3}\n");
    }
    // The text above is valid.
    toml::from_str(&text).unwrap_or_default()
}

fn program(noise: &mut Noise) -> Program {
    let count = 1 + below(noise, 4);
    let at_um = (0..count).map(|_| rounded(noise.between(5.0, 190.0))).collect();
    Program {
        at_um,
        exposure_us: over_orders(noise, 50.0, 20_000.0) as u32,
        window_nm: one_of(noise, &[50, 100, 200, 1_000]),
    }
}

fn step(noise: &mut Noise) -> Step {
    let axis = one_of(noise, &Axis::ALL);
    let stepper = one_of(noise, &[Axis::SensorCoarse, Axis::Lens]);
    let (deed, patience) = match below(noise, 23) {
        0 | 1 => (Deed::Home(happens(noise, 0.5).then_some(stepper)), 0.3),
        2..=6 => {
            let high_um = if axis == Axis::SensorFine { 195.0 } else { 1_500.0 };
            (Deed::Move { axis, to_um: rounded(noise.between(-5.0, high_um)) }, 0.4)
        }
        7..=9 | 20..=22 => (Deed::Expose(program(noise)), 0.3),
        10 => {
            let (period_us, exposures) = (one_of(noise, &[0, 40_000, 60_000]), 2 + below(noise, 10) as u32);
            (Deed::Continuous { program: program(noise), period_us, exposures }, 0.4)
        }
        11 => (Deed::Calibrate(stepper), 0.5),
        12 | 13 => {
            let key = one_of(noise, &[SettingKey::CameraReadoutUs, SettingKey::StrobeDeadlineUs]);
            (Deed::Set { key, value: 10_500 + below(noise, 2_000) as i32 }, 0.0)
        }
        14 => (Deed::Stop, 0.0),
        15 => (Deed::Halt, 0.0),
        16 => (if below(noise, 2) == 0 { Deed::Pause } else { Deed::Resume }, 0.0),
        17 => (Deed::Clear, 0.0),
        18 => (Deed::Wait { ms: rounded(over_orders(noise, 1.0, 500.0)) }, 0.0),
        _ if happens(noise, 0.5) => (Deed::Reboot, 0.0),
        _ => (Deed::Silent { ms: rounded(over_orders(noise, 10.0, 2_500.0)) }, 0.0),
    };
    Step { deed, goes_on_after_ms: goes_on(noise, patience) }
}

fn when(noise: &mut Noise, what: &Kind) -> When {
    let moment = one_of(noise, &Moment::ALL);
    // Limit of n: moments that occur in most runs.
    let most = match moment {
        Moment::Started | Moment::Alarm => 1,
        Moment::Homed | Moment::MoveDone => 3,
        Moment::ExposureBegins | Moment::ExposureEnds => 4,
        Moment::MotionBegins | Moment::MemoryWrite => 8,
        Moment::Request | Moment::Answer => 30,
    };
    match below(noise, 10) {
        // Mostly during activity: the start takes 0.1 s, homing a second.
        0..=3 => When::After { ms: rounded(noise.between(0.0, 3_500.0)) },
        4 if what.revert.is_some() => When::Chance { per_s: rounded(over_orders(noise, 0.2, 5.0)) },
        _ => When::On {
            moment,
            nth: 1 + below(noise, most) as u32,
            // Most faults shortly follow the moment.
            delay_ms: if happens(noise, 0.3) { 0.0 } else { rounded(over_orders(noise, 0.01, 100.0)) },
        },
    }
}

fn happening(noise: &mut Noise) -> Happening {
    let what = loop {
        let kind = one_of(noise, &KINDS);
        if !TAKES_BACK.contains(&kind.name) && !LEFT_OUT.contains(&kind.name) {
            break kind;
        }
    };
    let when = when(noise, &what);
    let by_chance = matches!(when, When::Chance { .. });
    let lasts = what.revert.is_some() && (by_chance || happens(noise, 0.8));
    let amount = what.takes.amount.map_or(0.0, |range| {
        let sign = if range.min < 0.0 && happens(noise, 0.5) { -1.0 } else { 1.0 };
        let amount = sign * range.usual * over_orders(noise, 0.1, 10.0);
        let digits = if range.usual < 0.1 { 1e7 } else { 1e3 };
        let whole = if range.usual >= 1.0 && range.max > 1.0 { libm::round(amount) } else { amount };
        (libm::round(whole * digits) / digits).clamp(range.min, range.max)
    });
    Happening {
        when,
        what,
        for_ms: lasts.then(|| rounded(over_orders(noise, 0.1, 800.0))),
        stage: if what.takes.stage {
            one_of(noise, &[StageName::Sensor, StageName::Lens])
        } else {
            StageName::Sensor
        },
        amount,
        address: if what.takes.place { below(noise, RECORDS_END) as u16 } else { 0 },
        bit: if what.takes.place { below(noise, 8) as u8 } else { 0 },
    }
}

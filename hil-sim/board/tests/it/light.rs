//! Lamp and flash on the emulated board, by the timer's registers.

use farnear_protocol::{
    EventKind, Micros, Request,
    message::{LIGHT_TIME_MAX, LightLevels, ShotLight},
};

use crate::bench::{Bench, SILENCE, fine_shot};

const LEVELS: LightLevels = LightLevels { first: 1_000, second: 250 };
const SHINES: [f64; 2] = [1.0, 0.25];
const DARK: [f64; 2] = [0.0; 2];

fn switch(bench: &mut Bench, levels: LightLevels, silence: Micros) {
    let answer = bench.ask(&Request::SetLights { levels, time: LIGHT_TIME_MAX, silence });
    assert!(answer.is_ok(), "{answer:?}");
    bench.rig.advance_us(2_000).expect("runs");
}

fn lights(bench: &mut Bench) -> [f64; 2] {
    bench.peek(|rig| rig.lights())
}

#[test]
fn the_outputs_are_as_bright_as_requested_and_dark_after_stop_alarm_reset_and_silence() {
    let mut bench = Bench::new(1);
    assert_eq!(lights(&mut bench), DARK);
    switch(&mut bench, LEVELS, SILENCE);
    assert_eq!(lights(&mut bench), SHINES);
    assert!(bench.ask(&Request::Stop).is_ok());
    bench.rig.advance_us(400).expect("runs");
    assert_eq!(lights(&mut bench), DARK, "stop");
    switch(&mut bench, LEVELS, SILENCE);
    bench.access(|rig| rig.press_reset());
    bench.settle();
    assert_eq!(lights(&mut bench), DARK, "reset");
    bench.say_hello();
    switch(&mut bench, LEVELS, Micros(300_000));
    bench.rig.advance_us(280_000).expect("runs");
    assert_eq!(lights(&mut bench), SHINES);
    bench.rig.advance_us(40_000).expect("runs");
    assert_eq!(lights(&mut bench), DARK, "silence");
    switch(&mut bench, LEVELS, SILENCE);
    assert!(bench.ask(&Request::Halt).is_ok());
    bench.rig.advance_us(400).expect("runs");
    assert_eq!(lights(&mut bench), DARK, "alarm");
}

#[test]
fn a_lost_clock_darkens_the_outputs_before_the_piezo_is_lowered() {
    let mut bench = Bench::new(1);
    switch(&mut bench, LEVELS, SILENCE);
    bench.access(|rig| rig.set_outer_clock(false));
    // The reset comes 4.4 ms later.
    bench.rig.advance_us(200).expect("runs");
    assert_eq!(lights(&mut bench), DARK);
}

#[test]
fn a_flash_is_within_its_exposure_and_stamped_to_the_microsecond() {
    let mut bench = Bench::new(1);
    let shots = [fine_shot(50_000, 5_000, 50, 2_000), fine_shot(60_000, 5_000, 50, 2_000)];
    for (index, shot) in shots.into_iter().enumerate() {
        assert!(bench.ask(&Request::LoadShot { index: index as u8, shot }).is_ok());
    }
    let light = ShotLight { levels: LEVELS, delay: Micros(1_000), length: Micros(2_000) };
    assert!(bench.ask(&Request::SetShotLight { index: 1, light: Some(light) }).is_ok());
    assert!(bench.ask(&Request::ArmProgram { shots: 2 }).is_ok());
    bench.peek(|rig| rig.take_light_changes());
    let end = bench.run();
    assert!(matches!(end, EventKind::ProgramDone { exposures: 2, .. }), "{end:?}");
    let shots = bench.rig.take_shots();
    assert_eq!(shots[0].light, DARK, "the shot without a flash");
    // 2 ms of 5 ms; the exposure begins some 20 us behind the trigger.
    for (mean, shines) in shots[1].light.iter().zip(SHINES) {
        assert!((mean - 0.4 * shines).abs() < 0.002, "{:?}", shots[1].light);
    }
    let changes = bench.peek(|rig| rig.take_light_changes());
    let flash = bench.events.iter().find_map(|event| match event.kind {
        EventKind::Flash { trigger_number, levels, on, off, .. } => {
            Some((trigger_number, levels, on.0, off.0))
        }
        _ => None,
    });
    let (number, levels, on_us, off_us) = flash.expect("the flash is reported");
    assert_eq!((number, levels), (shots[1].id, LEVELS));
    // Both channels are written one behind the other: the first change of each burst counts.
    let (first, last) = (changes.first().expect("on"), changes.last().expect("off"));
    assert_eq!(last.1, DARK);
    let length_us = (last.0 - first.0) as f64 * 1e-3;
    assert!((length_us - 2_000.0).abs() < 5.0, "{length_us} us");
    assert!((off_us - on_us).abs_diff(2_000) <= 3, "{on_us} to {off_us}");
    // The board's microseconds and virtual time differ by what they differ by at the exposure.
    let offset_us = shots[1].begin_ns as f64 * 1e-3 - shots[1].board_us as f64;
    let stamped_us = on_us as f64 + offset_us;
    assert!((stamped_us - first.0 as f64 * 1e-3).abs() < 3.0, "{stamped_us} us, {} ns", first.0);
}

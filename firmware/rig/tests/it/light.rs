//! Lamp and flash through the public interface.

use crate::bench::{Bench, SILENCE};
use farnear_protocol::message::{
    Axis, EventKind, LIGHT_TIME_MAX, LightFault, LightLevels, Shot, ShotFault, ShotLight, TriggerMode,
};
use farnear_protocol::{Micros, Nanometres, Request, RequestError};

const ON: LightLevels = LightLevels { first: 1_000, second: 250 };
const SECOND: Micros = Micros(1_000_000);

fn lights(levels: LightLevels, time: Micros, silence: Micros) -> Request {
    Request::SetLights { levels, time, silence }
}

fn shot(mode: TriggerMode) -> Shot {
    Shot {
        axis: Axis::SensorFine,
        target: Nanometres(20_000),
        exposure: Micros(5_000),
        settle_window: Nanometres(50),
        settle_dwell: Micros(2_000),
        repeat: 2,
        mode,
    }
}

const FLASH: ShotLight = ShotLight { levels: ON, delay: Micros(1_000), length: Micros(3_000) };

fn flash(index: u8, light: ShotLight) -> Request {
    Request::SetShotLight { index, light: Some(light) }
}

fn lit() -> Bench {
    let mut bench = Bench::new(700.0);
    bench.accepted(&lights(ON, LIGHT_TIME_MAX, SILENCE));
    assert_eq!(bench.hardware.lights, ON);
    bench
}

#[test]
fn lights_go_off_after_their_time() {
    let mut bench = Bench::new(700.0);
    bench.accepted(&lights(ON, SECOND, SILENCE));
    bench.run_ms(998);
    assert_eq!(bench.hardware.lights, ON);
    bench.run_ms(4);
    assert_eq!(bench.hardware.lights, LightLevels::OFF);
    assert_eq!(bench.alarm(), None);
}

#[test]
fn each_output_alone_obeys_its_time_the_silence_and_an_alarm() {
    for levels in [LightLevels { first: 1, second: 0 }, LightLevels { first: 0, second: 1 }] {
        for (time, silence) in [(SECOND, SILENCE), (LIGHT_TIME_MAX, SECOND)] {
            let mut bench = Bench::new(700.0);
            bench.accepted(&lights(levels, time, silence));
            bench.run_ms(998);
            assert_eq!(bench.hardware.lights, levels);
            bench.run_ms(4);
            assert_eq!(bench.hardware.lights, LightLevels::OFF, "{levels:?} {time:?} {silence:?}");
        }
        let mut bench = Bench::new(700.0);
        let refused = bench.ask(&lights(levels, Micros(0), SILENCE)).1;
        assert_eq!(refused, Err(RequestError::Light { reason: LightFault::Time }), "{levels:?}");
        bench.accepted(&Request::Halt);
        let refused = bench.ask(&lights(levels, SECOND, SILENCE)).1;
        assert!(matches!(refused, Err(RequestError::Alarm { .. })), "{levels:?}: {refused:?}");
    }
}

#[test]
fn lights_go_off_when_the_host_is_silent() {
    let mut bench = Bench::new(700.0);
    bench.accepted(&lights(ON, LIGHT_TIME_MAX, SECOND));
    bench.run_ms(900);
    bench.status();
    bench.run_ms(900);
    assert_eq!(bench.hardware.lights, ON, "a request restarts the time");
    bench.run_ms(110);
    assert_eq!(bench.hardware.lights, LightLevels::OFF);
}

#[test]
fn a_stop_an_alarm_and_a_new_session_switch_the_lights_off() {
    let mut bench = lit();
    bench.accepted(&Request::Stop);
    assert_eq!((bench.hardware.lights, bench.hardware.flash_cancelled), (LightLevels::OFF, true));
    let mut bench = lit();
    bench.open_session();
    bench.tick();
    assert_eq!(bench.hardware.lights, LightLevels::OFF);
    let mut bench = lit();
    bench.hardware.faults.supply_low = true;
    bench.tick();
    assert_eq!((bench.hardware.lights, bench.hardware.flash_cancelled), (LightLevels::OFF, true));
    let refused = bench.ask(&lights(ON, SECOND, SILENCE)).1;
    assert!(matches!(refused, Err(RequestError::Alarm { .. })), "{refused:?}");
    bench.accepted(&lights(LightLevels::OFF, Micros(0), Micros(0)));
}

#[test]
fn a_flash_is_reported_with_each_exposure_of_its_shot() {
    let mut bench = Bench::new(700.0);
    for index in 0..2 {
        bench.accepted(&Request::LoadShot { index, shot: shot(TriggerMode::Hardware) });
    }
    bench.accepted(&flash(1, FLASH));
    bench.accepted(&Request::ArmProgram { shots: 2 });
    let end = bench.work(&Request::RunProgram { silence: SILENCE });
    assert!(matches!(end, EventKind::ProgramDone { exposures: 4, .. }), "{end:?}");
    let flashes: Vec<_> = bench
        .events
        .iter()
        .filter_map(|(_, event)| match event.kind {
            EventKind::Flash { trigger_number, levels, on, off, .. } => {
                Some((trigger_number, levels, on.0, off.0))
            }
            _ => None,
        })
        .collect();
    let rises: Vec<_> = bench.hardware.triggers.iter().map(|(at, _)| *at).collect();
    assert_eq!(
        flashes,
        [(2, ON, rises[2] + 1_000, rises[2] + 4_000), (3, ON, rises[3] + 1_000, rises[3] + 4_000)]
    );
}

#[test]
fn a_shot_that_is_loaded_again_has_no_flash() {
    let mut bench = Bench::new(700.0);
    let load = Request::LoadShot { index: 0, shot: shot(TriggerMode::Hardware) };
    bench.accepted(&load);
    bench.accepted(&flash(0, FLASH));
    bench.accepted(&load);
    bench.accepted(&Request::ArmProgram { shots: 1 });
    bench.work(&Request::RunProgram { silence: SILENCE });
    assert!(!bench.events.iter().any(|(_, event)| matches!(event.kind, EventKind::Flash { .. })));
}

#[test]
fn light_that_is_too_bright_too_long_or_outside_the_exposure_is_refused() {
    let mut bench = Bench::new(700.0);
    let bright = LightLevels { first: 0, second: 1_001 };
    let refused = |reason| Err(RequestError::Light { reason });
    for levels in [bright, LightLevels { first: 1_001, second: 0 }] {
        assert_eq!(bench.ask(&lights(levels, SECOND, SILENCE)).1, refused(LightFault::Level), "{levels:?}");
    }
    for time in [Micros(0), Micros(LIGHT_TIME_MAX.0 + 1)] {
        assert_eq!(bench.ask(&lights(ON, time, SILENCE)).1, refused(LightFault::Time));
    }
    let refusal = bench.ask(&lights(ON, SECOND, Micros(1))).1;
    assert!(matches!(refusal, Err(RequestError::Silence { .. })), "{refusal:?}");
    let missing = Err(RequestError::Shot { index: 5, reason: ShotFault::Missing });
    assert_eq!(bench.ask(&flash(5, FLASH)).1, missing);
    bench.accepted(&Request::LoadShot { index: 0, shot: shot(TriggerMode::Hardware) });
    bench.accepted(&Request::LoadShot { index: 1, shot: shot(TriggerMode::Software) });
    let cases = [
        (0, ShotLight { levels: bright, ..FLASH }, LightFault::Level),
        (0, ShotLight { length: Micros(0), ..FLASH }, LightFault::Time),
        (0, ShotLight { length: Micros(4_001), ..FLASH }, LightFault::Exposure),
        (0, ShotLight { delay: Micros(u32::MAX), ..FLASH }, LightFault::Exposure),
        (1, FLASH, LightFault::Mode),
    ];
    for (index, light, reason) in cases {
        assert_eq!(bench.ask(&flash(index, light)).1, refused(reason), "{light:?}");
    }
    // It may end with the exposure.
    bench.accepted(&flash(0, ShotLight { length: Micros(4_000), ..FLASH }));
    assert_eq!(bench.hardware.lights, LightLevels::OFF);
}

use crate::bench::{Bench, SILENCE, go};
use farnear_protocol::{
    EventKind, Nanometres, Request, RequestError,
    message::{Alarm, Axis, Failure, PositionState, ResetCause, SCHEMA_KEY},
};
use farnear_sim::{board::SpiChip, plant::StageName};

#[test]
fn hello_identifies_the_board() {
    let hello = Bench::new(1).say_hello();
    assert_eq!((hello.board.as_str(), hello.boot), ("nucleo-f429zi", 1));
    assert_eq!(hello.schema_key, SCHEMA_KEY);
    assert_eq!(hello.reset_cause, ResetCause::PowerOn);
    assert!(hello.emulated);
    assert_ne!(hello.unique_id, Bench::new(2).say_hello().unique_id);
}

#[test]
fn homing_finds_the_edge_and_moves_reach_their_target() {
    let mut bench = Bench::new(1);
    let refused = bench.ask(&go(Axis::SensorCoarse, 0));
    assert!(
        matches!(refused, Err(RequestError::NotHomed { state: PositionState::Unknown, .. })),
        "{refused:?}"
    );
    bench.home();
    for target in [5_831_300, 12_999_000, 1_000] {
        let end = bench.move_to(Axis::SensorCoarse, Nanometres(target));
        let EventKind::MoveDone { measured, .. } = end else { panic!("{end:?}") };
        assert!((measured.0 - target).abs() <= 200, "{measured:?}: within a microstep and an encoder count");
        let off_um = bench.report().coarse.position_um - 1e-3 * f64::from(target);
        // Screw (2 um), home switch (3 SD = 0.9 um) and resolution of switch and steps.
        assert!(off_um.abs() < 3.2, "true position {off_um} um off at {target} nm");
    }
}

#[test]
fn a_stall_is_detected_and_invalidates_the_position() {
    let mut bench = Bench::near_home(3);
    bench.home();
    bench.access(|rig| rig.plant(|plant| plant.stage_mut(StageName::Sensor).set_stalled(true)));
    let end = bench.move_to(Axis::SensorCoarse, Nanometres(2_000_000));
    assert!(
        matches!(end, EventKind::Failed { reason: Failure::Following { .. }, .. }),
        "a blocked motor ends with {end:?}"
    );
    assert_eq!(bench.status().coarse.state, PositionState::Lost);
}

#[test]
fn a_home_switch_that_never_closes_ends_the_search() {
    let mut bench = Bench::new(4);
    bench.access(|rig| rig.plant(|plant| plant.stage_mut(StageName::Sensor).set_stuck_home(Some(false))));
    let end = bench.carry_out(&Request::Home { axis: Axis::SensorCoarse, silence: SILENCE });
    // The carriage hits its end stop; the encoder detects it first.
    assert!(
        matches!(
            end,
            EventKind::Failed { reason: Failure::HomeSwitchNotFound | Failure::Following { .. }, .. }
        ),
        "{end:?}"
    );
}

#[test]
fn a_cut_gauge_and_a_dead_drive_end_a_fine_move() {
    let mut bench = Bench::new(6);
    let go = |target| go(Axis::SensorFine, target);
    // The gauge's code passes through all bit patterns; none may look like a cut wire.
    for target in [20_000, 121_071, 121_072, 121_073, 180_000] {
        let end = bench.carry_out(&go(target));
        assert!(matches!(end, EventKind::MoveDone { .. }), "{target} nm: {end:?}");
    }
    bench.access(|rig| rig.disconnect(SpiChip::Gauge, true));
    let end = bench.carry_out(&go(50_000));
    assert!(matches!(end, EventKind::Failed { reason: Failure::Gauge, .. }), "{end:?}");
    bench.access(|rig| rig.disconnect(SpiChip::Gauge, false));
    bench.clear(|alarm| *alarm == Alarm::Gauge);
    let end = bench.carry_out(&go(50_000));
    assert!(matches!(end, EventKind::MoveDone { .. }), "{end:?}");
    bench.access(|rig| rig.disconnect(SpiChip::Dac, true));
    let end = bench.carry_out(&go(150_000));
    assert!(matches!(end, EventKind::Failed { reason: Failure::NotSettled { .. }, .. }), "{end:?}");
}

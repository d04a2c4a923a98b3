//! From a reset to the relaxed piezo.

use super::*;

/// A stack that stands at this code.
fn stretched(code: u16) -> Plant {
    let mut plant = Plant::new(NOMINAL, 5);
    for _ in 0..5_000 {
        plant.tick(Some(code));
    }
    plant
}

#[test]
fn after_a_reset_it_ramps_down_from_its_position() {
    let mut plant = stretched(51_000);
    let mut piezo = Piezo::new(Settings::DEFAULT.fine);
    // The converter does not answer immediately.
    piezo.sense(None);
    assert_eq!(piezo.act(), None, "no output while the position is unknown");
    let mut lowest = f64::MAX;
    for _ in 0..2_000 {
        let gauge = plant.gauge();
        piezo.sense(gauge);
        plant.tick(piezo.act());
        lowest = lowest.min(plant.position);
    }
    assert_eq!(piezo.act(), Some(0));
    assert!(lowest > -1_000.0 && plant.position.abs() < 100.0, "{lowest} nm, {} nm", plant.position);
}

#[test]
fn a_kept_code_is_lowered_without_the_gauge() {
    for kept in [0, 50_000, u16::MAX] {
        let mut piezo = Piezo::new(Settings::DEFAULT.fine);
        piezo.start_at(Some(kept));
        let mut before = kept;
        for _ in 0..RAMP {
            piezo.sense(None);
            let code = piezo.act().expect("a known code");
            assert!(before.abs_diff(code) <= 200, "{code} after {before}");
            before = code;
        }
        for _ in 0..SWINGING_TICKS {
            piezo.sense(None);
            assert_eq!((piezo.act(), piezo.extension()), (Some(0), Some(Nanometres(0))));
        }
        assert!(!piezo.is_moving() && !piezo.take_failure());
    }
}

#[test]
fn a_piezo_whose_code_is_unknown_is_left_where_it_is() {
    let mut piezo = Piezo::new(Settings::DEFAULT.fine);
    for _ in 0..TICK_HZ {
        piezo.sense(None);
        assert_eq!(piezo.act(), None);
    }
    assert!(!piezo.is_moving(), "nothing is output");
    assert_eq!((piezo.extension(), piezo.driven_from()), (None, None));
}

#[test]
fn a_move_after_a_start_waits_for_the_end_of_a_swing() {
    let mut plant = stretched(20_000);
    // The power fails and returns: the DAC is at 0, and the stack swings.
    let mut piezo = Piezo::new(Settings::DEFAULT.fine);
    piezo.start_at(Some(0));
    piezo.go(Nanometres(100_000));
    for _ in 1..SWINGING_TICKS {
        piezo.sense(plant.gauge());
        assert!(piezo.waits(), "{} nm", plant.position);
        assert_eq!(piezo.act(), Some(0));
        plant.tick(Some(0));
    }
    for _ in 0..100 {
        piezo.sense(plant.gauge());
        plant.tick(piezo.act());
    }
    assert!(!piezo.waits() && (plant.position - 100_000.0).abs() < 100.0, "{} nm", plant.position);
}

#[test]
fn a_move_that_is_stopped_while_it_waits_has_no_target() {
    let mut plant = Plant::new(NOMINAL, 5);
    let mut piezo = Piezo::new(Settings::DEFAULT.fine);
    piezo.start_at(Some(0));
    piezo.go(Nanometres(100_000));
    for _ in 0..10 {
        piezo.sense(plant.gauge());
        plant.tick(piezo.act());
    }
    piezo.hold();
    assert!(piezo.target() == Settings::DEFAULT.fine.min && piezo.arrived(), "{}", piezo.target().0);
}

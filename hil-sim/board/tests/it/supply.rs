//! Supply, floating pins and the emergency stop's contacts.

use farnear_protocol::{
    Nanometres, Request, Response,
    message::{Alarm, Axis, ResetCause},
};
use farnear_sim::parts::BrownOut;

use crate::{
    bench::{Bench, go},
    silicon::rig_with,
};

#[test]
fn the_firmware_never_programs_the_option_bytes() {
    // Programming erases the sector: a supply failure then leaves the chip protected.
    let mut bench = rig_with(|parts| parts.supply.brown_out = BrownOut::Off);
    assert_eq!(bench.boot, 1);
    bench.access(|rig| rig.press_reset());
    bench.settle();
    assert_eq!(bench.say_hello().boot, 2);
    // Brown-out reset off: the dip is not detected.
    bench.access(|rig| rig.brown_out());
    bench.rig.advance_us(200_000).expect("runs");
    assert_eq!(bench.say_hello().boot, 2);
}

#[test]
fn a_supply_below_the_brown_out_level_resets_the_chip() {
    let mut bench = rig_with(|parts| parts.supply.brown_out = BrownOut::Level3);
    bench.move_to(Axis::SensorFine, Nanometres(100_000));
    let before = bench.report();
    // The second is above the falling threshold of 2.83 V and below the rising one.
    for millivolts in [2_800, 2_900] {
        bench.access(move |rig| rig.set_supply_mv(millivolts));
        let held = bench.rig.advance_us(100_000).expect("runs");
        assert_eq!((held.powered, held.resets), (false, before.resets), "{millivolts} mV: it stays in reset");
        // It creeps by less than 2 um.
        assert!(
            (held.piezo_um - before.piezo_um).abs() < 5.0,
            "the DAC keeps its output: {} um",
            held.piezo_um
        );
    }
    bench.access(|rig| rig.set_supply_mv(3_300));
    bench.settle();
    let (hello, report) = (bench.say_hello(), bench.report());
    assert_eq!((hello.boot, hello.reset_cause), (2, ResetCause::BrownOut));
    assert_eq!((report.powered, report.resets), (true, before.resets + 1));
}

#[test]
fn a_sinking_supply_leaves_time_to_store_its_alarm() {
    // Also at rest, when a tick comes every 2 ms.
    for rest_us in [0, 100_000, 100_700, 101_900] {
        let mut bench = Bench::new(1);
        bench.rig.advance_us(rest_us).expect("runs");
        // Below the detector's level; 2,200 uF at 0.2 A give 4.95 ms from 2.95 V to the brown-out reset at 2.5 V; the test leaves 4.8.
        bench.access(|rig| rig.set_supply_mv(2_950));
        bench.rig.advance_us(4_800).expect("runs");
        bench.access(|rig| rig.brown_out());
        bench.access(|rig| rig.set_supply_mv(3_300));
        bench.settle();
        assert_eq!(bench.say_hello().reset_cause, ResetCause::BrownOut);
        let first = bench.alarm().expect("an alarm is latched");
        assert_eq!(first.alarm, Alarm::SupplyLow);
        assert_eq!(bench.ask(&Request::ClearAlarm { number: first.number }), Ok(Response::Accepted));
        bench.clear(|alarm| *alarm == Alarm::BrownOut);
    }
}

#[test]
fn unplugging_the_board_with_the_amplifier_on_does_not_snap_the_stack() {
    for (rest_us, left_us, allowed) in
        [(0, 4_800, 20.0..90.0), (1_500_000, 4_800, 20.0..90.0), (0, 0, 110.0..200.0)]
    {
        let mut bench = Bench::new(1);
        bench.move_to(Axis::SensorFine, Nanometres(156_000));
        bench.rig.advance_us(rest_us).expect("runs");
        bench.access(|rig| rig.set_supply_mv(2_950));
        bench.rig.advance_us(left_us).expect("runs");
        bench.access(|rig| rig.set_power(false));
        bench.rig.advance_us(100_000).expect("runs");
        let pulled = bench.report().piezo_pulled_um;
        println!("{rest_us} us after the move, {left_us} us left: pulled by {pulled:.1} um");
        // Without these 4.8 ms nothing softens it. Blocking force: 200 um.
        assert!(allowed.contains(&pulled), "{pulled} um");
    }
}

#[test]
fn a_clock_that_ends_before_the_supply_does_not_snap_the_stack() {
    // In several parts of a tick; 5 ms do not suffice for a start.
    for (rest_us, left_us) in [(0, 5_000), (15, 5_000), (30, 5_000), (45, 100_000)] {
        let mut bench = Bench::new(1);
        bench.move_to(Axis::SensorFine, Nanometres(156_000));
        bench.rig.advance_us(rest_us).expect("runs");
        bench.access(|rig| rig.set_outer_clock(false));
        bench.rig.advance_us(left_us).expect("runs");
        bench.access(|rig| rig.set_power(false));
        bench.rig.advance_us(100_000).expect("runs");
        let pulled = bench.report().piezo_pulled_um;
        println!("{rest_us} us after the move, {left_us} us left: pulled by {pulled:.1} um");
        assert!((20.0..90.0).contains(&pulled), "{pulled} um");
    }
}

#[test]
fn floating_selects_at_a_reset_move_the_piezo_and_resistors_prevent_it() {
    let jump = |resistors, rest_us| {
        let mut bench = rig_with(|parts| parts.wires.resistors = resistors);
        bench.move_to(Axis::SensorFine, Nanometres(100_000));
        let memory = bench.peek(|rig| rig.memory());
        bench.rig.advance_us(rest_us).expect("runs");
        let before = bench.report();
        bench.rig.take_shots();
        bench.access(|rig| rig.press_reset());
        // Before the firmware's first tick.
        let after = bench.rig.advance_us(500).expect("runs");
        let changed = bench.peek(|rig| rig.memory()) != memory;
        ((after.piezo_um - before.piezo_um).abs(), bench.rig.take_shots().len(), changed)
    };
    // The noise of the floating pins depends on the moment.
    let found = [0, 7, 23].map(|rest_us| jump(false, rest_us));
    println!("{found:?}");
    assert!(found.iter().any(|(um, ..)| *um > 5.0), "{found:?}");
    assert!(found.iter().any(|(_, shots, changed)| *shots == 1 && *changed), "{found:?}");
    let (um, shots, changed) = jump(true, 0);
    assert!(um < 1.0 && shots == 0 && !changed, "{um} um, {shots} exposures, {changed}");
}

#[test]
fn bouncing_break_contacts_cut_the_steps_once_and_none_follows() {
    for seed in 1..=8 {
        let mut bench = Bench::near_home(seed);
        bench.home_axis(Axis::Lens);
        bench.send(&go(Axis::Lens, 2_000_000));
        bench.rig.advance_us(250_000).expect("runs");
        bench.access(|rig| {
            rig.record_steps();
            rig.set_emergency_stop(true);
        });
        let pressed_ns = bench.report().now_ns;
        bench.rig.advance_us(20_000).expect("runs");
        let [_, steps] = bench.peek(|rig| rig.take_steps());
        // 0.1 ms of RC after at most 0.5 ms of bounce; no step restarts when the contact closes again in between.
        let last_us = steps.last().map_or(0, |at| at.saturating_sub(pressed_ns) / 1_000);
        let longest_us = steps.windows(2).map(|pair| (pair[1] - pair[0]) / 1_000).max().unwrap_or(0);
        assert!((50..=600).contains(&last_us), "seed {seed}: {last_us} us");
        assert!(longest_us < 80, "seed {seed}: STEP restarted after {longest_us} us");
        assert_eq!(bench.alarm().map(|record| record.alarm), Some(Alarm::EmergencyStop));
    }
}

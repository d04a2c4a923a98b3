//! Properties of axes in messages.

use farnear_protocol::{
    Micros, Nanometres, Settle,
    message::{Axis, Capabilities, SettingKey, ShotRecord, StepperKeys, sensor_distance_nm},
};

use crate::frozen_wire::{answers, parts::RECORD};

#[test]
fn each_axis_is_found_under_its_name() {
    let (hello, status) = (answers::hello(), answers::status());
    for (axis, name) in Axis::ALL.into_iter().zip(["coarse", "fine", "lens"]) {
        assert_eq!(axis.name(), name);
        assert_eq!(Axis::ALL[axis as usize], axis, "in the order of their numbers");
    }
    let limits = Axis::ALL.map(|axis| hello.limits.of(axis)).map(|(min, max)| (min.0, max.0));
    assert_eq!(limits, [(0, 13_000_000), (5_000, 195_000), (0, 12_000_000)]);
    assert_eq!(Axis::ALL.map(|axis| *status.axis(axis)), [status.coarse, status.fine, status.lens]);
    assert_eq!(
        Axis::ALL.map(|axis| status.switches(axis)),
        [[true, false], [false, false], [false, true]],
        "home and far switch of the frozen status"
    );
    assert_eq!(Axis::ALL.map(|axis| RECORD.measured(axis).0), [5_809_375, 178_140, -125]);
    let without_piezo = Capabilities { sensor_fine: false, ..hello.capabilities };
    assert_eq!(Axis::ALL.map(|axis| without_piezo.has(axis)), [true, false, true]);
}

#[test]
fn the_distance_is_the_datum_and_the_axes_that_carry_sensor_or_lens() {
    let measured =
        |record: ShotRecord| sensor_distance_nm(Nanometres(47_000_000), |axis| record.measured(axis));
    assert_eq!(measured(RECORD), 47_000_000 + 5_809_375 + 178_140 - 125);
    // Sums beyond an i32 do not wrap.
    assert_eq!(sensor_distance_nm(Nanometres(i32::MAX), |_| Nanometres(i32::MAX)), 4 * i64::from(i32::MAX));
}

#[test]
fn stepper_settings_have_the_axis_name() {
    for axis in Axis::ALL {
        let Some(keys) = StepperKeys::of(axis) else {
            assert_eq!(axis, Axis::SensorFine, "the piezo is not a stepper");
            continue;
        };
        let StepperKeys { min, max, speed, acceleration, jerk, backlash, following } = keys;
        let keys = [min, max, speed, acceleration, jerk, backlash, following];
        let ends = ["min_nm", "max_nm", "speed_nm_per_s", "acceleration_um_per_s2", "jerk_um_per_s3"];
        for (key, end) in
            keys.map(SettingKey::name).iter().zip(ends.into_iter().chain(["backlash_nm", "following_nm"]))
        {
            assert_eq!(*key, format!("{}_{end}", axis.name()));
        }
    }
}

#[test]
fn settle_criteria_have_the_expected_values() {
    // Existing captures used these values; a change is another measurement.
    let numbers = |settle: Settle| (settle.window.0, settle.dwell.0);
    let table = Axis::ALL.map(|axis| {
        [Settle::of_move(axis), Settle::of_shot(axis), Settle::of_search(axis), Settle::of_sweep(axis)]
            .map(numbers)
    });
    let stepper = [(1_000, 2_000), (1_000, 2_000), (2_000, 1_000), (1_000, 1_000)];
    assert_eq!(table, [stepper, [(50, 2_000), (100, 2_000), (500, 1_000), (100, 1_000)], stepper]);
    assert_eq!(Settle::of_move(Axis::Lens).dwell, Micros(2_000));
}

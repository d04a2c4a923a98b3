//! Non-volatile memory: survives power loss; a damaged copy is reported and replaced by the older one.

use crate::bench::{Bench, go};
use farnear_protocol::{
    EventKind, Request, RequestError, Response,
    message::{Alarm, Axis, PositionState, RecordName, SettingKey},
};
use farnear_sim::RigConfig;

const KEY: SettingKey = SettingKey::CoarseBacklashNm;

fn read(bench: &mut Bench) -> i32 {
    match bench.ask(&Request::ReadSetting { key: KEY }) {
        Ok(Response::Setting(setting)) => setting.value,
        other => panic!("expected a setting, got {other:?}"),
    }
}

fn write(bench: &mut Bench, value: i32) {
    let answer = bench.ask(&Request::WriteSetting { key: KEY, value });
    assert!(matches!(answer, Ok(Response::Setting(setting)) if setting.value == value), "{answer:?}");
    bench.rig.advance_us(20_000).expect("runs");
}

#[test]
fn keeps_the_memory_between_runs_on_request() {
    let folder = tempfile::tempdir().expect("a folder");
    let config = RigConfig { memory: Some(folder.path().join("fram.bin")), ..RigConfig::default() };
    let mut bench = Bench::with(&config);
    write(&mut bench, 7_000);
    bench.rig.stop().expect("it ends in order");
    let mut bench = Bench::with(&config);
    assert_eq!((read(&mut bench), bench.boot), (7_000, 2));
}

fn power_cycle(bench: &mut Bench) {
    bench.access(|rig| rig.set_power(false));
    bench.rig.advance_us(50_000).expect("runs");
    power_return(bench);
}

fn power_return(bench: &mut Bench) {
    bench.access(|rig| rig.set_power(true));
    bench.rig.settle().expect("runs");
    bench.events.clear();
    bench.answers();
    bench.say_hello();
}

fn repaired(bench: &Bench) -> Vec<RecordName> {
    let kinds = bench.events.iter().map(|event| &event.kind);
    kinds
        .filter_map(|kind| match kind {
            EventKind::RecordRepaired { record, .. } => Some(*record),
            _ => None,
        })
        .collect()
}

fn changed(before: &[u8], after: &[u8]) -> Vec<usize> {
    (0..before.len()).filter(|&i| before[i] != after[i]).collect()
}

#[test]
fn settings_survive_a_power_loss_and_the_boot_count_continues() {
    let mut bench = Bench::new(1);
    assert_eq!(bench.boot, 1);
    write(&mut bench, 3_210);
    power_cycle(&mut bench);
    assert_eq!((read(&mut bench), bench.boot), (3_210, 2));
    assert_eq!(bench.alarm(), None);
}

#[test]
fn a_flipped_bit_is_reported_and_the_older_copy_used() {
    let mut bench = Bench::new(1);
    write(&mut bench, 3_000);
    let before = bench.peek(|rig| rig.memory());
    write(&mut bench, 3_100);
    let after = bench.peek(|rig| rig.memory());
    let places = changed(&before, &after);
    assert!(places.len() > 4, "a sequence number, a value and a checksum: {places:?}");
    // First, last and a middle byte; the campaign tests every byte.
    let all = std::env::var_os("FARNEAR_CAMPAIGN").is_some();
    let some = [0, places.len() / 2, places.len() - 1].map(|i| places[i]);
    for place in if all { places } else { some.to_vec() } {
        for bit in [0, 7] {
            let spoilt = after.clone();
            bench.access(move |rig| {
                rig.change_memory(|contents| {
                    contents.copy_from_slice(&spoilt);
                    contents[place] ^= 1 << bit;
                });
                rig.press_reset();
            });
            bench.rig.settle().expect("runs");
            bench.events.clear();
            bench.answers();
            bench.say_hello();
            assert_eq!(read(&mut bench), 3_000, "bit {bit} of byte {place}: the older copy is used");
            assert_eq!(repaired(&bench), [RecordName::Settings], "bit {bit} of byte {place}");
            assert_eq!(bench.alarm(), None);
        }
    }
}

#[test]
fn two_damaged_copies_give_the_defaults_and_an_alarm() {
    let mut bench = Bench::new(1);
    write(&mut bench, 3_000);
    let before = bench.peek(|rig| rig.memory());
    write(&mut bench, 3_100);
    let between = bench.peek(|rig| rig.memory());
    write(&mut bench, 3_200);
    let after = bench.peek(|rig| rig.memory());
    let (one, other) = (changed(&before, &between)[0], changed(&between, &after)[0]);
    bench.access(move |rig| {
        rig.change_memory(|contents| {
            contents[one] ^= 1;
            contents[other] ^= 1;
        });
        rig.press_reset();
    });
    bench.settle();
    bench.say_hello();
    let default = match bench.ask(&Request::ReadSetting { key: KEY }) {
        Ok(Response::Setting(setting)) => setting.default,
        other => panic!("{other:?}"),
    };
    assert_eq!(read(&mut bench), default);
    bench.clear(|alarm| *alarm == Alarm::RecordLost { record: RecordName::Settings });
    write(&mut bench, 3_300);
    power_cycle(&mut bench);
    assert_eq!(read(&mut bench), 3_300, "the record is whole again");
}

#[test]
fn power_loss_during_a_write_leaves_the_old_or_the_new_value() {
    let mut bench = Bench::new(1);
    let mut value = 3_000;
    write(&mut bench, value);
    let before = bench.peek(|rig| rig.memory().len());
    assert_eq!(before, 32 * 1024);
    let (mut old, mut new) = (0, 0);
    for bytes in [1, 2, 5, 20, 40, 63, 64, 65, 80] {
        bench.access(move |rig| rig.fail_power_after_memory_bytes(bytes));
        let next = if value == 3_000 { 3_500 } else { 3_000 };
        bench.send(&Request::WriteSetting { key: KEY, value: next });
        bench.rig.advance_us(20_000).expect("runs");
        if bench.report().powered {
            // The write was shorter than that.
            power_cycle(&mut bench);
            assert_eq!(read(&mut bench), next);
            value = next;
            continue;
        }
        power_return(&mut bench);
        let found = read(&mut bench);
        assert!(found == value || found == next, "{bytes} bytes: {found} is neither {value} nor {next}");
        (old, new) = (old + u32::from(found == value), new + u32::from(found == next));
        assert_eq!(bench.alarm(), None, "{bytes} bytes");
        value = found;
    }
    println!("torn after 1 to 90 bytes: {old} times the old value, {new} times the new one");
    assert!(old >= 3, "most cuts leave the old value");
}

#[test]
fn power_loss_during_motion_invalidates_the_position() {
    let mut bench = Bench::near_home(1);
    for axis in [Axis::SensorCoarse, Axis::Lens] {
        bench.home();
        assert_eq!(bench.ask(&go(axis, 5_000_000)), Ok(Response::Accepted));
        bench.rig.advance_us(100_000).expect("runs");
        power_cycle(&mut bench);
        let status = bench.status();
        let (moved, other) = match axis {
            Axis::Lens => (status.lens, status.coarse),
            _ => (status.coarse, status.lens),
        };
        assert_eq!([moved.state, other.state], [PositionState::Lost, PositionState::Unknown]);
        let refused = bench.ask(&go(axis, 1_000_000));
        assert!(matches!(refused, Err(RequestError::Alarm { .. })), "{refused:?}");
        bench.clear(|alarm| *alarm == Alarm::MotionInterrupted { axis });
        bench.home_axis(axis);
        // The motor is at rest and the position stored.
        bench.rig.advance_us(200_000).expect("runs");
    }
    // At rest a power loss loses nothing.
    power_cycle(&mut bench);
    assert_eq!((bench.alarm(), bench.status().coarse.state), (None, PositionState::Unknown));
}

//! Requests without long work; texts of refusals and failures.

use std::time::Duration;

use farnear_capture::{ClientError, LogPart};
use farnear_protocol::{
    RequestError,
    message::{Alarm, Axis, Failure, SettingKey},
    units::Nanometres,
};
use farnear_scripted_board::Faults;

use crate::scripted::connect;

#[test]
fn an_alarm_stops_work_refuses_more_and_is_cleared_by_its_number() {
    let faults = Faults { alarm_at_work: Some(Alarm::HostSilence { request: 2 }), ..Faults::default() };
    let (client, peer) = connect(faults);
    let error = client.home(Axis::SensorCoarse).err().unwrap();
    let ClientError::Failed { alarm: Some(alarm), .. } = &error else { panic!("{error:?}") };
    assert_eq!(alarm.number, 1);
    assert!(error.to_string().contains("was the cable pulled"), "{error}");
    assert!(error.to_string().contains("alarm 1 is latched"), "{error}");
    peer.board().faults = Faults::default();
    let error = client.home(Axis::SensorCoarse).err().unwrap();
    assert!(error.to_string().contains("alarm 1 is latched"), "{error}");
    let error = client.clear_alarm(7).err().unwrap();
    assert!(error.to_string().contains("the latched alarm is number 1"), "{error}");
    client.clear_alarm(1).unwrap();
    client.home(Axis::SensorCoarse).unwrap();
    client.halt().unwrap();
    let kept: Vec<_> = client.alarms().unwrap().iter().map(|record| record.number).collect();
    assert_eq!((kept, client.status().unwrap().alarm.unwrap().alarm), (vec![2, 1], Alarm::Halt));
}

#[test]
fn settings_are_read_and_changed_within_their_range() {
    let (client, _) = connect(Faults::default());
    let key = SettingKey::CoarseBacklashNm;
    assert_eq!(client.set_setting(key, 4_000).unwrap().value, 4_000);
    assert_eq!(client.setting(key).unwrap().value, 4_000);
    let error = client.set_setting(key, -1).err().unwrap();
    assert!(error.to_string().contains("coarse_backlash_nm must lie between 0 and 20000000"), "{error}");
    assert_eq!(client.counters().unwrap().boots, 7);
}

#[test]
fn log_parts_report_missing_ones() {
    let (client, peer) = connect(Faults::default());
    let stream = client.logs().unwrap();
    client.status().unwrap(); // the stream is open
    peer.board().log(&[1, 2]);
    peer.board().lose_log();
    peer.board().log(&[3]);
    let wait = Duration::from_secs(20);
    let next = || stream.next_within(wait).unwrap().unwrap();
    assert_eq!(next(), LogPart { number: 0, missing: 0, bytes: vec![1, 2] });
    assert_eq!(next(), LogPart { number: 2, missing: 1, bytes: vec![3] });
}

#[test]
fn refusals_and_failures_give_a_remedy() {
    let (client, peer) = connect(Faults::default());
    let error = client.move_to(Axis::SensorCoarse, Nanometres(5)).err().unwrap();
    assert!(error.to_string().contains("home it first"), "{error}");
    client.home(Axis::SensorCoarse).unwrap();
    let error = client.move_to(Axis::SensorCoarse, Nanometres(14_000_000)).err().unwrap();
    assert!(
        matches!(error, ClientError::Refused { error: RequestError::OutOfRange { .. }, .. }),
        "{error:?}"
    );
    assert!(error.to_string().contains("14000.000 um is outside the limits"), "{error}");
    peer.board().faults.fails_with = Some(Failure::Following { error: Nanometres(12_500) });
    let error = client.move_to(Axis::SensorCoarse, Nanometres(5)).err().unwrap();
    assert!(error.to_string().contains("12.500 um (stall or slip)"), "{error}");
}

//! Hello, homing, moves: what a host does first.

mod common;

use common::Bench;
use farnear_protocol::{
    EventKind, Nanometres,
    message::{Axis, ResetCause, SCHEMA_KEY},
};

#[test]
fn hello_tells_who_the_board_is() {
    let bench = Bench::new(1);
    let hello = &bench.hello;
    assert_eq!((hello.board.as_str(), hello.boot), ("nucleo-f429zi", 1));
    assert_eq!(hello.schema_key, SCHEMA_KEY);
    assert_eq!(hello.reset_cause, ResetCause::PowerOn);
    assert!(hello.emulated);
    assert_ne!(hello.unique_id, Bench::new(2).hello.unique_id);
}

#[test]
fn homing_finds_the_edge_and_moves_reach_their_target() {
    let mut bench = Bench::new(1);
    bench.home();
    for target in [5_831_300, 12_999_000, 1_000] {
        let end = bench.move_to(Axis::SensorCoarse, Nanometres(target));
        let EventKind::MoveDone { measured, .. } = end else { panic!("{end:?}") };
        assert!((measured.0 - target).abs() <= 1_000, "{measured:?}");
        let report = bench.report();
        println!("{target} nm: measured {} nm, truly {} um", measured.0, report.coarse_um);
    }
}

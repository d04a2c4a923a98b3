//! Replays a run from its trace and detects a trace of another run.

use std::fs;

use farnear_campaign::host_model;
use farnear_sim::{RigConfig, Scenario, replay::replay};

const SCENARIO: &str = "start_um = [60.0, 80.0]\nbit_error_rate = 1e-5\n\
    [[happens]]\non = \"exposure-begins\"\nwhat = \"power-loss\"\nfor_ms = 20\n\
    [[host]]\ndoes = \"home\"\naxis = \"lens\"\n[[host]]\ndoes = \"expose\"";

#[test]
fn replays_a_trace_and_locates_a_change() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("run.vcd");
    let scenario = Scenario::parse(SCENARIO).expect("a scenario");
    let config = RigConfig { trace: Some(path.clone()), ..RigConfig::of(&scenario).expect("good parts") };
    let outcome = host_model::play(&scenario, &config).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!((outcome.broken.as_slice(), outcome.resets > 0), (&[][..], true));

    let text = fs::read_to_string(&path).expect("a trace");
    for signal in
        [" step_lens ", " exposing ", " to_board ", "spower-loss h", "s/power-loss h", "\n0w", "\n1e"]
    {
        assert!(text.contains(signal), "{signal} is missed");
    }
    let (end_ns, departure) = replay(&path, None).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(departure, None, "the same run again");
    assert!(end_ns > 1_000_000_000, "{end_ns}");

    // A position that differs from the record.
    let place = text.rfind(" l\n").expect("the lens' position") - 1;
    let digit = if text.as_bytes()[place] == b'1' { "2" } else { "1" };
    let changed = [&text[..place], digit, &text[place + 1..]].concat();
    fs::write(&path, changed).expect("writable");
    let departure = replay(&path, None).expect("it runs").1.expect("another run");
    assert_eq!(departure.signal, "lens_um");
    assert!(departure.recorded.is_some() && departure.now.is_some(), "{departure:?}");

    fs::write(&path, "time_us,event").expect("writable");
    let refused = replay(&path, None).expect_err("no trace").to_string();
    assert!(refused.contains("run.vcd") && refused.contains("VCD that farnear-sim wrote"), "{refused}");
}

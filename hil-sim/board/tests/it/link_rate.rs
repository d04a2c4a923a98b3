//! Change of the link rate, fallback to the old rate, and a slow adapter.

use farnear_protocol::{
    Request, Response,
    message::{LINK_TRIAL, LinkRate, ResetCause},
};

use farnear_sim::{RigConfig, Scenario};

use crate::bench::Bench;

const SLOW: LinkRate = LinkRate::Baud921600;

fn set(bench: &mut Bench, rate: LinkRate) {
    assert_eq!(bench.ask(&Request::SetLinkRate { rate }), Ok(Response::Accepted));
    bench.rig.advance_us(1_000).expect("the rig runs");
}

fn rate_of_host(bench: &mut Bench, rate: LinkRate) {
    bench.rig.set_host_rate(rate.baud()).expect("the rig runs");
}

#[test]
fn uses_the_requested_link_rate_until_reset() {
    let mut bench = Bench::new(1);
    rate_of_host(&mut bench, LinkRate::START);
    set(&mut bench, SLOW);
    rate_of_host(&mut bench, SLOW);
    for _ in 0..20 {
        bench.status();
        bench.rig.advance_us(50_000).expect("the rig runs");
    }
    assert_eq!(bench.status().link.bad_frames, 0);
    // Back, and once more.
    for rate in [LinkRate::START, SLOW] {
        set(&mut bench, rate);
        rate_of_host(&mut bench, rate);
        bench.status();
    }
    bench.access(|rig| rig.press_reset());
    bench.rig.advance_us(500_000).expect("the rig runs");
    assert_eq!(bench.try_ask(&Request::Hello), None, "it is back at the rate of the start");
    rate_of_host(&mut bench, LinkRate::START);
    assert_eq!(bench.say_hello().reset_cause, ResetCause::Pin);
}

#[test]
fn returns_to_the_old_rate_if_the_host_does_not_follow() {
    let mut bench = Bench::new(1);
    rate_of_host(&mut bench, LinkRate::START);
    set(&mut bench, SLOW);
    assert_eq!(bench.try_ask(&Request::Status), None);
    bench.rig.advance_us(u64::from(LINK_TRIAL.0)).expect("the rig runs");
    bench.status();
    bench.rig.advance_us(2 * u64::from(LINK_TRIAL.0)).expect("the rig runs");
    bench.status();
}

#[test]
fn adapter_latency_delays_answers_and_loses_none() {
    let scenario = "[[happens]]\nafter_ms = 200\nwhat = \"link-latency\"\namount = 16";
    let scenario = Scenario::parse(scenario).expect("a good file");
    let mut bench = Bench::with(&RigConfig { seed: 1, scenario, ..RigConfig::default() });
    bench.rig.advance_us(300_000).expect("the rig runs");
    for _ in 0..5 {
        let id = bench.send(&Request::Status);
        let mut waited_us = 0;
        while !bench.answers().iter().any(|(answered, _)| *answered == id) {
            bench.rig.advance_us(200).expect("the rig runs");
            waited_us += 200;
            assert!(waited_us < 100_000, "no answer");
        }
        // The first byte comes within 4 ms, including 2 ms of rest; the adapter then holds it for up to 16
        // ms.
        assert!(waited_us <= 20_200, "{waited_us} us");
        assert!(waited_us >= 1_000, "{waited_us} us");
        bench.rig.advance_us(40_000).expect("the rig runs");
    }
}

#[test]
fn a_scenario_can_use_cycles() {
    let text = "[[happens]]\nafter_cycles = 84000000\nwhat = \"reset-button\"";
    let scenario = Scenario::parse(text).expect("a good file");
    let mut bench = Bench::with(&RigConfig { seed: 1, scenario, ..RigConfig::default() });
    let now_us = bench.report().now_ns / 1_000;
    bench.rig.advance_us(499_900 - now_us).expect("the rig runs");
    assert_eq!(bench.report().resets, 0);
    bench.rig.advance_us(200).expect("the rig runs");
    assert_eq!(bench.report().resets, 1);
}

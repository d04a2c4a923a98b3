//! The link at another rate: both ends change, or the board goes back.

use farnear_protocol::{
    Request, Response,
    message::{LINK_TRIAL, LinkRate, ResetCause},
};

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
fn the_board_speaks_at_the_rate_that_its_host_asks_for_until_it_is_reset() {
    let mut bench = Bench::new(1);
    rate_of_host(&mut bench, LinkRate::START);
    set(&mut bench, SLOW);
    rate_of_host(&mut bench, SLOW);
    for _ in 0..20 {
        bench.status();
        bench.rig.advance_us(50_000).expect("the rig runs");
    }
    assert_eq!(bench.status().link.bad_frames, 0);
    // And back, and once more.
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
fn a_host_that_does_not_follow_finds_the_board_where_it_was() {
    let mut bench = Bench::new(1);
    rate_of_host(&mut bench, LinkRate::START);
    set(&mut bench, SLOW);
    assert_eq!(bench.try_ask(&Request::Status), None);
    bench.rig.advance_us(u64::from(LINK_TRIAL.0)).expect("the rig runs");
    bench.status();
    bench.rig.advance_us(2 * u64::from(LINK_TRIAL.0)).expect("the rig runs");
    bench.status();
}

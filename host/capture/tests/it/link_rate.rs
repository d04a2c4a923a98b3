//! Link rates: requested, discovered, unavailable.

use farnear_capture::Client;
use farnear_protocol::message::{Axis, LinkRate};
use farnear_scripted_board::{Faults, Peer};

const SLOW: LinkRate = LinkRate::Baud921600;

fn connect_at(peer: &Peer, rate: LinkRate) -> Client {
    Client::connect_at(peer.connect(), "scripted", rate).unwrap()
}

#[test]
fn sets_the_requested_rate_and_the_next_program_finds_the_board() {
    let peer = Peer::new(Faults::default());
    let client = connect_at(&peer, SLOW);
    assert_eq!((client.link_rate(), peer.board().rate, client.link_note()), (SLOW, SLOW, None));
    client.home(Axis::SensorCoarse).unwrap();
    drop(client);
    // The next client requests no rate and starts at the other one.
    let next = Client::connect(peer.connect(), "scripted").unwrap();
    assert_eq!(next.link_rate(), SLOW);
    next.home(Axis::SensorCoarse).unwrap();
    drop(next);
    assert_eq!(connect_at(&peer, LinkRate::START).link_rate(), LinkRate::START);
}

#[test]
fn a_board_that_starts_slowly_is_found_at_the_rate_after_a_reset() {
    // It answers neither of the short looks at that rate.
    let peer = Peer::new(Faults { lose_answers: 2, ..Faults::default() });
    assert_eq!(connect_at(&peer, SLOW).link_rate(), SLOW);
}

#[test]
fn restores_the_requested_rate_after_a_reset() {
    let peer = Peer::new(Faults::default());
    let mut client = connect_at(&peer, SLOW);
    client.reboot().unwrap();
    assert_eq!((client.hello().boot, client.link_rate(), peer.board().rate), (8, SLOW, SLOW));
    client.home(Axis::SensorCoarse).unwrap();
}

#[test]
fn keeps_the_old_rate_if_the_adapter_cannot_change() {
    let peer = Peer::new(Faults { no_rate: Some(SLOW), ..Faults::default() });
    let client = connect_at(&peer, SLOW);
    assert_eq!((client.link_rate(), peer.board().rate), (LinkRate::START, LinkRate::START));
    let note = client.link_note().unwrap();
    assert!(note.contains("stays at 2000000 baud") && note.contains("921600"), "{note}");
    client.home(Axis::SensorCoarse).unwrap();
}

#[test]
fn keeps_the_old_rate_with_older_firmware() {
    let peer = Peer::new(Faults { one_rate: true, ..Faults::default() });
    let client = connect_at(&peer, SLOW);
    assert!(client.link_note().is_some());
    client.home(Axis::SensorCoarse).unwrap();
}

#[test]
fn keeps_the_old_rate_of_a_board_that_moves() {
    let peer = Peer::new(Faults { busy: true, ..Faults::default() });
    let client = connect_at(&peer, SLOW);
    assert_eq!((client.link_rate(), peer.board().rate), (LinkRate::START, LinkRate::START));
    let note = client.link_note().unwrap();
    assert!(note.contains("the rig was moving"), "{note}");
}

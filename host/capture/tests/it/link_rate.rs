//! The link at another rate: asked for, found, and gone without.

use farnear_capture::Client;
use farnear_protocol::message::{Axis, LinkRate};
use farnear_scripted_board::{Faults, Peer};

const SLOW: LinkRate = LinkRate::Baud921600;

fn connect_at(peer: &Peer, rate: LinkRate) -> Client {
    Client::connect_at(peer.connect(), "scripted", rate).unwrap()
}

#[test]
fn a_rate_that_is_asked_for_is_had_and_the_next_program_finds_the_board_there() {
    let peer = Peer::new(Faults::default());
    let client = connect_at(&peer, SLOW);
    assert_eq!((client.link_rate(), peer.board().rate, client.link_note()), (SLOW, SLOW, None));
    client.home(Axis::SensorCoarse).unwrap();
    drop(client);
    // One that asks for none begins at the other rate.
    let next = Client::connect(peer.connect(), "scripted").unwrap();
    assert_eq!(next.link_rate(), SLOW);
    next.home(Axis::SensorCoarse).unwrap();
    drop(next);
    assert_eq!(connect_at(&peer, LinkRate::START).link_rate(), LinkRate::START);
}

#[test]
fn a_board_that_was_reset_has_the_wanted_rate_again() {
    let peer = Peer::new(Faults::default());
    let mut client = connect_at(&peer, SLOW);
    client.reboot().unwrap();
    assert_eq!((client.hello().boot, client.link_rate(), peer.board().rate), (8, SLOW, SLOW));
    client.home(Axis::SensorCoarse).unwrap();
}

#[test]
fn an_adapter_that_cannot_have_the_rate_leaves_the_link_as_it_was() {
    let peer = Peer::new(Faults { no_rate: Some(SLOW), ..Faults::default() });
    let client = connect_at(&peer, SLOW);
    assert_eq!((client.link_rate(), peer.board().rate), (LinkRate::START, LinkRate::START));
    let note = client.link_note().unwrap();
    assert!(note.contains("stays at 2000000 baud") && note.contains("921600"), "{note}");
    client.home(Axis::SensorCoarse).unwrap();
}

#[test]
fn firmware_that_does_not_know_the_request_goes_on_as_it_is() {
    let peer = Peer::new(Faults { one_rate: true, ..Faults::default() });
    let client = connect_at(&peer, SLOW);
    assert!(client.link_note().is_some());
    client.home(Axis::SensorCoarse).unwrap();
}

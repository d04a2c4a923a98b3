//! The protocol document agrees with the code.

use std::{fs, path::Path};

use farnear_protocol::{
    PROTOCOL_CURRENT,
    frame::{BODY_MAX, FRAME_MAX},
    message::ID_STEP_MAX,
};

use crate::frozen_wire::{BY_HAND, requests};

#[test]
fn the_document_lists_every_request() {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/protocol.md");
    let page = fs::read_to_string(&page).expect("the page lies next to the crate");
    for request in requests::table() {
        let name = format!("{request:?}");
        let name = name.split([' ', '(', '{']).next().expect("a name");
        assert!(page.contains(name), "docs/protocol.md says nothing of {name}");
    }
}

#[test]
fn the_documents_frame_equals_the_frozen_one() {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/protocol.md");
    let page = fs::read_to_string(&page).expect("the page lies next to the crate");
    let wire = page.lines().find_map(|line| line.strip_prefix("wire ")).expect("the frame by hand");
    assert_eq!(wire.replace(' ', ""), BY_HAND);
}

#[test]
fn the_document_states_the_numbers_of_the_code() {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/protocol.md");
    let page = fs::read_to_string(&page).expect("the page lies next to the crate");
    let step = format!("{},{:03}", ID_STEP_MAX / 1000, ID_STEP_MAX % 1000);
    for stated in [
        format!("Version {PROTOCOL_CURRENT}."),
        format!("at most {FRAME_MAX} bytes with its ending 0, a body at most {BODY_MAX} bytes"),
        format!("by at most {step}."),
    ] {
        assert!(page.contains(&stated), "docs/protocol.md does not say {stated:?}");
    }
}

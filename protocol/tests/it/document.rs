//! The document that a stranger writes a client from.

use std::{fs, path::Path};

use crate::frozen_wire::requests;

#[test]
fn the_document_tells_of_every_request() {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/protocol.md");
    let page = fs::read_to_string(&page).expect("the page lies beside the crate");
    for request in requests::table() {
        let name = format!("{request:?}");
        let name = name.split([' ', '(', '{']).next().expect("a name");
        assert!(page.contains(name), "docs/protocol.md says nothing of {name}");
    }
}

//! The protocol through its public API, in one test binary.

mod axes;
mod decoder;
mod document;
mod frozen_wire;

//! The protocol through its public face, one program for all of it: what is frozen, what is decoded, what an axis is.

mod axes;
mod decoder;
mod document;
mod frozen_wire;

//! The drivers of the NUCLEO-F429ZI, for the firmware and for the test of a real board (`farnear-board-test`).
#![no_std]

pub mod axis;
pub mod board;
pub mod camera;
pub mod clock;
mod clock_tree;
pub mod control;
mod encoder;
pub mod light;
pub mod link;
pub mod memory;
pub mod option_bytes;
pub mod piezo;
pub mod registers;
pub mod stepper;
mod supply;

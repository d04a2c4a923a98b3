//! The emulated board: the real firmware, the plant around it, and the program that offers both to clients. One
//! program for all of it, so that it is linked once and its tests run side by side.

mod accuracy;
mod bad_line;
mod bench;
mod calibration;
mod continuous;
mod fuzz;
mod gige;
mod light;
mod link_rate;
mod maths;
mod memory;
mod outstanding;
mod program;
mod pty;
mod python;
mod repeat;
mod reset;
mod session;
mod silence;
mod silicon;
mod steps;

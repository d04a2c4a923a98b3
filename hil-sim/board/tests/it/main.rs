//! One test binary, linked once.

mod accuracy;
mod bad_line;
mod bench;
mod board_test;
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
mod supply;

//! The program as its users meet it: what it prints, what it writes, how it ends.

mod common;

mod bad_images;
mod bad_optics;
mod bad_ports;
mod bad_rigs;
mod emulated_rig;
mod emulated_work;
mod maps;
mod scripted_board;
mod usage;

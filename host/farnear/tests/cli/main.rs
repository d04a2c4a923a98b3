//! The program as its users meet it: what it prints, what it writes, how it ends.

mod common;

mod activity;
mod bad_images;
mod bad_optics;
mod bad_ports;
mod bad_rigs;
mod emulated_rig;
mod emulated_work;
mod maps;
mod markers;
mod scene_files;
mod scripted_board;
mod shadow_remove;
mod sun;
mod uncertainty;
mod usage;

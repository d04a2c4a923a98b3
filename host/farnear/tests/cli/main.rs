//! The program as users see it: output, files, exit codes. One binary, because each costs a link.

#![allow(clippy::unwrap_used)] // helpers of tests: what cannot be prepared must stop the test

mod common;

mod activity;
mod bad_images;
mod bad_optics;
mod bad_ports;
mod bad_rigs;
mod batch;
mod calibrate_stack;
mod calibration;
mod camera;
mod captures;
mod doctor;
mod documents;
mod emulated_rig;
mod emulated_work;
mod focus_stack;
mod half_mirror;
mod hints;
mod interrupted;
mod lens_choice;
mod light;
mod maps;
mod markers;
mod outputs;
mod real_pairs;
mod scene_files;
mod scripted_board;
mod shadow_remove;
mod shadow_score;
mod silhouettes;
mod sun;
mod target;
mod uncertainty;
mod usage;
mod writers;

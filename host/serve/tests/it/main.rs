//! farnear-serve with a scripted board, in one test program.
#![allow(clippy::unwrap_used)] // a test that panics has failed, which is what it is for
#![cfg(target_os = "linux")] // where a pseudo-terminal holds the board

mod attacks;
mod captures;
mod client;
mod control;
mod exhaustion;
mod garbage;
mod interface;
mod silence;
mod two_servers;

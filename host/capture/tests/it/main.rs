//! farnear-capture through its public face, one program for all of it: a scripted board stands at the other end of the line.
#![allow(clippy::unwrap_used)] // a test that panics has failed, which is what it is for

mod cameras;
mod command_camera;
mod continuous;
#[cfg(feature = "genicam")]
mod genicam_camera;
#[cfg(feature = "genicam")]
mod gige_rig;
mod line;
mod link_rate;
mod pair;
mod requests;
mod scripted;
mod session;
mod work;

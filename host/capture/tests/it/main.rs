//! farnear-capture through its public API with a scripted board, in one test binary.
#![allow(clippy::unwrap_used)]

mod cameras;
mod command_camera;
mod continuous;
#[cfg(feature = "genicam")]
mod genicam_camera;
#[cfg(feature = "genicam")]
mod gige_rig;
mod line;
mod link_rate;
mod lost_frames;
mod pair;
mod requests;
mod scripted;
mod session;
mod work;

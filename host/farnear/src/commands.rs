//! Commands that need more than their request; the others run by [`Run`](crate::run::Run).

pub mod activity;
pub mod batch;
pub mod calibrate;
pub mod camera;
pub mod completions;
pub mod doctor;
pub mod man;
pub mod measure;
pub mod render;
pub mod rig;
pub mod serve;
pub mod shadow;
pub mod silhouettes;

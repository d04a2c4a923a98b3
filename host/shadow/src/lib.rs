//! The sun, the shadows it casts, and their removal from masks and pictures (Li 2014, chapter 8). No input or output.
//!
//! [`sun`] gives elevation and azimuth, or [`light`] describes a lamp or a measured direction; [`projection`] computes the shadow on the
//! ground and in the image; [`uncertainty`] the standard deviation of the cutting angle; [`cast`] models a silhouette as a body and
//! its cast shadow; [`cut`] removes the shadow; [`detectors`] find shadows by colour and texture; [`score`] compares with truth;
//! [`synthetic`] draws scenes whose shadow is known.
//!
//! Frames: on the ground, `r_x` to the camera's right and `r_y` along its viewing direction, metres; in the image x right, y DOWN.

pub mod camera;
pub mod cast;
pub mod cut;
pub mod detectors;
pub mod envelope;
pub mod light;
pub mod projection;
pub mod score;
pub mod sun;
pub mod synthetic;
pub mod uncertainty;

pub use camera::CameraFile;
pub use cut::{CutReport, Method, remove, subject_of};
pub use light::{Lamp, Light};
pub use projection::{GroundShadow, ImageShadow, ShadowError, Subject};

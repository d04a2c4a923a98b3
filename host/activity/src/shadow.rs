//! Shadows: where they fall in the image, how sure that is, and cutting them off a silhouette (Li 2014, chapter 8).
//!
//! The chain: [`crate::sun`] gives elevation and azimuth, or [`light`] knows a lamp or a measured direction; [`projection`] the shadow on the ground and in the image;
//! [`uncertainty`] the standard deviation of the cutting angle; [`cast`] explains a silhouette as a body and the shadow it throws; [`cut`] removes the shadow; [`crate::shadow_score`] measures against truth.
//!
//! Frames: on the ground, `r_x` to the camera's right and `r_y` along its viewing direction, metres; in the image x right, y DOWN.

pub mod camera;
pub mod cast;
pub mod cut;
pub mod envelope;
pub mod light;
pub mod projection;
pub mod uncertainty;

pub use camera::CameraFile;
pub use cut::{CutReport, Method, remove, subject_of};
pub use light::{Lamp, Light};
pub use projection::{GroundShadow, ImageShadow, ShadowError, Subject};

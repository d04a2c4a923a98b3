//! Sun, cast shadows, and their removal from masks and pictures (Li 2014, chapter 8). No I/O. [`sun`] gives
//! elevation and azimuth, [`light`] a lamp or a measured direction; [`projection`] the shadow on the ground
//! and in the image; [`uncertainty`] the standard deviation of the cutting angle; [`cast`] models body and
//! shadow; [`cut`] removes the shadow; [`detectors`] use colour and texture; [`score`] compares with truth.
//! Ground `r_x` is to the camera's right, `r_y` along its viewing direction, metres; image x right, y down.

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

//! # farnear-files
//!
//! What farnear reads and writes, without knowing what it means: pictures, maps of numbers, masks, meshes and video, and
//! results that are there whole or not at all.
//!
//! - [`image_file`]: an image of any common kind, as grey values; [`map`]: depths in `.npy` and float TIFF; [`masks`]: silhouettes as
//!   pictures; [`mesh`]: a surface as PLY; [`video`]: frames one by one.
//! - [`stack`]: images at different focus in a folder or a TIFF of many pages; [`order`]: the order in which they were taken.
//! - [`npy`], [`exr`]: the formats themselves, where no crate is worth its compile time.
//! - [`view`]: a depth map as a picture for people; [`text`]: words on a picture.
//! - [`staging`]: written aside, then renamed.
//!
//! ```
//! use farnear_files::{map, npy, staging};
//!
//! let folder = std::env::temp_dir().join(format!("farnear-files-{}", std::process::id()));
//! let staged = staging::Staging::new_folder(&folder)?;
//! staged.write("depth.npy", &npy::write(ndarray::array![[933.0f32, f32::NAN]].view()))?;
//! assert!(!folder.exists()); // nothing half-written is ever seen
//! staged.finish()?;
//! assert_eq!(map::read(&folder.join("depth.npy"))?[[0, 0]], 933.0);
//! # std::fs::remove_dir_all(&folder)?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod exr;
pub mod image_file;
pub mod map;
pub mod masks;
pub mod mesh;
pub mod npy;
pub mod order;
pub mod quantiles;
pub mod stack;
pub mod staging;
pub mod text;
pub mod video;
pub mod view;

/// Something could not be put into the bytes of a file: what the encoder says.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
#[error("cannot encode {what}: {reason}")]
pub struct EncodeError {
    /// What was to be encoded.
    pub what: &'static str,
    /// The encoder's words.
    pub reason: String,
}

impl EncodeError {
    /// For `map_err`.
    pub fn of<E: std::fmt::Display>(what: &'static str) -> impl FnOnce(E) -> Self {
        move |error| Self { what, reason: error.to_string() }
    }
}

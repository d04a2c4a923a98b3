//! # farnear-files
//!
//! File formats of farnear, and atomic output.
//!
//! - [`image_file`]: images as grey values; [`map`]: depths in `.npy` and float TIFF; [`masks`]: silhouettes as
//!   pictures; [`mesh`]: surfaces as PLY; [`video`]: frames.
//! - [`stack`]: focus stacks in a folder or multi-page TIFF; [`order`]: order of capture.
//! - [`npy`], [`exr`]: own implementations where a crate is not worth its compile time.
//! - [`view`]: depth map as a colour picture; [`text`]: text on a picture; [`staging`]: atomic files and folders.
//!
//! ```
//! use farnear_files::{map, npy, staging};
//!
//! let folder = std::env::temp_dir().join(format!("farnear-files-{}", std::process::id()));
//! let staged = staging::Staging::new_folder(&folder)?;
//! staged.write("depth.npy", &npy::write(ndarray::array![[933.0f32, f32::NAN]].view()))?;
//! assert!(!folder.exists()); // incomplete output is never visible
//! staged.finish()?;
//! assert_eq!(map::read(&folder.join("depth.npy"))?[[0, 0]], 933.0);
//! # std::fs::remove_dir_all(&folder)?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod exr;
pub mod glb;
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

#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
#[error("cannot encode {what}: {reason}")]
pub struct EncodeError {
    pub what: &'static str,
    pub reason: String,
}

impl EncodeError {
    pub fn of<E: std::fmt::Display>(what: &'static str) -> impl FnOnce(E) -> Self {
        move |error| Self { what, reason: error.to_string() }
    }
}

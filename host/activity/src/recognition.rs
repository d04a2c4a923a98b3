//! Activities from embedded silhouettes: patterns of a clip, classifiers, models, live recognition (Li 2014, section 9.3.2, which calls
//! it embedded pattern learning, EPL).
//!
//! The way of a clip: [`clip`] describes its masks, [`space`] embeds them and makes a pattern ([`codebook`], the thesis'
//! [`occupancy`] grid, or a [`network`]), a [`classifier`] answers, [`unknown`] says what it does not know; [`alignment`] and [`self_training`] serve where clips come from
//! another camera than those that were learned from. [`choice`] finds the settings of an [`experiment`] by cross-validation, [`training`]
//! makes the [`model`], [`live`] uses it while frames come in, [`segmentation`] in recordings that nobody cut.

pub mod alignment;
pub mod choice;
pub mod classifier;
pub mod clip;
pub mod codebook;
pub mod experiment;
pub mod frames;
pub mod lengths;
pub mod live;
pub mod model;
pub mod model_file;
pub mod nearest;
pub mod network;
pub mod occupancy;
pub(crate) mod patterns;
pub mod residuals;
pub mod second_opinion;
pub mod segmentation;
pub mod self_training;
pub mod space;
pub mod training;
pub mod unknown;
pub mod watch;

//! Activities from embedded silhouettes: patterns of a clip, classifiers, models, live recognition (Li 2014, section 9.3.2).

pub mod classifier;
pub mod clip;
pub mod codebook;
pub mod frames;
pub mod knn;
pub mod live;
pub mod model;
pub mod model_file;
pub mod occupancy;
pub mod residuals;
pub mod space;
pub mod svc;

//! Silhouettes, shadows, embedding and activity recognition; pure, no input or output.

pub mod background;
pub mod mask;
pub mod shadow_detectors;
pub mod shadow_score;

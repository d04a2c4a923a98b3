//! Activity recognition from silhouettes: training, recognition, evaluation and the shipped models.

mod annotated_video;
pub mod answer;
mod confusion_picture;
mod doubts;
pub mod evaluate;
pub mod evaluation;
pub mod judging;
pub mod method;
pub mod motion;
pub mod multi_person;
mod person;
pub mod recognise;
pub mod recognition;
pub mod samples;
pub mod sets;
pub mod shipped;
pub mod streaming;
pub mod training;
mod training_progress;
pub mod views;

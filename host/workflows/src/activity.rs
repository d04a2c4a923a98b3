//! Recognising what people do from their silhouettes: [`training`] a model on [`samples`] or [`motion`] files, using it ([`recognition`], [`streaming`] with the
//! pictures, [`multi_person`] in a picture by themselves), evaluating
//! a [`method`] ([`evaluation`]) or a model ([`judging`]); models that come with the program ([`shipped`]).

mod annotated_video;
pub mod answer;
mod confusion_picture;
pub mod evaluation;
pub mod judging;
pub mod method;
pub mod motion;
pub mod multi_person;
pub mod recognise;
pub mod recognition;
pub mod samples;
pub mod sets;
pub mod shipped;
pub mod streaming;
pub mod training;
mod training_progress;
pub mod views;

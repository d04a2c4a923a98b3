//! Recognising what people do from their silhouettes: [`training`] a model on [`samples`], using it ([`recognition`]), evaluating
//! a [`method`] ([`evaluation`]).

mod confusion_picture;
pub mod evaluation;
pub mod method;
pub mod recognition;
pub mod samples;
pub mod training;
pub mod views;
mod watched;

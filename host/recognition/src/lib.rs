//! Activities from silhouettes (Li 2014, chapter 9: embedded pattern learning, EPL). No input or output.
//!
//! [`clip`] describes masks, [`space`] embeds them and makes a pattern ([`codebook`], the thesis'
//! [`occupancy`] grid, or a [`network`]), a [`classifier`] answers, [`unknown`] rejects untrained activities.
//! [`alignment`] and [`self_training`] adapt to another camera. [`choice`] finds the settings of an
//! [`experiment`] by cross-validation, [`training`] makes the [`model`], [`live`] uses it frame by frame,
//! [`segmentation`] on un-segmented recordings. [`evaluation`] measures, [`synthetic`] makes seeded clips.
//! # From markers to an activity
//! A recording's points are turned to a view, filled part by part and described; such clips train a
//! recogniser, which then answers for an unseen one.
//! ```
//! use farnear_recognition::clip::{Clip, Track};
//! use farnear_recognition::embedding::descriptor::{ANGLES, Scaling, centroid_distance};
//! use farnear_recognition::model::{Recogniser, RecogniserSettings};
//! use farnear_recognition::space::{PatternKind, SpaceSettings};
//! use farnear_silhouettes::mask::Mask;
//! use farnear_silhouettes::readers::{self, recording::Choices};
//! use farnear_silhouettes::silhouette::{parts::{Fill, draw, extent}, template::Template, view::{Canvas, View}};
//! // Head, hip and hands, millimetres; the hands go up, or the head goes down.
//! let recording = |raise_mm: f64, stoop_mm: f64| {
//!     let mut csv = String::from("frame,HEAD_x,HEAD_y,HEAD_z,HIP_x,HIP_y,HIP_z,LHND_x,LHND_y,LHND_z,RHND_x,RHND_y,RHND_z\n");
//!     for frame in 0..12 {
//!         let t = f64::from(frame) / 11.0;
//!         let (head, hand) = (1700.0 - stoop_mm * t, 800.0 + (raise_mm - 0.5 * stoop_mm) * t);
//!         csv += &format!("{frame},0,0,{head},0,0,{},400,0,{hand},-400,0,{hand}\n", 0.55 * head);
//!     }
//!     readers::read(csv.as_bytes(), "csv", Choices::default())
//! };
//! let template = Template::parse(
//!     "name = 'doll'\n\
//!      [[part]]\nname = 'trunk'\nmarkers = ['HEAD', 'HIP']\nthickness_mm = 120.0\n\
//!      [[part]]\nname = 'left arm'\nmarkers = ['HIP', 'LHND']\nthickness_mm = 50.0\n\
//!      [[part]]\nname = 'right arm'\nmarkers = ['HIP', 'RHND']\nthickness_mm = 50.0\n",
//! )?;
//! // Silhouettes from the front, one per frame, at 20 mm per pixel.
//! let silhouettes = |raise_mm, stoop_mm| -> Result<Vec<Mask>, Box<dyn std::error::Error>> {
//!     let (recording, view) = (recording(raise_mm, stoop_mm)?, View::default());
//!     let frames: Vec<_> = (0..recording.frames.len()).map(|frame| recording.by_name(frame)).collect();
//!     let canvas = Canvas::fitting(&extent(&frames, &template, &view), 20.0, 2).ok_or("nothing to draw")?;
//!     Ok(frames.iter().map(|frame| draw(frame, &template, &view, &canvas, Fill::Hull).mask).collect())
//! };
//! let descriptor = centroid_distance(silhouettes(0.0, 0.0)?[0].view(), Scaling::KeepAspect)?;
//! assert_eq!(descriptor.len(), ANGLES);
//! // Two people do both, each in their own measure; a third one, never seen before, raises the arms.
//! let clip = |subject: &str, activity: &str, raise_mm, stoop_mm| -> Result<Clip, Box<dyn std::error::Error>> {
//!     let track = Track::from_masks(&silhouettes(raise_mm, stoop_mm)?, Scaling::KeepAspect, true);
//!     Ok(Clip { subject: subject.into(), activity: activity.into(), views: vec![track] })
//! };
//! let mut people = Vec::new();
//! for (subject, size) in [("ann", 0.9), ("bob", 1.1)] {
//!     people.push(clip(subject, "raise arms", 900.0 * size, 0.0)?);
//!     people.push(clip(subject, "stoop", 0.0, 800.0 * size)?);
//! }
//! let space = SpaceSettings { dimensions: 3, pattern: PatternKind::Codebook(8), residuals: 0, ..SpaceSettings::default() };
//! let model = Recogniser::train(&people, &RecogniserSettings { space, ..RecogniserSettings::default() })?;
//! let answer = model.recognise(&clip("eve", "?", 900.0, 0.0)?.views)?;
//! assert_eq!(answer.activity.as_deref(), Some("raise arms"));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod alignment;
pub mod auxiliary_model;
pub mod choice;
pub mod classifier;
pub mod clip;
pub mod codebook;
pub mod embedding;
pub mod evaluation;
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
pub mod segmentation;
pub mod self_training;
pub mod space;
pub mod synthetic;
pub mod training;
pub mod unknown;
pub mod watch;

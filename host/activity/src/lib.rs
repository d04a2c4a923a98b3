//! Silhouettes, shadows, embedding and activity recognition; pure, no input or output.
//!
//! The second half of Li 2014 (Ang Li, PhD thesis, University of Warwick, 2014, chapters 7 to 9) as a library.
//! Bytes, text and arrays go in, arrays and values come out; files, pictures and video are the caller's.
//!
//! | module | what it does |
//! |---|---|
//! | [`sun`] | where the sun is (PSA+, Astronomical Almanac, the thesis' form, NREL SPA) |
//! | [`shadow`] | where a person's shadow falls in the image, how sure that is, and cutting it off |
//! | [`shadow_detectors`], [`shadow_score`] | shadows by colour and texture, and how well any removal did |
//! | [`background`], [`mask`] | masks from video |
//! | [`silhouette`] | silhouettes from markers and joints in space, any view |
//! | [`readers`] | motion capture (C3D, TRC, CSV, BVH) and MATLAB skeletons |
//! | [`embedding`] | centroid distance, Isomap and landmark Isomap, PCA, the RBF map |
//! | [`recognition`] | patterns of embedded frames (the thesis' embedded pattern learning, EPL), classifiers, their choice and training, live answers |
//! | [`evaluation`] | leave-one-subject-out, confusion, intervals |
//! | [`synthetic`] | seeded people and scenes |
//!
//! Masks are `Array2<bool>` of shape (height, width), row 0 at the top.
//!
//! # From markers to an activity
//! A recording's points are turned to a view, filled part by part and described by 360 centroid distances and a coarse silhouette; clips of such
//! silhouettes train a recogniser, which then answers for one that it has not seen.
//!
//! ```
//! use farnear_activity::embedding::descriptor::{ANGLES, Scaling, centroid_distance};
//! use farnear_activity::mask::Mask;
//! use farnear_activity::readers::{self, recording::Choices};
//! use farnear_activity::recognition::clip::{Clip, Track};
//! use farnear_activity::recognition::model::{Recogniser, RecogniserSettings};
//! use farnear_activity::recognition::space::{PatternKind, SpaceSettings};
//! use farnear_activity::silhouette::parts::{Fill, draw, extent};
//! use farnear_activity::silhouette::template::Template;
//! use farnear_activity::silhouette::view::{Canvas, View};
//!
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
//!
//! // Silhouettes from the front, one per frame, at 20 mm per pixel.
//! let silhouettes = |raise_mm, stoop_mm| -> Result<Vec<Mask>, Box<dyn std::error::Error>> {
//!     let (recording, view) = (recording(raise_mm, stoop_mm)?, View::default());
//!     let frames: Vec<_> = (0..recording.frames.len()).map(|frame| recording.by_name(frame)).collect();
//!     let canvas = Canvas::fitting(&extent(&frames, &template, &view), 20.0, 2).ok_or("nothing to draw")?;
//!     Ok(frames.iter().map(|frame| draw(frame, &template, &view, &canvas, Fill::Hull).mask).collect())
//! };
//! let descriptor = centroid_distance(silhouettes(0.0, 0.0)?[0].view(), Scaling::KeepAspect)?;
//! assert_eq!(descriptor.len(), ANGLES);
//!
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

pub mod background;
pub mod embedding;
pub mod evaluation;
pub mod mask;
pub mod readers;
pub mod recognition;
pub mod shadow;
pub mod shadow_detectors;
pub mod shadow_score;
pub mod silhouette;
pub mod sun;
pub mod synthetic;

//! Streaming answers with picture and silhouette, for a live view of a video or the rig's camera.

use std::path::Path;

use farnear_capture::camera::Image;
use farnear_files::video::{Pixels, VideoFrame};
use farnear_silhouettes::mask::Mask;
use ndarray::Array2;

use super::{
    recognise::RecogniseRequest,
    recognition::{FrameAnswer, Model, Recognition, RecognitionFigures},
    views::{Seen, View, ViewKind, seen_in_frame},
};
use crate::{
    context::Context,
    error::Result,
    rig::live::{self, LiveSettings},
};

pub struct Moment<'a> {
    pub picture: &'a Pixels,
    pub mask: &'a Mask,
    pub answer: &'a FrameAnswer,
}

/// Recognises a video and passes each frame with its answer to `on_moment`.
pub fn video(
    path: &Path,
    model: &Model,
    context: &Context<'_>,
    mut on_moment: impl FnMut(&Moment<'_>) -> Result<()>,
) -> Result<RecognitionFigures> {
    let view = View { path: path.into(), kind: ViewKind::Video };
    let mut recognition = Recognition::begin(model, &[view], &RecogniseRequest::default())?;
    while let Some(moment) = recognition.next(context)? {
        context.progress.advance("frames", moment.1.frame, None);
        pass(&moment, &mut on_moment)?;
    }
    recognition.finish()
}

/// Recognises images of the rig's camera until the context or `on_moment` stops.
pub fn camera(
    settings: &LiveSettings,
    model: &Model,
    context: &Context<'_>,
    mut on_moment: impl FnMut(&Moment<'_>) -> Result<()>,
) -> Result<()> {
    let model = model.recogniser(true);
    let mut recognition = Recognition::of_frames(model, 1, model.typical_frames.max(1));
    let mut extractor = None;
    live::watch(settings, context, |_, image| {
        let frame = VideoFrame { name: String::new(), pixels: Pixels::Grey(eight_bits(&image)) };
        let moment = recognition.take(vec![seen_in_frame(frame, &mut extractor)?])?;
        recognition.forget();
        moment.map_or(Ok(()), |moment| pass(&moment, &mut on_moment))
    })
}

fn pass(
    (seen, answer): &(Seen, FrameAnswer),
    on_moment: &mut impl FnMut(&Moment<'_>) -> Result<()>,
) -> Result<()> {
    let Some(picture) = &seen.picture else { return Ok(()) };
    on_moment(&Moment { picture, mask: &seen.mask, answer })
}

fn eight_bits(image: &Image) -> Array2<u8> {
    let extra = image.bits.saturating_sub(8);
    image.pixels.mapv(|code| (code >> extra).min(255) as u8)
}

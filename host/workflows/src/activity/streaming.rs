//! Streaming answers with picture and silhouette, for a live view of a video or the rig's camera.

use std::{path::Path, time::Instant};

use farnear_capture::camera::Image;
use farnear_files::video::{Pixels, Video, VideoFrame};
use farnear_recognition::clip::Track;
use farnear_recognition::live::{Live, joined};
use farnear_recognition::model::{Answer, Recogniser};
use farnear_silhouettes::mask::{
    Mask,
    extractor::{Extractor, ExtractorSettings},
    subject::Flag,
};
use ndarray::{Array2, Axis};
use serde::Serialize;

use super::{
    answer::{
        AnswerSummary, PersonFigures, PersonInFrame, Probability, only_in_frame, only_person, outlier_score,
        probabilities, rounded_probability, stretches,
    },
    recognition::Model,
};
use crate::{
    context::Context,
    error::{About, Result},
    figures::rounded,
    rig::live::{self, LiveSettings},
    silhouettes::frame_of,
};

const BEST: usize = 3;

/// The answer for at most a window of frames up to this one.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct RunningAnswer {
    /// Number of the frame, from 1.
    pub frame: usize,
    /// Name of the activity; `None` is unknown.
    pub activity: Option<String>,
    pub confidence: f64,
    /// Above 1 the activity is unknown; `None` before the first silhouette.
    pub outlier_score: Option<f64>,
    /// The most probable first.
    pub best: Vec<Probability>,
    /// The person, if any, as for several people.
    pub people: Vec<PersonInFrame>,
    pub flags: Vec<String>,
}

pub struct Moment<'a> {
    pub picture: &'a Array2<u8>,
    pub mask: &'a Mask,
    pub answer: &'a RunningAnswer,
}

#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct RunningFigures {
    /// The answer for the only person, who is also in `people`.
    #[serde(flatten)]
    pub answer: AnswerSummary,
    pub best: Vec<Probability>,
    /// One person, or none in an empty recording.
    pub people: Vec<PersonFigures>,
    pub frames: usize,
    pub empty_frames: usize,
    /// Mean time from a frame to its answer.
    pub seconds_per_frame: f64,
}

pub struct StreamingRecogniser<'m> {
    model: &'m Recogniser,
    live: Live<'m>,
    extractor: Option<Extractor>,
    tracks: Vec<Track>,
    seconds: f64,
}

impl<'m> StreamingRecogniser<'m> {
    pub fn new(model: &'m Model) -> Self {
        let model = model.recogniser(true);
        let live = Live::new(model, model.typical_frames.max(1), true);
        Self { model, live, extractor: None, tracks: Vec::new(), seconds: 0.0 }
    }

    pub fn take(&mut self, pixels: &Pixels) -> Result<(Mask, RunningAnswer)> {
        let start = Instant::now();
        let frame = frame_of(pixels);
        let extractor = match &mut self.extractor {
            Some(extractor) => extractor,
            none => none.insert(Extractor::like(frame, ExtractorSettings::for_frame(frame))?),
        };
        let found = extractor.extract(frame)?.subject;
        let track = Track::from_masks(std::slice::from_ref(&found.mask), self.model.settings.scaling, true);
        self.tracks.push(track.clone());
        let answer = self.live.push_described(vec![track])?;
        self.seconds += start.elapsed().as_secs_f64();
        let running = RunningAnswer {
            frame: self.tracks.len(),
            outlier_score: outlier_score(&answer),
            people: only_in_frame(&found.mask, &answer, &found.flags).into_iter().collect(),
            confidence: rounded_probability(answer.confidence),
            best: best(&answer),
            activity: answer.activity,
            flags: found.flags.iter().map(Flag::to_string).collect(),
        };
        Ok((found.mask, running))
    }

    pub fn finish(&self) -> Result<RunningFigures> {
        let whole = joined(self.tracks.iter());
        let empty_frames = whole.empty_frames;
        let answer = self.model.recognise(&[whole])?;
        let frames = self.tracks.len();
        let seen: Vec<bool> = self.tracks.iter().map(|track| track.frames() > 0).collect();
        let window = self.model.typical_frames.max(1);
        let (windows, segments) =
            stretches(self.model, std::slice::from_ref(&self.tracks), &seen, window, &[])?;
        let best = best(&answer);
        let answer = AnswerSummary::new(answer, frames);
        Ok(RunningFigures {
            people: only_person(&seen, &answer, &windows, &segments).into_iter().collect(),
            best,
            answer,
            frames,
            empty_frames,
            seconds_per_frame: rounded(self.seconds / frames.max(1) as f64, 6),
        })
    }
}

/// Recognises a video and passes each frame with its answer to `on_moment`.
pub fn video(
    path: &Path,
    model: &Model,
    context: &Context<'_>,
    mut on_moment: impl FnMut(&Moment<'_>) -> Result<()>,
) -> Result<RunningFigures> {
    let mut watcher = StreamingRecogniser::new(model);
    let video = Video::open(path)?;
    if let Some(remark) = &video.remark {
        context.progress.warn(&format!("{}: {remark}", path.display()));
    }
    for frame in video {
        context.cancel.check("recognising")?;
        let VideoFrame { name, pixels } = frame?;
        let (mask, answer) = watcher.take(&pixels).about(|| name.clone())?;
        context.progress.advance("frames", answer.frame, None);
        on_moment(&Moment { picture: &grey(pixels), mask: &mask, answer: &answer })?;
    }
    watcher.finish()
}

/// Recognises images of the rig's camera until the context or `on_moment` stops.
pub fn camera(
    settings: &LiveSettings,
    model: &Model,
    context: &Context<'_>,
    mut on_moment: impl FnMut(&Moment<'_>) -> Result<()>,
) -> Result<()> {
    let mut watcher = StreamingRecogniser::new(model);
    live::watch(settings, context, |_, image| {
        let pixels = Pixels::Grey(eight_bits(&image));
        let (mask, answer) = watcher.take(&pixels)?;
        // A live recording has no end, so tracks are not stored.
        watcher.tracks.clear();
        on_moment(&Moment { picture: &grey(pixels), mask: &mask, answer: &answer })
    })
}

fn grey(pixels: Pixels) -> Array2<u8> {
    match pixels {
        Pixels::Grey(grey) => grey,
        Pixels::Rgb(rgb) => rgb.map_axis(Axis(2), |pixel| {
            let sum: u16 = pixel.iter().map(|level| u16::from(*level)).sum();
            ((sum + 1) / 3) as u8
        }),
    }
}

fn eight_bits(image: &Image) -> Array2<u8> {
    let extra = image.bits.saturating_sub(8);
    image.pixels.mapv(|code| (code >> extra).min(255) as u8)
}

fn best(answer: &Answer) -> Vec<Probability> {
    let mut probabilities = probabilities(answer);
    probabilities.sort_by(|a, b| b.probability.total_cmp(&a.probability));
    probabilities.truncate(BEST);
    probabilities
}

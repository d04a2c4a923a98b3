//! The task of recognising: masks or videos in, answers out.

use std::path::{Path, PathBuf};

use farnear_files::staging::Staging;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_with::{DisplayFromStr, serde_as};

use super::{
    multi_person::{FrameOfPeople, MultiPersonFigures, MultiPersonTracker},
    recognition::{FrameAnswer, Model, Recognition, RecognitionFigures},
    views::{View, ViewKind},
};
use crate::{
    context::Context,
    error::{Result, WorkflowError},
    request::{PathKind, Request, json, outputs},
};

/// Recognises what a person does, frame by frame.
///
/// For every frame one JSON line: the answer for the frames so far (at most `--window` of them), its confidence from 0 to 1, and its
/// outlier_score (above 1 the activity is null: unknown). The last line
/// answers for the whole, window by window, and for an un-segmented recording in `segments`: where one activity ends and the next begins.
/// With `--json` only that object is printed.
#[serde_as]
#[derive(Clone, Default, PartialEq, Eq, Debug, Serialize, Deserialize, JsonSchema)]
#[cfg_attr(feature = "clap", derive(clap::Args))]
#[cfg_attr(
    feature = "clap",
    command(after_help = "Example: farnear activity recognise masks/ --model everyday\n\
                  \x20        farnear activity recognise masks/ --model everyday --among walk,jog,'sit down','stand up'\n\
                  \x20        farnear activity recognise walk.y4m --model model.fnm --window 50\n\
                  \x20        farnear activity recognise street.y4m --model everyday --people --video-out street/")
)]
#[serde(default)]
pub struct RecogniseRequest {
    /// Folders of masks or videos (as `farnear silhouettes video` reads them), one per view of the model, in its order; a model of one
    /// view takes any number.
    #[cfg_attr(feature = "clap", arg(required = true, value_name = "MASKS|VIDEO"))]
    pub views: Vec<PathBuf>,
    /// The model: a file, or the name of one that comes with the program (farnear activity models).
    #[cfg_attr(feature = "clap", arg(long, value_name = "FILE|NAME"))]
    pub model: PathBuf,
    /// Restrict answers to these activities (comma separated, names with commas too); fewer candidates give better answers.
    #[cfg_attr(feature = "clap", arg(long, value_name = "ACTIVITIES"))]
    pub among: Vec<String>,
    /// Frames of the streaming answer and of windows over a long recording [default: as many as a training clip had].
    #[cfg_attr(feature = "clap", arg(long, value_name = "FRAMES"))]
    pub window: Option<usize>,
    /// Folders of masks of other, unlabelled clips from the same source, one view each: the model first adapts to its
    /// surest answers for them. Some dozens, of most of the activities.
    #[cfg_attr(feature = "clap", arg(long, value_name = "MASKS", num_args = 1..))]
    pub adapt_to: Vec<PathBuf>,
    /// A new folder for the frames of the first view as pictures with the streaming answer drawn on them (a video: `ffmpeg -i
    /// frame_%06d.png answer.mp4`).
    #[cfg_attr(feature = "clap", arg(long, value_name = "DIR"))]
    pub video_out: Option<PathBuf>,
    /// Follow all people in one view of full frames and recognise each: for every frame the people in it by number, what each does so
    /// far, and whether two cross or may have been swapped; last, what each did.
    #[cfg_attr(feature = "clap", arg(long))]
    pub people: bool,
    /// Contents of the folders, masks or video; by default pictures of black and white alone are masks, others video.
    #[cfg_attr(feature = "clap", arg(long = "as", id = "as", value_name = "KIND"))]
    #[serde(rename = "as")]
    #[serde_as(as = "Option<DisplayFromStr>")]
    pub kind: Option<ViewKind>,
    /// A new folder for answers.jsonl, an answer per frame, and recognition.json, the answer for the whole.
    #[cfg_attr(feature = "clap", arg(long, value_name = "DIR"))]
    pub out: Option<PathBuf>,
}

#[derive(Clone, PartialEq, Debug, Serialize)]
#[serde(untagged)]
pub enum RecogniseFigures {
    One(Box<RecognitionFigures>),
    People(MultiPersonFigures),
}

#[derive(Clone, PartialEq, Debug, Serialize)]
#[serde(untagged)]
pub enum StreamingAnswer {
    One(FrameAnswer),
    People(FrameOfPeople),
}

impl Request for RecogniseRequest {
    const NAME: &'static str = "activity recognise";
    const REQUIRED: &'static [&'static str] = &["views", "model"];
    const PATHS: &'static [(&'static str, PathKind)] = &[
        ("views", PathKind::Input),
        ("model", PathKind::InputOrName),
        ("adapt_to", PathKind::Input),
        ("out", PathKind::OutputFolder),
        ("video_out", PathKind::OutputFolder),
    ];
    type Figures = RecogniseFigures;

    fn check(&self) -> Result<()> {
        let views = self.views.len();
        if self.people && views != 1 {
            let expected = "--people follows all people in one view: run it for each view";
            return Err(WorkflowError::parameter("number of views", views, expected));
        }
        Ok(())
    }

    fn run(&self, context: &Context<'_>) -> Result<RecogniseFigures> {
        self.answers(context, &mut |_| Ok(()))
    }

    fn inputs(&self) -> Vec<PathBuf> {
        // A model that comes with the program is part of the program's version.
        let model = Model::file(&self.model).map(Path::to_path_buf);
        self.views.iter().chain(&self.adapt_to).cloned().chain(model).collect()
    }
}

impl RecogniseRequest {
    /// Recognises, and passes each streaming answer on. Fails for unreadable models and views, and as `each` does.
    pub fn answers(
        &self,
        context: &Context<'_>,
        each: &mut dyn FnMut(&StreamingAnswer) -> std::io::Result<()>,
    ) -> Result<RecogniseFigures> {
        outputs::check(self)?;
        let model = match self.adapt_to.as_slice() {
            [] => context.cache.model(&self.model)?,
            clips => Model::read(&self.model)?.adapted_to(clips, context)?.into(),
        };
        let model = if self.among.is_empty() { model } else { model.restricted_to(&self.among)?.into() };
        let views = self.views.iter().map(|path| self.view(path, context)).collect::<Result<Vec<View>>>()?;
        let mut lines = String::new();
        let mut pass = |answer: StreamingAnswer| {
            if self.out.is_some() {
                lines.push_str(&json(&answer)?.to_string());
                lines.push('\n');
            }
            each(&answer).map_err(|source| WorkflowError::Sink { source })
        };
        let figures = match (self.people, views.as_slice()) {
            (true, [view]) => {
                let mut work = MultiPersonTracker::begin(&model, view, self)?;
                while let Some(people) = work.next(context)? {
                    pass(StreamingAnswer::People(people))?;
                }
                RecogniseFigures::People(work.finish()?)
            }
            (_, views) => {
                let mut work = Recognition::begin(&model, views, self)?;
                while let Some((_, answer)) = work.next(context)? {
                    pass(StreamingAnswer::One(answer))?;
                }
                RecogniseFigures::One(Box::new(work.finish()?))
            }
        };
        if let Some(out) = &self.out {
            let mut whole = json(&figures)?;
            // It differs between runs; the same recording must give the same file.
            whole.as_object_mut().map(|whole| whole.remove("seconds_per_frame"));
            let staged = Staging::new_folder(out)?;
            staged.write("answers.jsonl", lines.as_bytes())?;
            staged.write("recognition.json", format!("{whole}\n").as_bytes())?;
            staged.finish()?;
        }
        Ok(figures)
    }

    /// A view with its kind; a guess is reported.
    fn view(&self, path: &Path, context: &Context<'_>) -> Result<View> {
        let kind = match self.kind {
            Some(kind) => kind,
            None => {
                let kind = ViewKind::guess(path)?;
                let other = match kind {
                    ViewKind::Masks => ViewKind::Video,
                    ViewKind::Video => ViewKind::Masks,
                };
                context.info(&format!("{}: read as {kind} (--as {other} otherwise)", path.display()));
                kind
            }
        };
        Ok(View { path: path.to_path_buf(), kind })
    }
}

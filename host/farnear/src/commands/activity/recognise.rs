//! `farnear activity recognise`: a streaming answer over masks or video, then windows and the whole.

use std::path::{Path, PathBuf};

use anyhow::{Result, ensure};
use clap::{Args, ValueEnum};
use farnear_workflows::activity::{
    multi_person::{MultiPersonSettings, MultiPersonTracker},
    recognition::{Model, Recognition, RecognitionSettings},
    views::{View, ViewKind},
};

use crate::{report, terminal};

/// Recognises what a person does, frame by frame.
///
/// For every frame one JSON line: the answer for the frames so far (at most `--window` of them), its confidence from 0 to 1, and its
/// outlier_score (above 1 the activity is null: unknown). The last line
/// answers for the whole, window by window, and for an un-segmented recording in `segments`: where one activity ends and the next begins.
/// With `--json` only that object is printed.
#[derive(Args)]
#[command(after_help = "Example: farnear activity recognise masks/ --model everyday\n\
                  \x20        farnear activity recognise masks/ --model everyday --among walk,jog,'sit down','stand up'\n\
                  \x20        farnear activity recognise walk.y4m --model model.fnm --window 50\n\
                  \x20        farnear activity recognise street.y4m --model everyday --people --video-out street/")]
pub struct Arguments {
    /// Folders of masks or videos (what `farnear silhouettes video` reads), one per view of the model, in its order; a model of one
    /// view takes any number.
    #[arg(required = true, value_name = "MASKS|VIDEO")]
    views: Vec<PathBuf>,
    /// The model: a file, or the name of one that comes with the program (farnear activity models).
    #[arg(long, value_name = "FILE|NAME")]
    model: PathBuf,
    /// Restrict answers to these activities (comma separated); fewer candidates give better answers.
    #[arg(long, value_name = "ACTIVITIES", value_delimiter = ',')]
    among: Vec<String>,
    /// Frames of the streaming answer and of windows over a long recording [default: as many as a training clip had].
    #[arg(long, value_name = "FRAMES")]
    window: Option<usize>,
    /// Folders of masks of other, unlabelled clips from the same source, one view each: the model adapts to its
    /// surest answers for them first. Some dozens, of most of the activities.
    #[arg(long, value_name = "MASKS", num_args = 1..)]
    adapt_to: Vec<PathBuf>,
    /// A new folder for the first view's frames as pictures with the streaming answer drawn on them (a video: `ffmpeg -i
    /// frame_%06d.png answer.mp4`).
    #[arg(long, value_name = "DIR")]
    video_out: Option<PathBuf>,
    /// Follow everybody in one view of full frames and recognise each apart: for every frame the people in it by number, what each does so far, and
    /// whether two cross or may have been swapped; last, what each did.
    #[arg(long)]
    people: bool,
    /// What the folders hold; by default pictures of black and white alone are masks, others video.
    #[arg(long = "as", value_name = "KIND")]
    kind: Option<Kind>,
    /// Print the last object only.
    #[arg(long)]
    json: bool,
}

#[derive(Clone, Copy, PartialEq, ValueEnum)]
enum Kind {
    Masks,
    Video,
}

pub fn run(arguments: Arguments) -> Result<()> {
    let mut model = Model::read(&arguments.model)?;
    if !arguments.adapt_to.is_empty() {
        model = model.adapted_to(&arguments.adapt_to, &terminal::counting(arguments.json)?)?;
    }
    let view = |path: PathBuf| -> Result<View> { Ok(View { kind: kind(&path, arguments.kind)?, path }) };
    let mut views = arguments.views.into_iter().map(view).collect::<Result<Vec<View>>>()?;
    if arguments.people {
        ensure!(
            views.len() == 1,
            "--people follows everybody in one view, {} were given: run it for each view",
            views.len()
        );
        let settings = MultiPersonSettings {
            view: views.swap_remove(0),
            among: arguments.among,
            window: arguments.window,
            annotated_video: arguments.video_out,
        };
        return multi_person(&model, &settings, arguments.json);
    }
    let settings = RecognitionSettings {
        views,
        among: arguments.among,
        window: arguments.window,
        annotated_video: arguments.video_out,
    };
    let context = terminal::context()?;
    let mut work = Recognition::begin(&model, &settings)?;
    while let Some(answer) = work.next(&context)? {
        if !arguments.json {
            report::print(&answer, true)?;
        }
    }
    report::print(&work.finish()?, true)
}

fn multi_person(model: &Model, settings: &MultiPersonSettings, json: bool) -> Result<()> {
    let context = terminal::context()?;
    let mut work = MultiPersonTracker::begin(model, settings)?;
    while let Some(people) = work.next(&context)? {
        if !json {
            report::print(&people, true)?;
        }
    }
    report::print(&work.finish()?, true)
}

/// The kind of a view; reports a guess.
fn kind(path: &Path, named: Option<Kind>) -> Result<ViewKind> {
    let kind = match named {
        Some(Kind::Masks) => return Ok(ViewKind::Masks),
        Some(Kind::Video) => return Ok(ViewKind::Video),
        None => ViewKind::guess(path)?,
    };
    let (is, other) = match kind {
        ViewKind::Masks => ("masks", "video"),
        ViewKind::Video => ("video", "masks"),
    };
    eprintln!("{}: read as {is} (--as {other} otherwise)", path.display());
    Ok(kind)
}

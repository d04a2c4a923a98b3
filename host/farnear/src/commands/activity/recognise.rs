//! `farnear activity recognise`: a running answer over masks or video, then windows and the whole.

use std::{
    fs,
    path::{Path, PathBuf},
    time::Instant,
};

use anyhow::{Context, Result, ensure};
use clap::{Args, ValueEnum};
use farnear_activity::{
    mask::{
        Mask,
        centre::SIDE_PX,
        extractor::{Extractor, ExtractorSettings},
        subject::{Flag, SubjectChooser, SubjectSettings},
    },
    recognition::{
        clip::Track,
        live::{Live, joined, segments, windows},
        model::{Answer, Recogniser},
    },
};
use serde::Serialize;

use crate::{
    masks, report,
    video::{Pixels, Video, VideoFrame, pictures},
};

/// Recognises what a person does, frame by frame.
///
/// For every frame one JSON line: the answer for the frames so far (at most `--window` of them), its confidence from 0 to 1, and its
/// strangeness, the distance from all training data over what is known (above 1 the activity is null: unknown). The last line
/// answers for the whole and, window by window, for a recording that nobody cut. With `--json` only that object is printed.
#[derive(Args)]
#[command(after_help = "Example: farnear activity recognise masks/ --model model.fnm\n\
                  \x20        farnear activity recognise walk.y4m --model model.fnm --window 50")]
pub struct Arguments {
    /// Folders of masks or videos (what `farnear silhouettes video` reads), one per view of the model, in its order.
    #[arg(required = true, value_name = "MASKS|VIDEO")]
    views: Vec<PathBuf>,
    /// The model.
    #[arg(long, value_name = "FILE")]
    model: PathBuf,
    /// Frames of the running answer and of windows over a long recording [default: as many as a training clip had].
    #[arg(long, value_name = "FRAMES", value_parser = clap::value_parser!(u32).range(1..))]
    window: Option<u32>,
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

#[derive(Serialize)]
struct Line<'a> {
    frame: usize,
    name: &'a str,
    activity: Option<&'a str>,
    confidence: f64,
    strangeness: Option<f64>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    flags: Vec<String>,
}

#[derive(Serialize)]
struct Whole {
    activity: Option<String>,
    confidence: f64,
    strangeness: Option<f64>,
    shares: Vec<Share>,
    frames: usize,
    empty_frames: usize,
    flagged_frames: usize,
    window: usize,
    windows: Vec<Part>,
    segments: Vec<Part>,
    seconds_per_frame: f64,
}

#[derive(Serialize)]
struct Share {
    activity: String,
    share: f64,
}

/// A stretch of the recording; frames from 1, both ends included.
#[derive(Serialize)]
struct Part {
    from: usize,
    to: usize,
    activity: Option<String>,
    confidence: f64,
}

/// Runs the command.
///
/// # Errors
/// Models and frames that cannot be read or do not belong together.
pub fn run(arguments: &Arguments) -> Result<()> {
    let shown = arguments.model.display();
    let bytes = fs::read(&arguments.model).with_context(|| format!("cannot read the model {shown}"))?;
    let model = Recogniser::from_bytes(&bytes).with_context(|| format!("{shown}"))?;
    ensure!(
        arguments.views.len() == model.views,
        "{shown}: the model fuses {} views, {} were given",
        model.views,
        arguments.views.len()
    );
    let mut sources: Vec<Source> =
        arguments.views.iter().map(|path| Source::open(path, arguments.kind)).collect::<Result<_>>()?;
    let window = arguments.window.map_or(model.typical_frames, |frames| frames as usize).max(1);
    let mut live = Live::new(&model, window, true);
    let mut tracks: Vec<Vec<Track>> = vec![Vec::new(); sources.len()];
    let (mut frames, mut flagged_frames, mut seconds) = (0, 0, 0.0);
    loop {
        let start = Instant::now();
        let moment: Option<Vec<Seen>> =
            sources.iter_mut().map(Source::next).collect::<Result<Option<Vec<Seen>>>>()?;
        let Some(moment) = moment else { break };
        frames += 1;
        let described: Vec<Track> = moment
            .iter()
            .map(|seen| {
                let full = seen.mask.dim() != (SIDE_PX, SIDE_PX);
                Track::from_masks(std::slice::from_ref(&seen.mask), model.settings.scaling, full)
            })
            .collect();
        for (all, track) in tracks.iter_mut().zip(&described) {
            all.push(track.clone());
        }
        let answer = live.push_described(described).with_context(|| moment[0].name.clone())?;
        seconds += start.elapsed().as_secs_f64();
        let flags: Vec<String> =
            moment.iter().flat_map(|seen| seen.flags.iter().map(Flag::to_string)).collect();
        flagged_frames += usize::from(!flags.is_empty());
        if !arguments.json {
            print(&Line {
                frame: frames,
                name: &moment[0].name,
                activity: answer.activity.as_deref(),
                confidence: share(answer.confidence),
                strangeness: strangeness(&answer),
                flags,
            })?;
        }
    }
    let whole: Vec<Track> = tracks.iter().map(|parts| joined(parts.iter())).collect();
    let empty_frames = whole.iter().map(|track| track.empty_frames).sum();
    let answer = model.recognise(&whole)?;
    let stretches = windows(&model, &whole, window, window.div_ceil(2))?;
    let parts = segments(&stretches);
    let figures = Whole {
        activity: answer.activity.clone(),
        confidence: share(answer.confidence),
        strangeness: strangeness(&answer),
        shares: answer
            .probabilities
            .into_iter()
            .map(|(activity, value)| Share { activity, share: share(value) })
            .collect(),
        frames,
        empty_frames,
        flagged_frames,
        window,
        windows: stretches
            .into_iter()
            .map(|stretch| Part {
                from: stretch.from + 1,
                to: stretch.to,
                activity: stretch.answer.activity,
                confidence: share(stretch.answer.confidence),
            })
            .collect(),
        segments: parts
            .into_iter()
            .map(|part| Part {
                from: part.from + 1,
                to: part.to,
                activity: part.activity,
                confidence: share(part.confidence),
            })
            .collect(),
        seconds_per_frame: report::rounded(seconds / frames.max(1) as f64, 6),
    };
    print(&figures)
}

/// A share with four decimals, without the digits that f32 does not have.
fn share(value: f32) -> f64 {
    report::rounded(f64::from(value), 4)
}

/// JSON has no infinity: nothing was seen.
fn strangeness(answer: &Answer) -> Option<f64> {
    answer.outlier_score.is_finite().then(|| share(answer.outlier_score))
}

fn print<T: Serialize>(line: &T) -> Result<()> {
    report::to_stdout((serde_json::to_string(line)? + "\n").as_bytes())
}

/// A frame's mask and what is doubtful about it.
struct Seen {
    name: String,
    mask: Mask,
    flags: Vec<Flag>,
}

/// Where the masks of a view come from.
enum Source {
    Masks {
        files: std::vec::IntoIter<PathBuf>,
        chooser: Option<SubjectChooser>,
        first: Option<(usize, usize)>,
    },
    Video {
        video: Box<Video>,
        extractor: Option<Box<Extractor>>,
    },
}

impl Source {
    fn open(path: &Path, kind: Option<Kind>) -> Result<Self> {
        let kind = match kind {
            Some(kind) => kind,
            None => guessed(path)?,
        };
        Ok(match kind {
            Kind::Masks => {
                let files = masks::listed(path)?.into_iter();
                Self::Masks { files, chooser: None, first: None }
            }
            Kind::Video => Self::Video { video: Box::new(Video::open(path)?), extractor: None },
        })
    }

    fn next(&mut self) -> Result<Option<Seen>> {
        match self {
            Self::Masks { files, chooser, first } => {
                let Some(file) = files.next() else { return Ok(None) };
                let mask = masks::read(&file)?;
                let size = *first.get_or_insert(mask.dim());
                ensure!(
                    mask.dim() == size,
                    "{}: the mask is {}x{}, but the first was {}x{}; the masks of a sequence must be alike",
                    file.display(),
                    mask.ncols(),
                    mask.nrows(),
                    size.1,
                    size.0
                );
                let chooser =
                    chooser.get_or_insert_with(|| SubjectChooser::new(SubjectSettings::for_size(size)));
                let mut flags = chooser.choose(mask.view()).flags;
                // Cut-out silhouettes fill their picture, so touching its edge says nothing.
                flags.retain(|flag| size != (SIDE_PX, SIDE_PX) || *flag != Flag::CutByEdge);
                Ok(Some(Seen { name: pictures::stem(&file), mask, flags }))
            }
            Self::Video { video, extractor } => {
                let Some(VideoFrame { name, pixels }) = video.next().transpose()? else { return Ok(None) };
                let frame = pixels.frame();
                let extractor = match extractor {
                    Some(extractor) => extractor,
                    None => extractor
                        .insert(Box::new(Extractor::like(frame, ExtractorSettings::for_frame(frame))?)),
                };
                let found = extractor.extract(frame)?.subject;
                Ok(Some(Seen { name, mask: found.mask, flags: found.flags }))
            }
        }
    }
}

/// Masks are folders of pictures (or one picture) that hold nothing but black and white.
fn guessed(path: &Path) -> Result<Kind> {
    let first = if path.is_dir() { pictures::list(path)?.swap_remove(0) } else { path.to_path_buf() };
    let ending = first.extension().unwrap_or_default().to_string_lossy().to_lowercase();
    if !pictures::EXTENSIONS.contains(&ending.as_str()) {
        return Ok(Kind::Video);
    }
    let kind = match pictures::read(&first)? {
        Pixels::Grey(levels) if levels.iter().all(|level| matches!(level, 0 | 255)) => Kind::Masks,
        _ => Kind::Video,
    };
    let (is, other) = if kind == Kind::Masks { ("masks", "video") } else { ("video", "masks") };
    eprintln!("{}: read as {is} (--as {other} otherwise)", path.display());
    Ok(kind)
}

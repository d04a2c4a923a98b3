//! Streaming answers over masks or video, then answers for windows and the whole recording.

use std::{
    fs,
    path::{Path, PathBuf},
    time::Instant,
};

use farnear_files::masks;
use farnear_recognition::clip::Track;
use farnear_recognition::model::{Answer, Recogniser};
use farnear_recognition::self_training::ROUNDS;
use farnear_recognition::space::Pattern;
use farnear_silhouettes::mask::{BoundingBox, Mask, centre::SIDE_PX, subject::Flag};
use serde::{Deserialize, Serialize};

use super::{
    annotated_video::AnnotatedVideo,
    answer::{
        AnswerSummary, Part, PersonFigures, PersonFlag, PersonInFrame, Probability, outlier_score,
        probabilities, rounded_probability,
    },
    person::Person,
    recognise::RecogniseRequest,
    samples::{SCALING, are_full_frames},
    shipped::Shipped,
    views::{Frames, Seen, View, ViewKind},
};
use crate::{
    context::Context,
    counter::Counter,
    error::{About, Result, WorkflowError},
    figures::rounded,
    parameters::at_least,
};

pub const MODEL_FILE: &str = "the model";

pub struct Model {
    path: PathBuf,
    recogniser: Recogniser,
    cut_out: Option<Recogniser>,
}

impl Model {
    /// Reads a model file. A missing path may be the name of a shipped model.
    pub fn read(path: &Path) -> Result<Self> {
        if let Some(shipped) = Self::shipped(path) {
            let [recogniser, cut_out] = shipped.recognisers()?;
            return Ok(Self { path: path.into(), recogniser, cut_out: Some(cut_out) });
        }
        let bytes = fs::read(path).map_err(WorkflowError::read(MODEL_FILE, path))?;
        let recogniser = Recogniser::from_bytes(&bytes).about(|| path.display().to_string())?;
        Ok(Self { path: path.into(), recogniser, cut_out: None })
    }

    /// Expected accuracy on new data; `None` for a model from a file.
    pub fn expectation(&self) -> Option<String> {
        Self::shipped(&self.path).map(Shipped::expectation)
    }

    fn shipped(path: &Path) -> Option<&'static Shipped> {
        path.to_str().and_then(Shipped::named).filter(|_| !path.exists())
    }

    /// The file that [`Model::read`] reads; `None` for a shipped model.
    pub fn file(path: &Path) -> Option<&Path> {
        Self::shipped(path).is_none().then_some(path)
    }

    /// Adapts the model to unlabelled clips from another camera, sensor or laboratory by self-training.
    /// `clips` are folders of masks, one view of a clip each. Fails for a model that fuses views.
    pub fn adapted_to(self, clips: &[PathBuf], context: &Context<'_>) -> Result<Self> {
        let counter = Counter::new(context, "clips read");
        let mut tracks = Vec::new();
        let mut full_frames = true;
        for folder in clips {
            counter.check("reading clips")?;
            let read: Vec<Mask> = masks::read_all(folder)?.pixels();
            let full = are_full_frames(&read);
            if !tracks.is_empty() && full != full_frames {
                let expected = "clips that are all full frames or all cut out at 100x100";
                return Err(WorkflowError::parameter("clip to adapt to", folder.display(), expected));
            }
            full_frames = full;
            tracks.push(vec![Track::from_masks(&read, SCALING, full)]);
            counter.one(Some(clips.len()));
        }
        let adapted =
            |model: &Recogniser| model.adapted(&tracks, ROUNDS).about(|| self.path.display().to_string());
        Ok(match (&self.cut_out, full_frames) {
            (Some(cut_out), false) => {
                Self { cut_out: Some(adapted(cut_out)?), recogniser: self.recogniser, path: self.path }
            }
            _ => Self { recogniser: adapted(&self.recogniser)?, cut_out: self.cut_out, path: self.path },
        })
    }

    pub fn recogniser(&self, full_frames: bool) -> &Recogniser {
        self.cut_out.as_ref().filter(|_| !full_frames).unwrap_or(&self.recogniser)
    }

    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    pub fn activities(&self) -> &[String] {
        &self.recogniser.activities
    }

    /// The model with some of its activities only. Each text is a name or a list of names with commas.
    pub(super) fn restricted_to(&self, texts: &[String]) -> Result<Self> {
        let mut all = Vec::new();
        for text in texts {
            all.extend(named(text, self.activities()).map_err(|unknown| {
                let expected = format!("the model knows {}", self.activities().join(", "));
                WorkflowError::parameter("activity", unknown, expected)
            })?);
        }
        Ok(Self {
            path: self.path.clone(),
            recogniser: self.recogniser.restricted_to(&all),
            cut_out: self.cut_out.as_ref().map(|model| model.restricted_to(&all)),
        })
    }
}

/// Splits a list at its commas. Names may have commas too: the longest known one is taken. Fails with a name that is unknown.
fn named(text: &str, known: &[String]) -> Result<Vec<String>, String> {
    let find = |name: &str| known.iter().find(|known| *known == name || *known == name.trim()).cloned();
    let parts: Vec<&str> = text.split(',').collect();
    let mut found = Vec::new();
    let mut from = 0;
    while from < parts.len() {
        let longest =
            (from + 1..=parts.len()).rev().find_map(|to| Some((find(&parts[from..to].join(","))?, to)));
        let (name, to) = longest.ok_or_else(|| parts[from].trim().to_owned())?;
        found.push(name);
        from = to;
    }
    Ok(found)
}

#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
#[error("{}: the model fuses {expected} views, {found} were given", model.display())]
pub struct ViewsError {
    pub model: PathBuf,
    pub expected: usize,
    pub found: usize,
}

/// Activities named in an answer for a frame.
const BEST: usize = 3;

/// The answer for at most a window of frames up to this one.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct FrameAnswer {
    /// Number of the frame, from 1.
    pub frame: usize,
    /// Name of the frame in the first view.
    pub name: String,
    /// Name of the activity; `None` is unknown.
    pub activity: Option<String>,
    pub confidence: f64,
    /// Above 1 the activity is unknown. `None` without a person.
    pub outlier_score: Option<f64>,
    /// The most probable first.
    pub best: Vec<Probability>,
    /// The person in the first view, if any, as for several people.
    pub people: Vec<PersonInFrame>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub flags: Vec<String>,
}

#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct RecognitionFigures {
    /// The answer for the only person, who is also in `people`.
    #[serde(flatten)]
    pub answer: AnswerSummary,
    /// One person, or none in an empty recording.
    pub people: Vec<PersonFigures>,
    pub frames: usize,
    pub empty_frames: usize,
    pub flagged_frames: usize,
    pub window: usize,
    /// Answers for windows that overlap by half.
    pub windows: Vec<Part>,
    /// Segments of one activity by a hidden semi-Markov model, independent of the windows.
    pub segments: Vec<Part>,
    /// From the file to the streaming answer.
    pub seconds_per_frame: f64,
    /// Notes on how the views were read: grey levels of masks, a varying frame rate.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub remarks: Vec<String>,
}

/// Recognises one person in all views. Call [`Self::next`] until it returns `None`, then [`Self::finish`].
pub(super) struct Recognition<'m> {
    model: &'m Recogniser,
    person: Person<'m>,
    views: Vec<Frames>,
    window: usize,
    annotated_video: Option<AnnotatedVideo>,
    frames: usize,
    flagged_frames: usize,
    seconds: f64,
    remarks: Vec<String>,
}

impl<'m> Recognition<'m> {
    pub(super) fn begin(model: &'m Model, views: &[View], request: &RecogniseRequest) -> Result<Self> {
        let first = views.first().map(View::is_cut_out).transpose()?;
        let recogniser = model.recogniser(first != Some(true));
        let (expected, found) = (recogniser.views, views.len());
        if found != expected && (expected > 1 || found == 0) {
            return Err(ViewsError { model: model.path.clone(), expected, found }.into());
        }
        let window = window(recogniser, request)?;
        let frames = views.iter().map(Frames::open).collect::<Result<Vec<Frames>>>()?;
        Ok(Self {
            annotated_video: request.video_out.as_deref().map(AnnotatedVideo::begin).transpose()?,
            remarks: model.expectation().into_iter().chain(rate_remark(recogniser, views, &frames)).collect(),
            views: frames,
            ..Self::of_frames(recogniser, found, window)
        })
    }

    /// A recognition whose frames are given to [`Self::take`].
    pub(super) fn of_frames(model: &'m Recogniser, views: usize, window: usize) -> Self {
        Self {
            person: Person::new(model, views, window),
            model,
            views: Vec::new(),
            window,
            annotated_video: None,
            frames: 0,
            flagged_frames: 0,
            seconds: 0.0,
            remarks: Vec::new(),
        }
    }

    /// The first view's next frame and the answer up to it; `None` at the end of the shortest view.
    pub(super) fn next(&mut self, context: &Context<'_>) -> Result<Option<(Seen, FrameAnswer)>> {
        context.cancel.check("recognising")?;
        if self.frames == 0 {
            self.remarks.iter().for_each(|remark| context.progress.warn(remark));
        }
        let start = Instant::now();
        let moment: Vec<Option<Seen>> = self.views.iter_mut().map(Frames::next).collect::<Result<_>>()?;
        if let Some(ended) = moment.iter().position(Option::is_none)
            && moment.iter().any(Option::is_some)
        {
            let remark = format!(
                "view {} ends after {} frames and others do not: the rest of them is left out",
                ended + 1,
                self.frames
            );
            context.warn([remark], &mut self.remarks);
        }
        let moment: Option<Vec<Seen>> = moment.into_iter().collect();
        context.warn(self.views.iter_mut().flat_map(Frames::take_remarks), &mut self.remarks);
        if moment.is_none() {
            context.warn(self.closing_remarks(), &mut self.remarks);
        }
        self.seconds += start.elapsed().as_secs_f64();
        moment.map_or(Ok(None), |moment| self.take(moment))
    }

    /// Notices about the whole recording.
    fn closing_remarks(&self) -> Vec<String> {
        let doubts = (1..).zip(&self.views).flat_map(|(view, frames)| {
            frames.doubts().into_iter().map(move |doubt| format!("view {view}: {doubt}"))
        });
        doubts.chain(self.person.joined_passages()).collect()
    }

    /// [`Self::next`] for a frame of each view.
    pub(super) fn take(&mut self, moment: Vec<Seen>) -> Result<Option<(Seen, FrameAnswer)>> {
        let start = Instant::now();
        let scaling = self.model.settings.scaling;
        let described = |seen: &Seen| {
            let full = seen.mask.dim() != (SIDE_PX, SIDE_PX);
            Track::from_masks(std::slice::from_ref(&seen.mask), scaling, full)
        };
        let described: Vec<Track> = moment.iter().map(described).collect();
        let flags: Vec<Flag> = moment.iter().flat_map(|seen| seen.flags.iter().copied()).collect();
        let Some(first) = moment.into_iter().next() else { return Ok(None) };
        self.frames += 1;
        let answer = self.person.see(self.frames, described).about(|| first.name.clone())?;
        self.seconds += start.elapsed().as_secs_f64();
        if let Some(annotated_video) = &mut self.annotated_video {
            annotated_video.draw(first.picture.as_ref(), &first.mask, &answer)?;
        }
        self.flagged_frames += usize::from(!flags.is_empty());
        let answer = FrameAnswer {
            frame: self.frames,
            name: first.name.clone(),
            confidence: rounded_probability(answer.confidence),
            outlier_score: outlier_score(&answer),
            best: best(&answer),
            people: in_frame(&first.mask, &answer, &flags).into_iter().collect(),
            activity: answer.activity,
            flags: flags.iter().map(Flag::to_string).collect(),
        };
        Ok(Some((first, answer)))
    }

    /// Keeps only the running window of a recording without an end.
    pub(super) fn forget(&mut self) {
        self.person.forget();
    }

    pub(super) fn finish(self) -> Result<RecognitionFigures> {
        if let Some(annotated_video) = self.annotated_video {
            annotated_video.finish()?;
        }
        let answer = self.person.summary()?;
        let person = self.person.figures(1, answer.clone())?;
        let of_person = |parts: fn(&PersonFigures) -> &Vec<Part>| person.as_ref().map(parts).cloned();
        Ok(RecognitionFigures {
            windows: of_person(|person| &person.windows).unwrap_or_default(),
            segments: of_person(|person| &person.segments).unwrap_or_default(),
            people: person.into_iter().collect(),
            answer,
            frames: self.frames,
            empty_frames: self.person.empty_frames(),
            flagged_frames: self.flagged_frames,
            window: self.window,
            seconds_per_frame: rounded(self.seconds / self.frames.max(1) as f64, 6),
            remarks: self.remarks,
        })
    }
}

/// Frames of the streaming answer and of windows.
pub(super) fn window(model: &Recogniser, request: &RecogniseRequest) -> Result<usize> {
    if let Some(window) = request.window {
        at_least("window", window, 1, "frames")?;
    }
    Ok(request.window.unwrap_or(model.typical_frames).max(1))
}

/// A remark on views with a higher frame rate than those that a network learned from. Other models learn the user's rate.
pub(super) fn rate_remark(model: &Recogniser, views: &[View], frames: &[Frames]) -> Option<String> {
    /// Highest rate of the networks' training clips.
    const LEARNED_HZ: f64 = 26.0;
    /// Windows are too short above it.
    const HIGH_HZ: f64 = 30.0;
    if !matches!(model.space.pattern, Pattern::Network(_)) {
        return None;
    }
    let is_high = |rate_hz: &f64| *rate_hz > HIGH_HZ && rate_hz.is_finite();
    let (view, rate_hz) = views
        .iter()
        .zip(frames)
        .find_map(|(view, frames)| Some((view, stated_rate_hz(view, frames).filter(is_high)?)))?;
    let every = (rate_hz / LEARNED_HZ).ceil();
    Some(format!(
        "{}: {rate_hz:.0} frames a second, the model learned from at most {LEARNED_HZ}: use one frame in {every} of these (motion \
         capture: farnear silhouettes markers --every {every}; video: ffmpeg -i VIDEO -r {:.2} -c:v ffv1 SLOWER.mkv)",
        view.path.display(),
        rate_hz / every
    ))
}

/// The frame rate of a video, or of masks in `silhouettes.toml`, in their folder or next to it.
fn stated_rate_hz(view: &View, frames: &Frames) -> Option<f64> {
    #[derive(Deserialize)]
    struct Index {
        rate_hz: f64,
    }
    if view.kind == ViewKind::Video {
        return frames.rate_hz();
    }
    let stated = |folder: &Path| {
        let text = fs::read_to_string(folder.join("silhouettes.toml")).ok()?;
        Some(toml::from_str::<Index>(&text).ok()?.rate_hz)
    };
    stated(&view.path).or_else(|| stated(view.path.parent()?))
}

fn best(answer: &Answer) -> Vec<Probability> {
    let mut probabilities = probabilities(answer);
    probabilities.sort_by(|a, b| b.probability.total_cmp(&a.probability));
    probabilities.truncate(BEST);
    probabilities
}

fn in_frame(mask: &Mask, answer: &Answer, flags: &[Flag]) -> Option<PersonInFrame> {
    let b = BoundingBox::of(mask.view())?;
    Some(PersonInFrame {
        person: 1,
        top_left_bottom_right: Some([b.top, b.left, b.bottom, b.right]),
        activity: answer.activity.clone(),
        confidence: rounded_probability(answer.confidence),
        outlier_score: outlier_score(answer),
        flags: flags.iter().copied().map(PersonFlag::Mask).collect(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_video_of_a_high_frame_rate_is_reported_for_a_network() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("fast.y4m");
        let model = Model::read(Path::new("everyday")).expect("shipped");
        let views = [View { path: path.clone(), kind: ViewKind::Video }];
        let remarks = |rate: &str| {
            fs::write(&path, format!("YUV4MPEG2 W4 H2 {rate} Cmono\nFRAME\n12345678")).expect("written");
            let begun = Recognition::begin(&model, &views, &RecogniseRequest::default());
            begun.expect("a video").remarks.join("\n")
        };
        let high = remarks("F50:1");
        assert!(high.contains("fast.y4m: 50 frames a second") && high.contains("-r 25.00"), "{high}");
        assert!(!remarks("F30:1").contains("frames a second"));
    }

    #[test]
    fn a_person_in_pieces_and_one_who_returns_are_reported() {
        let folder = tempfile::tempdir().expect("a folder");
        for frame in 0..48 {
            // Eight stripes, no person in the middle third of the frames.
            let mask = Mask::from_shape_fn((240, 160), |(row, column)| {
                !(16..32).contains(&frame)
                    && (42..154).contains(&row)
                    && row % 14 < 10
                    && (60..100).contains(&column)
            });
            let png = masks::png(&mask).expect("a picture");
            fs::write(folder.path().join(format!("{frame:02}.png")), png).expect("written");
        }
        let model = Model::read(Path::new("everyday")).expect("shipped");
        let views = [View { path: folder.path().into(), kind: ViewKind::Masks }];
        let begun = Recognition::begin(&model, &views, &RecogniseRequest::default());
        let mut recognition = begun.expect("masks");
        let context = Context::unattended();
        while recognition.next(&context).expect("an answer").is_some() {}
        let remarks = recognition.remarks.join("\n");
        assert!(remarks.contains("view 1: the person is in 8.0 pieces on average"), "{remarks}");
        assert!(
            remarks.contains("between 2 passages") && remarks.contains("silhouettes passages"),
            "{remarks}"
        );
    }

    #[test]
    fn masks_of_a_high_frame_rate_are_reported_for_a_network() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("view1");
        fs::create_dir(&path).expect("a folder");
        let mask = Mask::from_shape_fn((60, 40), |(row, column)| {
            (10..50).contains(&row) && (15..25).contains(&column)
        });
        fs::write(path.join("a.png"), masks::png(&mask).expect("a picture")).expect("written");
        let model = Model::read(Path::new("everyday")).expect("shipped");
        let views = [View { path, kind: ViewKind::Masks }];
        let remarks = |rate_hz: &str| {
            let index = format!("template = \"bvh\"\nrate_hz = {rate_hz}\n");
            fs::write(folder.path().join("silhouettes.toml"), index).expect("written");
            let begun = Recognition::begin(&model, &views, &RecogniseRequest::default());
            begun.expect("masks").remarks.join("\n")
        };
        let high = remarks("100.0");
        assert!(high.contains("100 frames a second") && high.contains("--every 4"), "{high}");
        for rate_hz in ["30.0", "0.0", "inf"] {
            assert!(!remarks(rate_hz).contains("frames a second"), "{rate_hz}");
        }
    }

    #[test]
    fn names_with_commas_are_found_in_a_list() {
        let known = ["geh", "geh, schnell", "lauf", "a,b,c"].map(str::to_owned);
        let of = |text: &str| named(text, &known);
        let names = |names: &[&str]| Ok(names.iter().map(|name| (*name).to_owned()).collect::<Vec<_>>());
        assert_eq!(of("geh,lauf"), names(&["geh", "lauf"]));
        assert_eq!(of("geh, schnell"), names(&["geh, schnell"]));
        assert_eq!(of("lauf, geh, schnell,geh"), names(&["lauf", "geh, schnell", "geh"]));
        assert_eq!(of("a,b,c,lauf"), names(&["a,b,c", "lauf"]));
        assert_eq!(of("lauf,schnell"), Err("schnell".into()));
        assert_eq!(of("a,b"), Err("a".into()));
        assert_eq!(of(""), Err(String::new()));
    }
}

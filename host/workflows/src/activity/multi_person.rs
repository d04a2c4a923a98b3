//! Recognises several people in a recording: tracks them and answers for each.

use std::{path::PathBuf, time::Instant};

use farnear_recognition::clip::Track;
use farnear_recognition::live::{Live, joined, windows};
use farnear_recognition::model::{Answer, Recogniser};
use farnear_recognition::segmentation::{Worth, segmented};
use farnear_silhouettes::mask::{
    Mask,
    subject::Flag,
    tracking::{Followed, Sight, Tracker, TrackingSettings},
};
use serde::Serialize;

use super::{
    annotated_video::{AnnotatedVideo, Shown},
    answer::{
        AnswerSummary, PersonFigures, PersonFlag, PersonInFrame, of_segments, outlier_score, parts,
        restricted, rounded_probability,
    },
    recognise::RecogniseRequest,
    recognition::Model,
    views::{Frames, View},
};
use crate::{
    context::Context,
    error::{About, Result},
    figures::rounded,
    parameters::at_least,
};

#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct FrameOfPeople {
    /// Number of the frame, from 1.
    pub frame: usize,
    pub name: String,
    pub people: Vec<PersonInFrame>,
    /// Why the frame is not searched for people.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub flags: Vec<String>,
}

#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct MultiPersonFigures {
    pub people: Vec<PersonFigures>,
    pub frames: usize,
    pub empty_frames: usize,
    pub flagged_frames: usize,
    pub window: usize,
    /// From the file to the streaming answers for all people.
    pub seconds_per_frame: f64,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub remarks: Vec<String>,
}

#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum MultiPersonError {
    #[error("{}: these are silhouettes cut out at 100x100, which hold one person each; several are looked for in full frames", path.display())]
    CutOut { path: PathBuf },
    #[error("{}: the model fuses {views} views; several people are recognised by a model of one view", model.display())]
    Views { model: PathBuf, views: usize },
}

struct Somebody<'m> {
    live: Live<'m>,
    answer: Option<Answer>,
    tracks: Vec<Track>,
    /// Frame numbers of the tracks, from 1.
    numbers: Vec<usize>,
    crossing_frames: usize,
    perhaps_swapped_with: Vec<usize>,
}

/// Call [`Self::next`] until it returns `None`, then [`Self::finish`].
pub struct MultiPersonTracker<'m> {
    model: &'m Recogniser,
    frames: Frames,
    tracker: Option<Tracker>,
    window: usize,
    among: Vec<String>,
    people: Vec<Somebody<'m>>,
    annotated_video: Option<AnnotatedVideo>,
    count: usize,
    empty_frames: usize,
    flagged_frames: usize,
    seconds: f64,
    remarks: Vec<String>,
}

impl<'m> MultiPersonTracker<'m> {
    pub(super) fn begin(model: &'m Model, view: &View, request: &RecogniseRequest) -> Result<Self> {
        model.check_known(&request.among)?;
        if view.is_cut_out()? {
            return Err(MultiPersonError::CutOut { path: view.path.clone() }.into());
        }
        let recogniser = model.recogniser(true);
        if recogniser.views != 1 {
            return Err(
                MultiPersonError::Views { model: model.path().into(), views: recogniser.views }.into()
            );
        }
        if let Some(window) = request.window {
            at_least("window", window, 1, "frames")?;
        }
        let frames = Frames::open(view)?;
        Ok(Self {
            remarks: model
                .expectation()
                .into_iter()
                .chain(super::views::remarks(std::slice::from_ref(view), std::slice::from_ref(&frames)))
                .collect(),
            frames,
            tracker: None,
            window: request.window.unwrap_or(recogniser.typical_frames).max(1),
            among: request.among.clone(),
            people: Vec::new(),
            annotated_video: request.video_out.as_deref().map(AnnotatedVideo::begin).transpose()?,
            count: 0,
            empty_frames: 0,
            flagged_frames: 0,
            seconds: 0.0,
            model: recogniser,
        })
    }

    /// Answers for everyone in the next frame; `None` at the end.
    pub fn next(&mut self, context: &Context<'_>) -> Result<Option<FrameOfPeople>> {
        context.cancel.check("recognising")?;
        if self.count == 0 {
            self.remarks.iter().for_each(|remark| context.progress.warn(remark));
        }
        let start = Instant::now();
        let Some(moved) = self.frames.next_moving()? else { return Ok(None) };
        self.count += 1;
        let (followed, flag) = match &moved.mask {
            Ok(mask) => {
                let like = || Tracker::new(TrackingSettings::for_size(mask.dim()));
                (self.tracker.get_or_insert_with(like).follow(mask.view()), None)
            }
            Err(flag) => (Vec::new(), Some(flag.to_string())),
        };
        let people = followed
            .into_iter()
            .map(|followed| self.answered(followed).about(|| moved.name.clone()))
            .collect::<Result<Vec<PersonInFrame>>>()?;
        self.empty_frames += usize::from(people.is_empty());
        let doubtful = flag.is_some() || people.iter().any(|person| !person.flags.is_empty());
        self.flagged_frames += usize::from(doubtful);
        self.seconds += start.elapsed().as_secs_f64();
        if let Some(annotated_video) = &mut self.annotated_video {
            let shown: Vec<Shown> = people.iter().filter_map(shown).collect();
            let nothing = || moved.picture.as_ref().map_or((1, 1), super::views::size);
            let mask = moved.mask.unwrap_or_else(|_| Mask::from_elem(nothing(), false));
            annotated_video.draw_people(moved.picture.as_ref(), &mask, &shown)?;
        }
        Ok(Some(FrameOfPeople {
            frame: self.count,
            name: moved.name,
            people,
            flags: flag.into_iter().collect(),
        }))
    }

    fn answered(
        &mut self,
        followed: Followed,
    ) -> Result<PersonInFrame, farnear_recognition::model::ModelError> {
        let Followed { person, sight, parted } = followed;
        while self.people.len() < person {
            self.people.push(Somebody {
                live: Live::new(self.model, self.window, true),
                answer: None,
                tracks: Vec::new(),
                numbers: Vec::new(),
                crossing_frames: 0,
                perhaps_swapped_with: Vec::new(),
            });
        }
        let somebody = &mut self.people[person - 1];
        let mut flags = Vec::new();
        let mut spans = None;
        match sight {
            Sight::Alone { mask, bounds, cut_by_edge, before } => {
                let first = self.count - before.len();
                for (number, mask) in (first..).zip(before.into_iter().chain([mask])) {
                    let track = Track::from_masks(&[mask], self.model.settings.scaling, true);
                    somebody.tracks.push(track.clone());
                    somebody.numbers.push(number);
                    let answer = somebody.live.push_described(vec![track])?;
                    somebody.answer = Some(restricted(answer, &self.among));
                }
                flags.extend(cut_by_edge.then_some(PersonFlag::Mask(Flag::CutByEdge)));
                spans = Some(bounds);
            }
            Sight::Crossing { with, bounds } => {
                somebody.crossing_frames += 1;
                flags.extend(with.iter().copied().map(PersonFlag::Crossing));
                spans = Some(bounds);
            }
            Sight::Missed => flags.push(PersonFlag::Missed),
        }
        for parting in parted {
            let other = parting.from;
            flags.push(if parting.ambiguous {
                PersonFlag::PerhapsSwapped(other)
            } else {
                PersonFlag::Parted(other)
            });
            if parting.ambiguous && !somebody.perhaps_swapped_with.contains(&other) {
                somebody.perhaps_swapped_with.push(other);
            }
        }
        let answer = somebody.answer.as_ref();
        Ok(PersonInFrame {
            person,
            top_left_bottom_right: spans.map(|b| [b.top, b.left, b.bottom, b.right]),
            activity: answer.and_then(|answer| answer.activity.clone()),
            confidence: answer.map_or(0.0, |answer| rounded_probability(answer.confidence)),
            outlier_score: answer.and_then(outlier_score),
            flags,
        })
    }

    pub fn finish(self) -> Result<MultiPersonFigures> {
        if let Some(annotated_video) = self.annotated_video {
            annotated_video.finish()?;
        }
        let (model, among, window) = (self.model, &self.among, self.window);
        let people = (1..)
            .zip(&self.people)
            .filter(|(_, somebody)| !somebody.tracks.is_empty())
            .map(|(person, somebody)| figures(model, among, window, person, somebody))
            .collect::<Result<Vec<PersonFigures>>>()?;
        Ok(MultiPersonFigures {
            people,
            frames: self.count,
            empty_frames: self.empty_frames,
            flagged_frames: self.flagged_frames,
            window: self.window,
            seconds_per_frame: rounded(self.seconds / self.count.max(1) as f64, 6),
            remarks: self.remarks,
        })
    }
}

fn figures(
    model: &Recogniser,
    among: &[String],
    window: usize,
    person: usize,
    somebody: &Somebody<'_>,
) -> Result<PersonFigures> {
    let whole = joined(somebody.tracks.iter());
    let numbers: Vec<usize> = somebody
        .numbers
        .iter()
        .zip(&somebody.tracks)
        .filter(|(_, track)| track.frames() > 0)
        .map(|(n, _)| *n)
        .collect();
    let at = |index: usize| numbers.get(index).copied().unwrap_or(0);
    let answer = restricted(model.recognise(std::slice::from_ref(&whole))?, among);
    let found = segmented(model, std::slice::from_ref(&whole), among, Worth::default())?;
    let last = at(numbers.len().saturating_sub(1));
    let mut in_windows = windows(model, std::slice::from_ref(&whole), window, window.div_ceil(2))?;
    in_windows.iter_mut().for_each(|s| s.answer = restricted(s.answer.clone(), among));
    let of_windows = in_windows.iter().map(|s| (s.from, s.to, &s.answer.activity, s.answer.confidence));
    Ok(PersonFigures {
        windows: parts(of_windows, &numbers, last),
        person,
        from: at(0),
        to: last,
        silhouettes: numbers.len(),
        crossing_frames: somebody.crossing_frames,
        perhaps_swapped_with: somebody.perhaps_swapped_with.clone(),
        answer: AnswerSummary::new(answer, numbers.len()),
        segments: parts(of_segments(&found), &numbers, last),
    })
}

fn shown(person: &PersonInFrame) -> Option<Shown> {
    let spans = person.top_left_bottom_right?;
    let crossing = person.flags.iter().any(|flag| matches!(flag, PersonFlag::Crossing(_)));
    let known = person.activity.is_some() && !crossing;
    let what = match &person.activity {
        _ if crossing => "crossing".to_owned(),
        Some(activity) => format!("{activity} {:.0} %", 100.0 * person.confidence),
        None => "unknown".to_owned(),
    };
    Some(Shown { spans, text: format!("{}: {what}", person.person), known })
}

//! Recognises several people in a recording: tracks them and answers for each.

use std::{path::PathBuf, time::Instant};

use farnear_recognition::clip::Track;
use farnear_recognition::model::{Answer, Recogniser};
use farnear_silhouettes::mask::{
    Mask,
    subject::Flag,
    tracking::{Followed, Sight, Tracker, TrackingSettings},
};
use serde::Serialize;

use super::{
    annotated_video::{AnnotatedVideo, Shown},
    answer::{PersonFigures, PersonFlag, PersonInFrame, outlier_score, rounded_probability},
    person::Person,
    recognise::RecogniseRequest,
    recognition::{Model, rate_remark, window},
    views::{Frames, View},
};
use crate::{
    context::Context,
    error::{About, Result},
    figures::rounded,
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

struct Tracked<'m> {
    person: Person<'m>,
    answer: Option<Answer>,
    crossing_frames: usize,
    perhaps_swapped_with: Vec<usize>,
}

/// Call [`Self::next`] until it returns `None`, then [`Self::finish`].
pub struct MultiPersonTracker<'m> {
    model: &'m Recogniser,
    frames: Frames,
    tracker: Option<Tracker>,
    window: usize,
    people: Vec<Tracked<'m>>,
    annotated_video: Option<AnnotatedVideo>,
    count: usize,
    empty_frames: usize,
    flagged_frames: usize,
    seconds: f64,
    remarks: Vec<String>,
}

impl<'m> MultiPersonTracker<'m> {
    pub(super) fn begin(model: &'m Model, view: &View, request: &RecogniseRequest) -> Result<Self> {
        if view.is_cut_out()? {
            return Err(MultiPersonError::CutOut { path: view.path.clone() }.into());
        }
        let recogniser = model.recogniser(true);
        if recogniser.views != 1 {
            return Err(
                MultiPersonError::Views { model: model.path().into(), views: recogniser.views }.into()
            );
        }
        let window = window(recogniser, request)?;
        let frames = Frames::open(view)?;
        let rate = rate_remark(recogniser, std::slice::from_ref(view), std::slice::from_ref(&frames));
        Ok(Self {
            remarks: model.expectation().into_iter().chain(rate).collect(),
            frames,
            tracker: None,
            window,
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
        let moved = self.frames.next_moving()?;
        context.warn(self.frames.take_remarks(), &mut self.remarks);
        let Some(moved) = moved else {
            context.warn(self.closing_remarks(), &mut self.remarks);
            return Ok(None);
        };
        self.count += 1;
        let followed = follow(&mut self.tracker, moved.mask.as_ref().ok());
        let flag = moved.mask.as_ref().err().map(Flag::to_string);
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

    /// Notices about the whole recording.
    fn closing_remarks(&self) -> Vec<String> {
        let joined = (1..).zip(&self.people).filter_map(|(number, tracked)| {
            Some(format!("person {number}: {}", tracked.person.joined_passages()?))
        });
        self.tracker.as_ref().and_then(Tracker::doubt).into_iter().chain(joined).collect()
    }

    fn answered(
        &mut self,
        followed: Followed,
    ) -> Result<PersonInFrame, farnear_recognition::model::ModelError> {
        let Followed { person, sight, parted } = followed;
        while self.people.len() < person {
            self.people.push(Tracked {
                person: Person::new(self.model, 1, self.window),
                answer: None,
                crossing_frames: 0,
                perhaps_swapped_with: Vec::new(),
            });
        }
        let tracked = &mut self.people[person - 1];
        let mut flags = Vec::new();
        let mut spans = None;
        match sight {
            Sight::Alone { mask, bounds, cut_by_edge, before } => {
                let first = self.count - before.len();
                for (number, mask) in (first..).zip(before.into_iter().chain([mask])) {
                    let track = Track::from_masks(&[mask], self.model.settings.scaling, true);
                    tracked.answer = Some(tracked.person.see(number, vec![track])?);
                }
                flags.extend(cut_by_edge.then_some(PersonFlag::Mask(Flag::CutByEdge)));
                spans = Some(bounds);
            }
            Sight::Crossing { with, bounds } => {
                tracked.crossing_frames += 1;
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
            if parting.ambiguous && !tracked.perhaps_swapped_with.contains(&other) {
                tracked.perhaps_swapped_with.push(other);
            }
        }
        let answer = tracked.answer.as_ref();
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
        let mut people = Vec::new();
        for (number, tracked) in (1..).zip(self.people) {
            let Tracked { person, crossing_frames, perhaps_swapped_with, .. } = tracked;
            let figures = person.figures(number, person.summary()?)?;
            people.extend(figures.map(|figures| PersonFigures {
                crossing_frames,
                perhaps_swapped_with,
                ..figures
            }));
        }
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

/// People in the next frame; none in one without a mask, in which they age: the next person in that place is another one.
fn follow(tracker: &mut Option<Tracker>, mask: Option<&Mask>) -> Vec<Followed> {
    match (mask, tracker) {
        (Some(mask), tracker) => {
            let like = || Tracker::new(TrackingSettings::for_size(mask.dim()));
            tracker.get_or_insert_with(like).follow(mask.view())
        }
        (None, Some(tracker)) => {
            tracker.follow(Mask::from_elem((1, 1), false).view());
            Vec::new()
        }
        (None, None) => Vec::new(),
    }
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

#[cfg(test)]
mod tests {
    use farnear_files::masks;

    use super::*;
    use crate::activity::views::ViewKind;

    #[test]
    fn people_in_pieces_and_masks_of_a_high_frame_rate_are_reported() {
        let folder = tempfile::tempdir().expect("a folder");
        let view = View { path: folder.path().join("view1"), kind: ViewKind::Masks };
        std::fs::create_dir(&view.path).expect("a folder");
        std::fs::write(folder.path().join("silhouettes.toml"), "rate_hz = 100.0\n").expect("written");
        // Eight stripes.
        let mask = Mask::from_shape_fn((240, 160), |(row, column)| {
            (42..154).contains(&row) && row % 14 < 10 && (60..100).contains(&column)
        });
        for frame in 0..20 {
            let png = masks::png(&mask).expect("a picture");
            std::fs::write(view.path.join(format!("{frame:02}.png")), png).expect("written");
        }
        let model = Model::read(std::path::Path::new("everyday")).expect("shipped");
        let begun = MultiPersonTracker::begin(&model, &view, &RecogniseRequest::default());
        let mut tracker = begun.expect("masks");
        let context = Context::unattended();
        while tracker.next(&context).expect("an answer").is_some() {}
        let remarks = tracker.finish().expect("an answer").remarks.join("\n");
        for part in ["view1: 100 frames a second", "in 8.0 pieces on average"] {
            assert!(remarks.contains(part), "{part}: {remarks}");
        }
    }

    #[test]
    fn a_person_after_a_changed_scene_is_another_one() {
        let person = Mask::from_shape_fn((120, 320), |(row, column)| {
            (20..90).contains(&row) && (100..120).contains(&column)
        });
        let mut tracker = None;
        assert!(follow(&mut tracker, None).is_empty() && tracker.is_none());
        let mut numbers = |frames: usize, mask: Option<&Mask>| -> Vec<usize> {
            let mut last = Vec::new();
            for _ in 0..frames {
                last = follow(&mut tracker, mask);
            }
            last.iter().map(|followed| followed.person).collect()
        };
        assert_eq!(numbers(5, Some(&person)), [1]);
        assert!(numbers(20, None).is_empty());
        assert_eq!(numbers(5, Some(&person)), [2]);
    }
}

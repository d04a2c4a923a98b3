//! From video frames to silhouettes: background model, cleaning and choice of the subject. About 2 ms a frame
//! of 640x480 on one thread, mostly for the background model.

use ndarray::Array2;

use super::{
    BoundingBox, Mask,
    cleaning::cleaned,
    feedback::Feedback,
    people::{Person, people},
    subject::{Flag, Subject, SubjectChooser, SubjectSettings},
};
use crate::background::{
    BackgroundError, BackgroundModel, Frame, Label, Settings,
    light::{Light, Relit, STEP_PX},
    shake::{self, Shift},
};

/// Frames and pixels that the background learns from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Learning {
    /// All frames, except where people are.
    #[default]
    OutsidePeople,
    /// [`Self::OutsidePeople`] for this many frames.
    Until(u32),
    /// All frames everywhere: a standing person becomes background within seconds.
    Always,
    /// Only the initial learning frames.
    Never,
}

impl std::fmt::Display for Learning {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::OutsidePeople => f.write_str("outside-people"),
            Self::Until(frames) => write!(f, "until:{frames}"),
            Self::Always => f.write_str("always"),
            Self::Never => f.write_str("never"),
        }
    }
}

impl std::str::FromStr for Learning {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.trim() {
            "outside-people" => Ok(Self::OutsidePeople),
            "always" => Ok(Self::Always),
            "never" => Ok(Self::Never),
            other => {
                let frames =
                    other.strip_prefix("until").map(|rest| rest.trim_start_matches([' ', ':', '=']).parse());
                match frames {
                    Some(Ok(frames)) => Ok(Self::Until(frames)),
                    _ => Err(format!("`{other}`: expected outside-people, until:FRAMES, always or never")),
                }
            }
        }
    }
}

#[derive(Clone, Debug, PartialEq)]
pub struct ExtractorSettings {
    pub background: Settings,
    pub subject: SubjectSettings,
    /// Initial frames that are only learned, and flagged.
    pub learning_frames: u32,
    /// Moving share of the picture, 0 to 1, above which the scene counts as changed.
    pub scene_change_share: f64,
    pub learning: Learning,
}

impl ExtractorSettings {
    /// Settings for people in frames like this one. Without colour, shadow and dark clothes look alike.
    #[must_use]
    pub fn for_frame(frame: Frame<'_>) -> Self {
        let size = frame.size();
        let usual = Settings::default();
        let background = Settings { shadow: usual.shadow.filter(|_| frame.has_colour()), ..usual };
        Self {
            background,
            subject: SubjectSettings { usual_share: 0.1, ..SubjectSettings::for_size(size) },
            learning_frames: 10,
            scene_change_share: 0.6,
            learning: Learning::default(),
        }
    }
}

#[derive(Clone, Debug, PartialEq)]
pub struct Extracted {
    pub subject: Subject,
    pub labels: Array2<Label>,
}

#[derive(Clone, Debug, PartialEq)]
pub struct Moving {
    pub mask: Result<Mask, Flag>,
    pub labels: Array2<Label>,
}

pub struct Extractor {
    settings: ExtractorSettings,
    model: BackgroundModel,
    chooser: SubjectChooser,
    feedback: Feedback,
    light: Light,
    changes_of_light: usize,
}

/// A frame's people, or the reason for their absence.
struct Sighted {
    people: Result<(Mask, Vec<Person>), Flag>,
    labels: Array2<Label>,
    shift: Shift,
    /// The frame in the background's light and place; `None` if it is there already.
    seen: Option<Relit>,
}

const ANEW: f32 = 1.0 / 15.0;
/// Least memory of [`Extractor::learn`], frames. With a shorter one people who enter early are learned.
const SHORTEST_MEMORY: u32 = 30;

impl Extractor {
    pub fn like(frame: Frame<'_>, settings: ExtractorSettings) -> Result<Self, BackgroundError> {
        Ok(Self {
            model: BackgroundModel::like(frame, settings.background.clone())?,
            chooser: SubjectChooser::new(settings.subject),
            feedback: Feedback::new(frame.size()),
            light: Light::unchanged(frame.channels()),
            changes_of_light: 0,
            settings,
        })
    }

    /// Learns a frame without choosing a subject, outside people except for [`Learning::Always`]. Fails for a frame of
    /// another size or kind and leaves the extractor unchanged.
    ///
    /// The first frames teach their people too. So the memory is half of the frames seen: at the end the first tenth has a
    /// weight of about 1 %, and not of 30 % as at the model's usual rate.
    pub fn learn(&mut self, frame: Frame<'_>) -> Result<(), BackgroundError> {
        let usual = self.model.usual_rate();
        let memory = (self.model.frames_seen() / 2).max(SHORTEST_MEMORY);
        let rate =
            if self.settings.learning == Learning::Always { usual } else { usual.max(1.0 / memory as f32) };
        self.sighted(frame, rate).map(|_| ())
    }

    /// Goes back to the first frame of a learned video. The background is kept, and no more frames are only learned.
    pub fn rewind(&mut self, first: Frame<'_>) {
        self.settings.learning_frames = 0;
        self.feedback.forget();
        self.light = Light::unchanged(self.model.channels());
        self.adapted(first);
        self.changes_of_light = 0;
    }

    /// Processes the next frame. After an error the extractor is unchanged.
    pub fn extract(&mut self, frame: Frame<'_>) -> Result<Extracted, BackgroundError> {
        self.extract_without(frame, |_, _, _| Ok(()))
    }

    /// [`Self::extract`] without the pixels that `remove` unsets in the subject's mask. It gets the frame in the light and
    /// place of the background.
    pub fn extract_without<E: From<BackgroundError>>(
        &mut self,
        frame: Frame<'_>,
        remove: impl FnOnce(Frame<'_>, &BackgroundModel, &mut Mask) -> Result<(), E>,
    ) -> Result<Extracted, E> {
        let Sighted { people, labels, shift, seen } = self.sighted(frame, self.rate())?;
        let mut subject = match people {
            Ok((_, people)) => self.chooser.among(self.feedback.walkers(people), labels.dim()),
            Err(flag) => {
                Subject { mask: Array2::from_elem(labels.dim(), false), bounds: None, flags: vec![flag] }
            }
        };
        if subject.bounds.is_some_and(|bounds| self.feedback.stopped(bounds)) {
            subject.flags.push(Flag::StoppedMoving);
        }
        match &seen {
            Some(seen) => remove(seen.frame(), &self.model, &mut subject.mask)?,
            None => remove(frame, &self.model, &mut subject.mask)?,
        }
        if shift != (0, 0) {
            subject.mask = shake::moved_forth(&subject.mask, shift, false);
        }
        if subject.bounds.is_some() {
            subject.bounds = BoundingBox::of(subject.mask.view());
            subject.flags.extend(subject.bounds.is_none().then_some(Flag::Empty));
        }
        let labels =
            if shift == (0, 0) { labels } else { shake::moved_forth(&labels, shift, Label::Background) };
        Ok(Extracted { subject, labels })
    }

    /// [`Self::extract`] for all moving regions.
    pub fn moving(&mut self, frame: Frame<'_>) -> Result<Moving, BackgroundError> {
        let Sighted { people, labels, shift, .. } = self.sighted(frame, self.rate())?;
        let moving = Moving { mask: people.map(|(mask, _)| mask), labels };
        if shift == (0, 0) {
            return Ok(moving);
        }
        Ok(Moving {
            mask: moving.mask.map(|mask| shake::moved_forth(&mask, shift, false)),
            labels: shake::moved_forth(&moving.labels, shift, Label::Background),
        })
    }

    /// Why the masks of all frames so far are doubtful.
    #[must_use]
    pub fn doubts(&self) -> Vec<String> {
        self.chooser.doubts()
    }

    #[must_use]
    pub fn changes_of_light(&self) -> usize {
        self.changes_of_light
    }

    fn rate(&self) -> f32 {
        let seen = self.model.frames_seen();
        let learns = match self.settings.learning {
            Learning::OutsidePeople | Learning::Always => true,
            Learning::Until(frames) => seen < frames.max(self.settings.learning_frames),
            Learning::Never => seen < self.settings.learning_frames.max(1),
        };
        if learns { self.model.usual_rate() } else { 0.0 }
    }

    fn sighted(&mut self, frame: Frame<'_>, rate: f32) -> Result<Sighted, BackgroundError> {
        let (shift, seen) = self.adapted(frame);
        let sighted = match &seen {
            Some(seen) => self.sighted_in_place(seen.frame(), rate)?,
            None => self.sighted_in_place(frame, rate)?,
        };
        Ok(Sighted { shift, seen, ..sighted })
    }

    /// The frame's shift, and the frame in the background's light and place; `None` if it is there already.
    fn adapted(&mut self, frame: Frame<'_>) -> (Shift, Option<Relit>) {
        let alone = self.settings.learning != Learning::Always;
        let known = self.model.frames_seen() >= self.settings.learning_frames.max(1);
        let same_kind = frame.size() == self.model.size() && frame.channels() == self.model.channels();
        if !(alone && known && same_kind) {
            return ((0, 0), None);
        }
        let shift = self.model.shift(frame, STEP_PX);
        let back = (shift != (0, 0)).then(|| shake::moved_back(frame, shift));
        let relit = match &back {
            Some(back) => self.relit(back.frame()),
            None => self.relit(frame),
        };
        (shift, relit.or(back))
    }

    /// The frame in the background's light; `None` if it is unchanged.
    fn relit(&mut self, frame: Frame<'_>) -> Option<Relit> {
        let pairs = self.model.compared(frame, STEP_PX);
        if let Some(light) = self.light.changed(&pairs) {
            self.light = light;
            self.changes_of_light += 1;
        }
        self.light.relit(frame)
    }

    fn sighted_in_place(&mut self, frame: Frame<'_>, rate: f32) -> Result<Sighted, BackgroundError> {
        let of = |people, labels| Sighted { people, labels, shift: (0, 0), seen: None };
        let alone = self.settings.learning != Learning::Always;
        let held = if alone { self.feedback.held() } else { None };
        let labels = self.model.apply_outside(frame, rate, held)?;
        let moving = labels.mapv(|label| label == Label::Foreground);
        if self.model.frames_seen() <= self.settings.learning_frames {
            return Ok(of(Err(Flag::Learning), labels));
        }
        let share = super::area(moving.view()) as f64 / moving.len() as f64;
        if share >= self.settings.scene_change_share {
            self.feedback.forget();
            if alone && rate > 0.0 {
                self.model.apply_at(frame, ANEW)?;
            }
            let flag = Flag::SceneChanged { moving_percent: (100.0 * share) as u8 };
            return Ok(of(Err(flag), labels));
        }
        let mask = cleaned(moving.view());
        let people = people(mask.view(), &self.settings.subject);
        if alone {
            let holes = self.feedback.follow(&people, frame, || self.model.background());
            if let Some(holes) = holes.filter(|_| rate > 0.0) {
                self.model.replace(frame, &holes);
            }
        }
        Ok(of(Ok((mask, people)), labels))
    }

    #[must_use]
    pub fn background(&self) -> &BackgroundModel {
        &self.model
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::Array2;

    const SIZE: (usize, usize) = (120, 160);

    fn frame(number: usize, person: Option<usize>) -> Array2<u8> {
        Array2::from_shape_fn(SIZE, |(row, column)| {
            let noise = ((number * 7919 + row * 104_729 + column * 1_299_709) % 7) as u8;
            let inside =
                person.is_some_and(|left| (30..90).contains(&row) && (left..left + 20).contains(&column));
            if inside { 220 - noise } else { 80 + 20 * ((column / 9) % 2) as u8 + noise }
        })
    }

    fn extractor() -> Extractor {
        let first = frame(0, None);
        let first = Frame::Grey(first.view());
        Extractor::like(first, ExtractorSettings::for_frame(first)).unwrap()
    }

    #[test]
    fn a_walking_block_comes_out_as_it_is_and_the_rest_is_flagged() {
        let mut extractor = extractor();
        for number in 0..40 {
            let found = extractor.extract(Frame::Grey(frame(number, None).view())).unwrap();
            let expected = if number < 10 { Flag::Learning } else { Flag::Empty };
            assert_eq!(found.subject.flags, [expected], "frame {number}");
        }
        for step in 0..5 {
            let left = 20 + 20 * step;
            let found = extractor.extract(Frame::Grey(frame(40 + step, Some(left)).view())).unwrap();
            assert_eq!(found.subject.flags, []);
            let expected = BoundingBox { top: 30, left, bottom: 90, right: left + 20 };
            assert_eq!(found.subject.bounds, Some(expected));
        }
        let flash = Array2::from_elem(SIZE, 255);
        let found = extractor.extract(Frame::Grey(flash.view())).unwrap();
        assert_eq!(found.subject.flags, [Flag::SceneChanged { moving_percent: 100 }]);
        assert_eq!(found.subject.bounds, None);
    }

    #[test]
    fn a_frame_of_another_size_is_refused() {
        let mut extractor = extractor();
        let other = Array2::zeros((10, 10));
        assert!(matches!(
            extractor.extract(Frame::Grey(other.view())),
            Err(BackgroundError::Changed { found: (10, 10), .. })
        ));
    }
}

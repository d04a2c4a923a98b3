//! Warnings of samples that make figures wrong: one name in two spellings, one clip under two names, activities that
//! another subject does not perform.

use std::{
    collections::{BTreeMap, BTreeSet, HashMap, HashSet, hash_map::Entry},
    hash::{DefaultHasher, Hash, Hasher},
};

use farnear_recognition::choice::names;
use farnear_recognition::clip::{Clip, Track};

use crate::context::Context;

/// Warns of subjects and of activities whose names differ in case or blanks only, and of equal masks under different
/// names.
pub(super) fn warn<'a>(clips: impl Iterator<Item = &'a Clip> + Clone, context: &Context<'_>) {
    let subjects = spellings(clips.clone().map(|clip| &clip.subject));
    let activities = spellings(clips.clone().map(|clip| &clip.activity));
    for (kind, names) in [("subjects", subjects), ("activities", activities)] {
        for [one, other] in names {
            context.progress.warn(&format!(
                "the {kind} `{one}` and `{other}` count as two, but differ in case or blanks only: if they are one, give \
                 both the same name"
            ));
        }
    }
    let (count, first) = equal(clips);
    if let Some([one, other]) = first {
        let clip = |clip: &Clip| format!("{} at {}", clip.subject, clip.activity);
        context.progress.warn(&format!(
            "the masks of {} and {} are equal ({count} such views): a clip that is in training and test says nothing",
            clip(one),
            clip(other)
        ));
    }
}

/// Two spellings of each name that has several.
fn spellings<'a>(all: impl Iterator<Item = &'a String>) -> Vec<[&'a str; 2]> {
    let mut found: BTreeMap<String, BTreeSet<&str>> = BTreeMap::new();
    for name in all {
        let plain = name.split_whitespace().collect::<Vec<_>>().join(" ").to_lowercase();
        found.entry(plain).or_default().insert(name);
    }
    let two = |spellings: BTreeSet<&'a str>| {
        let mut spellings = spellings.into_iter();
        Some([spellings.next()?, spellings.next()?])
    };
    found.into_values().filter_map(two).collect()
}

/// Number of views with the masks of an earlier one of another subject or activity, and the first of them.
fn equal<'a>(clips: impl Iterator<Item = &'a Clip>) -> (usize, Option<[&'a Clip; 2]>) {
    let mut seen: HashMap<u64, (&Clip, &Track)> = HashMap::new();
    let (mut count, mut first) = (0, None);
    for (clip, view) in clips.flat_map(|clip| clip.views.iter().map(move |view| (clip, view))) {
        let mut hasher = DefaultHasher::new();
        view.cells.hash(&mut hasher);
        match seen.entry(hasher.finish()) {
            Entry::Vacant(place) => {
                place.insert((clip, view));
            }
            Entry::Occupied(place) => {
                let (earlier, track) = *place.get();
                let others = (&earlier.subject, &earlier.activity) != (&clip.subject, &clip.activity);
                if others && track == view {
                    count += 1;
                    first = first.or(Some([earlier, clip]));
                }
            }
        }
    }
    (count, first)
}

/// Activities of tested clips that no other subject's clips teach.
pub(super) fn untaught(tested: &[Clip], learned: &[Clip]) -> Vec<String> {
    let mut teachers: HashMap<&str, HashSet<&str>> = HashMap::new();
    for clip in learned {
        teachers.entry(&clip.activity).or_default().insert(&clip.subject);
    }
    let is_taught = |clip: &Clip| {
        let of = teachers.get(clip.activity.as_str());
        of.is_some_and(|of| of.iter().any(|teacher| *teacher != clip.subject))
    };
    names(tested.iter().filter(|clip| !is_taught(clip)).map(|clip| &clip.activity))
}

#[cfg(test)]
mod tests {
    use farnear_recognition::embedding::descriptor::Scaling;
    use farnear_silhouettes::mask::Mask;

    use super::*;
    use crate::context::Heard;

    /// A clip of one frame.
    fn clip(subject: &str, activity: &str, width: usize) -> Clip {
        let mask = Mask::from_shape_fn((40, 30), |(row, column)| (10..35).contains(&row) && column < width);
        let views = vec![Track::from_masks(&[mask], Scaling::default(), true)];
        Clip { subject: subject.into(), activity: activity.into(), views }
    }

    #[test]
    fn names_in_two_spellings_and_clips_under_two_names_are_reported() {
        let heard = |clips: &[Clip]| {
            let heard = Heard::default();
            warn(clips.iter(), &heard.context());
            heard.warnings()
        };
        let [a, b] = [clip("Anna", "sit down", 5), clip("ben", "walk", 9)];
        assert!(heard(&[a.clone(), b.clone(), b.clone()]).is_empty());
        let names = heard(&[a.clone(), clip("anna", "sit  Down", 7), b.clone()]);
        assert_eq!(names.len(), 2, "{names:?}");
        assert!(names[0].contains("subjects `Anna` and `anna`"), "{names:?}");
        assert!(names[1].contains("activities `sit  Down` and `sit down`"), "{names:?}");
        let copied = heard(&[a, b, clip("carl", "walk", 9)]);
        assert_eq!(copied.len(), 1, "{copied:?}");
        assert!(copied[0].contains("ben at walk and carl at walk are equal (1 such"), "{copied:?}");
    }

    #[test]
    fn activities_of_one_subject_are_untaught_where_it_is_left_out() {
        let clips = [clip("a", "walk", 5), clip("b", "walk", 6), clip("b", "dig", 7), clip("b", "dig", 8)];
        assert_eq!(untaught(&clips, &clips), ["dig"]);
        assert!(untaught(&clips[..1], &clips[2..]).contains(&"walk".to_owned()));
        assert!(untaught(&clips[2..], &[clip("c", "dig", 9)]).is_empty());
    }
}

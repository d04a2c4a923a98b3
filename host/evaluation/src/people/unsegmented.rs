//! Un-segmented recordings: concatenated clips of one person, segmented by the recogniser.

use anyhow::Result;
use farnear_recognition::choice::names;
use farnear_recognition::clip::{Clip, Track};
use farnear_recognition::frames::Mode;
use farnear_recognition::live::{self, Segment, segments, windows};
use farnear_recognition::model::{Recogniser, RecogniserSettings};
use farnear_recognition::segmentation::{Worth, segmented};
use farnear_recognition::space::SpaceSettings;
use ndarray::{Array2, Axis};
use rayon::prelude::*;

use super::{data::Data, sets};
use crate::page::Page;

struct Recording {
    views: Vec<Track>,
    truth: Vec<(usize, String)>,
}

#[derive(Default)]
struct Found {
    frames: usize,
    right: usize,
    /// Distance of the nearest found border from each true one, frames.
    off: Vec<usize>,
    segments: usize,
    clips: usize,
}

pub fn measure(page: &mut Page, data: &Data) -> Result<()> {
    page.heading("Un-segmented recordings");
    page.paragraph(
        "The first performance of every activity by one person, one after the other in the set's order as one recording, the box led on without a leap, cut by a model that the other people's whole clips taught (ordered, default settings, all views fused). A frame is right where the \
         answer for its stretch is; a border is off by as many frames as the nearest one found. *Windows*: answers for windows of a typical clip's length, as before; *semi-Markov*: a hidden semi-Markov model over the model's answers for whole stretches \
         and over how long each activity's clips last (`segments` of `farnear activity recognise`). Its constants were set on these recordings: change 5 of 0.5 to 10 tried, strange 3 of 0 to 8. Cut where the clips really end, \
         clips are recognised as the tables above say for left-out people (ordered, fused): no way of cutting can be expected to do better.",
    );
    let mut rows = Vec::new();
    for read in [sets::utkinect, sets::florence, sets::weizmann] {
        let Some(set) = read(data)? else { continue };
        eprintln!("    {}", set.name);
        let people = names(set.clips.iter().map(|clip| &clip.subject));
        let found: Result<Vec<[Found; 2]>> =
            people.par_iter().map(|person| of_person(&set.clips, person, set.mirror)).collect();
        let found = found?;
        for (way, name) in ["windows", "semi-Markov"].into_iter().enumerate() {
            let mut all = Found::default();
            found.iter().for_each(|ways| all.add(&ways[way]));
            all.off.sort_unstable();
            let rank =
                |share: f64| all.off.get((share * all.off.len() as f64) as usize).copied().unwrap_or(0);
            let share = 100.0 * all.right as f64 / all.frames.max(1) as f64;
            let mut row = vec![set.name.to_owned(), name.to_owned()];
            row.extend([all.frames, all.clips, all.segments].map(|count| count.to_string()));
            row.extend([format!("{share:.1}"), rank(0.5).to_string(), rank(0.75).to_string()]);
            rows.push(row);
        }
    }
    if rows.is_empty() {
        page.paragraph("Skipped: none of the sets is at hand.");
        return Ok(());
    }
    let head = [
        "set",
        "cut by",
        "frames",
        "clips",
        "stretches found",
        "frames right, %",
        "border off, median",
        "three in four within",
    ];
    page.table(2, &head, &rows);
    Ok(())
}

/// Recording of one person by windows and by the semi-Markov model, trained on the others.
fn of_person(clips: &[Clip], person: &str, mirror: bool) -> Result<[Found; 2]> {
    let (own, others): (Vec<Clip>, Vec<Clip>) =
        clips.iter().cloned().partition(|clip| clip.subject == person);
    let space = SpaceSettings { mode: Mode::Ordered, ..SpaceSettings::default() };
    let model =
        Recogniser::train(&others, &RecogniserSettings { space, mirror, ..RecogniserSettings::default() })?;
    let recording = Recording::of(&own);
    let window = model.typical_frames;
    let by_windows = segments(&windows(&model, &recording.views, window, window.div_ceil(2))?);
    let by_worth = segmented(&model, &recording.views, Worth::default())?;
    Ok([recording.judged(&by_windows), recording.judged(&by_worth)])
}

impl Recording {
    fn of(clips: &[Clip]) -> Self {
        let mut taken: Vec<&Clip> = Vec::new();
        for clip in clips {
            if !taken.iter().any(|other| other.activity == clip.activity) {
                taken.push(clip);
            }
        }
        let views = taken.first().map_or(0, |clip| clip.views.len());
        let mut truth = Vec::new();
        let mut from = 0;
        for clip in &taken {
            truth.push((from, clip.activity.clone()));
            from += clip.views.iter().map(Track::frames).min().unwrap_or(0);
        }
        Self { views: (0..views).map(|view| Self::view(&taken, view)).collect(), truth }
    }

    fn view(clips: &[&Clip], view: usize) -> Track {
        let mut parts: Vec<Track> = Vec::new();
        for clip in clips {
            let frames = clip.views.iter().map(Track::frames).min().unwrap_or(0);
            let mut part = clip.views[view].select(&(0..frames).collect::<Vec<_>>());
            let end = parts.last().and_then(|last: &Track| {
                last.boxes.as_ref()?.rows().into_iter().next_back().map(|r| r.to_owned())
            });
            if let (Some(end), Some(boxes)) = (end, part.boxes.as_mut().filter(|boxes| boxes.nrows() > 0)) {
                lead_on(boxes, [end[2], end[3]]);
            }
            parts.push(part);
        }
        live::joined(parts.iter())
    }

    fn frames(&self) -> usize {
        self.views.iter().map(Track::frames).min().unwrap_or(0)
    }

    fn judged(&self, found: &[Segment]) -> Found {
        let frames = self.frames();
        let right = (0..frames).filter(|&frame| {
            let truth =
                self.truth.iter().rev().find(|(from, _)| *from <= frame).map(|(_, name)| name.as_str());
            let answer = found.iter().find(|s| s.from <= frame && frame < s.to);
            answer.and_then(|segment| segment.activity.as_deref()) == truth
        });
        let nearest = |border: usize| {
            found.iter().skip(1).map(|segment| segment.from.abs_diff(border)).min().unwrap_or(frames)
        };
        Found {
            frames,
            right: right.count(),
            off: self.truth.iter().skip(1).map(|(from, _)| nearest(*from)).collect(),
            segments: found.len(),
            clips: self.truth.len(),
        }
    }
}

/// Moves a clip's centroids to begin where the last clip ended.
fn lead_on(boxes: &mut Array2<f32>, [x, y]: [f32; 2]) {
    let first = boxes.index_axis(Axis(0), 0).to_owned();
    boxes.column_mut(2).mapv_inplace(|v| v + x - first[2]);
    boxes.column_mut(3).mapv_inplace(|v| v + y - first[3]);
}

impl Found {
    fn add(&mut self, other: &Self) {
        self.frames += other.frames;
        self.right += other.right;
        self.off.extend(&other.off);
        self.segments += other.segments;
        self.clips += other.clips;
    }
}

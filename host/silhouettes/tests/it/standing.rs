//! A room's camera: empty for a while, then a person enters and stands while a light is switched.

use farnear_silhouettes::background::{BackgroundError, Frame};
use farnear_silhouettes::mask::{
    Mask,
    extractor::{Extractor, ExtractorSettings, Learning},
    subject::Flag,
};
use ndarray::Array3;

const SIZE: (usize, usize) = (120, 160);

/// About two grey levels.
fn noise(frame: usize, row: usize, column: usize) -> f32 {
    let hash = (frame * 7919 + row * 104_729 + column * 1_299_709).wrapping_mul(2_654_435_761) >> 16;
    (hash % 7) as f32 - 3.0
}

/// Absent, entering from the left, standing in the middle, leaving to the right.
fn place(frame: usize) -> Option<usize> {
    match frame {
        0..150 => None,
        150..190 => Some(2 * (frame - 150)),
        190..490 => Some(80 + (frame / 40) % 2),
        490..525 => Some(80 + 2 * (frame - 490)),
        _ => None,
    }
}

fn person(frame: usize) -> Mask {
    Mask::from_shape_fn(SIZE, |(row, column)| {
        let Some(middle) = place(frame) else { return false };
        let aside = (column as i32 - middle as i32).unsigned_abs() as usize;
        match row {
            25..37 => aside <= 5,
            37..70 => aside <= 10,
            70..108 => (2..=8).contains(&aside),
            _ => false,
        }
    })
}

/// The light is dimmed to 60 % in frames 300 to 399.
fn picture(frame: usize) -> Array3<u8> {
    let person = person(frame);
    let light = if (300..400).contains(&frame) { 0.6 } else { 1.0 };
    Array3::from_shape_fn((SIZE.0, SIZE.1, 3), |(row, column, channel)| {
        let wall = 110.0 + 40.0 * ((row / 12 + column / 16) % 2) as f32 + 10.0 * channel as f32;
        let clothes = [150.0, 60.0, 50.0][channel] + 15.0 * ((row / 9) % 2) as f32;
        let level = if person[[row, column]] { clothes } else { wall };
        (light * level + noise(frame, row, column)).clamp(0.0, 255.0) as u8
    })
}

fn iou(a: &Mask, b: &Mask) -> f64 {
    let both = a.iter().zip(b).filter(|(a, b)| **a && **b).count();
    let any = a.iter().zip(b).filter(|(a, b)| **a || **b).count();
    both as f64 / any.max(1) as f64
}

struct Seen {
    /// Frames with a person, and those with a mask of IoU 0.7 or better.
    person: usize,
    masked: usize,
    /// Frames without a person that have a mask.
    ghosts: usize,
    stopped: usize,
    changes_of_light: usize,
}

fn extractor(first: &Array3<u8>) -> Extractor {
    let first = Frame::Rgb(first.view());
    Extractor::like(first, ExtractorSettings::for_frame(first)).expect("settings hold")
}

fn seen(learning: Learning) -> Seen {
    let first = picture(0);
    let first = Frame::Rgb(first.view());
    let settings = ExtractorSettings { learning, ..ExtractorSettings::for_frame(first) };
    let mut extractor = Extractor::like(first, settings).expect("settings hold");
    let mut seen = Seen { person: 0, masked: 0, ghosts: 0, stopped: 0, changes_of_light: 0 };
    for frame in 0..600 {
        let subject = extractor.extract(Frame::Rgb(picture(frame).view())).expect("a frame").subject;
        if place(frame).is_some() {
            seen.person += 1;
            seen.masked += usize::from(iou(&subject.mask, &person(frame)) >= 0.7);
            seen.stopped += usize::from(subject.flags.contains(&Flag::StoppedMoving));
        } else {
            seen.ghosts += usize::from(subject.bounds.is_some());
        }
    }
    seen.changes_of_light = extractor.changes_of_light();
    seen
}

#[test]
fn keeps_a_standing_person_while_the_light_is_switched() {
    let seen = seen(Learning::OutsidePeople);
    assert!(seen.masked * 10 >= seen.person * 9, "{} of {} person frames", seen.masked, seen.person);
    assert!(seen.ghosts <= 5, "{} empty frames have a mask", seen.ghosts);
    assert!(seen.stopped >= 200, "{} frames are flagged as standing", seen.stopped);
    assert_eq!(seen.changes_of_light, 2);
}

#[test]
fn learning_can_be_limited_or_stopped() {
    let always = seen(Learning::Always);
    assert!(
        always.masked * 2 < always.person,
        "{} of {} although all is learned",
        always.masked,
        always.person
    );
    for learning in [Learning::Until(100), Learning::Never] {
        let seen = seen(learning);
        assert!(seen.masked * 10 >= seen.person * 9, "{learning:?}: {} of {}", seen.masked, seen.person);
    }
    assert_eq!("until:300".parse(), Ok(Learning::Until(300)));
    assert_eq!("always".parse(), Ok(Learning::Always));
    assert!("sometimes".parse::<Learning>().is_err());
}

#[test]
fn pixels_are_removed_in_the_light_of_the_background_and_an_emptied_mask_is_flagged() {
    let mut extractor = extractor(&picture(0));
    for frame in 0..310 {
        let dimmed = frame >= 300;
        let found = extractor.extract_without(Frame::Rgb(picture(frame).view()), |seen, model, mask| {
            if let (Frame::Rgb(seen), true) = (seen, dimmed) {
                let apart =
                    seen.iter().zip(&model.background()).filter(|(a, b)| a.abs_diff(**b) > 25).count();
                assert!(5 * apart < seen.len(), "{apart} of {} in frame {frame}", seen.len());
                mask.fill(false);
            }
            Ok::<(), BackgroundError>(())
        });
        let subject = found.expect("a frame").subject;
        let emptied = subject.bounds.is_none() && subject.flags.contains(&Flag::Empty);
        assert!(emptied || !dimmed, "{:?}", subject.flags);
    }
}

#[test]
fn learns_an_object_that_appears_without_walking() {
    let mut extractor = extractor(&picture(0));
    let mut areas = Vec::new();
    for frame in 0..250 {
        let mut picture = picture(frame % 100);
        if frame >= 80 {
            // A cupboard appears.
            picture.slice_mut(ndarray::s![40..100, 60..90, ..]).fill(230);
        }
        let subject = extractor.extract(Frame::Rgb(picture.view())).expect("a frame").subject;
        areas.push(subject.mask.iter().filter(|set| **set).count());
    }
    assert!(areas[85] > 1500, "{}", areas[85]);
    assert_eq!(areas[249], 0);
}

#[test]
fn a_shaking_camera_is_registered() {
    // Without the border, moved by up to 3 pixels either way.
    let shaken = |frame: usize| {
        let (down, right) = if frame < 60 { (3, 3) } else { (frame * 5 % 7, frame * 3 % 7) };
        let cut = ndarray::s![down..SIZE.0 - 6 + down, right..SIZE.1 - 6 + right, ..];
        let mask = person(frame + 100);
        let truth = mask.slice(ndarray::s![down..SIZE.0 - 6 + down, right..SIZE.1 - 6 + right]).to_owned();
        (picture(frame + 100).slice(cut).to_owned(), truth)
    };
    let mut extractor = extractor(&shaken(0).0);
    let (mut person, mut masked) = (0, 0);
    for frame in 0..180 {
        let (picture, truth) = shaken(frame);
        let subject = extractor.extract(Frame::Rgb(picture.view())).expect("a frame").subject;
        // The person enters in frame 50.
        if frame >= 65 {
            person += 1;
            masked += usize::from(iou(&subject.mask, &truth) >= 0.7);
        }
    }
    assert!(masked * 10 >= person * 9, "{masked} of {person}");
}

/// Overlaps of masks and people in these frames, which are learned first, and the changes of light.
fn learned_first(frames: std::ops::Range<usize>) -> (Vec<f64>, usize) {
    let first = picture(frames.start);
    let mut extractor = extractor(&first);
    for frame in frames.clone() {
        extractor.learn(Frame::Rgb(picture(frame).view())).expect("a frame");
    }
    extractor.rewind(Frame::Rgb(first.view()));
    let mut overlap = |frame| {
        let subject = extractor.extract(Frame::Rgb(picture(frame).view())).expect("a frame").subject;
        assert!(!subject.flags.contains(&Flag::Learning));
        iou(&subject.mask, &person(frame))
    };
    (frames.map(&mut overlap).collect(), extractor.changes_of_light())
}

#[test]
fn people_of_the_first_frame_are_masked_if_the_video_is_learned_first() {
    // The person leaves at once, or after standing for 50 frames.
    for frames in [490..590, 440..640] {
        let (overlaps, _) = learned_first(frames.clone());
        assert!(overlaps[..=20].iter().all(|overlap| *overlap >= 0.7), "{frames:?}: {:?}", &overlaps[..=20]);
    }
}

#[test]
fn a_person_who_stops_early_is_not_learned_first() {
    let (overlaps, _) = learned_first(145..300);
    let inside = &overlaps[15..];
    let masked = inside.iter().filter(|overlap| **overlap >= 0.7).count();
    assert!(masked * 10 >= inside.len() * 9, "{masked} of {}", inside.len());
}

#[test]
fn changes_of_light_are_counted_once_if_the_video_is_learned_first() {
    assert_eq!(learned_first(0..600).1, 2);
    // The light of the end is not that of the beginning.
    assert_eq!(learned_first(250..350).1, 1);
}

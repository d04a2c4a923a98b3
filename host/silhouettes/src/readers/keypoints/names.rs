//! Names of frames, such as those of pictures: their order, the numbers missing between them, and whether they are one sequence.

use std::collections::HashMap;

/// Ordered by its numbers, so that `frame_9` comes before `frame_10`.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Name {
    /// Texts, each with the number after it.
    pieces: Vec<(String, u128)>,
    text: String,
}

pub fn split(name: &str) -> Name {
    // Roboflow adds a hash.
    let mut rest = name.split_once(".rf.").map_or(name, |(own, _)| own);
    let mut pieces = Vec::new();
    while let Some(at) = rest.find(|c: char| c.is_ascii_digit()) {
        let (text, numbers) = rest.split_at(at);
        let end = numbers.find(|c: char| !c.is_ascii_digit()).unwrap_or(numbers.len());
        pieces.push((text.into(), numbers[..end].parse().unwrap_or(u128::MAX)));
        rest = &numbers[end..];
    }
    pieces.push((rest.into(), 0));
    Name { pieces, text: name.into() }
}

/// The number of frames missing before each, and remarks.
pub fn gaps(names: &[Name]) -> (Vec<usize>, Vec<String>) {
    /// Gaps are filled if the recording grows at most by this factor.
    const LONGEST: u128 = 10;
    let steps: Vec<u128> = names.windows(2).map(|pair| step(&pair[0], &pair[1]).unwrap_or(0)).collect();
    let least = steps.iter().copied().filter(|step| *step > 0).min().unwrap_or(1);
    let reach = steps.iter().fold(0, |sum: u128, step| sum.saturating_add(*step));
    let are_wide = reach / least > LONGEST * names.len() as u128;
    let missing = |step: &u128| match are_wide {
        true => 0,
        false => usize::try_from((step / least).saturating_sub(1)).unwrap_or(0),
    };
    let wide = are_wide
        .then(|| "most numbers of frames are missing: the gaps between the others are closed".to_owned());
    let missing = std::iter::once(0).chain(steps.iter().map(missing)).collect();
    (missing, wide.into_iter().chain(sequences(names)).collect())
}

/// How far the one number rises in which the names differ.
fn step(from: &Name, to: &Name) -> Option<u128> {
    let mut differing = from.pieces.iter().zip(&to.pieces).filter(|(from, to)| from != to);
    let (before, after) = differing.next().filter(|_| from.pieces.len() == to.pieces.len())?;
    let alone = differing.next().is_none() && before.0 == after.0;
    after.1.checked_sub(before.1).filter(|_| alone)
}

/// Place of the first number in which names of the same texts differ. Numbers with one of these between them, as those of a
/// time, are one; with hyphens, those of a date or a time, which has three.
fn counted(from: &Name, to: &Name) -> Option<usize> {
    let pairs = || from.pieces.iter().zip(&to.pieces);
    let alike = from.pieces.len() == to.pieces.len() && pairs().all(|(from, to)| from.0 == to.0);
    let place = pairs().position(|(from, to)| from.1 != to.1).filter(|_| alike)?;
    let hyphens = to.pieces.iter().filter(|(text, _)| text == "-").count();
    let is_joined = |(text, _): &&(String, u128)| match text.as_str() {
        "." | "," | ":" => true,
        "-" => hyphens > 1,
        _ => false,
    };
    Some(place - to.pieces[1..=place].iter().rev().take_while(is_joined).count())
}

/// Reports names of several sequences, such as pictures of several folders, or of none.
fn sequences<'a>(names: &'a [Name]) -> Option<String> {
    /// Mean length of sequences; fewer names are not those of a recording.
    const LEAST: usize = 3;
    const SHOWN: usize = 3;
    // Seconds.
    if names.iter().all(|name| name.text.parse::<f64>().is_ok()) {
        return None;
    }
    let texts =
        |name: &'a Name| -> Vec<&'a str> { name.pieces.iter().map(|(text, _)| text.as_str()).collect() };
    let places: Vec<Option<usize>> = names.windows(2).map(|pair| counted(&pair[0], &pair[1])).collect();
    let steps = || places.iter().zip(names.iter().skip(1));
    let mut counting: HashMap<Vec<&str>, Option<usize>> = HashMap::new();
    for (place, name) in steps() {
        let most = counting.entry(texts(name)).or_default();
        *most = (*most).max(*place);
    }
    // A number before the one that counts begins another sequence.
    let begins = steps().filter(|&(place, name)| {
        place.is_none() || counting.get(&texts(name)).is_some_and(|most| place < most)
    });
    let begins = begins.map(|(_, name)| name);
    let first: Vec<&Name> = names.iter().take(1).chain(begins).collect();
    if first.len() < 2 {
        return None;
    }
    let shown: Vec<&str> = first.iter().take(SHOWN).map(|name| name.text.as_str()).collect();
    let shown = format!("{}{}", shown.join(", "), if first.len() > SHOWN { ", ..." } else { "" });
    Some(if names.len() >= LEAST * first.len() {
        format!(
            "names of frames form {} sequences, which begin with {shown}: they are read as one recording; put each recording into a separate file",
            first.len()
        )
    } else {
        format!("names of frames form no numbered sequence ({shown}): give the frames of one video")
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn remarks(names: &[String]) -> String {
        let mut names: Vec<Name> = names.iter().map(|name| split(name)).collect();
        names.sort();
        gaps(&names).1.join("; ")
    }

    #[test]
    fn names_of_several_recordings_and_of_unrelated_pictures_are_reported() {
        let numbered =
            |before: &str| -> Vec<String> { (1..=9).map(|n| format!("{before}{n:04}.jpg")).collect() };
        let two = [numbered("walk/"), numbered("run/")].concat();
        let found = remarks(&two);
        assert!(found.contains("2 sequences, which begin with run/0001.jpg, walk/0001.jpg:"), "{found}");
        let folders =
            [numbered("take1/"), numbered("take2/"), numbered("take3/"), numbered("take4/")].concat();
        let found = remarks(&folders);
        assert!(
            found.contains("4 sequences, which begin with take1/0001.jpg") && found.contains(", ...:"),
            "{found}"
        );
        let found = remarks(&[numbered("video1_"), numbered("video2_")].concat());
        assert!(found.contains("2 sequences, which begin with video1_0001.jpg, video2_0001.jpg:"), "{found}");
        let found = remarks(&[numbered("take_1-"), numbered("take_2-")].concat());
        assert!(found.contains("2 sequences, which begin with take_1-0001.jpg, take_2-0001.jpg:"), "{found}");
        let of_two_kinds: Vec<String> =
            (1..=9).flat_map(|n| [format!("a1/b{n}.jpg"), format!("cer-kratasy/{n}.jpg")]).collect();
        let found = remarks(&of_two_kinds);
        assert!(found.contains("2 sequences, which begin with a1/b1.jpg, cer-kratasy/1.jpg:"), "{found}");
        let photos =
            ["park_jpg.rf.0a1.jpg", "street-7_jpg.rf.9b.jpg", "beach_jpg.rf.77.jpg"].map(str::to_owned);
        let found = remarks(&photos);
        assert!(found.contains("no numbered sequence (beach_jpg.rf.77.jpg, park"), "{found}");
    }

    #[test]
    fn names_of_one_recording_are_not_reported() {
        let of = |name: fn(usize) -> String| -> Vec<String> { (1..=40).map(name).collect() };
        for names in [
            of(|n| format!("walk_{n}.png")),
            // A film of Roboflow, a frame with its time, and seconds.
            of(|n| format!("walk-{n}_jpg.rf.{:x}.jpg", n * 7919 % 4096)),
            of(|n| format!("frame_{n:03}_{}.{:03}s.png", n / 30, n % 30 * 33)),
            of(|n| format!("{}.{:06}", n / 30, n % 30 * 33_000)),
            of(|n| format!("00:00:{:02}.{:03}", n / 30, n % 30 * 33)),
            of(|n| format!("2024-05-01_12-{:02}-{:02}", n / 30, n % 30 * 2)),
            of(|n| format!("2018-07-04T12_07_{:02}.{:06}.jpg", n / 30, n % 30 * 33_000)),
            vec!["one.png".into()],
        ] {
            assert_eq!(remarks(&names), "", "{names:?}");
        }
    }
}

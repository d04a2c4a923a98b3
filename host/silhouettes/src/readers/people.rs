//! People of a recording: those that a format separates, or prefixes of names (`Ann:LASI`, `Ben:LASI`) that share names of
//! body markers. Points of no person, such as props, belong to all.

use std::collections::HashSet;

use super::recording::{Found, RecordingError};
use crate::silhouette::{
    anatomy::{self, Anatomy},
    capsule::Point3,
};

/// Body markers of a person.
const LEAST: usize = 4;
/// A person who moves less than another by this factor is a dummy: one who stands sways by more.
const STILL: f64 = 5000.0;
/// People whose names a remark lists.
const SHOWN: usize = 10;

/// The person of this number, from 1.
pub fn pick(mut found: Found, wanted: usize) -> Result<Found, RecordingError> {
    let missing = |count: usize| RecordingError::Person { wanted, found: count };
    let index = wanted.checked_sub(1);
    if found.others.is_empty() {
        // The file's names remain those of the recording, for templates that have them.
        let names = prefixed(&found.names).unwrap_or_else(|| found.names.clone());
        return by_prefix(found, &names, index).map_err(missing);
    }
    let count = 1 + found.others.len();
    let index = index.filter(|index| *index < count).ok_or_else(|| missing(count))?;
    if index > 0 {
        found.frames = found.others.swap_remove(index - 1);
    }
    Ok(found)
}

/// The names with the text before a separator as a prefix, if they are those of a body only then: `Ann_LASI` of several people, or
/// `PoseLandmark.NOSE`.
pub fn prefixed(names: &[String]) -> Option<Vec<String>> {
    const SEPARATORS: [char; 4] = ['.', '_', '-', ' '];
    let known = |names: &[String]| Anatomy::of(names).body.len();
    if known(names) >= LEAST {
        return None;
    }
    let split = |separator: char| -> Vec<String> {
        let split = |name: &String| match parts(name, separator) {
            Some((prefix, own)) if !name.contains(':') && !prefix.is_empty() => format!("{prefix}:{own}"),
            _ => name.clone(),
        };
        names.iter().map(split).collect()
    };
    let used = SEPARATORS.into_iter().filter(|separator| names.iter().any(|name| name.contains(*separator)));
    let all = used.map(|separator| {
        let names = split(separator);
        (known(&names), names)
    });
    all.max_by_key(|(known, _)| *known).filter(|(known, _)| *known >= LEAST).map(|(_, names)| names)
}

fn parts(name: &str, separator: char) -> Option<(&str, &str)> {
    // The path of a Python module has several.
    if separator == '.' { name.rsplit_once(separator) } else { name.split_once(separator) }
}

struct Group<'a> {
    prefix: &'a str,
    places: Vec<usize>,
    body: HashSet<&'a str>,
    visible: usize,
    /// Largest movement of a point of the body, file units.
    moved: f64,
}

/// Median distance of a point from its median place, along the axis with most of it. A few wrong frames do not count.
fn movement(frames: &[Vec<Option<Point3>>], place: usize) -> f64 {
    let median = |mut values: Vec<f64>| {
        let middle = values.len() / 2;
        if values.is_empty() { 0.0 } else { *values.select_nth_unstable_by(middle, f64::total_cmp).1 }
    };
    let seen = || frames.iter().filter_map(|frame| frame.get(place).copied().flatten());
    let along = |axis: usize| {
        let values = || seen().map(move |point| point[axis]).filter(|value| value.is_finite());
        let middle = median(values().collect());
        median(values().map(|value| (value - middle).abs()).collect())
    };
    (0..3).map(along).fold(0.0, f64::max)
}

/// Fails with the number of people.
fn by_prefix(found: Found, all: &[String], index: Option<usize>) -> Result<Found, usize> {
    let alone = |found: Found| if index == Some(0) { Ok(found) } else { Err(1) };
    let mut groups: Vec<Group<'_>> = Vec::new();
    for (place, name) in all.iter().enumerate() {
        let prefix = anatomy::prefix(name);
        match groups.iter_mut().find(|group| group.prefix == prefix) {
            Some(group) => group.places.push(place),
            None => groups.push(Group {
                prefix,
                places: vec![place],
                body: HashSet::new(),
                visible: 0,
                moved: 0.0,
            }),
        }
    }
    if groups.len() < 2 {
        return alone(found);
    }
    for group in groups.iter_mut().filter(|group| group.places.len() >= LEAST) {
        let names: Vec<String> = group.places.iter().map(|place| all[*place].clone()).collect();
        let body: Vec<usize> = Anatomy::of(&names).body.iter().map(|index| group.places[*index]).collect();
        let seen = |frame: &Vec<Option<Point3>>| {
            body.iter().filter(|place| frame.get(**place).is_some_and(Option::is_some)).count()
        };
        group.visible = found.frames.iter().map(seen).sum();
        group.moved = body.iter().map(|place| movement(&found.frames, *place)).fold(0.0, f64::max);
        group.body = body.iter().map(|place| anatomy::without_prefix(&all[*place])).collect();
    }
    let shares = |a: usize| {
        let others = groups.iter().enumerate().filter(|(b, other)| a != *b && other.body.len() >= LEAST);
        groups[a].body.len() >= LEAST
            && others.into_iter().any(|(_, other)| !groups[a].body.is_disjoint(&other.body))
    };
    let mut people: Vec<usize> = (0..groups.len()).filter(|group| shares(*group)).collect();
    if people.len() < 2 {
        return alone(found);
    }
    // In the file's order, dummies and static copies, then those who are rarely visible last.
    let farthest = people.iter().map(|group| groups[*group].moved).fold(0.0, f64::max);
    people.sort_by_key(|group| STILL * groups[*group].moved < farthest);
    let most = people.iter().map(|group| groups[*group].visible).max().unwrap_or(0);
    people.sort_by_key(|group| 2 * groups[*group].visible < most);
    let listed: Vec<String> = (1..)
        .zip(people.iter().take(SHOWN))
        .map(|(number, group)| match groups[*group].prefix {
            "" => format!("{number} without a prefix"),
            prefix => format!("{number} {prefix}"),
        })
        .collect();
    let (listed, more) = (listed.join(", "), if people.len() > SHOWN { ", ..." } else { "" });
    let remark = format!("{} people: {listed}{more} (--person selects one, default 1)", people.len());
    let person = *index.and_then(|index| people.get(index)).ok_or(people.len())?;
    let others = groups.iter().enumerate().filter(|(group, _)| !people.contains(group));
    let of_no_person = others
        .flat_map(|(_, group)| &group.places)
        .filter(|place| !groups[person].body.contains(anatomy::without_prefix(&all[**place])));
    let places: Vec<usize> = groups[person].places.iter().chain(of_no_person).copied().collect();
    let names = places.iter().map(|place| found.names[*place].clone()).collect();
    let mut own = Found { names, ..found };
    for frame in &mut own.frames {
        *frame = places.iter().map(|place| frame.get(*place).copied().flatten()).collect();
    }
    own.remarks.push(remark);
    Ok(own)
}

#[cfg(test)]
mod tests {
    use crate::readers::{
        read,
        recording::{Choices, Recording, RecordingError},
    };

    const SUIT: [&str; 5] = ["LFHD", "C7", "LASI", "LKNE", "LTOE"];

    /// Two people 3 m apart, a box, and a stray marker; Ann's LASI is hidden in the second frame.
    fn two() -> String {
        let names = ["Ann", "Ben"].into_iter().flat_map(|person| SUIT.map(|name| format!("{person}:{name}")));
        let names: Vec<String> = names.chain(["Box:B1", "C7"].map(str::to_owned)).collect();
        let row = |frame: usize| {
            let suit = |x: f64| {
                (0..5).map(move |marker| {
                    let hidden = frame == 1 && x < 1000.0 && SUIT[marker] == "LASI";
                    if hidden { ",,".into() } else { format!("{x},{},{}", 10 * marker, 1700 - 400 * marker) }
                })
            };
            let extra = ["700,5,5".to_owned(), "90000,5,5".into()];
            suit(500.0).chain(suit(3500.0)).chain(extra).collect::<Vec<String>>().join(",")
        };
        let header: Vec<String> = names.iter().map(|name| format!("{name}_x,{name}_y,{name}_z")).collect();
        format!("{}\n{}\n{}\n", header.join(","), row(0), row(1))
    }

    fn person(text: &str, person: Option<usize>) -> Result<Recording, RecordingError> {
        read(text.as_bytes(), "csv", Choices { person, ..Choices::default() })
    }

    #[test]
    fn prefixes_with_the_same_body_markers_are_people_who_are_never_mixed() {
        let ann = person(&two(), None).expect("a table");
        assert_eq!(ann.by_name(0)["LASI"][0], 500.0);
        assert!(!ann.by_name(1).contains_key("LASI"), "hidden, not Ben's");
        assert!(
            ann.by_name(0)["C7"][0] == 500.0 && ann.by_name(0).contains_key("B1") && ann.names.len() == 6
        );
        let people = "2 people: 1 Ann, 2 Ben (--person selects one, default 1)";
        assert_eq!(ann.remarks(), ["the file states no frame rate", people]);
        let ben = person(&two(), Some(2)).expect("a table");
        assert_eq!((ben.by_name(1)["LASI"][0], ben.by_name(1)["Ben:C7"][0]), (3500.0, 3500.0));
        assert!(matches!(person(&two(), Some(3)), Err(RecordingError::Person { wanted: 3, found: 2 })));
    }

    #[test]
    fn a_person_who_is_hidden_nearly_always_is_not_the_default() {
        let text = two();
        let hidden = text.lines().map(|row| {
            let cells: Vec<&str> = row.split(',').collect();
            let is_header = row.starts_with("Ann");
            let ann = if is_header { cells[..15].to_vec() } else { vec![""; 15] };
            [ann, cells[15..].to_vec()].concat().join(",")
        });
        let hidden = hidden.collect::<Vec<String>>().join("\n");
        assert_eq!(person(&hidden, None).expect("a table").by_name(0)["LASI"][0], 3500.0);
    }

    #[test]
    fn a_person_who_never_moves_is_not_the_default() {
        let table = two();
        let moving = table.lines().enumerate().map(|(row, text)| {
            // The suit of Ben walks 300 mm a frame.
            if row == 0 { text.to_owned() } else { text.replace("3500,", &format!("{},", 3500 + 300 * row)) }
        });
        let moving = moving.collect::<Vec<String>>().join("\n");
        let found = person(&moving, None).expect("a table");
        assert_eq!(found.by_name(0)["LASI"][0], 3800.0);
        assert!(found.remarks().iter().any(|remark| remark.contains("2 people: 1 Ben, 2 Ann")));
    }

    #[test]
    fn people_and_a_module_may_be_before_other_separators() {
        for separator in ["_", ".", "-", " "] {
            let text =
                two().replace("Ann:", &format!("P1{separator}")).replace("Ben:", &format!("P2{separator}"));
            let ben = person(&text, Some(2)).unwrap_or_else(|error| panic!("{error}: `{separator}`"));
            assert_eq!(ben.by_name(0)["LASI"][0], 3500.0);
            assert!(
                ben.remarks().iter().any(|remark| remark.contains("2 people: 1 P1, 2 P2")),
                "`{separator}`"
            );
        }
        let names = ["LEFT_SHOULDER", "RIGHT_SHOULDER", "LEFT_HIP", "RIGHT_HIP", "LEFT_KNEE", "RIGHT_KNEE"];
        let of_module = names.map(|name| format!("mp.solutions.pose.PoseLandmark.{name}"));
        let prefixed = super::prefixed(&of_module).expect("a body");
        assert!(
            prefixed.iter().zip(names).all(|(found, name)| found.ends_with(&format!("PoseLandmark:{name}")))
        );
        assert_eq!(super::prefixed(&names.map(str::to_owned)), None);
    }

    #[test]
    fn the_names_of_the_file_remain_with_others_before_them() {
        let text = two().replace("Ann:", "Suit_").replace("Ben:", "Prop_Box");
        let suit = person(&text, None).expect("a table").by_name(0)["Suit_LASI"];
        assert_eq!(suit, person(&text, None).expect("a table").by_name(0)["LASI"]);
    }

    #[test]
    fn a_remark_lists_few_of_many_people() {
        let suit = |n: usize| SUIT.map(|name| format!(",P{n}:{name}_x,P{n}:{name}_y,P{n}:{name}_z")).concat();
        let header: String = (1..=11).map(suit).collect();
        let row = ",500,20,900".repeat(11 * SUIT.len());
        let remarks =
            person(&format!("frame{header}\n0{row}\n"), None).expect("a table").remarks().join("; ");
        assert!(
            remarks.contains("11 people: 1 P1,") && remarks.contains("10 P10, ... (--person"),
            "{remarks}"
        );
    }

    #[test]
    fn prefixes_of_parts_of_one_suit_are_one_person() {
        let parts = two().replace("Ben:L", "Right:R").replace("Ben:C7", "Right:T10");
        let found = person(&parts, None).expect("a table");
        assert!(found.names.len() == 12 && found.by_name(0).contains_key("RASI"));
    }
}

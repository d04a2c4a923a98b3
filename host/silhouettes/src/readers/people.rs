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

/// The person of this number, from 1.
pub fn pick(mut found: Found, wanted: usize) -> Result<Found, RecordingError> {
    let missing = |count: usize| RecordingError::Person { wanted, found: count };
    let index = wanted.checked_sub(1);
    if found.others.is_empty() {
        return by_prefix(found, index).map_err(missing);
    }
    let count = 1 + found.others.len();
    let index = index.filter(|index| *index < count).ok_or_else(|| missing(count))?;
    if index > 0 {
        found.frames = found.others.swap_remove(index - 1);
    }
    Ok(found)
}

struct Group<'a> {
    prefix: &'a str,
    places: Vec<usize>,
    body: HashSet<&'a str>,
    visible: usize,
}

/// Fails with the number of people.
fn by_prefix(found: Found, index: Option<usize>) -> Result<Found, usize> {
    let alone = |found: Found| if index == Some(0) { Ok(found) } else { Err(1) };
    let mut groups: Vec<Group<'_>> = Vec::new();
    for (place, name) in found.names.iter().enumerate() {
        let prefix = anatomy::prefix(name);
        match groups.iter_mut().find(|group| group.prefix == prefix) {
            Some(group) => group.places.push(place),
            None => groups.push(Group { prefix, places: vec![place], body: HashSet::new(), visible: 0 }),
        }
    }
    if groups.len() < 2 {
        return alone(found);
    }
    for group in groups.iter_mut().filter(|group| group.places.len() >= LEAST) {
        let names: Vec<String> = group.places.iter().map(|place| found.names[*place].clone()).collect();
        let body: Vec<usize> = Anatomy::of(&names).body.iter().map(|index| group.places[*index]).collect();
        let seen = |frame: &Vec<Option<Point3>>| {
            body.iter().filter(|place| frame.get(**place).is_some_and(Option::is_some)).count()
        };
        group.visible = found.frames.iter().map(seen).sum();
        group.body = body.iter().map(|place| anatomy::without_prefix(&found.names[*place])).collect();
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
    // In the file's order, those who are rarely visible last.
    let most = people.iter().map(|group| groups[*group].visible).max().unwrap_or(0);
    people.sort_by_key(|group| 2 * groups[*group].visible < most);
    let listed: Vec<String> = (1..)
        .zip(&people)
        .map(|(number, group)| match groups[*group].prefix {
            "" => format!("{number} without a prefix"),
            prefix => format!("{number} {prefix}"),
        })
        .collect();
    let remark = format!("{} people: {} (--person selects one, default 1)", people.len(), listed.join(", "));
    let person = *index.and_then(|index| people.get(index)).ok_or(people.len())?;
    let others = groups.iter().enumerate().filter(|(group, _)| !people.contains(group));
    let of_no_person = others
        .flat_map(|(_, group)| &group.places)
        .filter(|place| !groups[person].body.contains(anatomy::without_prefix(&found.names[**place])));
    let places: Vec<usize> = groups[person].places.iter().chain(of_no_person).copied().collect();
    let names = places.iter().map(|place| found.names[*place].clone()).collect();
    let mut all = Found { names, ..found };
    for frame in &mut all.frames {
        *frame = places.iter().map(|place| frame.get(*place).copied().flatten()).collect();
    }
    all.remarks.push(remark);
    Ok(all)
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
    fn prefixes_of_parts_of_one_suit_are_one_person() {
        let parts = two().replace("Ben:L", "Right:R").replace("Ben:C7", "Right:T10");
        let found = person(&parts, None).expect("a table");
        assert!(found.names.len() == 12 && found.by_name(0).contains_key("RASI"));
    }
}

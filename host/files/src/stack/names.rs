//! Which images of a folder form one focus series, by the numbers in their names.

use std::{
    collections::{BTreeMap, HashMap, HashSet},
    path::PathBuf,
};

use super::positions::unit_um;
use crate::order::{
    self, file_name,
    name::{Name, Number, counting, first_word, focus, last_word},
};

/// Largest share of images outside the pattern of the others, relative to these, that is left out and not refused.
const FEW: f64 = 0.25;
const LISTED: usize = 3;
/// How microscopes name channels, times and places: an acquisition that was stopped lacks some of their combinations.
const NO_FOCUS: [&str; 13] = [
    "c",
    "ch",
    "channel",
    "w",
    "wavelength",
    "t",
    "time",
    "timepoint",
    "frame",
    "pos",
    "position",
    "xy",
    "tile",
];

#[derive(Debug, PartialEq)]
pub(super) struct Series {
    pub images: Vec<PathBuf>,
    pub remarks: Vec<String>,
    /// Of the texts in names; `None` if the images have several.
    pattern: Option<Vec<String>>,
}

impl Series {
    /// Selects from sorted images. Fails if they form several series.
    pub fn of(images: Vec<PathBuf>) -> Result<Self, String> {
        let names: Vec<Name> = images.iter().map(|path| Name::of(path)).collect();
        if images.len() < 2 || names.iter().all(|name| name.numbers.is_empty()) {
            let remarks = Vec::from_iter((images.len() > 1).then(|| {
                format!(
                    "the names have no numbers: the images, {} first, are in alphabetical order",
                    file_name(&images[0])
                )
            }));
            return Ok(Self { images, remarks, pattern: None });
        }
        let bare = without_number(&images, &names);
        let mut patterns: BTreeMap<&[String], Vec<usize>> = BTreeMap::new();
        for (index, name) in names.iter().enumerate().filter(|(index, _)| Some(*index) != bare) {
            patterns.entry(&name.texts).or_default().push(index);
        }
        let Some((pattern, within)) = patterns.iter().max_by_key(|(_, indices)| indices.len()) else {
            unreachable!("at least one image has a pattern")
        };
        let of_pattern: Vec<Name> = within.iter().map(|index| names[*index].clone()).collect();
        let units = units(&names, &of_pattern);
        if units.len() > 1 {
            return Err(format!(
                "the positions in its images' names are in several units ({}): write them in one unit",
                units.join(", ")
            ));
        }
        let others = names.len() - within.len() - usize::from(bare.is_some());
        let mut remarks = Vec::new();
        if others as f64 > FEW * within.len() as f64 || pattern.len() == 1 {
            if numbered_first(&names) {
                return Ok(Self { images, remarks, pattern: None });
            }
            return Err(format!(
                "its images have names of several kinds ({}; # is a number): a stack is one focus series; move \
                 the images that do not belong to it away",
                kinds(&patterns)
            ));
        }
        let fields = fields(&of_pattern);
        let unlike = || fields.iter().map(Field::to_string).collect::<Vec<_>>().join(" and ");
        if fields.len() > 1 {
            let combinations: usize = fields.iter().map(|field| field.values.len()).product();
            let every = if combinations == of_pattern.len() { " in every combination" } else { "" };
            if !every.is_empty() || fields.iter().any(Field::is_no_focus) {
                return Err(format!(
                    "the names differ in {}{every}: a stack is one focus series; move the images of one series into a folder and \
                     give that",
                    unlike()
                ));
            }
            remarks.push(format!(
                "the names differ in {}, without all combinations: the images count as one series in the order of their names",
                unlike()
            ));
        }
        if let Some(bare) = bare {
            remarks.push(format!("{} has no number: it counts as the first image", file_name(&images[bare])));
        }
        let belongs = |index: &usize| bare == Some(*index) || within.binary_search(index).is_ok();
        for index in (0..images.len()).filter(|index| !belongs(index)) {
            remarks.push(format!(
                "left out {}: its name does not belong to the series {}",
                file_name(&images[index]),
                shown(pattern)
            ));
        }
        let pattern = Some(pattern.to_vec());
        let images = (0..images.len()).filter(belongs).map(|index| images[index].clone()).collect();
        Ok(Self { images, remarks, pattern })
    }

    /// Whether a file of this name would be one of the images.
    pub fn would_hold(&self, path: &std::path::Path) -> bool {
        self.pattern.as_ref().is_none_or(|pattern| Name::of(path).texts == *pattern)
    }
}

/// Positions, um, if a unit (nm, um or mm) follows the number that counts the images: `z-83um.tif`.
pub fn positions_in_names(images: &[PathBuf]) -> Option<Vec<f64>> {
    let names: Vec<Name> = images.iter().map(|path| Name::of(path)).collect();
    let after = &names.first()?.texts[counting(&names)? + 1];
    let um = unit_um(first_word(after)).filter(|um| [1e-3, 1.0, 1e3].contains(um))?;
    order::numbers(images).into_iter().map(|number| Some(number? * um)).collect()
}

/// The image whose name begins all others, without their numbers: `a.png` of `a (2).png`, `a (3).png`.
fn without_number(images: &[PathBuf], names: &[Name]) -> Option<usize> {
    let shortest = (0..images.len()).min_by_key(|index| order::stem(&images[*index]).len())?;
    let stem = order::stem(&images[shortest]);
    let begins = images.iter().all(|path| order::stem(path).starts_with(&stem));
    let alike = names.iter().filter(|name| name.texts == names[shortest].texts).count();
    (begins && alike == 1).then_some(shortest)
}

/// Units of length in names that begin alike, after the first number that varies in the pattern.
fn units<'a>(names: &'a [Name], of_pattern: &[Name]) -> Vec<&'a str> {
    let Name { texts, numbers } = &of_pattern[0];
    let varies = |column: &usize| of_pattern.iter().any(|name| name.numbers[*column] != numbers[*column]);
    let column = (0..numbers.len()).find(varies).unwrap_or(0);
    let mut units: Vec<(f64, &str)> = Vec::new();
    for name in names.iter().filter(|name| name.texts.starts_with(&texts[..=column])) {
        let after = name.texts.get(column + 1).map_or("", String::as_str);
        let unit = first_word(after);
        if let Some(um) = unit_um(unit)
            && units.iter().all(|(other, _)| *other != um)
        {
            units.push((um, unit));
        }
    }
    units.into_iter().map(|(_, unit)| unit).collect()
}

/// Whether a number after the same text tells all names apart: `1 near`, `2 far`.
fn numbered_first(names: &[Name]) -> bool {
    let mut seen = HashSet::new();
    names.iter().all(|name| {
        name.texts[0] == names[0].texts[0] && name.numbers.first().is_some_and(|number| seen.insert(number))
    })
}

fn shown(pattern: &[String]) -> String {
    pattern.join("#")
}

fn kinds(patterns: &BTreeMap<&[String], Vec<usize>>) -> String {
    let mut kinds: Vec<_> = patterns.iter().map(|(pattern, found)| (found.len(), shown(pattern))).collect();
    kinds.sort_by_key(|(count, _)| std::cmp::Reverse(*count));
    let more = if kinds.len() > LISTED { ", ..." } else { "" };
    let first: Vec<_> =
        kinds.iter().take(LISTED).map(|(count, pattern)| format!("{count} of {pattern}")).collect();
    format!("{}{more}", first.join(", "))
}

/// A number in all names that differs between them.
struct Field {
    label: String,
    /// In order of their first occurrence.
    values: Vec<String>,
    /// Index in `values`, for each name.
    of_names: Vec<usize>,
}

impl Field {
    /// Whether its name is that of a channel, a time or a place.
    fn is_no_focus(&self) -> bool {
        NO_FOCUS.contains(&self.label.to_lowercase().as_str())
    }
}

impl std::fmt::Display for Field {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let mut values: Vec<&str> = self.values.iter().map(String::as_str).collect();
        let value = |text: &&str| text.parse().unwrap_or(f64::NAN);
        values.sort_by(|a, b| value(a).total_cmp(&value(b)));
        match values.as_slice() {
            [first, .., last] if values.len() > LISTED => write!(f, "{} ({first} to {last})", self.label),
            few => write!(f, "{} ({})", self.label, few.join(", ")),
        }
    }
}

/// Numbers that some names share, without those that another one of these determines; none where the names state one focus each.
fn fields(names: &[Name]) -> Vec<Field> {
    if focus(names).is_some() {
        return Vec::new();
    }
    let all: Vec<Field> = (0..names[0].numbers.len()).map(|column| field(names, column)).collect();
    let mut fields: Vec<Field> = Vec::new();
    for field in all.into_iter().filter(|field| (2..names.len()).contains(&field.values.len())) {
        if !fields.iter().any(|other| determines(other, &field)) {
            fields.retain(|other| !determines(&field, other));
            fields.push(field);
        }
    }
    fields
}

fn field(names: &[Name], column: usize) -> Field {
    let mut seen: HashMap<&Number, usize> = HashMap::new();
    let mut values = Vec::new();
    let of_names = names.iter().map(|name| {
        let number = &name.numbers[column];
        *seen.entry(number).or_insert_with(|| {
            values.push(format!(
                "{}{}",
                number.sign.filter(|sign| *sign == '-').map(String::from).unwrap_or_default(),
                number.text
            ));
            values.len() - 1
        })
    });
    let of_names = of_names.collect();
    let label = match last_word(&names[0].texts[column]) {
        "" => format!("number {}", column + 1),
        word => word.to_owned(),
    };
    Field { label, values, of_names }
}

fn determines(a: &Field, b: &Field) -> bool {
    let mut of_a = vec![None; a.values.len()];
    a.of_names.iter().zip(&b.of_names).all(|(a, b)| *of_a[*a].get_or_insert(*b) == *b)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn series<S: AsRef<str>>(names: &[S]) -> Result<Series, String> {
        let mut images: Vec<PathBuf> = names.iter().map(|name| PathBuf::from(name.as_ref())).collect();
        order::sort(&mut images);
        Series::of(images)
    }

    fn grid(name: impl Fn(u32, u32) -> String) -> Vec<String> {
        (0..5).flat_map(|z| [1, 2].map(|other| name(z, other))).collect()
    }

    #[test]
    fn channels_positions_and_times_are_several_series() {
        for (names, phrase) in [
            (
                grid(|z, c| format!("img_channel{c:03}_position000_time000000000_z{z:03}.tif")),
                "channel (001, 002) and z (000 to 004)",
            ),
            (grid(|z, w| format!("A01_s1_w{w}_z{z}.TIF")), "w (1, 2) and z (0 to 4)"),
            (grid(|z, p| format!("img_pos{p}_z{z:03}.tif")), "pos (1, 2)"),
            (grid(|z, t| format!("img_t{t:04}_z{z:03}.tif")), "t (0001, 0002)"),
            (grid(|z, c| format!("img_z{z:03}_c{c:02}_t0001.tif")), "z (000 to 004) and c (01, 02)"),
            (grid(|z, c| format!("r01c01f01p{z:02}-ch{c}sk1fk1fl1.tiff")), "p (00 to 04) and ch (1, 2)"),
            (grid(|z, c| format!("s{:04}_z{z}_c{c}.tif", 2 * z + c)), "z (0 to 4) and c (1, 2)"),
            (
                grid(|z, c| format!("z{}um_c{c}_{}nm.tif", 0.5 * f64::from(z), 400 + 88 * c)),
                "z (0 to 2) and c",
            ),
        ] {
            let error = series(&names).unwrap_err();
            assert!(error.contains(phrase) && error.contains("one focus series"), "{error}");
        }
        assert!(
            series(&grid(|z, c| format!("z{z}_{}.tif", ["DAPI", "FITC"][c as usize - 1])))
                .unwrap_err()
                .contains("5 of z#_DAPI, 5 of z#_FITC")
        );
        let incomplete = grid(|z, c| format!("z{z}_c{c}.tif"));
        for stopped in [&incomplete[1..], &incomplete[..9]] {
            assert!(
                series(stopped).unwrap_err().contains("z (0 to 4) and c (1, 2): a stack is one focus series")
            );
        }
        let coarse_and_fine = grid(|coarse, fine| format!("coarse{coarse}_fine{fine}.tif"));
        let found = series(&coarse_and_fine[..9]).unwrap();
        assert!(found.remarks[0].contains("coarse (0 to 4) and fine (1, 2), without all combinations"));
    }

    #[test]
    fn numbers_that_vary_together_are_one_series() {
        let of = |name: &dyn Fn(u32) -> String| series(&(0..6).map(name).collect::<Vec<_>>()).unwrap();
        for found in [
            of(&|z| format!("img_{:09}_z{z:03}_{}um.tif", 7 * z, 250 * z)),
            of(&|z| format!("IMG_2024050{}_{:06}.jpg", 1 + z / 3, 235_958 + z)),
            of(&|z| format!("z{:.2}.png", 0.25 * f64::from(z))),
            of(&|z| format!("z{},{:02}mm.png", z / 4, 25 * (z % 4))),
            of(&|z| format!("z{}.png", i64::from(z) - 2)),
            of(&|z| format!("z{}.png", 1 + 9 * z)),
            of(&|z| format!("2024-05-01_c1_z{z}.png")),
            of(&|z| format!("z{z:03}_t1{}-{:02}.png", z / 3, 5 + 20 * (z % 3))),
        ] {
            assert_eq!((found.images.len(), found.remarks), (6, vec![]));
        }
    }

    #[test]
    fn positions_in_several_units_are_refused() {
        let of = |name: &dyn Fn(u32) -> String| series(&(1..=20).map(name).collect::<Vec<_>>());
        let tenths = |z: u32| f64::from(z) / 10.0;
        let from = |last: u32, z: u32, [small, large]: [String; 2]| if z <= last { small } else { large };
        for (several, units) in [
            (
                of(&|z| from(9, z, [format!("{z}00um.png"), format!("{}mm.png", z.saturating_sub(9))])),
                "mm, um",
            ),
            (
                of(&|z| from(2, z, [format!("{z}00um.png"), format!("{}mm.png", z.saturating_sub(2))])),
                "mm, um",
            ),
            (of(&|z| from(9, z, [format!("z{z}00nm.tif"), format!("z{:.1}um.tif", tenths(z))])), "um, nm"),
            (of(&|z| from(9, z, [format!("{z}00_um.png"), format!("{:.1}_mm.png", tenths(z))])), "mm, um"),
            (of(&|z| from(9, z, [format!("f2_{z}0cm.png"), format!("f2_{:.1}m.png", tenths(z))])), "m, cm"),
            (series(&["900um.png", "1mm.png"]), "mm, um"),
        ] {
            let error = several.unwrap_err();
            assert!(error.contains(&format!("several units ({units})")), "{error}");
        }
        for one in [
            of(&|z| {
                format!("{z:03}_{}", from(9, z, [format!("{z}00um.png"), format!("{:.1}mm.png", tenths(z))]))
            }),
            of(&|z| format!("z{z}_{}nm.png", 400 + 10 * z)),
            of(&|z| format!("{z}{}.png", if z < 3 { "um" } else { "\u{b5}m" })),
        ] {
            one.unwrap();
        }
    }

    #[test]
    fn positions_in_names_have_a_unit_after_the_number_that_counts() {
        let of = |names: &[&str]| positions_in_names(&Vec::from_iter(names.iter().map(PathBuf::from)));
        for (names, positions) in [
            (["z-83um.tif", "z0um.tif", "z83um.tif"], [-83.0, 0.0, 83.0]),
            (["1 mm.png", "1.5 mm.png", "2 mm.png"], [1000.0, 1500.0, 2000.0]),
            (["a_250nm_x.png", "a_500nm_x.png", "a_750nm_x.png"], [0.25, 0.5, 0.75]),
            (["z-5um_t12-05.png", "z0um_t12-50.png", "z5um_t13-20.png"], [-5.0, 0.0, 5.0]),
            (["z1\u{b5}m.png", "z2\u{b5}m.png", "z3\u{b5}m.png"], [1.0, 2.0, 3.0]),
        ] {
            let found = of(&names).unwrap();
            assert!(found.iter().zip(positions).all(|(a, b)| (a - b).abs() < 1e-9), "{found:?}");
        }
        for names in [["1.png", "2.png"], ["1_50um.png", "2_50um.png"], ["1s.png", "2s.png"]] {
            assert_eq!(of(&names), None);
        }
    }

    #[test]
    fn names_outside_the_series_are_left_out_by_name() {
        let sources: Vec<String> = (0..8).map(|z| format!("img{z:03}.tif")).collect();
        for other in ["2024-05-01 ZS PMax.tif", "stack_fused.tif", "img008_helicon.tif", "0_fused.tif"] {
            let with_other = [&sources[..], &[other.to_owned()]].concat();
            let found = series(&with_other).unwrap();
            assert_eq!(found.images, sources.iter().map(PathBuf::from).collect::<Vec<_>>());
            assert!(found.remarks[0].starts_with(&format!("left out {other}: ")), "{:?}", found.remarks);
        }
        let error = series(&["a1.png", "a2.png", "b1.png"]).unwrap_err();
        assert!(error.contains("2 of a#, 1 of b#"), "{error}");
    }

    #[test]
    fn a_name_that_begins_the_others_is_the_first() {
        let found = series(&["a (2).png", "a (3).png", "a.png"]).unwrap();
        assert_eq!(found.images, ["a.png", "a (2).png", "a (3).png"].map(PathBuf::from));
        assert!(found.remarks[0].contains("a.png has no number"));
    }

    #[test]
    fn names_without_one_pattern_keep_their_order() {
        let found = series(&["near.png", "middle.png"]).unwrap();
        assert!(found.remarks[0].contains("alphabetical"));
        let found = series(&["2 far.png", "1 near.png", "3 beyond.png"]).unwrap();
        assert_eq!(found.images[0], PathBuf::from("1 near.png"));
        assert_eq!(found.remarks, [""; 0]);
    }
}

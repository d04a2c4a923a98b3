//! Order of capture by the numbers in file names: `in9` before `in10`, `z-0.5` before `z0.25`. Camera counters restart after
//! 9999 (DCF): if the numbers form two dense groups at the ends of the range, the upper one comes first unless time stamps
//! contradict.

pub(crate) mod name;
mod reading;

use std::{
    cmp::Ordering,
    path::{Path, PathBuf},
    time::SystemTime,
};

use unicode_normalization::UnicodeNormalization as _;

use crate::image_file::metadata::taken;
use name::{Name, counting};
use reading::read;

pub use reading::{ambiguity, same_number};

pub fn sort(paths: &mut [PathBuf]) {
    paths.sort_by(|a, b| natural(&stem(a), &stem(b)));
    let (names, values) = read(paths);
    if let Some(values) = values {
        let mut named: Vec<(Name, PathBuf)> = names.into_iter().zip(paths.iter().cloned()).collect();
        named.sort_by(|(a, _), (b, _)| values.order(a, b));
        paths.iter_mut().zip(named).for_each(|(path, (_, sorted))| *path = sorted);
        return;
    }
    if let Some(first) = roll_over(paths) {
        paths.rotate_left(first);
    }
}

/// Neighbours of a sorted list between which the counter restarted.
pub fn counter_started_again(sorted: &[PathBuf]) -> Option<[&PathBuf; 2]> {
    if read(sorted).1.is_some() {
        return None;
    }
    sorted.windows(2).find_map(|two| {
        let [before, after] = two else { return None };
        let ((a, text), (b, other)) = (number(before)?, number(after)?);
        (text == other && a > b).then_some([before, after])
    })
}

/// Neighbours of a sorted list between which a number is missing, where most numbers are evenly apart. A counter that starts
/// again leaves none.
pub fn gap(sorted: &[PathBuf]) -> Option<[&PathBuf; 2]> {
    let (names, _) = read(sorted);
    let column = counting(&names)?;
    let numbers: Vec<f64> = names.iter().map(|name| name.numbers[column].value()).collect::<Option<_>>()?;
    let steps: Vec<f64> = numbers.windows(2).map(|two| (two[1] - two[0]).abs()).collect();
    let mut in_order = steps.clone();
    in_order.sort_unstable_by(f64::total_cmp);
    let usual = *in_order.get(steps.len() / 2)?;
    let even = |step: &&f64| (**step - usual).abs() < 0.1 * usual;
    let mostly = 4 * steps.iter().filter(even).count() >= 3 * steps.len();
    let again = counter_started_again(sorted);
    let mut apart = sorted.windows(2).zip(&steps).filter(|(_, step)| mostly && **step > 1.5 * usual);
    let is_gap = |two: &&[PathBuf]| again.is_none_or(|[before, _]| *before != two[0]);
    apart.by_ref().map(|(two, _)| two).find(is_gap).map(|two| [&two[0], &two[1]])
}

/// The numbers that count files: of names of one pattern that of the focus (behind `z`, or before a unit of length), else the last that
/// varies; of other names the last.
pub fn numbers(paths: &[PathBuf]) -> Vec<Option<f64>> {
    let (names, _) = read(paths);
    let column = counting(&names);
    let number = |name: &Name| match column {
        Some(column) => name.numbers[column].value(),
        None => name.numbers.last()?.value(),
    };
    let numbers: Vec<Option<f64>> = names.iter().map(number).collect();
    // A minus before all numbers separates.
    let are_separated = numbers.iter().flatten().all(|number| *number <= 0.0);
    numbers.into_iter().map(|number| number.map(|n| if are_separated { n.abs() } else { n })).collect()
}

/// Two files that differ only in their ending.
pub fn same_stem(paths: &[PathBuf]) -> Option<[PathBuf; 2]> {
    let mut stems = std::collections::HashMap::new();
    paths.iter().find_map(|path| stems.insert(stem(path), path).map(|other| [other.clone(), path.clone()]))
}

pub(crate) fn file_name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// A text with its letters composed (NFC): names from macOS may have them in parts (NFD).
pub fn composed(text: &str) -> String {
    text.nfc().collect()
}

/// A composed name without its ending, with full-width digits as ASCII.
pub(crate) fn stem(path: &Path) -> String {
    let ascii = |c: char| {
        let value = u32::from(c).checked_sub(u32::from('\u{ff10}'));
        value.and_then(|value| char::from_digit(value, 10)).unwrap_or(c)
    };
    composed(&path.file_stem().unwrap_or_default().to_string_lossy()).chars().map(ascii).collect()
}

/// Last number of a name, with the surrounding text and digit count.
fn number(path: &Path) -> Option<(u64, (String, usize, String))> {
    let stem = stem(path);
    let end = stem.rfind(|c: char| c.is_ascii_digit())? + 1;
    let begin = stem[..end].rfind(|c: char| !c.is_ascii_digit()).map_or(0, |at| at + 1);
    // `rfind` returns the first byte of a possibly multi-byte character.
    let begin = (begin..end).find(|at| stem.is_char_boundary(*at))?;
    let digits = &stem[begin..end];
    Some((digits.parse().ok()?, (stem[..begin].into(), digits.len(), stem[end..].into())))
}

/// Start of the order after a counter restart, if any.
fn roll_over(sorted: &[PathBuf]) -> Option<usize> {
    let numbers: Vec<_> = sorted.iter().map(|path| number(path)).collect::<Option<_>>()?;
    let (largest, text) = numbers.last()?;
    if numbers.iter().any(|(_, other)| other != text) {
        return None;
    }
    let gaps = || numbers.windows(2).enumerate().map(|(at, two)| (two[1].0 - two[0].0, at + 1));
    let (gap, first) = gaps().max()?;
    let second = gaps().filter(|(_, at)| *at != first).map(|(gap, _)| gap).max().unwrap_or(1);
    // Counters end at 999, 9999 etc.; the name may have more digits (DSC09999).
    let end = (3..=9).map(|digits| 10_u64.pow(digits)).find(|end| end > largest)?;
    let across = numbers[0].0 + end - largest;
    let two_groups = 2 * gap > end && 8 * second < gap && 8 * across < gap;
    (two_groups && !written_in_order(sorted)).then_some(first)
}

/// Whether the exposures' times (EXIF), else those of the files, rise in this order.
fn written_in_order(paths: &[PathBuf]) -> bool {
    let taken: Option<Vec<String>> = paths.iter().map(|path| taken(path)).collect();
    if let Some(taken) = taken {
        // A burst may have one second for several exposures.
        return taken.is_sorted() && taken.first() != taken.last();
    }
    let times: Option<Vec<SystemTime>> =
        paths.iter().map(|path| path.metadata().ok()?.modified().ok()).collect();
    let Some(times) = times else { return false };
    let rising = times.windows(2).all(|two| two[0] < two[1]);
    let last = times.len().saturating_sub(1);
    let span = times.get(last).zip(times.first()).and_then(|(last, first)| last.duration_since(*first).ok());
    // Copying writes files by name within moments; capturing takes longer.
    rising && span.is_some_and(|span| span.as_secs_f64() >= last as f64)
}

fn natural(a: &str, b: &str) -> Ordering {
    let (mut a_rest, mut b_rest) = (a, b);
    while let (Some(x), Some(y)) = (a_rest.chars().next(), b_rest.chars().next()) {
        let (a_digits, b_digits) = (digits(a_rest), digits(b_rest));
        let (order, a_step, b_step) = if a_digits > 0 && b_digits > 0 {
            let (m, n) =
                (a_rest[..a_digits].trim_start_matches('0'), b_rest[..b_digits].trim_start_matches('0'));
            (m.len().cmp(&n.len()).then_with(|| m.cmp(n)), a_digits, b_digits)
        } else {
            (x.cmp(&y), x.len_utf8(), y.len_utf8())
        };
        if order != Ordering::Equal {
            return order;
        }
        (a_rest, b_rest) = (&a_rest[a_step..], &b_rest[b_step..]);
    }
    // Equal so far: shorter first, and `01` before `1`, so that the order is total.
    a_rest.len().cmp(&b_rest.len()).then_with(|| a.cmp(b))
}

fn digits(text: &str) -> usize {
    text.bytes().take_while(u8::is_ascii_digit).count()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image_file::metadata::tests::png_with_exif;

    #[test]
    fn files_are_counted_by_their_last_varying_number() {
        for (names, expected) in [
            (["000007_p1", "000010_p1"], [Some(7.0), Some(10.0)]),
            (["f_0001_512x512", "f_0002_512x512"], [Some(1.0), Some(2.0)]),
            (["a-1", "a-2"], [Some(1.0), Some(2.0)]),
            (["a3", "b4c"], [Some(3.0), Some(4.0)]),
            (["walk", "run2"], [None, Some(2.0)]),
        ] {
            assert_eq!(numbers(&names.map(PathBuf::from)), expected, "{names:?}");
        }
    }

    #[test]
    fn numbers_sort_by_value_and_letters_by_letter() {
        let mut names =
            ["in10", "in9", "in010", "b", "in9b", "in", "a2b10", "a2b9", "in123456789012345678901234"];
        names.sort_by(|a, b| natural(a, b));
        assert_eq!(
            names,
            ["a2b9", "a2b10", "b", "in", "in9", "in9b", "in010", "in10", "in123456789012345678901234"]
        );
    }

    fn sorted(names: &[&str]) -> Vec<String> {
        let mut paths: Vec<PathBuf> = names.iter().map(PathBuf::from).collect();
        sort(&mut paths);
        paths.iter().map(|path| path.display().to_string()).collect()
    }

    #[test]
    fn continues_the_stack_after_a_counter_restart() {
        let names = ["IMG_0001.jpg", "IMG_0002.jpg", "IMG_9997.jpg", "IMG_9998.jpg", "IMG_9999.jpg"];
        let expected = ["IMG_9997.jpg", "IMG_9998.jpg", "IMG_9999.jpg", "IMG_0001.jpg", "IMG_0002.jpg"];
        assert_eq!(sorted(&names), expected);
        let paths: Vec<PathBuf> = expected.iter().map(PathBuf::from).collect();
        assert_eq!(counter_started_again(&paths), Some([&paths[2], &paths[3]]));
        assert_eq!(counter_started_again(&paths[..3]), None);
        let stack: Vec<PathBuf> =
            [9995, 9996, 9997, 9998, 9999, 1, 2, 3, 5].map(|n| format!("IMG_{n:04}.jpg").into()).to_vec();
        assert_eq!(gap(&stack[..8]), None);
        assert_eq!(gap(&stack), Some([&stack[7], &stack[8]]));
        assert_eq!(sorted(&["DSC00001.tif", "DSC09999.tif"]), ["DSC09999.tif", "DSC00001.tif"]);
        // Some pictures around the end were deleted.
        assert_eq!(sorted(&["p0004.png", "p0006.png", "p9990.png"]), ["p9990.png", "p0004.png", "p0006.png"]);
    }

    #[test]
    fn a_minus_is_a_sign_where_others_have_none() {
        assert_eq!(
            sorted(&["z0.png", "z-10.png", "z5.png", "z-5.png", "z10.png"]),
            ["z-10.png", "z-5.png", "z0.png", "z5.png", "z10.png"]
        );
        let names = ["z-2.png", "z-1.png", "z0.png"].map(PathBuf::from);
        assert_eq!(counter_started_again(&names), None);
        assert_eq!(sorted(&["+2.tif", "-2.tif", "0.tif"]), ["-2.tif", "0.tif", "+2.tif"]);
        assert_eq!(sorted(&["a-1.png", "a-2.png", "a-3.png"]), ["a-1.png", "a-2.png", "a-3.png"]);
        assert_eq!(sorted(&["a-1.png", "a-2.png", "b0.png"]), ["a-1.png", "a-2.png", "b0.png"]);
        let with_signs = ["i+0_c1.png", "i+12_c1.png", "i+2_c1.png", "i-1_c1.png", "i-4_c1.png"];
        assert_eq!(
            sorted(&with_signs),
            ["i-4_c1.png", "i-1_c1.png", "i+0_c1.png", "i+2_c1.png", "i+12_c1.png"]
        );
    }

    #[test]
    fn decimals_sort_by_value() {
        for names in [
            &["pos_0.0.png", "pos_0.25.png", "pos_0.5.png", "pos_0.75.png", "pos_1.0.png", "pos_10.0.png"][..],
            &["z_0.1.tif", "z_0.2.tif", "z_0.30000000000000004.tif", "z_0.4.tif"],
            &["1305031103.02.png", "1305031103.1.png"],
            &["z-2.0um.png", "z-1.5um.png", "z0.0um.png", "z0.25um.png", "z0.5um.png"],
            &["z_0.png", "z_0.25.png", "z_0.5.png", "z_1.png"],
            &["z-1,50.png", "z-1,25.png", "z-0,75.png", "z0,00.png", "z0,25.png", "z1,00.png"],
            &["slice_0mm.tif", "slice_0,25mm.tif", "slice_0,5mm.tif", "slice_1mm.tif"],
            &["z_0.png", "z_2.5e-05.png", "z_5e-05.png", "z_0.0001.png", "z_0.000125.png"],
        ] {
            let reversed: Vec<&str> = names.iter().rev().copied().collect();
            assert_eq!(sorted(&reversed), names);
            let paths: Vec<PathBuf> = names.iter().map(PathBuf::from).collect();
            assert_eq!(counter_started_again(&paths), None);
        }
    }

    #[test]
    fn a_time_next_to_the_focus_does_not_count() {
        for names in [
            &["z001_t12-50.png", "z002_t12-05.png", "z003_t12-40.png", "z004_t12-20.png"][..],
            &["z-4_t12-05.png", "z-3_t12-22.png", "z0_t12-39.png", "z10_t12-13.png"],
            &["z0mm_05.png", "z0.25mm_22.png", "z0.5mm_39.png", "z1mm_13.png"],
            &["t3_Z1.png", "t1_Z2.png", "t4_Z3.png", "t2_Z10.png"],
            &["50um_9s.png", "100um_3s.png", "150um_7s.png", "200um_5s.png"],
        ] {
            let reversed: Vec<&str> = names.iter().rev().copied().collect();
            assert_eq!(sorted(&reversed), names);
            let paths: Vec<PathBuf> = names.iter().map(PathBuf::from).collect();
            assert_eq!(counter_started_again(&paths), None);
        }
        let minutes = ["z1_t12-05", "z2_t12-10", "z3_t12-15", "z4_t12-20", "z5_t12-50"].map(PathBuf::from);
        assert_eq!(gap(&minutes), None);
        let wavelengths = ["405nm_1.png", "488nm_2.png", "561nm_3.png"].map(PathBuf::from);
        assert_eq!(numbers(&wavelengths), [Some(1.0), Some(2.0), Some(3.0)]);
    }

    #[test]
    fn full_width_digits_are_digits() {
        let names = ["z\u{ff11}.png", "z\u{ff12}.png", "z\u{ff11}\u{ff10}.png"];
        assert_eq!(sorted(&[names[2], names[1], names[0]]), names);
        assert_eq!(numbers(&names.map(PathBuf::from)), [Some(1.0), Some(2.0), Some(10.0)]);
    }

    #[test]
    fn names_in_parts_are_those_of_whole_letters() {
        let names = ["Ho\u{308}he_1.png", "H\u{f6}he_2.png", "Ho\u{308}he_10.png"];
        assert_eq!(sorted(&[names[2], names[1], names[0]]), names);
        assert_eq!(numbers(&names.map(PathBuf::from)), [Some(1.0), Some(2.0), Some(10.0)]);
        let twins = ["Ho\u{308}he_1.png", "H\u{f6}he_1.png"].map(PathBuf::from);
        assert!(same_stem(&twins).is_some());
    }

    #[test]
    fn versions_and_dates_are_not_decimals() {
        for names in [
            &["v1.2_003.png", "v1.2_010.png", "v1.12_001.png"][..],
            &["fig1.1.png", "fig1.9.png", "fig1.10.png"],
            &["2024.5.9.png", "2024.5.25.png"],
            &["2024,5,9.png", "2024,5,25.png"],
            &["a.9.png", "a.10.png"],
        ] {
            let reversed: Vec<&str> = names.iter().rev().copied().collect();
            assert_eq!(sorted(&reversed), names);
        }
    }

    #[test]
    fn other_numbers_stay_in_order() {
        for names in [
            &["z0001.tif", "z0500.tif", "z0999.tif"][..],
            &["1.png", "2.png", "3.png", "1000.png"],
            &["a0001.png", "b9999.png"],
            &["s1.png", "s2.png", "s10.png", "s11.png"],
            &["x0100.png", "x0200.png", "x0900.png"],
        ] {
            assert_eq!(sorted(names), names);
        }
    }

    #[test]
    fn time_stamps_overrule_the_counter() {
        let folder = tempfile::tempdir().unwrap();
        let mut paths: Vec<PathBuf> =
            ["p0001.png", "p9998.png", "p9999.png"].iter().map(|name| folder.path().join(name)).collect();
        let written = |path: &PathBuf, seconds: u64| {
            let file = std::fs::File::create(path).unwrap();
            file.set_modified(SystemTime::UNIX_EPOCH + std::time::Duration::from_secs(1_000_000 + seconds))
                .unwrap();
        };
        let by_number = paths.clone();
        for (path, seconds) in paths.iter().zip([0, 60, 120]) {
            written(path, seconds);
        }
        sort(&mut paths);
        assert_eq!(paths, by_number);
        for (path, seconds) in paths.iter().zip([120, 0, 60]) {
            written(path, seconds);
        }
        sort(&mut paths);
        assert_eq!(paths, [by_number[1].clone(), by_number[2].clone(), by_number[0].clone()]);
    }

    #[test]
    fn times_of_exposure_overrule_the_files_times() {
        let folder = tempfile::tempdir().unwrap();
        let paths = ["p0001.png", "p9998.png", "p9999.png"].map(|name| folder.path().join(name));
        let sorted_with = |seconds: [u8; 3]| {
            for (path, second) in paths.iter().zip(seconds) {
                let time = format!("2026:11:25 20:00:{second:02}");
                std::fs::write(path, png_with_exif(1, &time)).unwrap();
            }
            let mut sorted = paths.to_vec();
            sort(&mut sorted);
            sorted
        };
        assert_eq!(sorted_with([10, 20, 30]), paths);
        let rolled_over = [&paths[1..], &paths[..1]].concat();
        assert_eq!(sorted_with([30, 10, 20]), rolled_over);
        assert_eq!(sorted_with([10, 10, 10]), rolled_over, "a burst within a second");
    }

    #[test]
    fn finds_a_missing_number() {
        let paths = |numbers: &[f64]| -> Vec<PathBuf> {
            numbers.iter().map(|number| format!("z{number}_b.png").into()).collect()
        };
        let sorted = paths(&[1.0, 2.0, 4.0, 5.0, 6.0, 7.0]);
        assert_eq!(gap(&sorted), Some([&sorted[1], &sorted[2]]));
        let tenths = paths(&[-0.2, -0.1, 0.0, 0.1, 0.2, 0.4]);
        assert_eq!(gap(&tenths), Some([&tenths[4], &tenths[5]]));
        for even in
            [&[1.0, 2.0, 3.0, 4.0][..], &[0.0, 0.25, 0.5, 0.75, 1.0], &[0.0, 1.0, 5.0, 6.0, 20.0], &[3.0]]
        {
            assert_eq!(gap(&paths(even)), None, "{even:?}");
        }
    }

    #[test]
    fn finds_one_name_with_two_endings() {
        let paths = ["a.tif", "b.tif", "b.png"].map(PathBuf::from);
        assert_eq!(same_stem(&paths), Some([paths[1].clone(), paths[2].clone()]));
        assert_eq!(same_stem(&paths[..2]), None);
    }
}

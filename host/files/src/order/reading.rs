//! What the numbers in names are: counts, decimals, or counts with separators of thousands.

use std::{
    cmp::Ordering,
    collections::{BTreeSet, HashMap},
    path::PathBuf,
};

use super::{
    file_name,
    name::{Name, Number, counting, focus},
    natural,
};

/// Largest step of even decimals relative to the least.
const EVEN: f64 = 1.5;

/// How to compare names of one pattern whose counting number has decimals, signs or separators of thousands, or is not the last.
pub(super) struct Values {
    column: usize,
    signed: bool,
    /// Whether no other number counts.
    is_focus: bool,
}

/// The names, without separators of thousands, and how to compare them where the order is not the natural one.
pub(super) fn read(paths: &[PathBuf]) -> (Vec<Name>, Option<Values>) {
    let mut names: Vec<Name> = paths.iter().map(|path| Name::of(path)).collect();
    let Some(column) = counting(&names) else { return (names, None) };
    let numbers = column_of(&names, column);
    let minus = |number: &&Number| number.sign == Some('-');
    // With all names, a minus separates: `a-1`, `a-2`.
    let signed = numbers.iter().any(minus) && !numbers.iter().all(minus);
    let thousands = are_thousands(&numbers);
    let is_focus = focus(&names) == Some(column);
    let others = |name: &Name| {
        (0..name.numbers.len()).any(|at| at != column && name.numbers[at] != names[0].numbers[at])
    };
    let by_value = signed || thousands || decimals(&numbers) || is_focus && names.iter().any(others);
    if thousands {
        names.iter_mut().for_each(|name| name.numbers[column].text.retain(|c| c != '.'));
    }
    (names, by_value.then_some(Values { column, signed, is_focus }))
}

fn column_of(names: &[Name], column: usize) -> Vec<&Number> {
    names.iter().map(|name| &name.numbers[column]).collect()
}

/// Whether the numbers are decimals, not `1.9` and `1.10` of a numbering by sections.
fn decimals(numbers: &[&Number]) -> bool {
    let lengths = || numbers.iter().map(|number| number.fraction().map_or(0, str::len));
    let one_length = lengths().min() == lengths().max();
    // Programs print decimals of several lengths without trailing zeros, apart from `1.0`.
    let shortest = |number: &&Number| number.fraction().is_none_or(|f| f.len() == 1 || !f.ends_with('0'));
    let exponents = numbers.iter().any(|number| number.has_exponent());
    exponents || lengths().any(|length| length > 0) && (one_length || numbers.iter().all(shortest))
}

/// Whether some numbers are at most 999 and the others have one separator before three digits.
fn may_be_thousands(numbers: &[&Number]) -> bool {
    let grouped = numbers.iter().filter(|number| number.fraction().is_some()).count();
    let fits = |number: &&Number| match number.text.split_once('.') {
        Some((before, after)) => after.len() == 3 && before.len() <= 3 && !before.starts_with('0'),
        None => number.text.len() <= 3,
    };
    (1..numbers.len()).contains(&grouped) && numbers.iter().all(fits)
}

/// Whether `1,000` among such numbers is 1000: that makes the steps more even.
fn are_thousands(numbers: &[&Number]) -> bool {
    let largest_step = |text: &dyn Fn(&str) -> String| {
        let mut values: Vec<f64> =
            numbers.iter().map(|number| text(&number.text).parse().unwrap_or(f64::NAN)).collect();
        values.sort_unstable_by(f64::total_cmp);
        let steps = values.array_windows().map(|[a, b]| b - a);
        steps.fold(0.0, f64::max) / (values[values.len() - 1] - values[0])
    };
    may_be_thousands(numbers) && largest_step(&|text| text.replace('.', "")) < largest_step(&str::to_owned)
}

/// Whether `1.1`, `1.2`, `2.1` and `2.2` may be rows and columns: all combinations, and as decimals they have uneven steps.
fn may_be_grid(numbers: &[&Number]) -> bool {
    let parts: Option<Vec<(&str, &str)>> =
        numbers.iter().map(|number| number.fraction().and(number.text.split_once('.'))).collect();
    let Some(parts) = parts else { return false };
    let rows: BTreeSet<&str> = parts.iter().map(|(row, _)| *row).collect();
    let columns: BTreeSet<&str> = parts.iter().map(|(_, column)| *column).collect();
    let mut values: Vec<f64> = numbers.iter().filter_map(|number| number.value()).collect();
    values.sort_unstable_by(f64::total_cmp);
    let steps = || values.array_windows().map(|[a, b]| b - a);
    let [least, most] = [steps().fold(f64::INFINITY, f64::min), steps().fold(0.0, f64::max)];
    rows.len() > 1 && columns.len() > 1 && rows.len() * columns.len() == parts.len() && most > EVEN * least
}

/// How the numbers of sorted files were understood, if they may mean something else.
pub fn ambiguity(sorted: &[PathBuf]) -> Option<String> {
    let (understood, _) = read(sorted);
    let names: Vec<Name> = sorted.iter().map(|path| Name::of(path)).collect();
    let column = counting(&names)?;
    let numbers = column_of(&names, column);
    if may_be_thousands(&numbers) {
        let at = numbers.iter().position(|number| number.fraction().is_some())?;
        let (name, value) = (file_name(&sorted[at]), &understood[at].numbers[column].text);
        let otherwise = match value.contains('.') {
            true => "are counts, write them without separators of thousands",
            false => "are decimals, write all with as many decimals",
        };
        return Some(format!("{name} counts as number {value}: if the numbers {otherwise}"));
    }
    may_be_grid(&numbers).then(|| {
        format!(
            "the names, {} to {}, may number the places of a grid: the images count as one series in the order of these numbers; if they \
             show several places, move those of one place into a folder and give that",
            file_name(&sorted[0]),
            file_name(&sorted[sorted.len() - 1])
        )
    })
}

/// Two files whose names differ only in how a number is written: `z1` and `z01`, `z1` and `z1.0`. Where names state the focus, no
/// other number counts: `z1_t3` and `z01_t4`.
pub fn same_number(paths: &[PathBuf]) -> Option<[&PathBuf; 2]> {
    let (names, values) = read(paths);
    let decimal = values.map(|values| values.column);
    let of_focus = focus(&names);
    let written = |(column, number): (usize, &Number)| {
        let text = number.text.trim_start_matches('0');
        let is_decimal = decimal == Some(column) && number.fraction().is_some();
        let text = if is_decimal { text.trim_end_matches('0').trim_end_matches('.') } else { text };
        (number.sign == Some('-'), text.to_owned())
    };
    let mut seen = HashMap::new();
    names.iter().zip(paths).find_map(|(name, path)| {
        let all = name.numbers.iter().enumerate();
        let compared = all.filter(|(column, _)| of_focus.is_none_or(|focus| focus == *column));
        let numbers: Vec<(bool, String)> = compared.map(written).collect();
        let has_numbers = !numbers.is_empty();
        seen.insert((name.texts.clone(), numbers), path).filter(|_| has_numbers).map(|other| [other, path])
    })
}

impl Values {
    pub fn order(&self, a: &Name, b: &Name) -> Ordering {
        let before = a.numbers.iter().zip(&b.numbers).take(if self.is_focus { 0 } else { self.column });
        let before = before.map(|(a, b)| natural(&a.text, &b.text)).find(|order| order.is_ne());
        let value = |name: &Name| {
            let Number { sign, text } = &name.numbers[self.column];
            let magnitude: f64 = text.parse().unwrap_or(f64::INFINITY);
            if self.signed && *sign == Some('-') { -magnitude } else { magnitude }
        };
        before.unwrap_or_else(|| value(a).partial_cmp(&value(b)).unwrap_or(Ordering::Equal))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sorted(names: &[&str]) -> Vec<PathBuf> {
        let mut paths: Vec<PathBuf> = names.iter().map(PathBuf::from).collect();
        crate::order::sort(&mut paths);
        paths
    }

    #[test]
    fn thousands_and_decimals_are_told_by_even_steps_and_the_reading_is_stated() {
        for (names, expected) in [
            (&["900.tif", "950.tif", "1,000.tif", "1,050.tif"][..], "1,000.tif counts as number 1000:"),
            (&["z998.tif", "z999.tif", "z1.001.tif", "z1.003.tif"], "z1.001.tif counts as number 1001:"),
            (&["z1.tif", "z1,125.tif", "z2.tif"], "z1,125.tif counts as number 1.125:"),
        ] {
            let mut reversed = names.to_vec();
            reversed.reverse();
            let found = sorted(&reversed);
            assert_eq!(found, names.iter().map(PathBuf::from).collect::<Vec<_>>());
            let remark = ambiguity(&found).unwrap();
            assert!(remark.starts_with(expected), "{remark}");
        }
        for names in [
            &["0.tif", "0,125.tif", "0,25.tif", "1.tif"][..],
            &["1,000.tif", "1,500.tif", "2,000.tif"],
            &["z1.0.tif", "z1.5.tif", "z2.0.tif", "z2.5.tif"],
            &["z998.tif", "z999.tif", "z1000.tif"],
            &["fig1.1.tif", "fig1.9.tif", "fig1.10.tif"],
        ] {
            assert_eq!(ambiguity(&sorted(names)), None, "{names:?}");
        }
    }

    #[test]
    fn a_grid_is_stated() {
        for separator in [',', '.'] {
            let name = |index: u32| format!("tile_{}{separator}{}.tif", 1 + index / 3, 1 + index % 3);
            let names: Vec<String> = (0..9).map(name).collect();
            let names: Vec<&str> = names.iter().map(String::as_str).collect();
            let remark = ambiguity(&sorted(&names)).unwrap();
            assert!(remark.contains(names[0]) && remark.contains("a grid"), "{remark}");
        }
    }

    #[test]
    fn a_number_that_is_written_twice_is_found() {
        for names in [
            ["z01.tif", "z1.tif", "z2.tif"],
            ["z1.tif", "z1.0.tif", "z2.0.tif"],
            ["z1,0.tif", "z1.0.tif", "z2.0.tif"],
            ["z1_t3.tif", "z01_t4.tif", "z2_t5.tif"],
            ["z1um_3.tif", "z1.0um_4.tif", "z2.0um_5.tif"],
        ] {
            assert!(same_number(&sorted(&names)).is_some(), "{names:?}");
        }
        for names in [
            &["fig1.1.tif", "fig1.9.tif", "fig1.10.tif"][..],
            &["z-1.tif", "z0.tif", "z1.tif"],
            &["t1700000000123456789.tif", "t1700000000123456790.tif"],
            &["near.tif", "far.tif"],
            &["exp2_far_t3.tif", "exp2_near_t4.tif"],
            &["t3_z1.tif", "t03_z2.tif"],
            &["c1_7.tif", "c01_8.tif"],
        ] {
            assert_eq!(same_number(&sorted(names)), None, "{names:?}");
        }
    }
}

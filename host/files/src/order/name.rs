//! The numbers in a file's name and the text around them.

use std::{collections::HashSet, path::Path};

/// `pos_-0.25mm` has the texts `pos_` and `mm` around the number -0.25.
#[derive(Clone, PartialEq, Debug)]
pub(crate) struct Name {
    /// One more than numbers, without signs.
    pub texts: Vec<String>,
    pub numbers: Vec<Number>,
}

#[derive(Clone, PartialEq, Eq, Hash, Debug)]
pub(crate) struct Number {
    pub sign: Option<char>,
    /// Digits, a dot and digits if there is exactly one dot or comma (`2024.05.01` is three numbers), and an exponent with a sign.
    pub text: String,
}

impl Name {
    /// Of the name without its ending.
    pub fn of(path: &Path) -> Self {
        let stem = super::stem(path);
        let mut name = Self { texts: vec![String::new()], numbers: Vec::new() };
        let mut rest = stem.as_str();
        while let Some(next) = rest.chars().next() {
            let Some(last) = name.texts.last_mut() else { unreachable!("begins with one") };
            let (length, separator) = dotted(rest);
            if length == 0 {
                last.push(next);
                rest = &rest[next.len_utf8()..];
                continue;
            }
            let sign = last.ends_with(['+', '-']).then(|| last.pop()).flatten();
            let dots = rest[..length].matches(separator).count();
            let length = if dots < 2 { length + exponent(&rest[length..]) } else { length };
            let (numbers, after) = rest.split_at(length);
            if dots == 1 {
                name.push(sign, &numbers.replacen(',', ".", 1));
            } else {
                numbers.split(separator).enumerate().for_each(|(index, number)| match index {
                    0 => name.push(sign, number),
                    _ => name.push_after(separator, number),
                });
            }
            rest = after;
        }
        name
    }

    fn push(&mut self, sign: Option<char>, text: &str) {
        self.numbers.push(Number { sign, text: text.into() });
        self.texts.push(String::new());
    }

    fn push_after(&mut self, separator: char, text: &str) {
        if let Some(last) = self.texts.last_mut() {
            last.push(separator);
        }
        self.push(None, text);
    }
}

impl Number {
    pub fn value(&self) -> Option<f64> {
        let value: f64 = self.text.parse().ok()?;
        Some(if self.sign == Some('-') { -value } else { value })
    }

    pub fn fraction(&self) -> Option<&str> {
        Some(self.text.split_once('.')?.1).filter(|_| !self.has_exponent())
    }

    pub fn has_exponent(&self) -> bool {
        self.text.contains(['e', 'E'])
    }
}

/// Length of `digits(.digits)*` or `digits(,digits)*` at the beginning, and its separator.
fn dotted(text: &str) -> (usize, char) {
    let mut length = super::digits(text);
    let separator = if text[length..].starts_with(',') { ',' } else { '.' };
    while length > 0 && text[length..].starts_with(separator) {
        match super::digits(&text[length + 1..]) {
            0 => break,
            digits => length += 1 + digits,
        }
    }
    (length, separator)
}

/// Length of `e-05` or `e+10` at the beginning.
fn exponent(text: &str) -> usize {
    let digits =
        text.strip_prefix(['e', 'E']).and_then(|text| text.strip_prefix(['+', '-'])).map(super::digits);
    digits.filter(|digits| *digits > 0).map_or(0, |digits| 2 + digits)
}

/// The number that counts names with one pattern of texts: that of the [`focus`], else the last that differs.
pub(crate) fn counting(names: &[Name]) -> Option<usize> {
    focus(names).or_else(|| last_varying(names))
}

/// The number of the focus where names state it and it tells them apart: the last that differs, if a unit of length follows, else
/// one before `um` or `mm`, else one behind `z`. A time may follow (`z1_t12-05`).
pub(crate) fn focus(names: &[Name]) -> Option<usize> {
    let last = last_varying(names)?;
    let texts = &names[0].texts;
    let tells_apart = |column: &usize| {
        let mut seen = HashSet::new();
        names.iter().all(|name| seen.insert(&name.numbers[*column]))
    };
    let unit = |column: &usize| first_word(&texts[column + 1]);
    let is_length = |column: &usize| matches!(unit(column), "um" | "\u{b5}m" | "\u{3bc}m" | "mm");
    let is_z = |column: &usize| last_word(&texts[*column]).eq_ignore_ascii_case("z");
    let columns = || (0..=last).rev().filter(tells_apart);
    let of_last = columns().find(|column| *column == last && (is_length(column) || unit(column) == "nm"));
    of_last.or_else(|| columns().find(is_length)).or_else(|| columns().find(is_z))
}

/// The last number that differs between names with one pattern of texts.
fn last_varying(names: &[Name]) -> Option<usize> {
    let first = names.first()?;
    let one_pattern = names.iter().all(|name| name.texts == first.texts);
    let varies = |column: &usize| names.iter().any(|name| name.numbers[*column] != first.numbers[*column]);
    (0..first.numbers.len()).rev().filter(|_| one_pattern).find(varies)
}

pub(crate) fn first_word(text: &str) -> &str {
    text.split(|c: char| !c.is_alphabetic()).find(|word| !word.is_empty()).unwrap_or_default()
}

/// The word at the end of a text; empty behind another sign.
pub(crate) fn last_word(text: &str) -> &str {
    text.rsplit(|c: char| !c.is_alphabetic()).next().unwrap_or_default()
}

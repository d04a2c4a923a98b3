//! The numbers in a file's name and the text around them.

use std::path::Path;

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

/// The last number that differs between names with one pattern of texts.
pub(crate) fn last_varying(names: &[Name]) -> Option<usize> {
    let first = names.first()?;
    let one_pattern = names.iter().all(|name| name.texts == first.texts);
    let varies = |column: &usize| names.iter().any(|name| name.numbers[*column] != first.numbers[*column]);
    (0..first.numbers.len()).rev().filter(|_| one_pattern).find(varies)
}

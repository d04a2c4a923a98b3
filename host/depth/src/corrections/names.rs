//! The corrections by name, for the command line and messages.

use std::fmt;
use std::str::FromStr;

use super::{CorrectionError, Method};

impl Method {
    /// The names of all methods, such as "clsf, cdc or spline".
    pub fn names() -> String {
        Self::listed(Self::ALL.map(|method| method.name().to_owned()).to_vec(), "or")
    }

    /// Names of all methods with descriptions, for help texts.
    pub fn choices() -> String {
        let with_summary = |method: Self| format!("{} ({})", method.name(), method.summary());
        Self::listed(Self::ALL.map(with_summary).to_vec(), "or")
    }

    /// The names of the methods that a board can compute, such as "clsf and clsf-full".
    pub fn board_names() -> String {
        let on_board = Self::ALL.into_iter().filter(|method| method.board_form().is_some());
        Self::listed(on_board.map(|method| method.name().to_owned()).collect(), "and")
    }

    fn listed(mut words: Vec<String>, conjunction: &str) -> String {
        match words.pop() {
            Some(last) if !words.is_empty() => format!("{} {conjunction} {last}", words.join(", ")),
            last => last.unwrap_or_default(),
        }
    }
}

impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Method {
    type Err = CorrectionError;

    fn from_str(text: &str) -> Result<Self, CorrectionError> {
        let known = Self::ALL.into_iter().find(|method| method.name() == text.trim());
        known.ok_or_else(|| CorrectionError::UnknownMethod(text.to_owned()))
    }
}

use std::{fmt::Display, ops::RangeInclusive};

use crate::error::{Result, WorkflowError};

/// Number of threads, 0 = all cores. Thousands bring a machine to a halt.
pub(crate) const THREADS: RangeInclusive<usize> = 0..=1024;

pub(crate) fn within<T: PartialOrd + Display>(
    name: &'static str,
    value: T,
    range: &RangeInclusive<T>,
    unit: &str,
) -> Result<()> {
    if range.contains(&value) {
        return Ok(());
    }
    let space = if unit.is_empty() { "" } else { " " };
    let expected = format!("expected {} to {}{space}{unit}", range.start(), range.end());
    Err(WorkflowError::parameter(name, value, expected))
}

pub(crate) fn at_least(name: &'static str, value: usize, least: usize, unit: &str) -> Result<()> {
    match value >= least {
        true => Ok(()),
        false => Err(WorkflowError::parameter(name, value, format!("expected {least} {unit} or more"))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_belong_to_the_range() {
        assert!(within("elevation", -90.0, &(-90.0..=90.0), "deg").is_ok());
        for value in [90.5, f64::NAN] {
            let error = within("elevation", value, &(-90.0..=90.0), "deg").expect_err("outside");
            assert!(error.is_usage());
            assert_eq!(error.to_string(), format!("elevation {value}: expected -90 to 90 deg"));
        }
        let error = within("views", 0, &(1..=72), "").expect_err("outside");
        assert_eq!(error.to_string(), "views 0: expected 1 to 72");
        let error = at_least("window", 4, 5, "frames").expect_err("too few");
        assert_eq!(error.to_string(), "window 4: expected 5 frames or more");
    }
}

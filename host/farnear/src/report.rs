//! Figures on stdout: lines for people, one JSON object with `--json`.

use anyhow::Result;
use serde::Serialize;
use serde_json::Value;

/// Prints the fields of `figures`, in their order.
pub fn print<T: Serialize>(figures: &T, json: bool) -> Result<()> {
    let value = serde_json::to_value(figures)?;
    if json {
        println!("{}", serde_json::to_string(figures)?);
        return Ok(());
    }
    let Value::Object(_) = value else {
        println!("{value}");
        return Ok(());
    };
    // serde_json sorts a Value's keys; the text keeps the order of the struct.
    let text = toml::to_string(figures)?;
    print!("{text}");
    Ok(())
}

/// A number with so many decimals, so that a report does not claim more than is known.
pub fn rounded(value: f64, decimals: i32) -> f64 {
    let scale = 10f64.powi(decimals);
    (value * scale).round() / scale
}

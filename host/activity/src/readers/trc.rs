//! TRC files (Motion Analysis, OpenSim): tab-separated marker trajectories.

use super::markers::{MarkerError, Markers, unit_mm};
use crate::silhouette::capsule::Point3;

/// Reads a TRC file. OpenSim and most TRC files have y up; `y_up` turns them to z up (x stays, z becomes -y).
///
/// # Errors
/// Missing header lines, unknown units, rows of another length, values that are no numbers; each with its line.
pub fn read(text: &str, y_up: bool) -> Result<Markers, MarkerError> {
    let lines: Vec<&str> = text.lines().collect();
    let line = |n: usize| {
        lines
            .get(n)
            .copied()
            .ok_or_else(|| MarkerError::Kind { kind: "TRC", reason: format!("it has no line {}", n + 1) })
    };
    if !line(0)?.starts_with("PathFileType") {
        return Err(MarkerError::Kind {
            kind: "TRC",
            reason: "its first line does not start with PathFileType".into(),
        });
    }
    let keys: Vec<&str> = line(1)?.split('\t').map(str::trim).collect();
    let values: Vec<&str> = line(2)?.split('\t').map(str::trim).collect();
    let value = |key: &str| {
        let found = keys.iter().position(|k| *k == key).and_then(|index| values.get(index).copied());
        found.ok_or_else(|| MarkerError::Line { line: 3, reason: format!("no value of {key}") })
    };
    let number = |key: &str| {
        let text = value(key)?;
        text.parse::<f64>()
            .map_err(|_| MarkerError::Line { line: 3, reason: format!("{key} = `{text}` is no number") })
    };
    let unit = unit_mm(value("Units")?)?;
    let (rate_hz, count) = (number("DataRate")?, number("NumMarkers")?);
    let names: Vec<String> = line(3)?
        .split('\t')
        .skip(2)
        .map(str::trim)
        .filter(|name| !name.is_empty())
        .map(str::to_owned)
        .collect();
    if names.len() as f64 != count {
        return Err(MarkerError::Line {
            line: 4,
            reason: format!("{} marker names, NumMarkers says {count}", names.len()),
        });
    }
    let mut frames = Vec::new();
    for (index, row) in lines.iter().enumerate().skip(5) {
        // Trailing tabs are common; a row that is only white space separates header and data.
        let cells: Vec<&str> = row.trim_end_matches(['\t', '\r']).split('\t').collect();
        if row.trim().is_empty() {
            continue;
        }
        if cells.len() > 2 + 3 * names.len() {
            let reason = format!("{} values, expected {}", cells.len(), 2 + 3 * names.len());
            return Err(MarkerError::Line { line: index + 1, reason });
        }
        let mut markers = Vec::with_capacity(names.len());
        for m in 0..names.len() {
            let cell = |k: usize| cells.get(2 + 3 * m + k).map_or("", |cell| cell.trim());
            markers.push(point([cell(0), cell(1), cell(2)], unit, y_up, index + 1)?);
        }
        frames.push(markers);
    }
    Ok(Markers { names, rate_hz, frames })
}

/// Three cells; all empty (or not a number) is a hidden marker.
pub(super) fn point(
    cells: [&str; 3],
    unit: f64,
    y_up: bool,
    line: usize,
) -> Result<Option<Point3>, MarkerError> {
    if cells.iter().any(|cell| cell.is_empty() || cell.eq_ignore_ascii_case("nan")) {
        return Ok(None);
    }
    let mut p = [0.0; 3];
    for (value, cell) in p.iter_mut().zip(cells) {
        let parsed = cell.parse::<f64>();
        *value = unit
            * parsed.map_err(|_| MarkerError::Line { line, reason: format!("`{cell}` is no number") })?;
    }
    Ok(p.iter().all(|v| v.is_finite()).then(|| if y_up { [p[0], -p[2], p[1]] } else { p }))
}

//! C3D motion-capture files (c3d.org user guide): the 3-D points of every frame.
//!
//! Integer and floating-point data, Intel, DEC and SGI numbers. Analogue samples are read past. A point whose residual is
//! negative was hidden. Nothing in a damaged file makes this panic or ask for more memory than the file holds.

use super::markers::{MarkerError, Markers, unit_mm};
use std::collections::HashMap;

/// Size of the blocks in which everything is counted.
const BLOCK: usize = 512;

/// How numbers are stored.
#[derive(Clone, Copy, PartialEq)]
enum Processor {
    Intel,
    Dec,
    Sgi,
}

struct File<'a> {
    bytes: &'a [u8],
    processor: Processor,
}

impl File<'_> {
    fn raw<const N: usize>(&self, at: usize, what: &'static str) -> Result<[u8; N], MarkerError> {
        let found =
            at.checked_add(N).and_then(|end| self.bytes.get(at..end)).and_then(|raw| raw.try_into().ok());
        found.ok_or(MarkerError::Truncated {
            kind: "C3D",
            what,
            needed: at.saturating_add(N),
            found: self.bytes.len(),
        })
    }

    fn word(&self, at: usize, what: &'static str) -> Result<u16, MarkerError> {
        let raw = self.raw::<2>(at, what)?;
        Ok(if self.processor == Processor::Sgi { u16::from_be_bytes(raw) } else { u16::from_le_bytes(raw) })
    }

    fn real(&self, at: usize, what: &'static str) -> Result<f32, MarkerError> {
        let raw = self.raw::<4>(at, what)?;
        Ok(match self.processor {
            Processor::Intel => f32::from_le_bytes(raw),
            Processor::Sgi => f32::from_be_bytes(raw),
            // DEC's exponent counts two more, and its 16-bit halves are swapped.
            Processor::Dec => f32::from_le_bytes([raw[2], raw[3], raw[0], raw[1]]) / 4.0,
        })
    }
}

/// A parameter's dimensions and where its data stand.
struct Parameter {
    element: i8,
    dimensions: Vec<usize>,
    at: usize,
}

/// Reads the points of a C3D file.
///
/// # Errors
/// See [`MarkerError`]; a file without points is an error too.
pub fn read(bytes: &[u8]) -> Result<Markers, MarkerError> {
    let bad = |reason: String| MarkerError::Kind { kind: "C3D", reason };
    let (first_block, magic) = match bytes {
        [block, magic, ..] => (usize::from(*block), *magic),
        _ => return Err(bad("shorter than two bytes".into())),
    };
    if magic != 0x50 || first_block < 2 {
        return Err(bad(format!(
            "starts with {first_block:#04x} {magic:#04x}, expected the key 0x50 in second place"
        )));
    }
    let parameters_at = (first_block - 1) * BLOCK;
    let mut file = File { bytes, processor: Processor::Intel };
    let [_, _, _, processor] = file.raw::<4>(parameters_at, "the parameter section")?;
    file.processor = match processor {
        84 => Processor::Intel,
        85 => Processor::Dec,
        86 => Processor::Sgi,
        other => return Err(bad(format!("unknown processor {other}, expected 84, 85 or 86"))),
    };
    let parameters = parameters(&file, parameters_at + 4);
    let header = |word: usize| file.word(2 * (word - 1), "the header");
    let points = usize::from(header(2)?);
    let analogue = usize::from(header(3)?);
    let frames_by_header = usize::from(header(5)?).saturating_sub(usize::from(header(4)?)) + 1;
    let scale = file.real(12, "the header")?;
    let data_at = usize::from(header(9)?).max(1) * BLOCK - BLOCK;
    let rate_hz = f64::from(file.real(20, "the header")?);
    if points == 0 {
        return Err(bad("it holds no points".into()));
    }
    let unit =
        text_rows(&file, parameters.get("POINT:UNITS")).into_iter().next().unwrap_or_else(|| "mm".into());
    let unit = unit_mm(if unit.is_empty() { "mm" } else { &unit })?;
    let mut names = text_rows(&file, parameters.get("POINT:LABELS"));
    names.extend(text_rows(&file, parameters.get("POINT:LABELS2")));
    names.truncate(points);
    for index in names.len()..points {
        names.push(format!("*{}", index + 1));
    }
    let floating = scale < 0.0;
    let size = if floating { 4 } else { 2 };
    let stride = size * (4 * points + analogue);
    let room = bytes.len().saturating_sub(data_at) / stride;
    // The 16-bit header cannot count beyond 65535 frames; POINT:FRAMES or the file's length then tells.
    let frames = if frames_by_header >= 65_535 { room } else { frames_by_header };
    if frames > room {
        return Err(MarkerError::Truncated {
            kind: "C3D",
            what: "the frames",
            needed: data_at.saturating_add(frames.saturating_mul(stride)),
            found: bytes.len(),
        });
    }
    let mut all = Vec::with_capacity(frames);
    for frame in 0..frames {
        let mut markers = Vec::with_capacity(points);
        for point in 0..points {
            let at = data_at + frame * stride + 4 * size * point;
            let mut values = [0.0_f64; 4];
            for (k, value) in values.iter_mut().enumerate() {
                *value = if floating {
                    f64::from(file.real(at + 4 * k, "a frame")?)
                } else {
                    f64::from(file.word(at + 2 * k, "a frame")? as i16)
                        * if k < 3 { f64::from(scale) } else { 1.0 }
                };
            }
            let visible = values[3] >= 0.0 && values[..3].iter().all(|v| v.is_finite());
            markers.push(visible.then(|| [unit * values[0], unit * values[1], unit * values[2]]));
        }
        all.push(markers);
    }
    Ok(Markers { names, rate_hz: if rate_hz.is_finite() { rate_hz } else { 0.0 }, frames: all })
}

/// All parameters by `GROUP:NAME`; stops quietly where the section is damaged (points can be read without names).
fn parameters(file: &File, start: usize) -> HashMap<String, Parameter> {
    let mut groups: HashMap<i8, String> = HashMap::new();
    let mut found: Vec<(i8, String, Parameter)> = Vec::new();
    let mut at = start;
    while let Some((name_length, group)) = file.bytes.get(at).zip(file.bytes.get(at + 1)) {
        // A negative length marks a locked entry.
        let (length, group) = (usize::from((*name_length as i8).unsigned_abs()), *group as i8);
        let Some(name) = file.bytes.get(at + 2..at + 2 + length) else { break };
        if length == 0 || group == 0 {
            break;
        }
        let name = String::from_utf8_lossy(name).trim().to_ascii_uppercase();
        let next_at = at + 2 + length;
        let Ok(offset) = file.word(next_at, "a parameter") else { break };
        if group < 0 {
            groups.insert(-group.max(-127), name);
        } else if let (Some(&element), Some(&count)) =
            (file.bytes.get(next_at + 2), file.bytes.get(next_at + 3))
        {
            let from = next_at + 4;
            let Some(dimensions) = file.bytes.get(from..from + usize::from(count)) else { break };
            let dimensions: Vec<usize> = dimensions.iter().map(|&d| usize::from(d)).collect();
            let data = from + dimensions.len();
            found.push((group, name, Parameter { element: element as i8, dimensions, at: data }));
        }
        if offset == 0 {
            break;
        }
        at = next_at + usize::from(offset);
    }
    let named =
        |(group, name, parameter)| (format!("{}:{name}", groups.get(&group).map_or("", |g| g)), parameter);
    found.into_iter().map(named).collect()
}

/// The rows of a character parameter, trimmed.
fn text_rows(file: &File, parameter: Option<&Parameter>) -> Vec<String> {
    let Some(parameter) = parameter.filter(|p| p.element == -1) else { return Vec::new() };
    let width = parameter.dimensions.first().copied().unwrap_or(1).max(1);
    let rows = parameter
        .dimensions
        .get(1..)
        .map_or(1, |rest| rest.iter().fold(1_usize, |product, &d| product.saturating_mul(d)));
    let text = file.bytes.get(parameter.at..).unwrap_or(&[]);
    text.chunks_exact(width).take(rows).map(|row| String::from_utf8_lossy(row).trim().to_owned()).collect()
}

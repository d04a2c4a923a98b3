//! C3D motion capture (c3d.org user guide): 3-D points of every frame, integer and floating-point, Intel, DEC
//! and SGI. Analogue samples and model outputs are skipped; a negative residual means hidden.

use super::reader::Reader;
use super::recording::{Found, Known, RecordingError, Source, Up};
use crate::silhouette::{anatomy::without_prefix, capsule::Point3};
use std::collections::{HashMap, HashSet};

const BLOCK: usize = 512;

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
    fn raw<const N: usize>(&self, at: usize, what: &'static str) -> Result<[u8; N], RecordingError> {
        let found =
            at.checked_add(N).and_then(|end| self.bytes.get(at..end)).and_then(|raw| raw.try_into().ok());
        found.ok_or(RecordingError::Truncated {
            kind: "C3D",
            what,
            needed: at.saturating_add(N),
            found: self.bytes.len(),
        })
    }

    fn word(&self, at: usize, what: &'static str) -> Result<u16, RecordingError> {
        let raw = self.raw::<2>(at, what)?;
        Ok(if self.processor == Processor::Sgi { u16::from_be_bytes(raw) } else { u16::from_le_bytes(raw) })
    }

    fn real(&self, at: usize, what: &'static str) -> Result<f32, RecordingError> {
        let raw = self.raw::<4>(at, what)?;
        Ok(match self.processor {
            Processor::Intel => f32::from_le_bytes(raw),
            Processor::Sgi => f32::from_be_bytes(raw),
            // DEC exponents are two larger, and 16-bit halves are swapped.
            Processor::Dec => f32::from_le_bytes([raw[2], raw[3], raw[0], raw[1]]) / 4.0,
        })
    }
}

struct Parameter {
    element: i8,
    dimensions: Vec<usize>,
    at: usize,
}

pub const READER: Reader = Reader {
    name: "C3D",
    extensions: &["c3d"],
    about: "Vicon and most other systems, z up",
    read: |bytes, _| read(bytes),
};

/// Groups of `POINT` with labels of points that are not positions (Vicon's models, `POINT:TYPE_GROUPS`).
const MODEL_OUTPUTS: [&str; 6] = ["ANGLES", "FORCES", "MOMENTS", "POWERS", "REACTIONS", "SCALARS"];

/// Reads the points. `POINT:Y_SCREEN` states the upward axis; without it, nearly all files have z up.
pub fn read(bytes: &[u8]) -> Result<Found, RecordingError> {
    let (file, parameters_at) = opened(bytes)?;
    let parameters = parameters(&file, parameters_at + 4);
    let layout = Layout::read(&file)?;
    let unit = text_rows(&file, parameters.get("POINT:UNITS")).into_iter().next().unwrap_or_default();
    let mut names = text_rows(&file, parameters.get("POINT:LABELS"));
    names.extend(text_rows(&file, parameters.get("POINT:LABELS2")));
    names.truncate(layout.points);
    for index in names.len()..layout.points {
        names.push(format!("*{}", index + 1));
    }
    let (count, mut remarks) = layout.count(&file, &declared_frames(&file, &parameters));
    let mut frames = layout.frames(&file, count)?;
    let outputs: HashSet<String> = MODEL_OUTPUTS
        .iter()
        .flat_map(|group| text_rows(&file, parameters.get(&format!("POINT:{group}"))))
        .collect();
    let is_place = |name: &String| !outputs.contains(name) && !outputs.contains(without_prefix(name));
    let places: Vec<usize> = (0..names.len()).filter(|place| is_place(&names[*place])).collect();
    if !places.is_empty() && places.len() < names.len() {
        remarks.push(format!("{} model outputs (angles, moments) are not read", names.len() - places.len()));
        frames.iter_mut().for_each(|frame| *frame = places.iter().map(|place| frame[*place]).collect());
        names = places.iter().map(|place| names[*place].clone()).collect();
    }
    let screen = text_rows(&file, parameters.get("POINT:Y_SCREEN")).into_iter().next();
    let up = match screen.and_then(|axis| axis.parse().ok()) {
        Some(value) => Known { value, source: Source::File },
        None => Known { value: Up::Z, source: Source::Format },
    };
    Ok(Found {
        others: Vec::new(),
        planar: false,
        names,
        rate_hz: if layout.rate_hz.is_finite() { layout.rate_hz } else { 0.0 },
        frames,
        unit: Found::stated_unit(&unit),
        up,
        remarks,
    })
}

/// Checks key and processor; returns the file and the offset of its parameters.
fn opened(bytes: &[u8]) -> Result<(File<'_>, usize), RecordingError> {
    let bad = |reason: String| RecordingError::Kind { kind: "C3D", reason };
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
    Ok((file, parameters_at))
}

struct Layout {
    points: usize,
    /// Values per frame other than points.
    analogue: usize,
    frames_by_header: usize,
    /// Unit of integer data; negative for floating-point data.
    scale: f32,
    data_at: usize,
    rate_hz: f64,
}

impl Layout {
    fn read(file: &File) -> Result<Self, RecordingError> {
        let word = |number: usize| file.word(2 * (number - 1), "the header");
        let points = usize::from(word(2)?);
        if points == 0 {
            return Err(RecordingError::Kind { kind: "C3D", reason: "it holds no points".into() });
        }
        Ok(Self {
            points,
            analogue: usize::from(word(3)?),
            frames_by_header: usize::from(word(5)?.wrapping_sub(word(4)?)) + 1,
            scale: file.real(12, "the header")?,
            data_at: usize::from(word(9)?).max(1) * BLOCK - BLOCK,
            rate_hz: f64::from(file.real(20, "the header")?),
        })
    }

    fn sizes(&self) -> (usize, usize) {
        let size = if self.scale < 0.0 { 4 } else { 2 };
        (size, size * (4 * self.points + self.analogue))
    }

    /// Frames to read, and remarks. The header's 16-bit count wraps, and some programs trim only the header:
    /// a larger count in the parameters is used if the data suffice.
    fn count(&self, file: &File, declared: &[usize]) -> (usize, Vec<String>) {
        let (_, stride) = self.sizes();
        let bytes = file.bytes.len().saturating_sub(self.data_at);
        let room = bytes / stride;
        let fitting = declared.iter().copied().filter(|&frames| frames <= room).max();
        let frames = match (self.frames_by_header, fitting) {
            (65_535.., None) => room,
            (header, Some(fitting)) if header > room || fitting > header => fitting,
            (header, None) => header + room.saturating_sub(header) / 65_536 * 65_536,
            (header, Some(_)) => header,
        };
        let mut remarks = Vec::new();
        if frames != self.frames_by_header {
            remarks.push(format!(
                "the header counts {} frames, {frames} are declared elsewhere and read",
                self.frames_by_header
            ));
        }
        // The last block may be padded.
        let left = bytes.saturating_sub(frames.saturating_mul(stride));
        if left >= BLOCK.max(stride) {
            remarks.push(format!("the file has room for {room} frames, {frames} are declared and read"));
        }
        (frames, remarks)
    }

    fn frames(&self, file: &File, frames: usize) -> Result<Vec<Vec<Option<Point3>>>, RecordingError> {
        let (size, stride) = self.sizes();
        let room = file.bytes.len().saturating_sub(self.data_at) / stride;
        if frames > room {
            return Err(RecordingError::Truncated {
                kind: "C3D",
                what: "the frames",
                needed: self.data_at.saturating_add(frames.saturating_mul(stride)),
                found: file.bytes.len(),
            });
        }
        let frame = |frame: usize| {
            (0..self.points).map(|m| self.point(file, self.data_at + frame * stride + 4 * size * m)).collect()
        };
        (0..frames).map(frame).collect()
    }

    /// Coordinates and residual, negative if hidden.
    fn point(&self, file: &File, at: usize) -> Result<Option<Point3>, RecordingError> {
        let mut values = [0.0_f64; 4];
        for (k, value) in values.iter_mut().enumerate() {
            *value = if self.scale < 0.0 {
                f64::from(file.real(at + 4 * k, "a frame")?)
            } else {
                let scale = if k < 3 { f64::from(self.scale) } else { 1.0 };
                f64::from(file.word(at + 2 * k, "a frame")? as i16) * scale
            };
        }
        let [x, y, z, residual] = values;
        let visible = residual >= 0.0 && [x, y, z].iter().all(|v| v.is_finite());
        Ok(visible.then_some([x, y, z]))
    }
}

/// Parameters `TRIAL:ACTUAL_START_FIELD` to `ACTUAL_END_FIELD` and `POINT:FRAMES`: a real number, or one or two words,
/// low first.
fn declared_frames(file: &File, parameters: &HashMap<String, Parameter>) -> Vec<usize> {
    let word = |at: usize| file.word(at, "a parameter").ok().map(usize::from);
    let field = |name: &str| -> Option<usize> {
        let parameter = parameters.get(name)?;
        match parameter.element {
            2 => {
                let high = if parameter.dimensions.first() == Some(&2) { word(parameter.at + 2)? } else { 0 };
                Some(word(parameter.at)? + 65_536 * high)
            }
            4 => file.real(parameter.at, "a parameter").ok().map(|value| value as usize),
            _ => None,
        }
    };
    let trial = field("TRIAL:ACTUAL_END_FIELD")
        .zip(field("TRIAL:ACTUAL_START_FIELD"))
        .and_then(|(last, first)| last.checked_sub(first).map(|frames| frames.saturating_add(1)));
    trial.into_iter().chain(field("POINT:FRAMES")).collect()
}

/// Parameters by `GROUP:NAME`; stops at damage, because points need no names.
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

fn text_rows(file: &File, parameter: Option<&Parameter>) -> Vec<String> {
    let Some(parameter) = parameter.filter(|p| p.element == -1) else { return Vec::new() };
    let width = parameter.dimensions.first().copied().unwrap_or(1).max(1);
    let rows = parameter
        .dimensions
        .get(1..)
        .map_or(1, |rest| rest.iter().fold(1_usize, |product, &d| product.saturating_mul(d)));
    if parameter.dimensions.contains(&0) {
        return Vec::new();
    }
    let text = file.bytes.get(parameter.at..).unwrap_or(&[]);
    text.chunks_exact(width).take(rows).map(|row| String::from_utf8_lossy(row).trim().to_owned()).collect()
}

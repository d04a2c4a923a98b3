//! Recordings of named points over time, the common form of all motion-capture files. A reader returns the
//! file's own unit and axes with their source ([`Found`]); [`Found::settled`] converts to mm and z up.

use super::{body, keypoints::aspect::Aspect, people::prefixed, posture};
use crate::silhouette::{anatomy::Anatomy, capsule::Point3};
use std::borrow::Cow;
use std::collections::HashMap;
use std::fmt;
use std::str::FromStr;

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unit {
    pub mm: f64,
}

impl Unit {
    /// Read name, millimetres, shown name. The last is the CMU library's, whose skeletons count 1/0.45 inch.
    pub const NAMED: [(&str, f64, &str); 5] = [
        ("mm", 1.0, "millimetres"),
        ("cm", 10.0, "centimetres"),
        ("m", 1000.0, "metres"),
        ("in", 25.4, "inches"),
        ("cmu", 25.4 / 0.45, "units of 56.444 mm (1/0.45 inch, the CMU library's)"),
    ];

    pub const MM: Self = Self { mm: 1.0 };

    /// Of a guess by the size of a body, of which more than six digits are not known.
    pub(super) fn rounded(mm: f64) -> Self {
        Self { mm: format!("{mm:.5e}").parse().unwrap_or(mm) }
    }

    pub fn named(name: &str) -> Result<Self, RecordingError> {
        let edge = |c: char| c.is_whitespace() || matches!(c, '\0' | '[' | ']' | '(' | ')' | '.');
        let name = name.trim_matches(edge).to_ascii_lowercase();
        let short = match name.strip_suffix('s').unwrap_or(&name) {
            "millimeter" | "millimetre" => "mm",
            "centimeter" | "centimetre" => "cm",
            "meter" | "metre" => "m",
            "inch" | "inche" => "in",
            // Cut to four characters in some C3D files.
            "mill" => "mm",
            "cent" => "cm",
            "mete" | "metr" => "m",
            other => other,
        };
        let found = Self::NAMED.iter().find(|(known, _, _)| *known == short);
        found.map(|&(_, mm, _)| Self { mm }).ok_or(RecordingError::Unit(name))
    }
}

impl fmt::Display for Unit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match Self::NAMED.iter().find(|(_, mm, _)| *mm == self.mm) {
            Some((_, _, shown)) => f.write_str(shown),
            None => write!(f, "units of {} mm", self.mm),
        }
    }
}

impl FromStr for Unit {
    type Err = RecordingError;

    /// A name ([`Unit::named`]) or a positive number of millimetres.
    fn from_str(text: &str) -> Result<Self, RecordingError> {
        Self::named(text).or_else(|unknown| match text.trim().parse::<f64>() {
            Ok(mm) if mm.is_finite() && mm > 0.0 => Ok(Self { mm }),
            _ => Err(unknown),
        })
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Up {
    X,
    Y,
    Z,
    MinusX,
    MinusY,
    MinusZ,
}

impl Up {
    /// Read and shown name.
    pub const NAMED: [(&str, Self); 6] = [
        ("x", Self::X),
        ("y", Self::Y),
        ("z", Self::Z),
        ("-x", Self::MinusX),
        ("-y", Self::MinusY),
        ("-z", Self::MinusZ),
    ];

    /// Rotates (never mirrors) a point with this axis up to z up.
    pub fn to_z(self, [x, y, z]: Point3) -> Point3 {
        match self {
            Self::X => [y, z, x],
            Self::Y => [x, -z, y],
            Self::Z => [x, y, z],
            Self::MinusX => [y, -z, -x],
            Self::MinusY => [x, z, -y],
            Self::MinusZ => [x, -y, -z],
        }
    }

    /// The direction that a vector points along most; y for zero.
    pub fn along(vector: Point3) -> Self {
        let mut best = Self::Y;
        for (_, up) in Self::NAMED {
            if up.height(vector) > best.height(vector) {
                best = up;
            }
        }
        best
    }

    pub fn height(self, point: Point3) -> f64 {
        self.to_z(point)[2]
    }

    pub fn reversed(self) -> Self {
        match self {
            Self::X => Self::MinusX,
            Self::Y => Self::MinusY,
            Self::Z => Self::MinusZ,
            Self::MinusX => Self::X,
            Self::MinusY => Self::Y,
            Self::MinusZ => Self::Z,
        }
    }
}

impl fmt::Display for Up {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = Self::NAMED.iter().find(|(_, up)| up == self).map_or("", |(name, _)| name);
        f.write_str(name)
    }
}

impl FromStr for Up {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let name = text.trim().trim_start_matches('+').to_ascii_lowercase();
        let found = Self::NAMED.iter().find(|(known, _)| *known == name);
        found
            .map(|(_, up)| *up)
            .ok_or_else(|| format!("unknown axis `{text}`: expected x, y, z, -x, -y or -z"))
    }
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Source {
    Caller,
    File,
    Format,
    Unknown {
        stated: String,
    },
    /// Not stated in the file.
    Guess {
        reason: String,
        /// Whether the alternatives are clearly worse.
        sure: bool,
    },
}

impl Source {
    pub fn is_guess(&self) -> bool {
        matches!(self, Self::Guess { .. })
    }
}

#[derive(Clone, Debug, PartialEq)]
pub struct Known<T> {
    pub value: T,
    pub source: Source,
}

impl<T> Known<T> {
    fn unless(self, named: Option<T>) -> Self {
        match named {
            Some(value) => Self { value, source: Source::Caller },
            None => self,
        }
    }
}

/// Values that override the file's.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Choices {
    pub unit: Option<Unit>,
    pub up: Option<Up>,
    /// Which of several people, from 1; `None` selects the actor.
    pub person: Option<usize>,
    /// Of the picture, for keypoints in parts of its sides.
    pub aspect: Option<Aspect>,
}

#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    pub names: Vec<String>,
    /// 0 if the file does not state it.
    pub rate_hz: f64,
    /// `frames[f][m]`: point m in frame f.
    pub frames: Vec<Vec<Option<Point3>>>,
    pub others: Vec<Vec<Vec<Option<Point3>>>>,
    /// Points are in the plane of x and y.
    pub planar: bool,
    pub unit: Known<Unit>,
    pub up: Known<Up>,
    pub remarks: Vec<String>,
}

impl Found {
    /// The caller has to name a unit that is not known. Without one, lengths are millimetres.
    pub(super) fn stated_unit(stated: &str) -> Known<Unit> {
        if stated.is_empty() {
            return Known { value: Unit::MM, source: Source::Format };
        }
        match Unit::named(stated) {
            Ok(value) => Known { value, source: Source::File },
            Err(_) => Known { value: Unit::MM, source: Source::Unknown { stated: stated.to_owned() } },
        }
    }

    /// Converts to millimetres, z up. Hides non-finite points, 0, 0, 0 and other constants for missing points.
    pub fn settled(self, choices: Choices) -> Recording {
        let (mut names, mut frames, mut remarks) = (self.names, self.frames, self.remarks);
        let hidden = body::hide_zeros(&mut frames);
        if hidden > 0 {
            remarks.push(format!("{hidden} points at exactly 0, 0, 0 are treated as missing markers"));
        }
        if let Some((count, [x, y, z])) = body::hide_constants(&mut frames) {
            remarks.push(format!("{count} points at {x}, {y}, {z} are treated as missing markers"));
        }
        let repeated = repeated(&names);
        if !repeated.is_empty() {
            remarks.push(format!(
                "points share a name ({}): in each frame the last visible one is used; rename the others",
                repeated.join(", ")
            ));
        }
        remarks.extend(choices.aspect.filter(|_| !self.planar).map(Aspect::ignored));
        let with_prefixes = prefixed(&names);
        let anatomy = Anatomy::of(with_prefixes.as_deref().unwrap_or(&names));
        body::add_neck(&mut names, &anatomy.aliases, &mut frames);
        let (unit, doubtful) = body::plausible(self.unit.unless(choices.unit), &frames, &anatomy.body);
        let (up, inverted) = posture::checked(self.up.unless(choices.up), &frames, &anatomy, self.planar);
        let lying = posture::lying(up.value, &frames, &anatomy, self.planar);
        for point in frames.iter_mut().flatten() {
            let settled = point.map(|p| up.value.to_z(p.map(|v| unit.value.mm * v)));
            *point = settled.filter(|p| p.iter().all(|v| v.is_finite()));
        }
        remarks.extend(doubtful.into_iter().chain(anatomy.remark).chain(inverted).chain(lying));
        Recording {
            names,
            rate_hz: self.rate_hz,
            frames,
            planar: self.planar,
            aliases: anatomy.aliases,
            unit,
            up,
            remarks,
        }
    }
}

/// Named points (markers or joints) over time, `None` = hidden: millimetres, z up.
#[derive(Clone, Debug, PartialEq)]
pub struct Recording {
    pub names: Vec<String>,
    pub rate_hz: f64,
    pub frames: Vec<Vec<Option<Point3>>>,
    /// Seen from one side: points are in the plane of x and z, and no other view can be drawn.
    pub planar: bool,
    /// Names without a prefix, and names of built-in templates.
    aliases: Vec<(usize, String)>,
    pub unit: Known<Unit>,
    pub up: Known<Up>,
    remarks: Vec<String>,
}

impl Recording {
    /// Positions of a frame without hidden points, by name with and without a prefix (`Nick:LASI`, `LASI`).
    pub fn by_name(&self, frame: usize) -> HashMap<&str, Point3> {
        let points = self.frames.get(frame).map_or(&[][..], Vec::as_slice);
        let names = self.names.iter().enumerate();
        let aliases = self.aliases.iter().map(|(place, alias)| (*place, alias));
        names
            .chain(aliases)
            .filter_map(|(place, name)| Some((name.as_str(), (*points.get(place)?)?)))
            .collect()
    }

    /// Names of all points, with those of built-in templates.
    pub fn known_names(&self) -> Vec<String> {
        self.names.iter().chain(self.aliases.iter().map(|(_, alias)| alias)).cloned().collect()
    }

    /// Guesses about the file, one sentence each; the caller can override them.
    pub fn remarks(&self) -> Vec<String> {
        let remark = |what: String, source: &Source| match source {
            Source::Guess { reason, sure } => {
                Some(format!("{what}: a{} guess, {reason}", if *sure { "" } else { " doubtful" }))
            }
            Source::Caller | Source::File | Source::Format | Source::Unknown { .. } => None,
        };
        let unit = remark(format!("lengths are taken as {}", self.unit.value), &self.unit.source);
        let up = remark(format!("{} is taken as up", self.up.value), &self.up.source);
        unit.into_iter().chain(up).chain(self.remarks.iter().cloned()).collect()
    }
}

#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RecordingError {
    #[error("no motion-capture format ends with `.{found}`: expected {known}")]
    Extension { found: String, known: String },
    #[error("not a {kind} file: {reason}")]
    Kind { kind: &'static str, reason: String },
    #[error("the {kind} file ends within {what}: {needed} bytes are needed, {found} are there")]
    Truncated { kind: &'static str, what: &'static str, needed: usize, found: usize },
    /// Only a licensed body model converts pose parameters to joints.
    #[error(
        "it holds pose parameters of {model} (array `{array}`, {shape}) and no joint positions, which need the body model file \
         {file}; write the joints that it gives to an array `joints` of frames x joints x 3"
    )]
    BodyModel { array: String, shape: String, model: &'static str, file: String },
    /// In one of several files.
    #[error("{name}: {error}")]
    File { name: String, error: Box<Self> },
    #[error("no person {wanted}: {found} are in the file")]
    Person { wanted: usize, found: usize },
    #[error("line {line}: {reason}")]
    Line { line: usize, reason: String },
    #[error(
        "unknown unit of length `{0}`: expected mm, cm, m, in, cmu (56.444 mm) or a number of millimetres (--units)"
    )]
    Unit(String),
    #[error(
        "--up {0} does not fit keypoints in two dimensions: expected -y, y, or -x or x where the file has y before x"
    )]
    PlanarUp(Up),
}

/// Compares the frames of a file with the number that it states. Some exporters count one too many, which gives a remark; a
/// file that lacks more is an error.
pub(super) fn promised_frames(what: &str, promised: f64, found: usize) -> Result<Option<String>, String> {
    let missing = promised - found as f64;
    if missing > 1.0 {
        return Err(format!(
            "{what} promises {promised} frames, the file ends after {found}: it was cut short"
        ));
    }
    Ok((missing > 0.0).then(|| format!("{what} promises {promised} frames, the file has {found}")))
}

/// Refuses a table that ends in the middle of its last row. Programs that leave out empty cells at the end of a row do so in
/// other rows, too. A row is its line and its number of cells.
pub(super) fn check_last_row(rows: &[(usize, usize)], width: usize) -> Result<(), RecordingError> {
    match rows.split_last() {
        Some((&(line, cells), others))
            if cells < width && others.iter().all(|(_, cells)| *cells >= width) =>
        {
            let reason = format!("{cells} values, the header names {width}: the file was cut short");
            Err(RecordingError::Line { line, reason })
        }
        _ => Ok(()),
    }
}

/// Names that several points have.
fn repeated(names: &[String]) -> Vec<&str> {
    let mut sorted: Vec<&str> = names.iter().map(String::as_str).filter(|name| !name.is_empty()).collect();
    sorted.sort_unstable();
    sorted.chunk_by(|a, b| a == b).filter(|same| same.len() > 1).map(|same| same[0]).collect()
}

/// A number with a point or, as programs of many countries write it, a comma before its decimals.
pub(super) fn number(text: &str) -> Option<f64> {
    text.parse().or_else(|_| text.replacen(',', ".", 1).parse()).ok()
}

/// Text without a byte-order mark, with line feeds at all ends of lines; Latin-1 if it is not UTF-8. Errors have the
/// line of the first other byte.
pub(super) fn text(bytes: &[u8]) -> Result<Cow<'_, str>, RecordingError> {
    let text = decoded(bytes)?;
    Ok(if text.contains('\r') { text.replace("\r\n", "\n").replace('\r', "\n").into() } else { text })
}

fn decoded(bytes: &[u8]) -> Result<Cow<'_, str>, RecordingError> {
    let control = |byte: &u8| byte.is_ascii_control() && !byte.is_ascii_whitespace();
    match std::str::from_utf8(bytes) {
        Ok(text) => Ok(text.trim_start_matches('\u{feff}').into()),
        Err(_) if !bytes.iter().any(control) => Ok(bytes.iter().map(|&byte| char::from(byte)).collect()),
        Err(error) => {
            let at = error.valid_up_to();
            let line = 1 + bytes.iter().take(at).filter(|&&byte| byte == b'\n').count();
            let byte = bytes.get(at).copied().unwrap_or_default();
            let reason = format!("byte {byte:#04x} is not text, expected a file of UTF-8 text");
            Err(RecordingError::Line { line, reason })
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(point: Point3) -> Found {
        let guess = Source::Guess { reason: "for it is 1.7 m tall".into(), sure: true };
        Found {
            names: vec!["Nick:HEAD".into()],
            rate_hz: 0.0,
            frames: vec![vec![Some(point)], vec![None], vec![Some([f64::MAX, 0.0, 0.0])]],
            others: Vec::new(),
            planar: false,
            unit: Known { value: Unit { mm: 10.0 }, source: guess },
            up: Known { value: Up::Y, source: Source::Format },
            remarks: Vec::new(),
        }
    }

    #[test]
    fn recordings_are_converted_to_millimetres_and_z_up_unless_the_caller_decides() {
        let by_itself = found([1.0, 2.0, 3.0]).settled(Choices::default());
        assert_eq!(by_itself.frames[0], vec![Some([10.0, -30.0, 20.0])]);
        assert_eq!(by_itself.by_name(0)["HEAD"], by_itself.by_name(0)["Nick:HEAD"]);
        assert_eq!(
            by_itself.remarks(),
            ["lengths are taken as centimetres: a guess, for it is 1.7 m tall"],
            "what the format fixes is not a guess"
        );
        assert_eq!(by_itself.frames[2], vec![None], "what overflows is hidden");
        let given = found([1.0, 2.0, 3.0]).settled(Choices {
            unit: Some(Unit::MM),
            up: Some(Up::X),
            ..Choices::default()
        });
        assert_eq!(given.frames[0], vec![Some([2.0, 3.0, 1.0])]);
        assert_eq!((given.unit.source.clone(), given.remarks().len()), (Source::Caller, 0));
    }

    #[test]
    fn points_of_one_name_are_reported() {
        let named = |name: &str| {
            let names = ["LASI", name, "", ""].map(str::to_owned).to_vec();
            Found { names, frames: vec![vec![Some([1.0, 2.0, 3.0]); 4]], ..found([0.0; 3]) }
        };
        let remarks = |name: &str| {
            named(name).settled(Choices { unit: Some(Unit::MM), ..Choices::default() }).remarks()
        };
        assert!(remarks("LASI").iter().any(|remark| remark.contains("share a name (LASI)")));
        assert!(remarks("RASI").iter().all(|remark| !remark.contains("share a name")));
    }

    #[test]
    fn conversion_to_z_up_stays_right_handed() {
        // A right-handed frame stays one: x cross y is z, for every upward axis.
        for (_, up) in Up::NAMED {
            let [x, y, z] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|p| up.to_z(p));
            let cross = [x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]];
            assert_eq!(cross, z, "{up}");
            assert_eq!(up.to_string().parse(), Ok(up));
            assert_eq!(up.reversed().reversed(), up);
        }
    }

    #[test]
    fn units_are_read_and_shown() {
        for (text, mm) in
            [("Meters", 1000.0), ("metre", 1000.0), ("[m]", 1000.0), ("millimetre", 1.0), ("inch", 25.4)]
        {
            assert_eq!(text.parse(), Ok(Unit { mm }), "{text}");
        }
        assert!("furlong".parse::<Unit>().is_err_and(|error| error.to_string().contains("--units")));
        assert_eq!("cmu".parse::<Unit>().map(|unit| (unit.mm * 1000.0).round()), Ok(56_444.0));
        assert_eq!("5.5".parse::<Unit>().map(|unit| unit.to_string()), Ok("units of 5.5 mm".into()));
        for bad in ["furlong", "-2", "0", "inf", ""] {
            assert_eq!(bad.parse::<Unit>(), Err(RecordingError::Unit(bad.into())));
        }
    }

    #[test]
    fn binary_data_is_reported_with_the_line() {
        assert_eq!(text(b"\xef\xbb\xbfabc"), Ok("abc".into()));
        assert_eq!(text(b"M\xfcller"), Ok("M\u{fc}ller".into()));
        let error = text(b"one\ntwo\n\xff\x00").expect_err("not text");
        assert!(error.to_string().starts_with("line 3: byte 0xff"), "{error}");
    }
}

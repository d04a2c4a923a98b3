//! The recorded properties of a file.

use std::path::Path;

use farnear_files::map;
use image::GenericImageView;
use serde::{Deserialize, Serialize};

const VALUES: usize = 9;
/// Relative and absolute tolerance between kinds of processors: hundredths of a millimetre in maps, a grey level or a
/// plotted pixel in pictures.
const TOLERANCE: [f64; 2] = [1e-4, 5e-3];
const PICTURE_TOLERANCE: [f64; 2] = [0.0, 1.5];

/// Recorded bytes of a text's first line, of a binary file's header, and of a TIFF's: later bytes depend on rounding.
const HEAD: usize = 100;
const MARK: usize = 8;
const TIFF_MARK: usize = 4;

#[derive(Serialize, Deserialize, PartialEq, Debug)]
pub struct Digest {
    /// Path relative to the story's folder.
    pub name: String,
    /// Independent of rounding.
    form: String,
    values: Vec<f64>,
    /// FNV-1a, 64 bits, over all bytes.
    hash: String,
}

impl Digest {
    pub fn of(name: &str, bytes: &[u8]) -> Self {
        let ending = Path::new(name).extension().unwrap_or_default().to_string_lossy();
        let (form, values) = match &*ending {
            "npy" | "tiff" => of_map(name, bytes),
            "png" | "jpg" => of_picture(bytes),
            "toml" | "svg" | "csv" | "json" | "txt" => {
                let text = String::from_utf8_lossy(bytes);
                // Inputs that differ by rounding between kinds of processors.
                let of_input = |line: &str| line.starts_with("sha256 = ") || line.starts_with("bytes = ");
                let same: String = text.split_inclusive('\n').filter(|line| !of_input(line)).collect();
                let (numbers, rest) = numbers_and_rest(&same);
                (
                    format!("{} numbers in a text {:016x}", numbers.len(), hash(rest.as_bytes())),
                    some_of(&numbers),
                )
            }
            _ => {
                let most = if bytes.contains(&0) { MARK } else { HEAD };
                (format!("{} bytes that begin {}", bytes.len(), beginning(bytes, most)), Vec::new())
            }
        };
        Self { name: name.into(), form, values, hash: format!("{:016x}", hash(bytes)) }
    }

    /// Whether it can be the same file from another kind of processor.
    pub fn is_close_to(&self, recorded: &Self) -> bool {
        let pictures = [".png", ".svg", ".jpg"].iter().any(|ending| self.name.ends_with(ending));
        let [relative, absolute] = if pictures { PICTURE_TOLERANCE } else { TOLERANCE };
        let mut pairs = recorded.values.iter().zip(&self.values);
        self.form == recorded.form
            && self.values.len() == recorded.values.len()
            && pairs.all(|(a, b)| (a - b).abs() <= absolute + relative * a.abs())
    }
}

fn of_map(name: &str, bytes: &[u8]) -> (String, Vec<f64>) {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join(Path::new(name).file_name().unwrap());
    std::fs::write(&file, bytes).unwrap();
    let map = map::read(&file).unwrap();
    let values: Vec<f64> =
        map.iter().filter(|value| value.is_finite()).map(|value| f64::from(*value)).collect();
    let (height, width) = map.dim();
    // A NumPy file begins with a line of text; in a TIFF values may follow the magic number directly.
    let head = if name.ends_with(".npy") { HEAD } else { TIFF_MARK };
    (
        format!("map of {width}x{height}, {} with a value, in {}", values.len(), beginning(bytes, head)),
        some_of(&values),
    )
}

fn of_picture(bytes: &[u8]) -> (String, Vec<f64>) {
    let picture = image::load_from_memory(bytes).unwrap();
    let (width, height) = picture.dimensions();
    let form = format!("picture of {width}x{height} {:?}", picture.color());
    let values: Vec<f64> = match picture.as_luma16() {
        // The last bits of the codes' range may differ.
        Some(codes) => codes.iter().map(|code| f64::from(*code) / 256.0).collect(),
        None => picture.into_bytes().into_iter().map(f64::from).collect(),
    };
    (form, some_of(&values))
}

fn some_of(values: &[f64]) -> Vec<f64> {
    let Some(last) = values.len().checked_sub(1) else { return Vec::new() };
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let places = (0..VALUES).map(|place| place * last / (VALUES - 1));
    std::iter::once(mean).chain(places.map(|place| values[place])).collect()
}

fn beginning(bytes: &[u8], most: usize) -> String {
    let line = bytes.split(|byte| *byte == b'\n').next().unwrap_or_default();
    let line: Vec<u8> = line.iter().take(most).copied().collect();
    line.escape_ascii().to_string().trim_end().into()
}

/// The numbers in a text, and the text with `#` in their places.
pub fn numbers_and_rest(text: &str) -> (Vec<f64>, String) {
    let (mut numbers, mut rest) = (Vec::new(), String::new());
    let mut after_word = false;
    let mut left = text;
    while let Some(first) = left.chars().next() {
        let run = left.find(|c: char| !c.is_ascii_digit() && !"+-.eE".contains(c)).unwrap_or(left.len());
        let starts =
            first.is_ascii_digit() || first == '-' && left[1..].starts_with(|c: char| c.is_ascii_digit());
        let number = (1..=run).rev().find_map(|length| Some((length, left[..length].parse::<f64>().ok()?)));
        let length = match number {
            Some((length, number)) if starts && !after_word => {
                numbers.push(number);
                rest.push('#');
                length
            }
            _ => {
                rest.push(first);
                first.len_utf8()
            }
        };
        after_word = rest.ends_with(|c: char| c.is_alphanumeric() || c == '_');
        left = &left[length..];
    }
    (numbers, rest)
}

pub fn hash(bytes: &[u8]) -> u64 {
    bytes
        .iter()
        .fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(*byte)).wrapping_mul(0x100_0000_01b3))
}

/// Kind of this machine, as far as floating-point sums depend on it.
pub fn machine() -> String {
    #[cfg(target_arch = "x86_64")]
    let units = [
        ("avx2", is_x86_feature_detected!("avx2")),
        ("fma", is_x86_feature_detected!("fma")),
        ("avx512f", is_x86_feature_detected!("avx512f")),
    ];
    #[cfg(not(target_arch = "x86_64"))]
    let units: [(&str, bool); 0] = [];
    let units: String =
        units.iter().filter(|(_, there)| *there).map(|(name, _)| format!(" {name}")).collect();
    format!("{} {}{}{units}", std::env::consts::OS, std::env::consts::ARCH, maker())
}

/// The processor's maker on Linux: estimates of reciprocals differ in their last bits from one to the other.
fn maker() -> String {
    let text = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let maker = text.lines().find_map(|line| line.strip_prefix("vendor_id")?.split_whitespace().last());
    maker.map_or(String::new(), |maker| format!(" {maker}"))
}

#[test]
fn numbers_are_distinguished_from_words() {
    let (numbers, rest) = numbers_and_rest("[p1]\nk = -4.5e-3, x2 = 7. -b M3,4");
    assert_eq!(numbers, [-4.5e-3, 7.0, 4.0]);
    assert_eq!(rest, "[p1]\nk = #, x2 = # -b M3,#");
}

//! MATLAB 5 MAT-files (MathWorks, "MAT-File Format", rev. 2016), plain or zlib-compressed: numeric and cell
//! arrays, as in skeleton data sets. f64 values, first index fastest; other classes become [`Array::Other`].

use flate2::read::ZlibDecoder;
use std::io::Read;

#[derive(Clone, Debug, PartialEq)]
pub enum Array {
    /// First index fastest.
    Numeric {
        dimensions: Vec<usize>,
        values: Vec<f64>,
    },
    Cell {
        dimensions: Vec<usize>,
        cells: Vec<Array>,
    },
    /// Number of an unsupported class.
    Other(u8),
}

#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum MatlabError {
    #[error("not a MATLAB 5 MAT-file: {0}")]
    Header(&'static str),
    #[error("the file ends within {what} at byte {at}")]
    Truncated {
        what: &'static str,
        /// Offset in the (decompressed) element.
        at: usize,
    },
    #[error("{what} at byte {at} is {value}, which is not valid")]
    Invalid { what: &'static str, value: u64, at: usize },
    #[error("damaged compressed data: {0}")]
    Compression(String),
}

const MI_MATRIX: u32 = 14;
const MI_COMPRESSED: u32 = 15;
const CELL_CLASS: u8 = 1;
const NUMERIC_CLASSES: std::ops::RangeInclusive<u8> = 6..=15;
const DEEPEST: usize = 16;
const LARGEST_BYTES: u64 = 1 << 30;

pub fn read(bytes: &[u8]) -> Result<Vec<(String, Array)>, MatlabError> {
    const HEADER: usize = 128;
    let header = bytes.get(..HEADER).ok_or(MatlabError::Header("shorter than its 128-byte header"))?;
    let big_endian = match &header[126..128] {
        b"IM" => false,
        b"MI" => true,
        _ => {
            return Err(MatlabError::Header(
                "no endian mark; version 7.3 files (HDF5) are not read: save with -v7",
            ));
        }
    };
    let mut variables = Vec::new();
    let mut cursor = Cursor { bytes: &bytes[HEADER..], at: 0, big_endian };
    while cursor.at < cursor.bytes.len() {
        let (kind, payload) = cursor.element("a variable")?;
        match kind {
            MI_MATRIX => variables.extend(matrix(Cursor { bytes: payload, at: 0, big_endian }, 0)?),
            MI_COMPRESSED => {
                let mut plain = Vec::new();
                ZlibDecoder::new(payload)
                    .take(LARGEST_BYTES)
                    .read_to_end(&mut plain)
                    .map_err(|error| MatlabError::Compression(error.to_string()))?;
                let mut inner = Cursor { bytes: &plain, at: 0, big_endian };
                let (kind, payload) = inner.element("a compressed variable")?;
                if kind == MI_MATRIX {
                    variables.extend(matrix(Cursor { bytes: payload, at: 0, big_endian }, 0)?);
                }
            }
            _ => {}
        }
    }
    Ok(variables)
}

struct Cursor<'a> {
    bytes: &'a [u8],
    at: usize,
    big_endian: bool,
}

impl<'a> Cursor<'a> {
    fn take(&mut self, length: usize, what: &'static str) -> Result<&'a [u8], MatlabError> {
        let end = self.at.checked_add(length).filter(|end| *end <= self.bytes.len());
        let end = end.ok_or(MatlabError::Truncated { what, at: self.at })?;
        let taken = &self.bytes[self.at..end];
        self.at = end;
        Ok(taken)
    }

    fn word(&mut self, what: &'static str) -> Result<u32, MatlabError> {
        let raw: [u8; 4] = self.take(4, what)?.try_into().unwrap_or_default();
        Ok(if self.big_endian { u32::from_be_bytes(raw) } else { u32::from_le_bytes(raw) })
    }

    /// Type and payload of the next element, long or small form; skips the padding to 8 bytes.
    fn element(&mut self, what: &'static str) -> Result<(u32, &'a [u8]), MatlabError> {
        let first = self.word(what)?;
        if first >> 16 != 0 {
            let data = self.take(4, what)?;
            let length = (first >> 16) as usize;
            let payload = data.get(..length).ok_or(MatlabError::Invalid {
                what: "small element's length",
                value: length as u64,
                at: self.at,
            })?;
            return Ok((first & 0xffff, payload));
        }
        let length = self.word(what)? as usize;
        let payload = self.take(length, what)?;
        if first != MI_COMPRESSED {
            let padding = (8 - length % 8) % 8;
            self.at = (self.at + padding).min(self.bytes.len());
        }
        Ok((first, payload))
    }
}

fn matrix(mut cursor: Cursor, depth: usize) -> Result<Option<(String, Array)>, MatlabError> {
    if cursor.bytes.is_empty() {
        return Ok(None);
    }
    let (_, flags) = cursor.element("array flags")?;
    let word: [u8; 4] = flags
        .get(..4)
        .and_then(|raw| raw.try_into().ok())
        .ok_or(MatlabError::Truncated { what: "array flags", at: cursor.at })?;
    let class = if cursor.big_endian { u32::from_be_bytes(word) } else { u32::from_le_bytes(word) } as u8;
    let (_, raw) = cursor.element("dimensions")?;
    let dimensions: Vec<usize> = numbers(5, raw, cursor.big_endian, cursor.at)?
        .into_iter()
        .map(|d| {
            if d >= 0.0 {
                Ok(d as usize)
            } else {
                Err(MatlabError::Invalid { what: "dimension", value: 0, at: cursor.at })
            }
        })
        .collect::<Result<_, _>>()?;
    let count = dimensions.iter().try_fold(1_usize, |product, &d| product.checked_mul(d));
    let (_, name) = cursor.element("name")?;
    let name = String::from_utf8_lossy(name).into_owned();
    // A value takes at least a byte, a cell eight: bounds the count.
    let count = count.filter(|&count| count <= cursor.bytes.len()).ok_or(MatlabError::Invalid {
        what: "number of values",
        value: count.unwrap_or(usize::MAX) as u64,
        at: cursor.at,
    })?;
    if class == CELL_CLASS && depth < DEEPEST {
        let mut cells = Vec::with_capacity(count.min(cursor.bytes.len() / 8));
        for _ in 0..count {
            let (_, payload) = cursor.element("a cell")?;
            let inner = matrix(Cursor { bytes: payload, at: 0, big_endian: cursor.big_endian }, depth + 1)?;
            let empty = || Array::Numeric { dimensions: vec![0, 0], values: Vec::new() };
            cells.push(inner.map_or_else(empty, |(_, array)| array));
        }
        return Ok(Some((name, Array::Cell { dimensions, cells })));
    }
    if NUMERIC_CLASSES.contains(&class) {
        let (kind, raw) = cursor.element("values")?;
        let values = numbers(kind, raw, cursor.big_endian, cursor.at)?;
        if values.len() != count {
            return Err(MatlabError::Invalid {
                what: "number of values",
                value: values.len() as u64,
                at: cursor.at,
            });
        }
        return Ok(Some((name, Array::Numeric { dimensions, values })));
    }
    Ok(Some((name, Array::Other(class))))
}

/// Numbers of a storage type (MATLAB uses the smallest that fits).
fn numbers(kind: u32, raw: &[u8], big_endian: bool, at: usize) -> Result<Vec<f64>, MatlabError> {
    macro_rules! as_f64 {
        ($type:ty) => {
            raw.chunks_exact(size_of::<$type>())
                .map(|chunk| {
                    let bytes = chunk.try_into().unwrap_or_default();
                    let value = if big_endian {
                        <$type>::from_be_bytes(bytes)
                    } else {
                        <$type>::from_le_bytes(bytes)
                    };
                    value as f64
                })
                .collect()
        };
    }
    Ok(match kind {
        1 => as_f64!(i8),
        2 => as_f64!(u8),
        3 => as_f64!(i16),
        4 => as_f64!(u16),
        5 => as_f64!(i32),
        6 => as_f64!(u32),
        7 => as_f64!(f32),
        9 => as_f64!(f64),
        12 => as_f64!(i64),
        13 => as_f64!(u64),
        other => return Err(MatlabError::Invalid { what: "storage type", value: u64::from(other), at }),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn numeric(name: &str, dimensions: &[i32], values: &[f64]) -> Vec<u8> {
        let mut body = Vec::new();
        let mut element = |kind: u32, data: &[u8]| {
            body.extend(kind.to_le_bytes());
            body.extend((data.len() as u32).to_le_bytes());
            body.extend(data);
            body.resize(body.len().next_multiple_of(8), 0);
        };
        element(6, &[6, 0, 0, 0, 0, 0, 0, 0]);
        element(5, &dimensions.iter().flat_map(|d| d.to_le_bytes()).collect::<Vec<_>>());
        element(1, name.as_bytes());
        element(9, &values.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<_>>());
        let mut out = 14_u32.to_le_bytes().to_vec();
        out.extend((body.len() as u32).to_le_bytes());
        out.extend(body);
        out
    }

    fn file(elements: &[u8]) -> Vec<u8> {
        let mut bytes = vec![b' '; 124];
        bytes.extend([0x00, 0x01, b'I', b'M']);
        bytes.extend(elements);
        bytes
    }

    #[test]
    fn a_small_file_is_read_and_a_cut_one_refused_everywhere() {
        let bytes = file(&numeric("data", &[2, 3], &[1.0, 2.0, 3.0, 4.0, 5.0, 6.5]));
        let read_back = read(&bytes).expect("valid");
        let expected = Array::Numeric { dimensions: vec![2, 3], values: vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.5] };
        assert_eq!(read_back, vec![("data".into(), expected)]);
        for cut in 129..bytes.len() {
            assert!(read(&bytes[..cut]).is_err(), "cut at {cut}");
        }
        assert!(matches!(read(b"hello"), Err(MatlabError::Header(_))));
    }
}

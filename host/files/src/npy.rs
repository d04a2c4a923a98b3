//! `.npy`, NumPy's array format (NumPy Enhancement Proposal 1), for maps: two axes of f16, f32 or f64. A file has
//! `\x93NUMPY`, the version (two bytes), the header length (little-endian; two bytes in version 1, four in 2 and 3),
//! the header (a Python dictionary padded with blanks and a line feed) and the values. Reads both byte and axis orders;
//! writes little-endian f32 by rows. Reasons for an own implementation: `docs/decisions/0011-npy.md`.

mod header;

use std::io::{self, Write};

use half::f16;
use ndarray::{Array2, ArrayView2};

use header::Header;

pub const MAGIC: &[u8] = b"\x93NUMPY";

/// Alignment of the values, for memory mapping.
const BLOCK: usize = 64;
/// Bytes before the header in version 1: magic, version, header length.
const PREFIX: usize = MAGIC.len() + 2 + 2;

#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum NpyError {
    #[error("it does not begin with \\x93NUMPY")]
    Magic,
    #[error("it has version {major}.{minor}; 1.0, 2.0 and 3.0 are known")]
    Version { major: u8, minor: u8 },
    #[error("it breaks off in the header")]
    Cut,
    #[error("byte {at} of its header should be {expected}")]
    Header {
        /// Offset in the header.
        at: usize,
        expected: &'static str,
    },
    #[error("its header has no '{key}'")]
    Missing { key: &'static str },
    #[error("its values are '{descr}', and floats ('f2', 'f4' and 'f8', of either byte order) are read")]
    Kind { descr: String },
    #[error("its values are '{descr}', and a mask has bool, integers, f16, f32 or f64")]
    MaskKind { descr: String },
    #[error("its shape is {shape:?}, and a map has two axes (height, width)")]
    Axes { shape: Vec<usize> },
    #[error("its shape is {shape:?} of '{descr}', and {found} bytes follow the header")]
    Size { shape: [usize; 2], descr: String, found: usize },
}

/// Reads an array of (height, width); f64 is rounded to f32. Uses no more memory than the file's size.
pub fn read(bytes: &[u8]) -> Result<Array2<f32>, NpyError> {
    let (header, values) = split(bytes)?;
    let header = Header::parse(header)?;
    let numbers =
        floats(&header.descr, values).ok_or_else(|| NpyError::Kind { descr: header.descr.clone() })?;
    array(header, numbers, values.len())
}

/// Where an array of bool, integers or floats is neither 0 nor NaN.
pub fn read_mask(bytes: &[u8]) -> Result<Array2<bool>, NpyError> {
    let (header, values) = split(bytes)?;
    let header = Header::parse(header)?;
    let size = match header.descr.trim_start_matches(['<', '>', '|', '=']) {
        "b1" | "i1" | "u1" => Some(1),
        "i2" | "u2" => Some(2),
        "i4" | "u4" => Some(4),
        "i8" | "u8" => Some(8),
        _ => None,
    };
    let truths = match size {
        Some(size) => {
            let items = values.chunks_exact(size);
            let whole = items.remainder().is_empty();
            whole.then(|| items.map(|item| item.iter().any(|byte| *byte != 0)).collect())
        }
        None => floats(&header.descr, values)
            .ok_or_else(|| NpyError::MaskKind { descr: header.descr.clone() })?
            .map(|values| values.into_iter().map(|value| value != 0.0 && !value.is_nan()).collect()),
    };
    array(header, truths, values.len())
}

/// `None` for other kinds; within, `None` for a part of a number at the end.
fn floats(descr: &str, values: &[u8]) -> Option<Option<Vec<f32>>> {
    Some(match descr {
        "<f2" => numbers(values, |bytes| f16::from_le_bytes(bytes).to_f32()),
        ">f2" => numbers(values, |bytes| f16::from_be_bytes(bytes).to_f32()),
        "<f4" => numbers(values, f32::from_le_bytes),
        ">f4" => numbers(values, f32::from_be_bytes),
        "<f8" => numbers(values, |bytes| f64::from_le_bytes(bytes) as f32),
        ">f8" => numbers(values, |bytes| f64::from_be_bytes(bytes) as f32),
        _ => return None,
    })
}

fn array<T: Clone>(header: Header, numbers: Option<Vec<T>>, found: usize) -> Result<Array2<T>, NpyError> {
    let Header { descr, fortran_order, shape } = header;
    let [height, width] = shape[..].try_into().map_err(|_| NpyError::Axes { shape: shape.clone() })?;
    let size = || NpyError::Size { shape: [height, width], descr: descr.clone(), found };
    let numbers = numbers.ok_or_else(size)?;
    if fortran_order {
        let columns = Array2::from_shape_vec((width, height), numbers).map_err(|_| size())?;
        return Ok(columns.t().as_standard_layout().into_owned());
    }
    Array2::from_shape_vec((height, width), numbers).map_err(|_| size())
}

fn split(bytes: &[u8]) -> Result<(&[u8], &[u8]), NpyError> {
    let rest = bytes.strip_prefix(MAGIC).ok_or(NpyError::Magic)?;
    let (&[major, minor], rest) = rest.split_first_chunk().ok_or(NpyError::Cut)?;
    let (length, rest) = match (major, minor) {
        (1, 0) => {
            let (length, rest) = rest.split_first_chunk().ok_or(NpyError::Cut)?;
            (usize::from(u16::from_le_bytes(*length)), rest)
        }
        (2 | 3, 0) => {
            let (length, rest) = rest.split_first_chunk().ok_or(NpyError::Cut)?;
            (usize::try_from(u32::from_le_bytes(*length)).map_err(|_| NpyError::Cut)?, rest)
        }
        _ => return Err(NpyError::Version { major, minor }),
    };
    rest.split_at_checked(length).ok_or(NpyError::Cut)
}

fn numbers<const SIZE: usize>(values: &[u8], number: fn([u8; SIZE]) -> f32) -> Option<Vec<f32>> {
    let (whole, cut) = values.as_chunks();
    cut.is_empty().then(|| whole.iter().map(|bytes| number(*bytes)).collect())
}

/// Encodes a map of (height, width): version 1.0, little-endian f32 by rows.
pub fn write(map: ArrayView2<f32>) -> Vec<u8> {
    let mut bytes = header(map.dim());
    bytes.reserve_exact(4 * map.len());
    match map.as_slice() {
        Some(values) => values.chunks(1 << 10).for_each(|part| {
            let mut four = [[0; 4]; 1 << 10];
            four.iter_mut().zip(part).for_each(|(bytes, value)| *bytes = value.to_le_bytes());
            bytes.extend_from_slice(four[..part.len()].as_flattened());
        }),
        None => bytes.extend(map.iter().flat_map(|value| value.to_le_bytes())),
    }
    bytes
}

/// [`write()`] into a file by rows.
pub fn write_to(map: ArrayView2<f32>, to: &mut impl Write) -> io::Result<()> {
    to.write_all(&header(map.dim()))?;
    // Four bytes per value, which the compiler turns into a copy.
    let mut row_bytes = vec![[0; 4]; map.ncols()];
    for row in map.rows() {
        row_bytes.iter_mut().zip(row).for_each(|(bytes, value)| *bytes = value.to_le_bytes());
        to.write_all(row_bytes.as_flattened())?;
    }
    Ok(())
}

fn header((height, width): (usize, usize)) -> Vec<u8> {
    let header = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({height}, {width})}}");
    // At least one blank, then the line feed. Two numbers never exceed 65,535 bytes.
    let values_from = (PREFIX + header.len() + 1) / BLOCK * BLOCK + BLOCK;
    let header_length = (values_from - PREFIX) as u16;
    let mut bytes = Vec::with_capacity(values_from);
    bytes.extend(MAGIC);
    bytes.extend([1, 0]);
    bytes.extend(header_length.to_le_bytes());
    bytes.extend(header.bytes());
    bytes.resize(values_from - 1, b' ');
    bytes.push(b'\n');
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::array;
    use proptest::prelude::*;

    fn file(version: u8, header: &str, values: &[u8]) -> Vec<u8> {
        let mut bytes = [MAGIC, &[version, 0]].concat();
        match version {
            1 => bytes.extend((header.len() as u16).to_le_bytes()),
            _ => bytes.extend((header.len() as u32).to_le_bytes()),
        }
        [&bytes, header.as_bytes(), values].concat()
    }

    fn of_kind(descr: &str, values: &[u8]) -> Result<Array2<f32>, NpyError> {
        let header = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': (1, 2), }}\n");
        read(&file(1, &header, values))
    }

    #[test]
    fn writes_the_expected_bytes() {
        let bytes = write(array![[933.0f32, f32::NAN, -0.0]].view());
        let head = b"\x93NUMPY\x01\x00\x76\x00{'descr': '<f4', 'fortran_order': False, 'shape': (1, 3)}";
        assert_eq!(bytes[..head.len()], head[..]);
        assert!(bytes[head.len()..127].iter().all(|byte| *byte == b' '));
        assert_eq!(bytes[127..], *b"\n\x00\x40\x69\x44\x00\x00\xc0\x7f\x00\x00\x00\x80");
    }

    #[test]
    fn reads_all_types_versions_and_orders() {
        let expected = array![[933.5f32, -2.0]];
        let little4 = [933.5f32, -2.0].map(f32::to_le_bytes).concat();
        let big4 = [933.5f32, -2.0].map(f32::to_be_bytes).concat();
        let little8 = [933.5f64, -2.0].map(f64::to_le_bytes).concat();
        let big8 = [933.5f64, -2.0].map(f64::to_be_bytes).concat();
        for (descr, values) in [("<f4", &little4), (">f4", &big4), ("<f8", &little8), (">f8", &big8)] {
            assert_eq!(of_kind(descr, values).unwrap(), expected, "{descr}");
        }
        let halves = [0x634b_u16, 0xc000];
        let little2 = halves.map(u16::to_le_bytes).concat();
        let big2 = halves.map(u16::to_be_bytes).concat();
        for (descr, values) in [("<f2", &little2), (">f2", &big2)] {
            assert_eq!(of_kind(descr, values).unwrap(), expected, "{descr}");
        }
        // As written by NumPy 1 on Python 2, NumPy 2 and ndarray-npy, and in other key orders.
        for header in [
            "{'descr': '<f4', 'fortran_order': False, 'shape': (1L, 2L), }     \n",
            "{'descr': '<f4', 'fortran_order': False, 'shape': (1, 2), }\n",
            "{'descr': '<f4', 'fortran_order': False, 'shape': (1, 2)}\n",
            "{\"shape\":(1,2,),\"fortran_order\":False,\"descr\":\"<f4\"}\n",
        ] {
            for version in 1..=3 {
                assert_eq!(read(&file(version, header, &little4)).unwrap(), expected, "{version} {header}");
            }
        }
        let columns = "{'descr': '<f4', 'fortran_order': True, 'shape': (2, 3), }\n";
        let values = [1f32, 2.0, 3.0, 4.0, 5.0, 6.0].map(f32::to_le_bytes).concat();
        assert_eq!(read(&file(1, columns, &values)).unwrap(), array![[1.0, 3.0, 5.0], [2.0, 4.0, 6.0]]);
    }

    #[test]
    fn masks_of_any_kind_are_true_where_not_zero() {
        let mask = |descr: &str, values: &[u8]| {
            let header = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': (1, 2), }}\n");
            read_mask(&file(1, &header, values)).map(|mask| mask.into_raw_vec_and_offset().0)
        };
        for (descr, values) in [
            ("|b1", vec![0, 1]),
            ("|i1", vec![0, 0xff]),
            ("<i4", [0_i32, -256].map(i32::to_le_bytes).concat()),
            (">u2", [0_u16, 1].map(u16::to_be_bytes).concat()),
            ("<f4", [-0.0_f32, 0.5].map(f32::to_le_bytes).concat()),
            ("<f8", [f64::NAN, -1.0].map(f64::to_le_bytes).concat()),
        ] {
            assert_eq!(mask(descr, &values), Ok(vec![false, true]), "{descr}");
        }
        assert!(mask("<U4", &[0; 32]).unwrap_err().to_string().contains("bool"));
        assert!(matches!(mask("<i4", &[0; 7]), Err(NpyError::Size { .. })));
    }

    #[test]
    fn rejects_invalid_files_with_a_reason() {
        let eight = [0u8; 8];
        let of_shape = |shape: &str| {
            let header = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': {shape}, }}\n");
            read(&file(1, &header, &eight)).unwrap_err()
        };
        for (error, phrase) in [
            (read(b"\x93NUMP").unwrap_err(), "\\x93NUMPY"),
            (read(&file(4, "", &[])).unwrap_err(), "version 4.0"),
            (read(b"\x93NUMPY\x01").unwrap_err(), "breaks off"),
            (read(b"\x93NUMPY\x01\x00\xff\xff{").unwrap_err(), "breaks off"),
            (read(b"\x93NUMPY\x03\x00\xff\xff\xff\xff{").unwrap_err(), "breaks off"),
            (read(&file(1, "{'descr': '<f4', 'shape': (1, 2)}", &eight)).unwrap_err(), "'fortran_order'"),
            (read(&file(1, "{'descr': '<f4'", &eight)).unwrap_err(), "byte 15"),
            (read(&file(1, "{'descr': [('a', '<f4')]}", &eight)).unwrap_err(), "byte 10"),
            (of_kind("<i4", &eight).unwrap_err(), "'<i4'"),
            (of_kind("<f4", &eight[..7]).unwrap_err(), "7 bytes"),
            (of_kind("<f8", &eight).unwrap_err(), "[1, 2] of '<f8', and 8 bytes"),
            (of_shape("(2,)"), "[2]"),
            (of_shape("(1, 2, 1)"), "two axes"),
            (of_shape("()"), "two axes"),
            (of_shape("(1, -2)"), "length of an axis"),
            (of_shape("(18446744073709551615, 18446744073709551615)"), "8 bytes"),
            (of_shape("(0, 18446744073709551615)"), "8 bytes"),
            (of_shape("(1, 18446744073709551616)"), "length of an axis"),
        ] {
            assert!(error.to_string().contains(phrase), "{phrase}: {error}");
        }
    }

    proptest! {
        #[test]
        fn any_map_comes_back(map in (0..9usize, 0..9usize).prop_flat_map(|size| {
            proptest::collection::vec(any::<u32>(), size.0 * size.1)
                .prop_map(move |bits| Array2::from_shape_vec(size, bits).expect("as many").mapv(f32::from_bits))
        })) {
            let mut by_rows = Vec::new();
            write_to(map.view(), &mut by_rows).unwrap();
            prop_assert_eq!(&by_rows, &write(map.view()));
            let back = read(&by_rows).unwrap();
            prop_assert_eq!(back.mapv(f32::to_bits), map.mapv(f32::to_bits));
        }

        #[test]
        fn survives_any_bytes(
            version in 0..4u8,
            header in "\\{?('descr'|'shape'|'fortran_order'|[\\]\\[:,(){}'\"<>f480-9A-Za-zL ]){0,24}\\}?\\n?",
            values in proptest::collection::vec(any::<u8>(), 0..64),
        ) {
            if let Ok(map) = read(&file(version, &header, &values)) {
                prop_assert!(4 * map.len() <= values.len());
            }
            let _ = read(&values);
            let _ = read(&[MAGIC, &values].concat());
        }
    }
}

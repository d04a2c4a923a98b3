//! NPZ files of body motion (AMASS and others) with joint positions. AMASS itself stores pose parameters of
//! SMPL, SMPL-H and SMPL-X, which need the licensed body model; such files are rejected.

use super::{
    posture,
    reader::Reader,
    recording::{Found, Known, RecordingError, Source, Unit, Up},
    zip,
};
use crate::silhouette::capsule::Point3;

pub const READER: Reader = Reader {
    name: "NPZ",
    extensions: &["npz"],
    about: "joint positions of SMPL bodies (array `joints`, frames x joints x 3), metres; AMASS pose parameters are refused",
    read: |bytes, _| read(bytes),
};

const POSITIONS: [&str; 10] = [
    "joints",
    "Jtr",
    "jtr",
    "joints3d",
    "joints3D",
    "joints_3d",
    "smpl_joints",
    "keypoints3d",
    "joint_positions",
    "positions",
];
const RATES: [&str; 4] = ["mocap_framerate", "mocap_frame_rate", "fps", "framerate"];
/// Body joints of all SMPL models in order; hands and face follow.
const SMPL: [&str; 22] = [
    "pelvis",
    "left_hip",
    "right_hip",
    "spine1",
    "left_knee",
    "right_knee",
    "spine2",
    "left_ankle",
    "right_ankle",
    "spine3",
    "left_foot",
    "right_foot",
    "neck",
    "left_collar",
    "right_collar",
    "head",
    "left_shoulder",
    "right_shoulder",
    "left_elbow",
    "right_elbow",
    "left_wrist",
    "right_wrist",
];
const HEAD: usize = 15;
const FEET: [usize; 2] = [10, 11];

struct Array {
    name: String,
    shape: Vec<usize>,
    kind: String,
    /// Numbers in C order; empty for text.
    values: Vec<f64>,
    text: String,
}

/// Fails with [`RecordingError::BodyModel`] for pose parameters without positions.
pub fn read(bytes: &[u8]) -> Result<Found, RecordingError> {
    let arrays = zip::entries(bytes, |name| name.ends_with(".npy"))?
        .iter()
        .map(|(name, bytes)| array(name.trim_end_matches(".npy"), bytes))
        .collect::<Result<Vec<Array>, RecordingError>>()?;
    let named =
        |names: &[&str]| names.iter().find_map(|name| arrays.iter().find(|array| array.name == *name));
    let positions = POSITIONS.iter().find_map(|name| {
        arrays.iter().find(|array| {
            array.name == *name && matches!(array.shape.as_slice(), [_, joints, 3] if *joints >= SMPL.len())
        })
    });
    let Some(positions) = positions else { return Err(refused(&arrays)) };
    if positions.values.is_empty() && positions.shape[0] > 0 {
        let reason =
            format!("array `{}` has the type {}, expected f2, f4 or f8", positions.name, positions.kind);
        return Err(RecordingError::Kind { kind: "NPZ", reason });
    }
    let (count, joints) = (positions.shape[0], positions.shape[1]);
    let frames: Vec<Vec<Option<Point3>>> = (0..count)
        .map(|frame| {
            let at = |joint: usize| -> Point3 {
                std::array::from_fn(|k| {
                    positions.values.get((frame * joints + joint) * 3 + k).copied().unwrap_or(f64::NAN)
                })
            };
            (0..SMPL.len()).map(|joint| Some(at(joint))).collect()
        })
        .collect();
    let rate_hz = named(&RATES).and_then(|array| array.values.first().copied()).filter(|rate| *rate > 0.0);
    let mut remarks = Vec::new();
    if joints > SMPL.len() {
        remarks.push(format!(
            "{joints} joints are taken as those of an SMPL body, of which the first 22 are read"
        ));
    }
    if rate_hz.is_none() {
        remarks.push("nothing states the frame rate".into());
    }
    Ok(Found {
        names: SMPL.iter().map(|name| (*name).to_owned()).collect(),
        rate_hz: rate_hz.unwrap_or(0.0),
        unit: Known { value: Unit { mm: 1000.0 }, source: Source::Format },
        up: posture::upright(&frames, &[HEAD], &FEET, Up::Z),
        frames,
        others: Vec::new(),
        planar: false,
        remarks,
    })
}

fn refused(arrays: &[Array]) -> RecordingError {
    let of = |name: &str| arrays.iter().find(|array| array.name == name);
    let text = |name: &str| of(name).map(|array| array.text.to_lowercase()).filter(|text| !text.is_empty());
    let Some(poses) = of("poses").or_else(|| of("pose_body")).or_else(|| of("body_pose")) else {
        let all: Vec<&str> = arrays.iter().map(|array| array.name.as_str()).take(12).collect();
        let reason = format!(
            "it holds {} and no joint positions: expected an array `joints` of frames x 22 or more joints x 3",
            if all.is_empty() { "no array".to_owned() } else { all.join(", ") }
        );
        return RecordingError::Kind { kind: "NPZ", reason };
    };
    let gender = text("gender").unwrap_or_else(|| "neutral".into());
    let width = poses.shape.last().copied().unwrap_or(0);
    let (model, file) = match (text("surface_model_type").as_deref(), width) {
        (Some("smplx"), _) | (_, 162 | 165 | 63) => ("SMPL-X", "SMPLX"),
        (Some("smplh"), _) | (_, 156) => ("SMPL-H", "SMPLH"),
        _ => ("SMPL", "SMPL"),
    };
    RecordingError::BodyModel {
        array: poses.name.clone(),
        shape: poses.shape.iter().map(usize::to_string).collect::<Vec<_>>().join("x"),
        model,
        file: format!("{file}_{}.npz", gender.to_uppercase()),
    }
}

fn array(name: &str, bytes: &[u8]) -> Result<Array, RecordingError> {
    let bad =
        |reason: &str| RecordingError::Kind { kind: "NPZ", reason: format!("array `{name}`: {reason}") };
    let version =
        *bytes.get(6).filter(|_| bytes.starts_with(b"\x93NUMPY")).ok_or_else(|| bad("not an NPY file"))?;
    let length = |range: std::ops::Range<usize>| -> Option<usize> {
        Some(bytes.get(range)?.iter().rev().fold(0, |sum, &byte| sum * 256 + usize::from(byte)))
    };
    let (from, header) = if version == 1 { (10, length(8..10)) } else { (12, length(8..12)) };
    let header_end = header.and_then(|length| length.checked_add(from));
    let header =
        header_end.and_then(|end| bytes.get(from..end)).ok_or_else(|| bad("its header is cut short"))?;
    let header = String::from_utf8_lossy(header);
    let after = |key: &str| header.split_once(key).map(|(_, rest)| rest);
    let kind = after("'descr':").and_then(|rest| rest.split('\'').nth(1)).unwrap_or_default().to_owned();
    let shape: Vec<usize> = after("'shape':")
        .and_then(|rest| rest.split_once('(')?.1.split_once(')'))
        .map(|(inside, _)| inside.split(',').filter_map(|length| length.trim().parse().ok()).collect())
        .ok_or_else(|| bad("its header has no shape"))?;
    let fortran = after("'fortran_order':").is_some_and(|rest| rest.trim_start().starts_with("True"));
    let data = bytes.get(header_end.unwrap_or(0)..).unwrap_or_default();
    let (order, letter) = kind.split_at_checked(1).unwrap_or_default();
    let big = order == ">";
    let number = |raw: &[u8]| -> f64 {
        let mut raw: [u8; 8] = std::array::from_fn(|k| raw.get(k).copied().unwrap_or(0));
        let size = letter[1..].parse::<usize>().unwrap_or(8).min(8);
        if big {
            raw[..size].reverse();
        }
        match letter {
            "f2" => half(u16::from_le_bytes([raw[0], raw[1]])),
            "f4" => f64::from(f32::from_le_bytes([raw[0], raw[1], raw[2], raw[3]])),
            "f8" => f64::from_le_bytes(raw),
            "i4" => f64::from(i32::from_le_bytes([raw[0], raw[1], raw[2], raw[3]])),
            _ => i64::from_le_bytes(raw) as f64,
        }
    };
    let mut found =
        Array { name: name.into(), shape, kind: kind.clone(), values: Vec::new(), text: String::new() };
    match letter {
        "f2" => found.values = data.chunks_exact(2).map(number).collect(),
        "f4" | "i4" => found.values = data.chunks_exact(4).map(number).collect(),
        "f8" | "i8" => found.values = data.chunks_exact(8).map(number).collect(),
        _ if letter.starts_with('U') => {
            found.text = data.chunks_exact(4).map(|c| char::from(c[0])).filter(|c| *c != '\0').collect();
        }
        _ if letter.starts_with('S') => {
            found.text = data.iter().map(|&c| char::from(c)).filter(|c| *c != '\0').collect();
        }
        // Objects are not needed.
        _ => {}
    }
    let expected = found.shape.iter().fold(1_usize, |product, &length| product.saturating_mul(length));
    if !found.values.is_empty() && found.values.len() < expected {
        return Err(bad(&format!("{} of {expected} values are there: it was cut short", found.values.len())));
    }
    if fortran && !found.values.is_empty() {
        found.values.truncate(expected);
        found.values = in_c_order(&found.values, &found.shape);
    }
    Ok(found)
}

/// Values whose first index changes fastest, with the last one changing fastest.
fn in_c_order(values: &[f64], shape: &[usize]) -> Vec<f64> {
    let place = |index: usize| {
        let mut stride = values.len();
        let (mut rest, mut at) = (index, 0);
        for &length in shape.iter().rev() {
            stride /= length;
            at += rest % length * stride;
            rest /= length;
        }
        at
    };
    (0..values.len()).filter_map(|index| values.get(place(index)).copied()).collect()
}

/// IEEE 754 binary16.
fn half(bits: u16) -> f64 {
    let (exponent, fraction) = (i32::from(bits >> 10 & 0x1f), f64::from(bits & 0x3ff) / 1024.0);
    let size = match exponent {
        0 => fraction * 2.0_f64.powi(-14),
        31 if fraction == 0.0 => f64::INFINITY,
        31 => f64::NAN,
        _ => (1.0 + fraction) * 2.0_f64.powi(exponent - 15),
    };
    if bits >> 15 == 1 { -size } else { size }
}

#[cfg(test)]
mod tests {
    use super::super::recording::Choices;
    use super::*;

    fn npy(kind: &str, shape: &str, data: &[u8]) -> Vec<u8> {
        let header = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}\n");
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend((header.len() as u16).to_le_bytes());
        bytes.extend(header.as_bytes());
        bytes.extend(data);
        bytes
    }

    fn npz(entries: &[(&str, Vec<u8>)]) -> Vec<u8> {
        let (mut file, mut directory) = (Vec::new(), Vec::new());
        for (name, data) in entries {
            let name = format!("{name}.npy");
            let at = file.len() as u32;
            let sizes = [(data.len() as u32).to_le_bytes(), (data.len() as u32).to_le_bytes()].concat();
            let lengths = [(name.len() as u16).to_le_bytes(), [0, 0]].concat();
            file.extend(
                [b"PK\x03\x04".as_slice(), &[0; 14], &sizes, &lengths, name.as_bytes(), data].concat(),
            );
            let entry = [
                b"PK\x01\x02".as_slice(),
                &[0; 16],
                &sizes,
                &lengths,
                &[0; 10],
                &at.to_le_bytes(),
                name.as_bytes(),
            ];
            directory.extend(entry.concat());
        }
        let (at, count) = (file.len() as u32, entries.len() as u16);
        let sizes = [(directory.len() as u32).to_le_bytes(), at.to_le_bytes()].concat();
        let counts = [count.to_le_bytes(), count.to_le_bytes()].concat();
        [file, directory, b"PK\x05\x06\0\0\0\0".to_vec(), counts, sizes, vec![0, 0]].concat()
    }

    fn floats(values: impl IntoIterator<Item = f32>) -> Vec<u8> {
        values.into_iter().flat_map(f32::to_le_bytes).collect()
    }

    #[test]
    fn joint_positions_are_read_with_rate_and_upward_axis() {
        // A body along y: feet at 0, head at 1.6 m.
        let joints = (0..3).flat_map(|_| {
            (0..24).flat_map(|joint| {
                [
                    0.1,
                    if joint == HEAD {
                        1.6
                    } else if FEET.contains(&joint) {
                        0.05
                    } else {
                        0.8
                    },
                    0.3,
                ]
            })
        });
        let file = npz(&[
            ("joints", npy("<f4", "(3, 24, 3)", &floats(joints))),
            ("mocap_framerate", npy("<f8", "()", &120.0_f64.to_le_bytes())),
        ]);
        let found = super::super::read(&file, "npz", Choices::default()).expect("a recording");
        assert_eq!((found.frames.len(), found.rate_hz, found.up.value), (3, 120.0, Up::Y));
        let head = found.by_name(1)["head"];
        assert!((head[2] - 1600.0).abs() < 0.1 && (head[0] - 100.0).abs() < 0.1, "{head:?}");
        assert!(found.by_name(0).contains_key("LeftUpLeg"), "matched by alias");
    }

    #[test]
    fn halves_are_read_and_other_types_refused_by_name() {
        let expected = [1.0, -2.5, 0.099_975_585_937_5, 6.103_515_625e-5, 0.0];
        assert_eq!([0x3c00, 0xc100, 0x2e66, 0x0400, 0x0000].map(half), expected);
        assert!(half(0x7c00).is_infinite() && half(0x7e00).is_nan());
        let data: Vec<u8> = (0..66).flat_map(|_| 0x3c00_u16.to_le_bytes()).collect();
        let found = read(&npz(&[("joints", npy("<f2", "(1, 22, 3)", &data))])).expect("halves");
        assert_eq!(found.frames[0][21], Some([1.0; 3]));
        let complex = npz(&[("joints", npy("<c8", "(1, 22, 3)", &vec![0; 66 * 8]))]);
        let error = read(&complex).expect_err("complex numbers").to_string();
        assert!(error.contains("`joints` has the type <c8"), "{error}");
    }

    #[test]
    fn arrays_in_fortrans_order_are_the_same_arrays() {
        let joints = npy("<f4", "(1, 22, 3)", &floats((0..66).map(|n| n as f32)));
        let turned = (0..3).flat_map(|axis| (0..22).map(move |joint| (joint * 3 + axis) as f32));
        let mut fortran = npy("<f4", "(1, 22, 3)", &floats(turned));
        let at = fortran.windows(5).position(|word| word == b"False").expect("an order");
        fortran[at..at + 5].copy_from_slice(b"True ");
        assert_eq!(read(&npz(&[("joints", fortran)])), read(&npz(&[("joints", joints)])));
    }

    #[test]
    fn a_body_with_y_down_is_turned_upright() {
        let joints = (0..22).flat_map(|joint| [0.1, if joint == HEAD { -1.6 } else { 0.1 }, 0.3]);
        let file = npz(&[("joints", npy("<f4", "(1, 22, 3)", &floats(joints)))]);
        let found = super::super::read(&file, "npz", Choices::default()).expect("a recording");
        assert_eq!(found.up.value, Up::MinusY);
        assert!(found.by_name(0)["head"][2] > found.by_name(0)["left_foot"][2]);
    }

    #[test]
    fn pose_parameters_are_refused_with_the_body_model_that_is_needed() {
        let gender: Vec<u8> = "female".chars().flat_map(|c| (c as u32).to_le_bytes()).collect();
        let file = npz(&[
            ("poses", npy("<f4", "(2, 156)", &floats(vec![0.0; 312]))),
            ("gender", npy("<U6", "()", &gender)),
        ]);
        let error =
            super::super::read(&file, "npz", Choices::default()).expect_err("no positions").to_string();
        assert!(
            error.contains("2x156") && error.contains("SMPLH_FEMALE.npz") && error.contains("joints"),
            "{error}"
        );
        let other = npz(&[("betas", npy("<f4", "(16,)", &floats(vec![0.0; 16])))]);
        let error =
            super::super::read(&other, "npz", Choices::default()).expect_err("no positions").to_string();
        assert!(error.contains("betas") && error.contains("joints"), "{error}");
    }

    #[test]
    fn damaged_archives_are_read_or_refused() {
        let file = npz(&[("joints", npy("<f4", "(1, 22, 3)", &floats(vec![0.5; 66])))]);
        for at in 0..file.len() {
            let mut damaged = file.clone();
            damaged[at] ^= 0x80;
            let _ = read(&damaged);
        }
    }

    #[test]
    fn archives_cut_anywhere_are_errors() {
        let file = npz(&[("joints", npy("<f4", "(1, 22, 3)", &floats(vec![0.5; 66])))]);
        assert!(read(&file).is_ok());
        for end in 0..file.len() - 2 {
            assert!(read(&file[..end]).is_err(), "{end} bytes");
        }
    }
}

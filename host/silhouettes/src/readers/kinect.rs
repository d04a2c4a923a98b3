//! Kinect joints as text, one frame per line: 20 joints of the first or 25 of the second generation, x, y, z
//! in metres (x across, y up, z away), with or without a frame number (as in UTKinect).

use super::reader::Reader;
use super::recording::{Found, Known, RecordingError, Source, Unit, Up, text};

pub const READER: Reader = Reader {
    name: "Kinect joints",
    extensions: &["txt"],
    about: "20 or 25 joints per line, metres, y up, optionally after a frame number",
    read: |bytes, _| read(bytes),
};

/// Joints of the second generation; the first 20 are those of the first.
pub const JOINTS_25: [&str; 25] = [
    "hip centre",
    "spine",
    "neck",
    "head",
    "left shoulder",
    "left elbow",
    "left wrist",
    "left hand",
    "right shoulder",
    "right elbow",
    "right wrist",
    "right hand",
    "left hip",
    "left knee",
    "left ankle",
    "left foot",
    "right hip",
    "right knee",
    "right ankle",
    "right foot",
    "shoulder centre",
    "left hand tip",
    "left thumb",
    "right hand tip",
    "right thumb",
];

const RATE_HZ: f64 = 30.0;

pub fn read(bytes: &[u8]) -> Result<Found, RecordingError> {
    let mut frames = Vec::new();
    let mut joints = None;
    let whole = text(bytes)?;
    for (line, content) in (1..).zip(whole.lines()) {
        let wrong = |reason: String| RecordingError::Line { line, reason };
        let words = content.split([' ', '\t', ',', ';']).filter(|word| !word.trim().is_empty());
        let numbers: Vec<f64> = words
            .map(|word| {
                let number = word.trim().parse::<f64>();
                number.map_err(|_| {
                    wrong(format!("`{}` is not a number", word.chars().take(20).collect::<String>()))
                })
            })
            .collect::<Result<_, _>>()?;
        if numbers.is_empty() {
            continue;
        }
        let found = match numbers.len() {
            60 | 61 => 20,
            75 | 76 => 25,
            other => {
                return Err(wrong(format!(
                    "{other} numbers, expected 20 or 25 joints with 3 each, optionally after a frame number: write others, such as \
                     YOLO's keypoints, to a CSV file with columns NAME_x and NAME_y"
                )));
            }
        };
        let expected = *joints.get_or_insert(found);
        if expected != found {
            return Err(wrong(format!("{found} joints, the lines before have {expected}")));
        }
        let points = &numbers[numbers.len() % 3..];
        // Joints that were not found are at the sensor's position.
        frames.push(
            points.chunks_exact(3).map(|p| p.iter().any(|v| *v != 0.0).then(|| [p[0], p[1], p[2]])).collect(),
        );
    }
    let Some(joints) = joints else {
        return Err(RecordingError::Line {
            line: 1,
            reason: "no numbers, expected joints of a Kinect".into(),
        });
    };
    let mut names: Vec<String> = JOINTS_25.iter().take(joints).map(|name| (*name).to_owned()).collect();
    if joints == 20 {
        // The first generation has no neck but a point between the shoulders.
        names[2] = JOINTS_25[20].into();
    }
    Ok(Found {
        others: Vec::new(),
        planar: false,
        names,
        rate_hz: RATE_HZ,
        frames,
        unit: Known { value: Unit { mm: 1000.0 }, source: Source::Format },
        // The sensor's, also of a person who lies.
        up: Known { value: Up::Y, source: Source::File },
        remarks: Vec::new(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(joints: usize) -> String {
        (0..3 * joints).map(|k| format!("{} ", 0.1 * (k + 1) as f64)).collect()
    }

    #[test]
    fn first_and_second_sensors_are_distinguished_by_their_joints() {
        let first = read(format!("1 {}\n2 {}\n", line(20), line(20)).as_bytes()).expect("joints");
        assert_eq!(
            (first.frames.len(), first.names.len(), first.names[2].as_str()),
            (2, 20, "shoulder centre")
        );
        let p = first.frames[1][0].expect("seen");
        assert!((p[0] - 0.1).abs() < 1e-12 && (p[2] - 0.3).abs() < 1e-12);
        let second = read(line(25).replace(' ', ",").as_bytes()).expect("joints");
        assert_eq!((second.names[2].as_str(), second.names[24].as_str()), ("neck", "right thumb"));
        let hidden = format!("0 0 0 {}", line(19));
        assert_eq!(read(hidden.as_bytes()).expect("joints").frames[0][0], None);
    }

    #[test]
    fn other_text_is_refused_with_its_line() {
        for (text, line_number, part) in [
            ("".to_owned(), 1, "no numbers"),
            ("1 2 3\n".into(), 1, "3 numbers"),
            (format!("{}\n{}\n", line(20), line(25)), 2, "25 joints"),
            (format!("{}\nx\n", line(20)), 2, "`x`"),
        ] {
            match read(text.as_bytes()) {
                Err(RecordingError::Line { line, reason }) => {
                    assert!(line == line_number && reason.contains(part), "{line}: {reason}");
                }
                other => panic!("{other:?}"),
            }
        }
    }
}

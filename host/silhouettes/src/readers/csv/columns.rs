//! What columns of tables are called, other than those of points.

use std::collections::HashSet;

use csv::StringRecord;

use crate::readers::recording::number;

pub const CONFIDENCES: [&str; 9] =
    ["likelihood", "score", "confidence", "conf", "visibility", "visible", "vis", "probability", "prob"];
pub const FRAMES: [&str; 7] =
    ["frame_idx", "frame", "frame_number", "frame_id", "frame_index", "frame_no", "frame_num"];
pub const TIMES: [&str; 10] = [
    "time",
    "t",
    "time_s",
    "time_sec",
    "time_ms",
    "timestamp",
    "timestamp_s",
    "timestamp_sec",
    "timestamp_ms",
    "timestamp_us",
];
/// What columns of points' names are called, mostly with a word such as `_name` or `_id` after it.
pub const POINTS: [&str; 11] = [
    "keypoint",
    "kpt",
    "kp",
    "landmark",
    "bodyparts",
    "bodypart",
    "joint",
    "marker",
    "point",
    "part",
    "node",
];
pub const PEOPLE: [&str; 6] = ["track", "track_id", "person", "person_id", "person_idx", "skeleton_id"];
/// Of people in some tables, and of rows or recordings in others.
const PERHAPS_PEOPLE: [&str; 12] = [
    "id",
    "pid",
    "player",
    "player_id",
    "subject",
    "subject_id",
    "instance",
    "instance_id",
    "object_id",
    "tracking_id",
    "body_id",
    "user_id",
];
/// A recording has fewer people; more are those of a collection of recordings.
const MOST_PEOPLE: usize = 16;
/// What follows `time` or `timestamp` in names that state the unit of their times, and the units in a second.
const STATED: [(&str, f64); 4] = [("s", 1.0), ("sec", 1.0), ("ms", 1e3), ("us", 1e6)];
/// Longest steps of times without a stated unit, and the units in a second: seconds, milliseconds, microseconds, 100 ns (Kinect).
/// Longer steps are nanoseconds.
const UNITS: [(f64, f64); 4] = [(2.0, 1.0), (2e3, 1e3), (2e5, 1e6), (2e6, 1e7)];

/// A name without case, blanks and punctuation: `Person ID` and `person_id` are one.
pub fn simple(name: &str) -> String {
    let letters = name.chars().filter(char::is_ascii_alphanumeric);
    letters.map(|c| c.to_ascii_lowercase()).collect()
}

pub fn is_of(column: &str, known: &[&str]) -> bool {
    let own = simple(column);
    known.iter().any(|name| simple(name) == own)
}

pub fn place(columns: &StringRecord, known: &[&str]) -> Option<usize> {
    columns.iter().position(|column| is_of(column, known))
}

/// The column that tells people apart. One that may have another meaning has recurring values, several in a frame, each of several
/// points.
pub fn people(columns: &StringRecord, rows: &[StringRecord], are_points: bool) -> Option<usize> {
    let frame = place(columns, &FRAMES).or_else(|| place(columns, &TIMES));
    let is_one = |at: &usize| {
        let pairs: HashSet<(&str, &str)> =
            rows.iter().filter_map(|row| Some((row.get(*at)?, row.get(frame?)?))).collect();
        let people: HashSet<&str> = pairs.iter().map(|(person, _)| *person).collect();
        let frames: HashSet<&str> = pairs.iter().map(|(_, frame)| *frame).collect();
        let recur = 2 * people.len() <= pairs.len() && frames.len() < pairs.len();
        recur && people.len() <= MOST_PEOPLE && (!are_points || 2 * pairs.len() <= rows.len())
    };
    let perhaps = || {
        let named = columns.iter().enumerate().filter(|(_, column)| is_of(column, &PERHAPS_PEOPLE));
        named.map(|(at, _)| at).find(is_one)
    };
    place(columns, &PEOPLE).or_else(perhaps)
}

/// The names of the rows' frames; with people, the order of times if no column has names.
pub fn frames(columns: &StringRecord, rows: &[StringRecord], has_people: bool) -> Option<Vec<String>> {
    let cells = |at: usize| rows.iter().map(move |row| row.get(at).unwrap_or_default());
    if let Some(at) = place(columns, &FRAMES) {
        return Some(cells(at).map(str::to_owned).collect());
    }
    let at = place(columns, &TIMES).filter(|_| has_people)?;
    let times: Vec<f64> =
        cells(at).map(|cell| number(cell).filter(|time| time.is_finite())).collect::<Option<_>>()?;
    let mut known = times.clone();
    known.sort_unstable_by(f64::total_cmp);
    known.dedup();
    Some(times.iter().map(|time| known.partition_point(|other| other < time).to_string()).collect())
}

/// Frames per second by a column of times, to three decimals: by all steps if the times are even but for rounding, else by the
/// usual ones.
pub fn rate_hz(columns: &StringRecord, rows: &[StringRecord]) -> Option<f64> {
    let column = place(columns, &TIMES)?;
    let times: Vec<f64> = rows.iter().filter_map(|row| number(row.get(column)?)).collect();
    // People of one frame have the same time.
    let steps = times.windows(2).map(|two| two[1] - two[0]);
    let mut steps: Vec<f64> = steps.filter(|step| *step > 0.0).collect();
    steps.sort_unstable_by(f64::total_cmp);
    let step = steps.get(steps.len() / 2).copied()?;
    let decimals = rows
        .iter()
        .filter_map(|row| row.get(column)?.split_once(['.', ',']))
        .map(|(_, after)| after.trim().len());
    let unit = 0.1_f64.powi(decimals.max().unwrap_or(0) as i32);
    let mean_of = |steps: &[f64]| steps.iter().sum::<f64>() / steps.len() as f64;
    let of_all = mean_of(&steps);
    let mut frames = times;
    frames.dedup();
    // Errors of rounding do not add up, those of missing frames do.
    let is_even = frames
        .iter()
        .enumerate()
        .all(|(frame, time)| (time - frames[0] - frame as f64 * of_all).abs() < 1.1 * unit);
    let usual = steps.partition_point(|other| *other < 1.5 * step);
    // A rate between those of two rounded steps has many of both.
    let are_rounded = is_even && 10 * (steps.len() - usual) >= steps.len();
    let mean = if are_rounded { of_all } else { mean_of(&steps[..usual]) };
    let name = simple(columns.get(column)?);
    let unit = ["timestamp", "time"].into_iter().find_map(|word| name.strip_prefix(word));
    let per_second = match STATED.iter().find(|(stated, _)| unit == Some(*stated)) {
        Some((_, units)) => *units,
        None => UNITS.iter().find(|(most, _)| step <= *most).map_or(1e9, |(_, units)| *units),
    };
    Some((1000.0 * per_second / mean).round() / 1000.0).filter(|rate| rate.is_finite() && *rate > 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn records(text: &str) -> (StringRecord, Vec<StringRecord>) {
        let mut rows = text.lines().map(|line| line.split(',').collect::<StringRecord>());
        (rows.next().expect("a header"), rows.collect())
    }

    #[test]
    fn times_are_read_in_the_unit_that_makes_their_rate_one_of_a_camera() {
        for (column, step) in [
            ("time_s", 0.04),
            ("Time [s]", 0.04),
            ("time (ms)", 40.0),
            ("TimestampUs", 40_000.0),
            ("timestamp_ms", 40.0),
            ("timestamp", 40_000.0),
            ("Timestamp", 400_000.0),
            ("timestamp", 40_000_000.0),
            ("timestamp_us", 40_000.0),
        ] {
            let rows: String =
                (0..4).map(|frame| format!("\n{}", 7.0 * step + step * f64::from(frame))).collect();
            let (columns, rows) = records(&format!("{column}{rows}"));
            assert_eq!(rate_hz(&columns, &rows), Some(25.0), "{column} {step}");
        }
    }

    #[test]
    fn rounded_times_have_the_rate_of_all_their_steps() {
        for (column, rate, digits) in
            [("time", 30.0, 2), ("time", 60.0, 2), ("time", 75.0, 2), ("time_s", 60.0, 3)]
        {
            let rows: String =
                (0..=300).map(|frame| format!("\n{:.digits$}", f64::from(frame) / rate)).collect();
            let (columns, rows) = records(&format!("{column}{rows}"));
            assert_eq!(rate_hz(&columns, &rows), Some(rate), "{column} {rate}");
        }
        let times = (0..300).filter(|frame| ![7, 23, 24, 60].contains(frame));
        let rows: String = times.map(|frame| format!("\n{:.2}", f64::from(frame) / 100.0)).collect();
        let (columns, rows) = records(&format!("time{rows}"));
        assert_eq!(rate_hz(&columns, &rows), Some(100.0), "without four frames");
    }

    #[test]
    fn a_unit_in_the_name_of_times_counts_more_than_their_range() {
        for (text, rate) in [
            ("time_ms\n0\n1\n2", Some(1000.0)),
            ("timestamp_us\n0\n2000\n4000", Some(500.0)),
            ("time_s\n0\n2.5\n5", Some(0.4)),
            ("seconds\n0\n0\n1", None),
        ] {
            let (columns, rows) = records(text);
            assert_eq!(rate_hz(&columns, &rows), rate, "{text}");
        }
    }

    #[test]
    fn more_numbers_than_people_in_a_recording_are_not_those_of_people() {
        for (count, found) in [(16, Some(1)), (17, None)] {
            let rows: String = (0..2 * count).map(|n| format!("\n{},{}", n / count, n % count)).collect();
            let (columns, rows) = records(&format!("frame,id{rows}"));
            assert_eq!(people(&columns, &rows, false), found);
        }
    }

    #[test]
    fn a_column_of_numbers_is_one_of_people_if_they_recur_and_share_frames() {
        for (text, are_points, found) in [
            ("frame,id\n0,1\n0,2\n1,1\n1,2", false, Some(1)),
            ("Frame #,Person ID\n0,1\n1,2", false, Some(1)),
            ("frame,id\n0,1\n1,2\n2,3\n3,4", false, None),
            ("frame,id\n0,1\n0,2\n1,3\n1,4", false, None),
            ("frame,subject\n0,ann\n1,ann\n2,ann", false, None),
            ("id,n\n1,1\n2,1\n1,2\n2,2", false, None),
            ("frame,person_id\n0,1\n1,2", false, Some(1)),
            // Numbers of points.
            ("frame,id\n0,1\n0,2\n1,1\n1,2", true, None),
            ("frame,id\n0,1\n0,1\n0,2\n0,2\n1,1\n1,1\n1,2\n1,2", true, Some(1)),
        ] {
            let (columns, rows) = records(text);
            assert_eq!(people(&columns, &rows, are_points), found, "{text}");
        }
    }
}

//! Common parts of all body recordings: missing points written as zeros, a missing neck, and a plausible size.

use super::posture::body_points;
use super::recording::{Known, Source, Unit};
use crate::silhouette::capsule::Point3;
use std::collections::{HashMap, HashSet};

const POINTS: usize = 4;
/// Possible extents of a body with its props, mm; the file's unit is rejected beyond them.
const POSSIBLE_MM: [f64; 2] = [100.0, 20_000.0];
/// Extents that are not checked further, mm.
const USUAL_MM: [f64; 2] = [400.0, 6000.0];
const ADULT_MM: f64 = 1700.0;
/// Least size of a constant for missing points, file units.
const LEAST_CONSTANT: f64 = 1.0;
/// Three equal numbers of this size, file units, are never a place.
const FAR: f64 = 9999.0;

/// Hides and counts points at the origin. A root stays in frames with a person: it is there in all of them, and inside the
/// body in most.
pub fn hide_zeros(frames: &mut [Vec<Option<Point3>>]) -> usize {
    let zero = |point: &Option<Point3>| *point == Some([0.0; 3]);
    // The root itself and other points that are not zero.
    let has_person = |frame: &[Option<Point3>]| {
        frame.iter().filter(|point| point.is_some() && !zero(point)).count() + 1 >= POINTS
    };
    let people: Vec<&Vec<Option<Point3>>> = frames.iter().filter(|frame| has_person(frame)).collect();
    let mostly_inside = 2 * people.iter().filter(|frame| inside(frame)).count() > people.len();
    let root = |m: usize| mostly_inside && people.iter().all(|frame| frame.get(m).is_some_and(zero));
    let markers = frames.first().map_or(0, Vec::len);
    let roots: Vec<bool> = (0..markers).map(root).collect();
    let mut hidden = 0;
    for frame in frames {
        let has_person = has_person(frame);
        for (point, root) in frame.iter_mut().zip(&roots) {
            if zero(point) && !(*root && has_person) {
                *point = None;
                hidden += 1;
            }
        }
    }
    hidden
}

/// Hides and counts constants that programs write for missing points: three equal numbers (-1, -9999.99, 9999999) that
/// recur exactly, at several points or, if negative, at a point that is elsewhere in other frames. Returns the first one, too.
pub fn hide_constants(frames: &mut [Vec<Option<Point3>>]) -> Option<(usize, Point3)> {
    let constant = |point: &Option<Point3>| -> Option<[u64; 3]> {
        let place = (*point)?;
        let is_constant = place[0].abs() >= LEAST_CONSTANT && place.iter().all(|value| *value == place[0]);
        is_constant.then(|| place.map(f64::to_bits))
    };
    let all: &[Vec<Option<Point3>>] = frames;
    let points = || all.iter().flat_map(|frame| frame.iter().enumerate());
    let mut markers_at: HashMap<[u64; 3], Vec<usize>> = HashMap::new();
    for (marker, point) in points() {
        if let Some(place) = constant(point) {
            markers_at.entry(place).or_default().push(marker);
        }
    }
    if markers_at.is_empty() {
        return None;
    }
    let elsewhere: HashSet<usize> = points()
        .filter(|(_, point)| point.is_some() && constant(point).is_none())
        .map(|(marker, _)| marker)
        .collect();
    let is_missing = |place: &[u64; 3]| {
        let value = f64::from_bits(place[0]);
        markers_at.get(place).is_some_and(|markers| {
            let first = markers[0];
            let shared = markers.iter().any(|marker| *marker != first);
            let returns = value < 0.0 && elsewhere.contains(&first);
            value.abs() >= FAR || (markers.len() > 1 && (shared || returns))
        })
    };
    let mut hidden: Option<(usize, Point3)> = None;
    for point in frames.iter_mut().flatten() {
        let Some(place) = constant(point).filter(is_missing) else { continue };
        hidden.get_or_insert((0, place.map(f64::from_bits))).0 += 1;
        *point = None;
    }
    hidden
}

/// Adds a missing neck between the shoulders: the templates of keypoints join the head to the trunk by it. `aliases` are other
/// names of points.
pub fn add_neck(names: &mut Vec<String>, aliases: &[(usize, String)], frames: &mut [Vec<Option<Point3>>]) {
    let place = |wanted: &str| {
        let alias = || aliases.iter().find(|(_, alias)| alias == wanted).map(|(place, _)| *place);
        names.iter().position(|name| name == wanted).or_else(alias)
    };
    let shoulders = place("left shoulder").zip(place("right shoulder"));
    let (Some((left, right)), None) = (shoulders, place("shoulder centre")) else { return };
    let neck = place("neck").unwrap_or(names.len());
    if neck == names.len() {
        names.push("neck".into());
    }
    for frame in frames {
        frame.resize(names.len(), None);
        if let (None, Some(a), Some(b)) = (frame[neck], frame[left], frame[right]) {
            frame[neck] = Some(std::array::from_fn(|k| 0.5 * (a[k] + b[k])));
        }
    }
}

fn inside(frame: &[Option<Point3>]) -> bool {
    (0..3).all(|k| {
        let values = || frame.iter().flatten().map(|p| p[k]);
        values().any(|v| v < 0.0) && values().any(|v| v > 0.0)
    })
}

/// The unit, or the best fitting of mm, cm and m if the size is not human; a remark if none fits better. Keeps the caller's unit.
/// Measures the points `body`.
pub fn plausible(
    unit: Known<Unit>,
    frames: &[Vec<Option<Point3>>],
    body: &[usize],
) -> (Known<Unit>, Option<String>) {
    let limits = match unit.source {
        Source::Format => USUAL_MM,
        Source::File => POSSIBLE_MM,
        Source::Caller | Source::Unknown { .. } | Source::Guess { .. } => return (unit, None),
    };
    let Some(extent) = median_extent(frames, body) else { return (unit, None) };
    let stated_mm = extent * unit.value.mm;
    let is_within = |[low, high]: [f64; 2]| (low..=high).contains(&stated_mm);
    let off = |mm: f64| (extent * mm / ADULT_MM).ln().abs();
    let best = [1.0, 10.0, 1000.0].into_iter().min_by(|a, b| off(*a).total_cmp(&off(*b)));
    let other = best.filter(|mm| off(*mm) <= 1.5 && (mm - unit.value.mm).abs() >= 1e-9);
    let stated = if unit.source == Source::File { " as the file states" } else { "" };
    let reason = format!("in {}{stated} the body would be {stated_mm:.3} mm long", unit.value);
    match other.filter(|_| !is_within(limits)) {
        Some(mm) => {
            let source = Source::Guess { reason, sure: off(mm) < 0.7 };
            (Known { value: Unit { mm }, source }, None)
        }
        None if body.len() >= POINTS && !is_within(USUAL_MM) => {
            (unit, Some(format!("{reason}: the unit is doubtful (--units)")))
        }
        None => (unit, None),
    }
}

/// Median over frames of the largest extent, file units; `None` if no frame has enough points.
fn median_extent(frames: &[Vec<Option<Point3>>], body: &[usize]) -> Option<f64> {
    let extent = |frame: &Vec<Option<Point3>>| -> Option<f64> {
        let points = body_points(frame, body);
        let along = |k: usize| {
            let values = || points.iter().map(|p| p[k]);
            values().fold(f64::MIN, f64::max) - values().fold(f64::MAX, f64::min)
        };
        (points.len() >= POINTS).then(|| (0..3).map(along).fold(0.0, f64::max))
    };
    let mut extents: Vec<f64> = frames.iter().filter_map(extent).filter(|extent| *extent > 0.0).collect();
    extents.sort_by(f64::total_cmp);
    extents.get(extents.len() / 2).copied()
}

#[cfg(test)]
mod tests {
    use super::super::{read, recording::Choices};

    #[test]
    fn a_neck_is_added_to_keypoints_in_space_and_joins_the_head() {
        let joints = [
            ("nose", [0.1, 0.0, 1.6]),
            ("left_shoulder", [0.0, 0.2, 1.4]),
            ("right_shoulder", [0.0, -0.2, 1.4]),
            ("left_elbow", [0.0, 0.3, 1.1]),
            ("right_elbow", [0.0, -0.3, 1.1]),
            ("left_wrist", [0.0, 0.3, 0.9]),
            ("right_wrist", [0.0, -0.3, 0.9]),
            ("left_hip", [0.0, 0.1, 0.9]),
            ("right_hip", [0.0, -0.1, 0.9]),
            ("left_knee", [0.0, 0.1, 0.5]),
            ("right_knee", [0.0, -0.1, 0.5]),
            ("left_ankle", [0.0, 0.1, 0.1]),
            ("right_ankle", [0.0, -0.1, 0.1]),
        ];
        let header = joints.map(|(name, _)| format!("{name}_x,{name}_y,{name}_z")).join(",");
        let row = joints.map(|(_, place)| place.map(|v| v.to_string()).join(",")).join(",");
        let found = read(format!("{header}\n{row}\n").as_bytes(), "csv", Choices::default());
        let found = found.expect("a table");
        assert_eq!(found.by_name(0)["neck"], [0.0, 0.0, 1400.0]);
        assert_eq!(found.names.len(), 14);
    }

    fn csv(rows: &[[f64; 12]]) -> String {
        let mut text = String::from("A_x,A_y,A_z,B_x,B_y,B_z,C_x,C_y,C_z,D_x,D_y,D_z\n");
        for row in rows {
            text += &(row.map(|v| v.to_string()).join(",") + "\n");
        }
        text
    }

    #[test]
    fn a_missing_marker_at_zero_is_hidden_and_reported() {
        let row = [500.0, 900.0, 1700.0, 500.0, 900.0, 900.0, 450.0, 900.0, 100.0, 0.0, 0.0, 0.0];
        let found = read(csv(&[row]).as_bytes(), "csv", Choices::default()).expect("a table");
        assert_eq!(found.frames[0][3], None);
        let hidden = "1 points at exactly 0, 0, 0 are treated as missing markers".to_owned();
        assert!(found.remarks().contains(&hidden), "{:?}", found.remarks());
    }

    #[test]
    fn constants_for_missing_markers_are_hidden_and_reported() {
        let row =
            |[x, y, z]: [f64; 3]| [500.0, 900.0, 1700.0, 500.0, 900.0, 900.0, 450.0, 900.0, 100.0, x, y, z];
        for (constant, shown) in
            [(-1.0, "-1"), (-999.0, "-999"), (-9999.99, "-9999.99"), (9_999_999.0, "9999999")]
        {
            let rows = [row([700.0, 900.0, 800.0]), row([constant; 3]), row([constant; 3])];
            let found = read(csv(&rows).as_bytes(), "csv", Choices::default()).expect("a table");
            let seen: Vec<bool> = found.frames.iter().map(|frame| frame[3].is_some()).collect();
            assert_eq!(seen, [true, false, false], "{constant}");
            let remark = format!("2 points at {shown}, {shown}, {shown} are treated as missing markers");
            assert!(found.remarks().contains(&remark), "{:?}", found.remarks());
        }
        // A marker that stays.
        let still = csv(&[row([500.0; 3]); 2]);
        let found = read(still.as_bytes(), "csv", Choices::default()).expect("a table");
        assert_eq!(found.frames[1][3], Some([500.0; 3]));
    }

    #[test]
    fn the_root_of_root_relative_joints_is_kept() {
        let row = [-50.0, -40.0, 700.0, 60.0, 50.0, -800.0, 10.0, 0.0, 300.0, 0.0, 0.0, 0.0];
        let found = read(csv(&[row, row]).as_bytes(), "csv", Choices::default()).expect("a table");
        assert_eq!(found.frames[1][3], Some([0.0; 3]));
        // A frame without the person, and one in which the root is not inside.
        let reaching = [50.0, 40.0, 700.0, 60.0, 50.0, -800.0, 10.0, 0.0, 300.0, 0.0, 0.0, 0.0];
        let found = read(csv(&[row, [0.0; 12], row, reaching]).as_bytes(), "csv", Choices::default());
        let found = found.expect("a table");
        assert_eq!(found.frames[3][3], Some([0.0; 3]));
        assert!(found.frames[1].iter().all(Option::is_none), "{:?}", found.frames[1]);
    }

    #[test]
    fn a_body_of_two_millimetres_is_read_in_metres_unless_the_caller_names_the_unit() {
        let row = [0.5, 0.9, 1.7, 0.5, 0.9, 0.9, 0.45, 0.9, 0.1, 0.4, 0.9, 0.1];
        let found = read(csv(&[row]).as_bytes(), "csv", Choices::default()).expect("a table");
        assert_eq!(found.unit.value.mm, 1000.0);
        assert!(found.remarks()[0].contains("1.600 mm long"), "{:?}", found.remarks());
        let named = Choices { unit: Some(super::Unit { mm: 10.0 }), ..Choices::default() };
        assert_eq!(read(csv(&[row]).as_bytes(), "csv", named).expect("a table").unit.value.mm, 10.0);
    }

    #[test]
    fn a_body_too_small_for_the_unit_that_the_file_states_is_reported() {
        let names = ["LFHD", "C7", "LASI", "LTOE"];
        let header = names.join("\t\t\t");
        let text = |scale: f64| {
            let row = [1.7, 1.5, 1.0, 0.1].map(|y| format!("0.1\t{}\t0.1", scale * y)).join("\t");
            format!(
                "PathFileType\t4\nDataRate\tNumMarkers\tUnits\n100\t4\tm\nFrame#\tTime\t{header}\n\n\n1\t0\t{row}\n"
            )
        };
        let remarks = |scale: f64| {
            let found = read(text(scale).as_bytes(), "trc", Choices::default()).expect("a recording");
            assert_eq!(found.unit.value.mm, 1000.0);
            found.remarks().join("; ")
        };
        let small = remarks(0.2);
        assert!(
            small.contains(
                "in metres as the file states the body would be 320.000 mm long: the unit is doubtful"
            ),
            "{small}"
        );
        assert!(!remarks(1.0).contains("unit"), "{}", remarks(1.0));
    }

    #[test]
    fn the_unit_is_that_of_the_body_and_not_of_forces() {
        let names = ["LFHD", "C7", "LASI", "LTOE", "Force"];
        let header = names.map(|name| format!("{name}_x,{name}_y,{name}_z")).join(",");
        let text = format!("{header}\n.1,.1,1.7,.1,.2,1.5,.1,.2,1,.1,.2,.1,400,1200,9\n");
        let found = read(text.as_bytes(), "csv", Choices::default()).expect("a table");
        assert_eq!(found.unit.value.mm, 1000.0);
    }

    #[test]
    fn trc_files_as_cortex_and_rokoko_write_them_are_read() {
        let text = b"PathFileType\t4\t(X/Y/Z)\tM\xfcller.trc\nDataRate\tNumFrames\tNumMarkers\tUnits\n100\t3\t3\tyard\nFrame#\tTime\tA\t\t\t\t\t\tC\t\t\n\t\tX1\tY1\tZ1\tX2\tY2\tZ2\tX3\tY3\tZ3\n\n1\t0.0\t1\t2\t3\t4\t5\t6\t7\t8\t9\n2\t0.01\t1\t2\t3\t4\t5\t6\t7\t8\t9\n";
        let error = read(text, "trc", Choices::default()).expect_err("an unknown unit");
        assert!(error.to_string().contains("yard"), "{error}");
        let named = Choices { unit: Some(super::Unit::MM), ..Choices::default() };
        let found = read(text, "trc", named).expect("a recording");
        assert_eq!(
            (found.names.as_slice(), found.frames.len()),
            (["A".to_owned(), "C".to_owned()].as_slice(), 2)
        );
        assert_eq!(found.frames[0][1], Some([7.0, -9.0, 8.0]));
        assert_eq!(found.remarks().len(), 2, "{:?}", found.remarks());
    }
}

//! Whether a recorded person is upright: the head above the feet along the upward axis. A person upside-down means that
//! the other direction is up. A person who is longer than high may lie, unless the feet are on the ground of another axis.

use super::recording::{Known, Source, Up};
use crate::silhouette::{anatomy::Anatomy, capsule::Point3};

type Frames = [Vec<Option<Point3>>];

/// Share of the feet-to-head vector along an axis for a sure up axis.
const UPRIGHT: f64 = 0.8;
/// The span of spread arms equals the body height; this is clearly more.
const LONGER: f64 = 1.4;
/// Height of the feet above the origin over that of the head above the feet, of a person who stands on the ground.
const ON_GROUND: std::ops::RangeInclusive<f64> = -0.05..=0.15;

fn mean(frame: &[Option<Point3>], places: &[usize]) -> Option<Point3> {
    let at = |place: &usize| frame.get(*place).copied().flatten();
    let points: Vec<Point3> =
        places.iter().filter_map(at).filter(|p| p.iter().all(|v| v.is_finite())).collect();
    let of = |k: usize| points.iter().map(|p| p[k]).sum::<f64>() / points.len() as f64;
    (!points.is_empty()).then(|| [of(0), of(1), of(2)])
}

/// From the mean of the feet to the mean of the head, in each frame that shows both.
fn head_above_feet(frames: &Frames, head: &[usize], feet: &[usize]) -> Vec<Point3> {
    let way = |frame: &Vec<Option<Point3>>| {
        let (head, feet) = (mean(frame, head)?, mean(frame, feet)?);
        Some([head[0] - feet[0], head[1] - feet[1], head[2] - feet[2]])
    };
    frames.iter().filter_map(way).collect()
}

fn sum(ways: &[Point3]) -> Point3 {
    std::array::from_fn(|k| ways.iter().map(|way| way[k]).sum())
}

/// The direction along which the head is above the feet on average; `usual` without a head or feet.
pub fn upright(frames: &Frames, head: &[usize], feet: &[usize], usual: Up) -> Known<Up> {
    let upward = sum(&head_above_feet(frames, head, feet));
    let length = upward.iter().map(|v| v * v).sum::<f64>().sqrt();
    let value = if length > 0.0 { Up::along(upward) } else { usual };
    let part = if length > 0.0 { value.height(upward) / length } else { 0.0 };
    let reason = format!("for {:.0} % of the way from the feet to the head lie along it", 100.0 * part);
    Known { value, source: Source::Guess { reason, sure: part >= UPRIGHT } }
}

/// The axis along which a person stands on the ground in most frames, and the number of these frames.
fn standing(ways: &[Point3], frames: &Frames, anatomy: &Anatomy) -> Option<(Up, usize)> {
    let upward = sum(ways).map(|v| v / ways.len() as f64);
    let up = Up::along(upward);
    let high = up.height(upward);
    let mut heights: Vec<f64> =
        frames.iter().filter_map(|frame| Some(up.height(mean(frame, &anatomy.feet)?))).collect();
    heights.sort_unstable_by(f64::total_cmp);
    let feet = *heights.get(heights.len() / 2)?;
    let count = ways.iter().filter(|way| Up::along(**way) == up).count();
    let is_along = high >= UPRIGHT * upward.iter().map(|v| v * v).sum::<f64>().sqrt();
    (2 * count > ways.len() && is_along && ON_GROUND.contains(&(feet / high))).then_some((up, count))
}

/// Reverses an upward axis that was not stated where the head is below the feet in most frames, and replaces one that only the
/// format implies where the person stands along another; a remark where it was stated.
pub fn checked(
    up: Known<Up>,
    frames: &Frames,
    anatomy: &Anatomy,
    planar: bool,
) -> (Known<Up>, Option<String>) {
    let ways = head_above_feet(frames, &anatomy.head, &anatomy.feet);
    let (value, all) = (up.value, ways.len());
    if let Some((best, count)) = standing(&ways, frames, anatomy)
        && up.source == Source::Format
        && !planar
        && ![value, value.reversed()].contains(&best)
    {
        let reason = format!(
            "for the head is above the feet along it in {count} of {all} frames, and the feet are on its ground"
        );
        return (Known { value: best, source: Source::Guess { reason, sure: false } }, None);
    }
    let below = ways.iter().filter(|way| Up::along(**way) == value.reversed()).count();
    if 2 * below <= all {
        return (up, None);
    }
    let inverted = format!("with {value} up the head is below the feet in {below} of {all} frames");
    let reversed = value.reversed();
    match up.source {
        Source::Format | Source::Guess { .. } => {
            let source = Source::Guess { reason: format!("for {inverted}"), sure: true };
            (Known { value: reversed, source }, None)
        }
        Source::Caller | Source::File | Source::Unknown { .. } => {
            (up, Some(format!("the person is upside-down: {inverted} (--up {reversed} reverses it)")))
        }
    }
}

/// Most frames show a person longer than high: lying, or another axis points up. `frames` in the file's axes.
pub fn lying(up: Up, frames: &Frames, anatomy: &Anatomy, planar: bool) -> Option<String> {
    let ways = head_above_feet(frames, &anatomy.head, &anatomy.feet);
    // Spread arms hide the extents of a body.
    let of_ways = ways.iter().filter(|_| !planar).map(|way| {
        let [x, y, z] = up.to_z(*way).map(f64::abs);
        (x.max(y), z)
    });
    let extents = frames.iter().filter(|_| planar || ways.is_empty()).filter_map(|frame| {
        let points: Vec<Point3> =
            body_points(frame, &anatomy.body).iter().map(|point| up.to_z(*point)).collect();
        let side = |k: usize| extent(&points, k);
        (points.len() > 3).then(|| (side(0).max(side(1)), side(2)))
    });
    let (mut all, mut longer) = (0_usize, 0);
    for (along, high) in of_ways.chain(extents) {
        all += 1;
        longer += usize::from(along > LONGER * high);
    }
    if 2 * longer <= all {
        return None;
    }
    let advice = match Up::along(sum(&ways)) {
        _ if ways.is_empty() && planar => return None,
        _ if ways.is_empty() => "another axis points up (--up)".to_owned(),
        best if best == up => return None,
        best if planar => format!("the file has y before x (--up {best})"),
        best => format!("another axis points up (--up {best})"),
    };
    Some(format!("longer than high in {longer} of {all} frames: if the person does not lie, {advice}"))
}

/// Visible points that templates name, or all if they are too few.
pub fn body_points(frame: &[Option<Point3>], body: &[usize]) -> Vec<Point3> {
    const LEAST: usize = 4;
    let visible = |point: &Option<Point3>| point.filter(|p| p.iter().all(|v| v.is_finite()));
    if body.len() < LEAST {
        return frame.iter().filter_map(visible).collect();
    }
    body.iter().filter_map(|place| visible(frame.get(*place)?)).collect()
}

/// Distance between the outermost points along an axis.
pub fn extent(points: &[Point3], axis: usize) -> f64 {
    let values = || points.iter().map(|point| point[axis]);
    values().fold(f64::NEG_INFINITY, f64::max) - values().fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use crate::readers::{
        read,
        recording::{Choices, Recording, Up},
    };

    /// A body with its head 1.7 m above its feet along `up`, arms spread, and points that no template names.
    fn body(up: Up, feet_mm: f64) -> String {
        let turned = |[x, y, z]: [f64; 3]| {
            let point = [x, y, z + feet_mm - 100.0];
            // Inverse of the rotation to z up.
            let columns = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|axis| up.to_z(axis));
            columns.map(|column| (0..3).map(|k| column[k] * point[k]).sum::<f64>().to_string()).join(",")
        };
        let points = [
            ("LFHD", [100.0, -100.0, 1800.0]),
            ("RFHD", [250.0, -100.0, 1800.0]),
            ("LASI", [100.0, 60.0, 1000.0]),
            ("RASI", [300.0, 60.0, 1000.0]),
            ("LFIN", [-750.0, 60.0, 1500.0]),
            ("RFIN", [1150.0, 60.0, 1500.0]),
            ("LTOE", [100.0, 200.0, 100.0]),
            ("RTOE", [300.0, 200.0, 100.0]),
            ("LHipAngles", [40_000.0, 65.0, -170.0]),
        ];
        let header = points.map(|(name, _)| format!("{name}_x,{name}_y,{name}_z")).join(",");
        let row = points.map(|(_, point)| turned(point)).join(",");
        format!("time,{header}\n0,{row}\n0.01,{row}\n")
    }

    fn recording(text: &str, up: Option<Up>) -> Recording {
        read(text.as_bytes(), "csv", Choices { up, ..Choices::default() }).expect("a table")
    }

    fn is_upright(recording: &Recording) -> bool {
        let points = recording.by_name(0);
        (points["LFHD"][2] - points["LTOE"][2] - 1700.0).abs() < 1e-9
    }

    #[test]
    fn a_person_upside_down_reverses_an_axis_that_was_not_stated() {
        let upright = recording(&body(Up::Z, 100.0), None);
        assert!(is_upright(&upright) && upright.remarks().is_empty(), "{:?}", upright.remarks());
        let turned = recording(&body(Up::MinusZ, 100.0), None);
        assert!(is_upright(&turned) && turned.up.value == Up::MinusZ);
        assert!(turned.remarks()[0].contains("with z up the head is below the feet in 2 of 2 frames"));
        let stated = recording(&body(Up::MinusZ, 100.0), Some(Up::Z));
        assert!(!is_upright(&stated));
        assert!(stated.remarks()[0].contains("upside-down") && stated.remarks()[0].contains("--up -z"));
    }

    #[test]
    fn a_person_who_stands_on_the_ground_of_another_axis_is_turned_unless_the_axis_is_stated() {
        for (_, up) in Up::NAMED.into_iter().filter(|(_, up)| !matches!(up, Up::Z | Up::MinusZ)) {
            let turned = recording(&body(up, 100.0), None);
            assert!(is_upright(&turned) && turned.up.value == up, "{up}");
            let remarks = turned.remarks();
            assert!(
                remarks[0].starts_with(&format!("{up} is taken as up: a doubtful guess, for the head")),
                "{remarks:?}"
            );
            assert!(!is_upright(&recording(&body(up, 100.0), Some(Up::Z))), "{up}");
        }
    }

    #[test]
    fn a_person_who_leans_is_not_longer_than_high() {
        let leaning = body(Up::Z, 100.0).replace(",-100,1800", ",1900,1700");
        assert_ne!(leaning, body(Up::Z, 100.0));
        let remarks = recording(&leaning, None).remarks();
        assert!(remarks.iter().all(|remark| !remark.contains("longer than high")), "{remarks:?}");
    }

    #[test]
    fn a_person_who_may_lie_stays_and_the_advice_turns_them_upright() {
        for (_, up) in Up::NAMED.into_iter().filter(|(_, up)| !matches!(up, Up::Z | Up::MinusZ)) {
            let text = body(up, 600.0);
            let lying = recording(&text, None);
            assert!(!is_upright(&lying));
            let remarks = lying.remarks();
            assert!(remarks[0].starts_with("longer than high in 2 of 2 frames"), "{remarks:?}");
            assert!(remarks[0].ends_with(&format!("(--up {up})")), "{up} {remarks:?}");
            assert!(is_upright(&recording(&text, Some(up))), "{up}");
        }
    }
}

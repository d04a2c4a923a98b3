//! What a calibration is worth.

use farnear_depth::{calibrate::stack::StackLens, optics::RESPONSE_POINTS};

/// Share of errors within three standard deviations for the verdict `good`.
const HONEST: f64 = 0.97;
/// Least share of pixels with a depth.
const FILLED: f64 = 0.9;
/// Largest RMS error relative to the range. Real and simulated lenses have 0.01 to 0.03.
const ROUGH: f64 = 0.05;
/// Least span of the response in normalised depth, of 2.
const LEARNED: f64 = 1.2;
/// Largest difference of the blur's growth on the two sides of the focus, relative to the faster one. Simulated lenses
/// with aberrations have at most 0.04. A real one has 0.15 and accurate depth, so it is named only where depth suffers.
const ALIKE: f64 = 0.12;

/// `good`, or what to change.
pub fn verdict(found: &StackLens) -> String {
    if let Some(first) = found.wrapped {
        return format!(
            "the order looks wrapped: sharpness rises and falls once only if the stack begins with slice {}; number the slices in the \
             order of their focus, and calibrate again",
            first + 1
        );
    }
    if let Some(pair) = found.exchanged.first() {
        let [one, other] = pair.map(|slice| slice + 1);
        return format!(
            "slices {one} and {other} look exchanged, or one of them is defocused: in this order sharpness rises and falls more than \
             once; exchange them, or take the stack again"
        );
    }
    let foreign: Vec<String> = found.foreign.iter().map(|slice| (slice + 1).to_string()).collect();
    if !foreign.is_empty() {
        return format!(
            "slice {} does not fit the others: is it defocused, moved or of something else? Take the stack again",
            foreign.join(" or ")
        );
    }
    let learned = learned(found);
    if learned < LEARNED {
        return format!(
            "only {:.0} % of the range of a pair was learned, depths outside that part are left out: take more slices around the focus, \
             or tilt the target",
            50.0 * learned
        );
    }
    match (inaccurate(found), found.fixed_pattern) {
        (None, _) => "good".into(),
        (Some(_), Some(pattern)) => format!(
            "{:.0} % of the sharpest slice's finest detail is the same in the most defocused slices: it is probably of the \
             camera (response of its pixels, dust) and hides the blur; clean the sensor, or measure it with farnear calibrate camera and \
             give --camera-frames",
            100.0 * pattern
        ),
        (Some(advice), None) => match unlike_sides(found) {
            Some(unlike) => format!("{advice}; and {unlike}"),
            None => advice,
        },
    }
}

/// Blur that does not grow alike on both sides of the focus.
fn unlike_sides(found: &StackLens) -> Option<String> {
    let [before, behind] = found.blur.per_slice_px;
    let (slow, fast) = (before.min(behind), before.max(behind));
    if slow <= 0.0 {
        return Some(format!(
            "blur grows by {fast:.3} px per slice on one side of the focus and was not measured on the other: check that the slices are \
             in order, and take finer steps from well in front of the focus to well behind it"
        ));
    }
    (slow < (1.0 - ALIKE) * fast).then(|| {
        format!(
            "blur grows by {before:.3} px per slice on one side of the focus and by {behind:.3} px on the other, expected within {:.0} %: \
             check that the stage's steps are even, no slice is missing and the target is flat",
            100.0 * ALIKE
        )
    })
}

/// What to change where depth is inaccurate or missing.
fn inaccurate(found: &StackLens) -> Option<String> {
    let held_out = &found.held_out;
    if held_out.fill < FILLED {
        return Some(format!(
            "only {:.0} % of the target has a depth: check, in this order, for saturated (white) parts of the target, parts without fine \
             texture, too little light, too coarse a step, a lamp that changes over the stack, an image whose size changes by some \
             percent, a lens with an obscured centre (mirror lens)",
            100.0 * held_out.fill
        ));
    }
    let range = found.optics.working_range();
    let error = held_out.rms_mm / (range.far_mm - range.near_mm);
    if error > ROUGH {
        return Some(format!(
            "the error is {:.0} % of the range of a pair: look for slices that are missing, moved or out of order, and check that the \
             stage's steps are even, the target is flat and the lens has little field curvature",
            100.0 * error
        ));
    }
    if !(0.9..=1.1).contains(&held_out.slope) {
        return Some(format!(
            "measured depth changes {:.2} times as much as the stage moves: take a finer step or more slices around the focus",
            held_out.slope
        ));
    }
    if held_out.within_three < HONEST {
        return Some(format!(
            "{:.0} % of the errors are within three predicted standard deviations, 97 % are expected: check that the target is flat \
             and the stage's steps are even",
            100.0 * held_out.within_three
        ));
    }
    None
}

/// Normalised depth, of 2, that the response spans.
pub(super) fn learned(found: &StackLens) -> f64 {
    found.optics.stage().map_or(2.0, |stage| stage.response[RESPONSE_POINTS - 1] - stage.response[0])
}

#[cfg(test)]
mod tests {
    use farnear_depth::calibrate::stack::{HeldOut, blur::BlurCurve, focus_plane::FocusPlane};

    use super::*;

    fn good() -> StackLens {
        StackLens {
            optics: toml::from_str(include_str!("../../../../../examples/rig.toml")).unwrap(),
            plane: FocusPlane { x_per_px: 0.0, y_per_px: 0.0, at_origin: 6.0, spread: 0.0, blocks: 100 },
            blur: BlurCurve { points: Vec::new(), per_slice_px: [0.6; 2] },
            held_out: HeldOut {
                robust_mm: 0.1,
                rms_mm: 0.2,
                bias_mm: 0.0,
                slope: 1.0,
                fill: 1.0,
                within_three: 0.99,
                scatter: 1.0,
                pairs: 8,
                by_depth: Vec::new(),
            },
            trials: Vec::new(),
            foreign: Vec::new(),
            exchanged: Vec::new(),
            wrapped: None,
            fixed_pattern: None,
        }
    }

    #[test]
    fn a_fixed_pattern_is_named_where_depth_suffers() {
        let of = |held_out: HeldOut, fixed_pattern| verdict(&StackLens { held_out, fixed_pattern, ..good() });
        let usual = good().held_out;
        assert_eq!(of(usual.clone(), None), "good");
        assert_eq!(of(usual.clone(), Some(0.3)), "good");
        let [few, rough] =
            [(0.5, 0.2), (1.0, 10.0)].map(|(fill, rms_mm)| HeldOut { fill, rms_mm, ..usual.clone() });
        for held_out in [few, rough] {
            let without = of(held_out.clone(), None);
            assert!(without != "good" && !without.contains("calibrate camera"), "{without}");
            let with = of(held_out, Some(0.3));
            assert!(with.contains("30 %") && with.contains("calibrate camera"), "{with}");
        }
    }

    #[test]
    fn unlike_growth_of_blur_is_named_where_depth_suffers() {
        let of = |per_slice_px, fill| {
            let (blur, held_out) = (BlurCurve { points: Vec::new(), per_slice_px }, good().held_out);
            verdict(&StackLens { blur, held_out: HeldOut { fill, ..held_out }, ..good() })
        };
        let uneven = of([0.885, 0.615], 0.85);
        let words = ["85 %", "0.885 px", "0.615 px", "12 %", "even"];
        assert!(words.iter().all(|word| uneven.contains(word)), "{uneven}");
        let unmeasured = of([26.72, 0.0], 0.85);
        assert!(unmeasured.contains("26.720 px") && unmeasured.contains("not measured"), "{unmeasured}");
        let alike = of([0.76, 0.71], 0.85);
        let words = ["85 %", "saturated", "texture", "lamp", "mirror lens"];
        assert!(words.iter().all(|word| alike.contains(word)), "{alike}");
        // A real lens has these, and depth within 0.014 of its range.
        assert_eq!(of([1.153, 0.975], 1.0), "good");
    }

    #[test]
    fn a_wrapped_order_is_named_by_its_first_slice() {
        let found = verdict(&StackLens { wrapped: Some(3), ..good() });
        assert!(found.contains("begins with slice 4"), "{found}");
    }
}

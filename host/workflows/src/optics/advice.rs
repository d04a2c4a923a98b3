//! What to change in a pair's optics.

use farnear_depth::optics::{FocusSection, Optics, OpticsFile};

use crate::figures::rounded_for;

/// Usable range of the largest blur radius, px, and its target.
pub(super) const USABLE_BLUR_PX: [f64; 2] = [2.0, 4.0];
pub(super) const BEST_BLUR_PX: f64 = 2.7;
/// Radius of the Airy disc per f-number at 550 nm.
pub(super) const AIRY_UM: f64 = 0.67;
/// Largest radius of the Airy disc / largest blur radius that leaves the blur to defocus. It grows with the square of the f-number
/// and does not depend on the pixels.
const MOST_AIRY: f64 = 0.7;
/// Largest f-number of usual lenses.
const MOST_STOPPED: f64 = 22.0;

pub(super) fn advice(optics: &Optics) -> Vec<String> {
    // Focal length, f-number and pixel of a learned lens are assumed ones.
    let (blur, learned) = (optics.max_blur_px(), optics.stage().is_some());
    let range = optics.working_range();
    let distance = |mm: f64| rounded_for(range.far_mm - range.near_mm, mm, 2);
    // The cone of light of an aperture at the lens is 1 + magnification times as long as the f-number tells.
    let cone = range.sensor_travel_mm / (2e-3 * blur * optics.pixel_um());
    let airy_px = AIRY_UM * cone / optics.pixel_um();
    let best_is_of_defocus = |radius_px: f64| learned || radius_px <= MOST_AIRY * BEST_BLUR_PX;
    let [least, most] = USABLE_BLUR_PX;
    let mut advice = Vec::new();
    if blur > most {
        let binning = (blur / BEST_BLUR_PX).round().max(2.0);
        let stopped = blur / BEST_BLUR_PX;
        let f_number = optics.f_number() * stopped;
        let near = match of_blur(optics, BEST_BLUR_PX) {
            Some(near) if best_is_of_defocus(airy_px) => format!(
                ", or focus the near image at {} mm instead of {} mm",
                distance(near),
                distance(range.near_mm)
            ),
            _ => String::new(),
        };
        let stop = if !learned && f_number <= MOST_STOPPED && best_is_of_defocus(airy_px * stopped) {
            format!(", stop down to f/{f_number:.1}")
        } else {
            String::new()
        };
        advice.push(format!(
            "the largest blur radius is {blur:.1} px, usable is {least} to {most} px: bin {binning} x {binning} pixels{stop}{near}"
        ));
    } else if blur < least {
        let f_number = optics.f_number() * blur / BEST_BLUR_PX;
        let near = of_blur(optics, BEST_BLUR_PX)
            .map_or(String::new(), |near| format!(", or focus the near image at {} mm", distance(near)));
        let stop = if learned {
            "open the aperture".into()
        } else if f_number >= 0.95 {
            format!("open the aperture to f/{f_number:.1}")
        } else {
            "use a longer lens".into()
        };
        advice.push(format!(
            "the largest blur radius is {blur:.2} px, usable is {least} to {most} px: {stop}{near}"
        ));
    }
    if !learned && airy_px > MOST_AIRY * blur {
        advice.push(format!(
            "diffraction blurs by {airy_px:.1} px, as much as defocus does: open the aperture, or focus the two images farther apart"
        ));
    }
    advice
}

fn of_blur(optics: &Optics, blur_px: f64) -> Option<f64> {
    let mut file = OpticsFile::from(*optics);
    file.focus = FocusSection { max_blur_px: Some(blur_px), near_mm: None, ..file.focus };
    file.check().ok().map(|optics| optics.working_range().near_mm)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn optics(lens: &str, pixel_um: f64, focus: &str) -> Optics {
        let text = format!("[lens]\n{lens}\n[sensor]\npixel_um = {pixel_um:?}\n[focus]\n{focus}\n");
        toml::from_str::<OpticsFile>(&text).unwrap().check().unwrap()
    }

    fn rig(blur: f64) -> Optics {
        let focus = format!("far_mm = 933.0\nmax_blur_px = {blur:?}");
        optics("focal_length_mm = 50.0\naperture_mm = 12.8", 7.4, &focus)
    }

    #[test]
    fn advice_brings_the_blur_into_the_usable_range() {
        assert!(advice(&rig(2.703)).is_empty());
        let text = advice(&rig(133.0)).join("; ");
        assert!(
            text.contains("133.0 px") && text.contains("bin 49 x 49") && text.contains("near image at"),
            "{text}"
        );
        let wide = of_blur(&rig(133.0), BEST_BLUR_PX).unwrap();
        assert!((wide - rig(BEST_BLUR_PX).working_range().near_mm).abs() < 1e-9);
        assert!(advice(&rig(0.5)).join("; ").contains("open the aperture"));
    }

    #[test]
    fn advice_does_not_lead_into_diffraction() {
        // A phone's pixels: the blur of f/5.5 would be half diffraction.
        let phone = |f_number: f64| {
            let lens = format!("focal_length_mm = 4.2\nf_number = {f_number:?}");
            advice(&optics(&lens, 1.4, "far_mm = 1000.0\nnear_mm = 300.0")).join("; ")
        };
        let text = phone(1.8);
        assert!(text.contains("bin 3 x 3") && !text.contains("stop down"), "{text}");
        assert!(text.contains("near image at") && !text.contains("diffraction"), "{text}");
        assert!(phone(5.5).contains("diffraction blurs by 2.6 px"), "{}", phone(5.5));
        // Binning leaves the share of diffraction, a smaller range raises it.
        let stopped = "focal_length_mm = 50.0\nf_number = 32.0";
        let text = advice(&optics(stopped, 2.0, "far_mm = 500.0\nnear_mm = 400.0")).join("; ");
        assert!(text.contains("open the aperture, or focus the two images farther apart"), "{text}");
        assert!(text.contains("bin 5 x 5 pixels;") && !text.contains("larger pixels"), "{text}");
    }

    /// At five times life size the cone of an aperture at the lens is six times as long as the focal length.
    #[test]
    fn diffraction_grows_with_the_magnification() {
        let of = |telecentric: bool| {
            let lens = format!("focal_length_mm = 50.0\nf_number = 2.8\ntelecentric = {telecentric}");
            advice(&optics(&lens, 3.45, "far_mm = 60.0\nnear_mm = 59.995")).join("; ")
        };
        assert!(of(false).contains("diffraction blurs by 3.3 px"), "{}", of(false));
        assert!(!of(true).contains("diffraction"), "{}", of(true));
    }
}

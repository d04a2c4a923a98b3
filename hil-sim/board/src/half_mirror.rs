//! Half mirror: a second camera with its sensor further away, so one trigger gives far and near (Li 2014, 5.5, 10.2).

use std::str::FromStr;

use farnear_scene::Lens;

/// Largest sensor distance; far above the range of useful focus settings.
const FURTHER_MAX_UM: f64 = 10_000.0;

#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Further {
    Near,
    Micrometres(f64),
}

impl FromStr for Further {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == "near" {
            return Ok(Self::Near);
        }
        let further_um: Option<f64> = text.parse().ok().filter(|um| *um > 0.0 && *um <= FURTHER_MAX_UM);
        let expected = || format!("expected micrometres above 0, at most {FURTHER_MAX_UM}, or near");
        further_um.map(Self::Micrometres).ok_or_else(expected)
    }
}

impl Further {
    pub fn mm(self, lens: &Lens) -> f64 {
        match self {
            Self::Near => lens.sensor_near_mm - lens.sensor_far_mm,
            Self::Micrometres(um) => um * 1e-3,
        }
    }
}

#[cfg(test)]
mod tests {
    use farnear_scene::{OpticsFile, standard};

    use super::*;

    #[test]
    fn near_is_the_distance_between_the_focus_settings() {
        let lens = Lens::from_optics(&OpticsFile::parse(standard::OPTICS).expect("optics")).expect("a lens");
        let near: Further = "near".parse().expect("a word");
        // 2.703 px of blur on either side: 2 * 2.703 px * 7.4 um * 50 / 12.8.
        assert!((near.mm(&lens) - 0.156_27).abs() < 1e-5, "{}", near.mm(&lens));
        assert_eq!("150".parse(), Ok(Further::Micrometres(150.0)));
        for wrong in ["0", "-1", "NaN", "10001", "far"] {
            assert!(wrong.parse::<Further>().is_err_and(|expected| expected.contains("above 0")), "{wrong}");
        }
    }
}

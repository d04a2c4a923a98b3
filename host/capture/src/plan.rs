//! Axis positions for a pair: `sensor distance = datum + coarse + fine + lens`, nanometres unless named otherwise. The
//! lens stage is not moved; datum plus lens is the *base*, the distance with stage A at 0. The coarse stage centres
//! both distances in the piezo's range; the piezo corrects its error and switches between them in milliseconds.

use farnear_protocol::{
    message::Limits,
    units::{Micros, Nanometres},
};

/// Sensor distances of a pair from the principal plane.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct SensorPair {
    pub far_mm: f64,
    /// Larger than `far_mm`.
    pub near_mm: f64,
}

#[derive(Clone, PartialEq, Debug, thiserror::Error)]
pub enum PlanError {
    #[error("an exposure of {} us is outside the board's limits, {} to {} us", asked.0, min.0, max.0)]
    Exposure { asked: Micros, min: Micros, max: Micros },
    #[error(
        "{axis} to {:.3} um is outside the limits, {:.3} to {:.3} um",
        um(asked.0), um(min.0), um(max.0)
    )]
    Position { axis: &'static str, asked: Nanometres, min: Nanometres, max: Nanometres },
    #[error(
        "a continuous run repeats a cycle of 1 to {max} shots, which the board holds, this one has {asked}; shorten it, or take it \
         without a rate by `farnear rig sequence --runs`"
    )]
    Shots { asked: usize, max: u8 },
    #[error(
        "the optics ask for {travel_um:.2} um between the two images, the piezo has {piezo_um:.2} um; \
         a smaller max_blur_px or f-number needs less"
    )]
    Travel { travel_um: f64, piezo_um: f64 },
    #[error(
        "the optics ask for a sensor distance of {sensor_mm:.4} mm, the stage reaches {min_mm:.4} to {max_mm:.4} mm; \
         check focal length, focus distances, the setting datum_nm and where the lens stage stands"
    )]
    Reach { sensor_mm: f64, min_mm: f64, max_mm: f64 },
    #[error(
        "the piezo has {piezo_um:.1} um between fine_min_nm and fine_max_nm, the focus search needs {needed_um:.1} um; widen these \
         settings"
    )]
    Sweep { piezo_um: f64, needed_um: f64 },
    #[error(
        "with the coarse stage at {coarse_um:.3} um the piezo would have to go to {fine_um:.3} um, outside {min_um:.3} to {max_um:.3} um"
    )]
    CoarseOff { coarse_um: f64, fine_um: f64, min_um: f64, max_um: f64 },
}

fn nm(mm: f64) -> i64 {
    (mm * 1e6).round() as i64
}

fn um(nm: impl Into<i64>) -> f64 {
    nm.into() as f64 / 1e3
}

/// The whole step that centres the pair in the piezo's range.
pub fn coarse_for(pair: &SensorPair, base_nm: i64, limits: &Limits) -> Result<Nanometres, PlanError> {
    let (fine_min, fine_max) = (i64::from(limits.fine_min.0), i64::from(limits.fine_max.0));
    let (coarse_min, coarse_max) = (i64::from(limits.coarse_min.0), i64::from(limits.coarse_max.0));
    // Rounding costs up to half a step on either side.
    let step_nm = f64::from(limits.coarse_step_pm.max(1)) / 1e3;
    let travel = nm(pair.near_mm - pair.far_mm);
    if travel as f64 + step_nm > (fine_max - fine_min) as f64 {
        return Err(PlanError::Travel { travel_um: um(travel), piezo_um: um(fine_max - fine_min) });
    }
    for sensor_mm in [pair.far_mm, pair.near_mm] {
        let (min, max) = (base_nm + coarse_min + fine_min, base_nm + coarse_max + fine_max);
        if !(min..=max).contains(&nm(sensor_mm)) {
            return Err(PlanError::Reach { sensor_mm, min_mm: min as f64 / 1e6, max_mm: max as f64 / 1e6 });
        }
    }
    let middle = (nm(pair.far_mm) + nm(pair.near_mm)) / 2;
    let wanted = (middle - base_nm - (fine_min + fine_max) / 2).clamp(coarse_min, coarse_max);
    let whole_steps = (wanted as f64 / step_nm).round() * step_nm;
    Ok(Nanometres((whole_steps.round() as i64).clamp(coarse_min, coarse_max) as i32))
}

/// Piezo position for a sensor distance and the measured coarse position.
pub fn fine_for(
    sensor_mm: f64,
    base_nm: i64,
    coarse: Nanometres,
    limits: &Limits,
) -> Result<Nanometres, PlanError> {
    let fine = nm(sensor_mm) - base_nm - i64::from(coarse.0);
    if !(i64::from(limits.fine_min.0)..=i64::from(limits.fine_max.0)).contains(&fine) {
        return Err(PlanError::CoarseOff {
            coarse_um: um(coarse.0),
            fine_um: um(fine),
            min_um: um(limits.fine_min.0),
            max_um: um(limits.fine_max.0),
        });
    }
    Ok(Nanometres(fine as i32))
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use proptest::prelude::*;

    const BASE: i64 = 47_000_000;

    pub(crate) fn limits() -> Limits {
        Limits {
            datum: Nanometres(47_000_000),
            coarse_min: Nanometres(0),
            coarse_max: Nanometres(13_000_000),
            coarse_step_pm: 156_250,
            fine_min: Nanometres(5_000),
            fine_max: Nanometres(195_000),
            shots_max: 64,
            exposure_min: Micros(20),
            exposure_max: Micros(1_000_000),
            lens_min: Nanometres(0),
            lens_max: Nanometres(12_000_000),
            lens_step_pm: 156_250,
            distance_min: Nanometres(46_000_000),
            silence_min: Micros(100_000),
            silence_max: Micros(60_000_000),
            row_pixels_max: 1024,
        }
    }

    #[test]
    fn the_pair_of_the_50_mm_lens_lies_in_the_middle_of_the_piezo() {
        let pair = SensorPair { far_mm: 52.8313, near_mm: 52.9875 };
        let coarse = coarse_for(&pair, BASE, &limits()).unwrap();
        let far = fine_for(pair.far_mm, BASE, coarse, &limits()).unwrap();
        let near = fine_for(pair.near_mm, BASE, coarse, &limits()).unwrap();
        assert_eq!(near.0 - far.0, 156_200);
        // Centres of both and of the piezo's range agree to a step.
        assert!(((far.0 + near.0) / 2 - 100_000).abs() <= 157, "{far:?} {near:?}");
    }

    #[test]
    fn a_lens_stage_further_out_moves_the_sensor_in() {
        let pair = SensorPair { far_mm: 52.8313, near_mm: 52.9875 };
        let coarse = coarse_for(&pair, BASE, &limits()).unwrap();
        let with_lens = coarse_for(&pair, BASE + 1_000_000, &limits()).unwrap();
        assert_eq!(coarse.0 - with_lens.0, 1_000_000);
    }

    #[test]
    fn rejects_unreachable_distances() {
        let wide = SensorPair { far_mm: 52.0, near_mm: 52.2 };
        assert!(matches!(coarse_for(&wide, BASE, &limits()), Err(PlanError::Travel { .. })));
        // Far lenses, and one of 8 mm with the datum of another.
        for far_mm in [75.0, 8.2051] {
            let pair = SensorPair { far_mm, near_mm: far_mm + 0.1 };
            let error = coarse_for(&pair, BASE, &limits()).unwrap_err();
            assert!(
                matches!(error, PlanError::Reach { .. }) && error.to_string().contains("datum_nm"),
                "{error}"
            );
        }
        let off = fine_for(52.0, BASE, Nanometres(6_000_000), &limits()).unwrap_err();
        assert!(off.to_string().contains("-1000.000 um"), "{off}");
    }

    proptest! {
        /// Every pair in reach can be taken with the coarse stage up to 2 um off.
        #[test]
        fn every_pair_in_reach_is_reached(far in 47.1..59.9f64, travel in 0.001..0.185f64, off in -2_000..2_000i32) {
            let pair = SensorPair { far_mm: far, near_mm: far + travel };
            let coarse = coarse_for(&pair, BASE, &limits()).unwrap();
            let stands = Nanometres(coarse.0 + off);
            for sensor_mm in [pair.far_mm, pair.near_mm] {
                let fine = fine_for(sensor_mm, BASE, stands, &limits()).unwrap();
                let reached = 47_000_000 + stands.0 + fine.0;
                prop_assert!((f64::from(reached) / 1e6 - sensor_mm).abs() < 1e-6);
            }
        }
    }
}

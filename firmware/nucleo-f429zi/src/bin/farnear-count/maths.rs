//! Depth correction and its fit, sun and shadow.

use core::hint::black_box;

use farnear_maths::{
    angle::BinaryAngle,
    clsf::{
        Blend, Coefficient, Columns, Frame, Full, FullCoefficients, FullFit, RegionCoefficients, RegionFit,
        Regions,
    },
    shadow::{Deviations, Geometry, Shadow},
    sun::{Place, Sun},
};

use crate::{cycles, fail};

const WIDTH: usize = 640;
const HEIGHT: u16 = 480;
pub const PIXELS: u32 = WIDTH as u32;
/// A row inside a region, so that tables exist already.
pub const FIRST_ROW: u16 = 100;
pub const SAMPLES: u32 = 80;

/// Marsaglia's xorshift, 2003.
struct Numbers(u32);

impl Numbers {
    fn next(&mut self) -> u32 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 17;
        self.0 ^= self.0 << 5;
        self.0
    }

    fn code(&mut self) -> i16 {
        (self.next() >> 16) as i16 / 2
    }

    /// A realistically small coefficient.
    fn coefficient(&mut self) -> Coefficient {
        Coefficient::from_bits(self.next() as i32 >> 8).unwrap_or_default()
    }
}

fn frame() -> Frame {
    match Frame::new(WIDTH as u16, HEIGHT) {
        Ok(frame) => frame,
        Err(_) => fail(),
    }
}

fn region_coefficients() -> RegionCoefficients {
    let mut numbers = Numbers(7);
    let mut all = RegionCoefficients::default();
    all.as_flattened_mut().as_flattened_mut().fill_with(|| numbers.coefficient());
    all
}

fn full_coefficients() -> FullCoefficients {
    let mut numbers = Numbers(9);
    let mut all = FullCoefficients::default();
    all.fill_with(|| numbers.coefficient());
    all
}

pub enum Form {
    Regions,
    Blend,
    Full,
}

/// Counts the second of two rows.
pub fn of_rows(form: Form, first: u16) -> u32 {
    let mut numbers = Numbers(1);
    let mut row: [i16; WIDTH] = core::array::from_fn(|_| numbers.code());
    let mut table = [0; 3 * WIDTH];
    let second = if first == 0 { HEIGHT / 2 } else { first + 1 };
    let table = black_box(&mut table[..]);
    match form {
        Form::Regions => {
            let Ok(mut form) = Regions::new(region_coefficients(), frame(), table) else { fail() };
            let _ = form.correct_row(first, &mut row);
            cycles(|| form.correct_row(second, black_box(&mut row)))
        }
        Form::Blend => {
            let Ok(mut form) = Blend::new(region_coefficients(), frame(), table) else { fail() };
            let _ = form.correct_row(first, &mut row);
            cycles(|| form.correct_row(second, black_box(&mut row)))
        }
        Form::Full => {
            let Ok(mut form) = Full::new(full_coefficients(), frame(), table) else { fail() };
            let _ = form.correct_row(first, &mut row);
            cycles(|| form.correct_row(second, black_box(&mut row)))
        }
    }
}

/// Noisy rows of flat targets at six depths over the frame.
fn targets(mut add: impl FnMut(u16, Columns, &[i16], i16)) {
    let mut numbers = Numbers(3);
    for depth in 0..6 {
        let truth = depth * 8_000 - 20_000;
        for row in (0..HEIGHT).step_by(16) {
            let codes: [i16; SAMPLES as usize] = core::array::from_fn(|_| truth + numbers.code() / 64);
            add(row, Columns { first: 0, step: 8 }, &codes, truth);
        }
    }
}

fn sample_row() -> [i16; SAMPLES as usize] {
    let mut numbers = Numbers(5);
    core::array::from_fn(|_| numbers.code())
}

pub fn samples_of_regions() -> u32 {
    let mut fit = RegionFit::new(frame());
    let row = sample_row();
    cycles(|| fit.add_row(FIRST_ROW, Columns { first: 0, step: 8 }, black_box(&row), 100))
}

pub fn solve_regions() -> u32 {
    let mut fit = RegionFit::new(frame());
    targets(|row, columns, codes, truth| {
        let _ = fit.add_row(row, columns, codes, truth);
    });
    if fit.solve().is_err() {
        fail();
    }
    cycles(|| fit.solve())
}

pub fn samples_of_all() -> u32 {
    let mut fit = FullFit::new(frame());
    let row = sample_row();
    cycles(|| fit.add_row(FIRST_ROW, Columns { first: 0, step: 8 }, black_box(&row), 100))
}

pub fn solve_all() -> u32 {
    let mut fit = FullFit::new(frame());
    targets(|row, columns, codes, truth| {
        let _ = fit.add_row(row, columns, codes, truth);
    });
    if fit.solve().is_err() {
        fail();
    }
    cycles(|| fit.solve())
}

/// A summer afternoon in Coventry.
const MOMENT: i64 = 1_403_794_800;

fn place() -> Place {
    Place { latitude: BinaryAngle::from_degrees(52.4), longitude: BinaryAngle::from_degrees(-1.56) }
}

fn geometry() -> Geometry {
    Geometry {
        azimuth: BinaryAngle::from_degrees(20.0),
        camera_height_m: 1.5,
        distance_m: 8.0,
        lateral_m: 0.3,
        height_m: 1.75,
    }
}

pub fn sun() -> u32 {
    let (moment, place) = (black_box(MOMENT), black_box(place()));
    cycles(|| {
        let sun = Sun::at(moment, &place);
        (sun.elevation_deg(), sun.azimuth_deg())
    })
}

pub fn sun_and_shadow() -> u32 {
    let (moment, place, geometry) = (black_box(MOMENT), black_box(place()), black_box(geometry()));
    cycles(|| Shadow::at(moment, &place, &geometry))
}

pub fn sun_shadow_deviation() -> u32 {
    let (moment, place, geometry) = (black_box(MOMENT), black_box(place()), black_box(geometry()));
    let given = black_box(Deviations {
        day: 0.0,
        time_h: 0.01,
        latitude_deg: 0.01,
        longitude_deg: 0.01,
        azimuth_deg: 1.0,
        camera_height_m: 0.02,
        height_m: 0.05,
        distance_m: 0.1,
    });
    cycles(|| {
        let Ok(shadow) = Shadow::at(moment, &place, &geometry) else { fail() };
        (shadow, shadow.deviation(moment, &place, &geometry, &given))
    })
}

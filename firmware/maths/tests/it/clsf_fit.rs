//! The board's fit of a depth correction finds known polynomials.

use farnear_maths::clsf::{
    Columns, Error, FULL_TERMS, Frame, Full, FullFit, NO_VALUE, REGION_TERMS, RegionFit, Regions,
};

use crate::clsf::{Numbers, RegionReals, coordinate, regions_f64, twenty_terms};

/// Flat targets through a known inverse, by bisection: `truth = polynomial(x, y, U)` for every sample up to rounding.
fn target_row(
    (w, h): (usize, usize),
    row: usize,
    step: usize,
    truth: f64,
    exact: &dyn Fn((usize, usize), f64) -> f64,
) -> Vec<i16> {
    assert!(row < h);
    let solve = |column: usize| {
        let (mut low, mut high) = (-0.999, 0.999);
        for _ in 0..40 {
            let middle = (low + high) / 2.0;
            if exact((row, column), middle) < truth { low = middle } else { high = middle }
        }
        low
    };
    (0..w).step_by(step).map(|column| (solve(column) * 32_768.0).round() as i16).collect()
}

#[test]
fn the_boards_fit_finds_the_correction() {
    let size = (160, 120);
    let frame = Frame::new(160, 120).unwrap();
    let mut numbers = Numbers(9);
    let regions: RegionReals = std::array::from_fn(|_| {
        std::array::from_fn(|_| {
            let mut terms: [f64; REGION_TERMS] = std::array::from_fn(|_| 0.1 * (numbers.next() - 0.5));
            terms[7] += 1.0;
            terms
        })
    });
    let mut full: [f64; FULL_TERMS] = std::array::from_fn(|_| 0.1 * (numbers.next() - 0.5));
    full[10] += 1.0;
    let of_regions = |place, u| regions_f64(&regions, size, place, u);
    let of_full = |(row, column), u| twenty_terms(&full, coordinate(column, 160), coordinate(row, 120), u);
    let (mut region_fit, mut full_fit) = (RegionFit::new(frame), FullFit::new(frame));
    let columns = Columns { first: 0, step: 4 };
    for target in 0..8 {
        let truth = f64::from(target) / 7.0 - 0.5;
        let code = (truth * 32_768.0).round() as i16;
        for row in (0..120).step_by(4) {
            let depths = target_row(size, row, 4, truth, &of_regions);
            region_fit.add_row(row as u16, columns, &depths, code).unwrap();
            let depths = target_row(size, row, 4, truth, &of_full);
            full_fit.add_row(row as u16, columns, &depths, code).unwrap();
        }
    }
    // Compared at the targets' depths, at pixels between the samples.
    let (mut a, mut b) = (vec![0; 160], vec![0; 480]);
    let mut by_regions = Regions::new(region_fit.solve().unwrap(), frame, &mut a).unwrap();
    let mut by_full = Full::new(full_fit.solve().unwrap(), frame, &mut b).unwrap();
    for (truth, row) in [(-0.45, 3), (0.0, 61), (0.3, 117), (0.2, 58)] {
        for (name, exact, correct) in
            [("regions", &of_regions as &dyn Fn((usize, usize), f64) -> f64, true), ("full", &of_full, false)]
        {
            let mut depths = target_row(size, row, 1, truth, exact);
            if correct {
                by_regions.correct_row(row as u16, &mut depths).unwrap();
            } else {
                by_full.correct_row(row as u16, &mut depths).unwrap();
            }
            for (column, depth) in depths.iter().enumerate() {
                let error_mm = 30.0 * (f64::from(*depth) / 32_768.0 - truth);
                assert!(error_mm.abs() < 0.005, "{name} row {row} column {column}: {error_mm} mm");
            }
        }
    }
}

#[test]
fn an_underdetermined_fit_is_an_error() {
    let frame = Frame::new(60, 60).unwrap();
    let mut fit = RegionFit::new(frame);
    assert_eq!(fit.solve(), Err(Error::Underdetermined { samples: 0, terms: 10 }));
    let mut full = FullFit::new(frame);
    for truth in [-10_000_i16, 0, 10_000] {
        for row in 0..60 {
            fit.add_row(row, Columns::ALL, &[truth; 60], truth).unwrap();
            full.add_row(row, Columns::ALL, &[truth; 60], truth).unwrap();
        }
    }
    assert!(matches!(fit.solve(), Err(Error::Underdetermined { samples: 1200, .. })));
    assert!(matches!(full.solve(), Err(Error::Underdetermined { terms: 20, .. })));
    let row = [0; 60];
    assert_eq!(fit.add_row(60, Columns::ALL, &row, 0), Err(Error::NoSuchRow { row: 60, height: 60 }));
    for columns in
        [Columns { first: 1, step: 1 }, Columns { first: 0, step: 2 }, Columns { first: 0, step: 0 }]
    {
        assert_eq!(fit.add_row(0, columns, &row, 0), Err(Error::RowLength { pixels: 60, width: 60 }));
    }
    let holes = [NO_VALUE; 60];
    let before = fit.solve();
    fit.add_row(0, Columns::ALL, &holes, 0).unwrap();
    assert_eq!(fit.solve(), before);
}

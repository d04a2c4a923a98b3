//! Mathematics over the link: the host's bits, each request acts once, and none while a stepper moves.

use crate::bench::{self, Bench, go};
use farnear_maths::clsf::{
    Blend, Coefficient, Columns, Frame, Full, FullFit, RegionCoefficients, RegionFit, Regions,
};
use farnear_protocol::message::{
    Axis, CODES_MAX, COEFFICIENTS_MAX, Codes, CoefficientBits, CorrectionFault, CorrectionForm,
    CorrectionInfo, ResetCause, SunQuery,
};
use farnear_protocol::{Request, RequestError, Response};
use proptest::prelude::*;

const WIDTH: u16 = 160;
const HEIGHT: u16 = 120;

fn info(form: CorrectionForm) -> CorrectionInfo {
    CorrectionInfo { form, width: WIDTH, height: HEIGHT, centre_um: 900_000, half_span_um: 120_000 }
}

fn numbers(seed: u64) -> impl FnMut() -> i32 {
    let mut state = seed | 1;
    move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        (state >> 32) as i32
    }
}

fn put_coefficients(bench: &mut Bench, bits: &[i32]) {
    for (index, chunk) in bits.chunks(COEFFICIENTS_MAX).enumerate() {
        let bits = CoefficientBits::from_slice(chunk).expect("a chunk fits");
        bench.accepted(&Request::PutCoefficients { first: (index * COEFFICIENTS_MAX) as u8, bits });
    }
}

fn coefficients(bench: &mut Bench, count: u8) -> Vec<i32> {
    let mut all = Vec::new();
    for first in (0..count).step_by(COEFFICIENTS_MAX) {
        let count = (count - first).min(COEFFICIENTS_MAX as u8);
        match bench.ask(&Request::GetCoefficients { first, count }).1 {
            Ok(Response::Coefficients(bits)) => all.extend_from_slice(&bits),
            other => panic!("{other:?}"),
        }
    }
    all
}

fn correct(bench: &mut Bench, row: u16, codes: &[i16]) -> Vec<i16> {
    for (index, chunk) in codes.chunks(CODES_MAX).enumerate() {
        let codes = Codes::from_slice(chunk).expect("a chunk fits");
        bench.accepted(&Request::PutRow { first: (index * CODES_MAX) as u16, codes });
    }
    bench.accepted(&Request::CorrectRow { row });
    let mut out = Vec::new();
    for first in (0..codes.len()).step_by(CODES_MAX) {
        let count = (codes.len() - first).min(CODES_MAX) as u8;
        match bench.ask(&Request::GetRow { first: first as u16, count }).1 {
            Ok(Response::Row(codes)) => out.extend_from_slice(&codes),
            other => panic!("{other:?}"),
        }
    }
    out
}

fn reference(form: CorrectionForm, bits: &[i32], row: u16, codes: &[i16]) -> Vec<i16> {
    let frame = Frame::new(WIDTH, HEIGHT).expect("a good size");
    let coefficient = |index: usize| Coefficient::from_bits(bits[index]).expect("not i32::MIN");
    let regions: RegionCoefficients = std::array::from_fn(|r| {
        std::array::from_fn(|c| {
            std::array::from_fn(|t| {
                if bits.len() == 90 { coefficient((r * 3 + c) * 10 + t) } else { Coefficient::default() }
            })
        })
    });
    let (mut table, mut out) = ([0; 3 * WIDTH as usize], codes.to_vec());
    match form {
        CorrectionForm::Regions => {
            Regions::new(regions, frame, &mut table).and_then(|mut form| form.correct_row(row, &mut out))
        }
        CorrectionForm::Blend => {
            Blend::new(regions, frame, &mut table).and_then(|mut form| form.correct_row(row, &mut out))
        }
        CorrectionForm::Full => Full::new(std::array::from_fn(coefficient), frame, &mut table)
            .and_then(|mut form| form.correct_row(row, &mut out)),
    }
    .expect("a good row");
    out
}

fn forms() -> impl Strategy<Value = CorrectionForm> {
    prop_oneof![Just(CorrectionForm::Regions), Just(CorrectionForm::Blend), Just(CorrectionForm::Full)]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(20))]

    #[test]
    fn rows_have_the_hosts_bits(form in forms(), seed in any::<u64>(), rows in prop::collection::vec(0..HEIGHT, 1..8)) {
        let mut bench = Bench::new(700.0);
        let mut next = numbers(seed);
        bench.accepted(&Request::OpenCorrection(info(form)));
        let bits: Vec<i32> = (0..form.coefficients()).map(|_| next() / 8).collect();
        put_coefficients(&mut bench, &bits);
        prop_assert_eq!(&coefficients(&mut bench, form.coefficients()), &bits);
        for row in rows {
            let codes: Vec<i16> = (0..WIDTH).map(|_| (next() >> 16) as i16).collect();
            prop_assert_eq!(correct(&mut bench, row, &codes), reference(form, &bits, row, &codes));
        }
    }

    #[test]
    fn a_fit_has_the_hosts_bits_and_can_be_kept(form in forms(), seed in any::<u64>()) {
        let mut bench = Bench::new(700.0);
        let mut next = numbers(seed);
        bench.accepted(&Request::OpenCorrection(info(form)));
        let frame = Frame::new(WIDTH, HEIGHT).expect("a good size");
        let (mut of_regions, mut of_all) = (RegionFit::new(frame), FullFit::new(frame));
        for depth in 0..6i16 {
            let truth = depth * 6_000 - 15_000;
            for row in (0..HEIGHT).step_by(10) {
                let list: Vec<i16> = (0..40).map(|_| truth + (next() >> 24) as i16 * 4).collect();
                let codes = Codes::from_slice(&list).expect("40 fit");
                bench.accepted(&Request::FitSamples { row, first: 1, step: 4, truth, codes });
                let columns = Columns { first: 1, step: 4 };
                of_regions.add_row(row, columns, &list, truth).expect("a good row");
                of_all.add_row(row, columns, &list, truth).expect("a good row");
            }
        }
        bench.accepted(&Request::SolveFit);
        let expected: Vec<i32> = match form {
            CorrectionForm::Full => of_all.solve().expect("determined").map(Coefficient::to_bits).to_vec(),
            _ => {
                let solved = of_regions.solve().expect("determined");
                solved.as_flattened().as_flattened().iter().map(|c| c.to_bits()).collect()
            }
        };
        prop_assert_eq!(&coefficients(&mut bench, form.coefficients()), &expected);
        bench.accepted(&Request::StoreCorrection);
        bench.run_ms(10);
        bench.restart(1, ResetCause::PowerOn);
        prop_assert_eq!(bench.ask(&Request::LoadCorrection).1, Ok(Response::Correction(info(form))));
        prop_assert_eq!(&coefficients(&mut bench, form.coefficients()), &expected);
    }
}

#[test]
fn a_repeated_correction_acts_once() {
    let mut bench = Bench::new(700.0);
    bench.accepted(&Request::OpenCorrection(info(CorrectionForm::Full)));
    let mut bits = [0; 20];
    (bits[0], bits[10]) = (1 << 26, 1 << 29); // U + 1/8
    put_coefficients(&mut bench, &bits);
    let codes = Codes::from_slice(&[0; CODES_MAX]).expect("they fit");
    bench.accepted(&Request::PutRow { first: 0, codes });
    let request = Request::CorrectRow { row: 3 };
    let (id, _) = bench.ask(&request);
    assert_eq!(bench.ask_as(id, bench::BOOT, &request), Ok(Response::Accepted), "a retry");
    let Ok(Response::Row(row)) = bench.ask(&Request::GetRow { first: 0, count: 1 }).1 else {
        panic!("a row")
    };
    assert_eq!(row[0], 4_096, "an eighth once, not twice");
}

/// The rows' table is kept from one row to the next while the coefficients stay.
#[test]
fn a_row_is_corrected_with_the_coefficients_that_are_open_now() {
    let mut bench = Bench::new(700.0);
    let codes: Vec<i16> = (0..WIDTH as i16).map(|column| 150 * column - 12_000).collect();
    let mut next = numbers(5);
    let mut draw = |form: CorrectionForm| (0..form.coefficients()).map(|_| next() / 8).collect::<Vec<i32>>();
    for form in [CorrectionForm::Regions, CorrectionForm::Blend, CorrectionForm::Full] {
        let [kept, other] = [(); 2].map(|()| draw(form));
        let [by_kept, by_other] = [&kept, &other].map(|bits| reference(form, bits, 7, &codes));
        assert_ne!(by_kept, by_other);
        // Opened behind a row of the form before.
        bench.accepted(&Request::OpenCorrection(info(form)));
        put_coefficients(&mut bench, &kept);
        bench.accepted(&Request::StoreCorrection);
        assert_eq!(correct(&mut bench, 7, &codes), by_kept, "{form:?}: opened");
        put_coefficients(&mut bench, &other);
        assert_eq!(correct(&mut bench, 7, &codes), by_other, "{form:?}: other coefficients");
        bench.ask(&Request::LoadCorrection).1.expect("one is stored");
        assert_eq!(correct(&mut bench, 7, &codes), by_kept, "{form:?}: loaded");
    }
}

#[test]
fn impossible_requests_are_rejected_with_a_reason() {
    let mut bench = Bench::new(700.0);
    let fault = |fault| Err(RequestError::Correction(fault));
    assert_eq!(bench.ask(&Request::CorrectRow { row: 0 }).1, fault(CorrectionFault::None));
    assert_eq!(bench.ask(&Request::LoadCorrection).1, fault(CorrectionFault::None));
    for (width, height) in [(1_025, 480), (5, 480), (640, 0)] {
        let info = CorrectionInfo { width, height, ..info(CorrectionForm::Full) };
        assert_eq!(bench.ask(&Request::OpenCorrection(info)).1, fault(CorrectionFault::Size));
    }
    for half_span_um in [0, -1] {
        let info = CorrectionInfo { half_span_um, ..info(CorrectionForm::Full) };
        assert_eq!(bench.ask(&Request::OpenCorrection(info)).1, fault(CorrectionFault::Size));
    }
    bench.accepted(&Request::OpenCorrection(info(CorrectionForm::Full)));
    assert_eq!(bench.ask(&Request::SolveFit).1, fault(CorrectionFault::Underdetermined));
    assert_eq!(bench.ask(&Request::CorrectRow { row: HEIGHT }).1, fault(CorrectionFault::Place));
    let beyond = Request::PutRow { first: WIDTH - 1, codes: Codes::from_slice(&[1, 2]).expect("two fit") };
    assert_eq!(bench.ask(&beyond).1, fault(CorrectionFault::Place));
    let too_many = Request::GetRow { first: 0, count: CODES_MAX as u8 + 1 };
    assert_eq!(bench.ask(&too_many).1, fault(CorrectionFault::Place));
    let bits = |bits: &[i32]| CoefficientBits::from_slice(bits).expect("they fit");
    for (first, bits) in [(19, bits(&[1, 2])), (0, bits(&[i32::MIN]))] {
        assert_eq!(
            bench.ask(&Request::PutCoefficients { first, bits }).1,
            fault(CorrectionFault::Coefficient)
        );
    }
    let step = Request::FitSamples {
        row: 0,
        first: 0,
        step: 0,
        truth: 0,
        codes: Codes::from_slice(&[1, 2]).expect("fits"),
    };
    assert_eq!(bench.ask(&step).1, fault(CorrectionFault::Place));
}

#[test]
fn nothing_is_calculated_while_something_moves() {
    let mut bench = Bench::homed();
    for axis in [Axis::SensorCoarse, Axis::SensorFine] {
        let request = bench.accepted(&go(axis, 100_000));
        let busy = Err(RequestError::Busy { request });
        assert_eq!(bench.ask(&Request::OpenCorrection(info(CorrectionForm::Full))).1, busy);
        let sun = SunQuery { unix_seconds: 0, latitude_e7: 0, longitude_e7: 0, shadow: None };
        assert_eq!(bench.ask(&Request::Sun(sun)).1, busy);
        bench.end_of(request);
    }
    bench.accepted(&Request::OpenCorrection(info(CorrectionForm::Full)));
}

#[test]
fn ticks_that_catch_up_after_a_long_calculation_do_not_shake_the_piezo() {
    let mut bench = Bench::new(700.0);
    bench.work(&go(Axis::SensorFine, 120_000));
    for _ in 0..5 {
        bench.catch_up(22);
        for _ in 0..200 {
            bench.tick();
            let off = bench.hardware.piezo_nm - 120e3;
            assert!(off.abs() <= 50.0, "{off} nm");
        }
    }
}

//! Fixed-point CLSF compared with the polynomials in f64.

use farnear_maths::clsf::{
    Blend, Coefficient, DepthScale, Error, FULL_TERMS, Frame, Full, FullCoefficients, NO_VALUE, REGION_TERMS,
    REGIONS, RegionCoefficients, Regions,
};
use proptest::prelude::*;

/// Working range of the rig in Li 2014: half of it times 1.3 is 30 mm.
const FAR_MM: f32 = 933.0;
const NEAR_MM: f32 = 886.81;
/// Specified error; quantisation of input and output alone may take (0.5 + 0.5 slope) of 0.92 um.
const TOLERANCE_MM: f64 = 0.005;

pub type RegionReals = [[[f64; REGION_TERMS]; REGIONS]; REGIONS];

pub fn coordinate(index: usize, length: usize) -> f64 {
    2.0 * index as f64 / (length as f64 - 1.0) - 1.0
}

fn ten_terms(c: &[f64; REGION_TERMS], x: f64, y: f64, u: f64) -> f64 {
    let powers = [1.0, x, x * x, x.powi(3), y, y * y, y.powi(3), u, u * u, u.powi(3)];
    c.iter().zip(powers).map(|(c, power)| c * power).sum()
}

pub fn twenty_terms(c: &[f64; FULL_TERMS], x: f64, y: f64, u: f64) -> f64 {
    let of_xy = [1.0, x, x * x, x.powi(3), y, x * y, x * x * y, y * y, x * y * y, y.powi(3)];
    let of_u = [u, x * u, x * x * u, y * u, x * y * u, y * y * u];
    let of_u2 = [u * u, x * u * u, y * u * u, u.powi(3)];
    c.iter().zip(of_xy.iter().chain(&of_u).chain(&of_u2)).map(|(c, power)| c * power).sum()
}

fn region_start(region: usize, length: usize) -> usize {
    length * region / REGIONS
}

fn region_of(index: usize, length: usize) -> usize {
    (0..REGIONS).rev().find(|&region| index >= region_start(region, length)).unwrap()
}

fn centre(region: usize, length: usize) -> f64 {
    (region_start(region, length) + region_start(region + 1, length) - 1) as f64 / 2.0
}

fn weights(index: usize, length: usize) -> [f64; REGIONS] {
    let place = index as f64;
    std::array::from_fn(|region| {
        let here = centre(region, length);
        let neighbour =
            if place < here { region.checked_sub(1) } else { Some(region + 1).filter(|&r| r < REGIONS) };
        neighbour.map_or(1.0, |neighbour| {
            (1.0 - (place - here).abs() / (centre(neighbour, length) - here).abs()).max(0.0)
        })
    })
}

pub fn regions_f64(c: &RegionReals, (w, h): (usize, usize), (row, column): (usize, usize), u: f64) -> f64 {
    let terms = &c[region_of(row, h)][region_of(column, w)];
    ten_terms(terms, coordinate(column, w), coordinate(row, h), u)
}

fn blend_f64(c: &RegionReals, (w, h): (usize, usize), (row, column): (usize, usize), u: f64) -> f64 {
    let (x, y) = (coordinate(column, w), coordinate(row, h));
    let (of_rows, of_columns) = (weights(row, h), weights(column, w));
    let mut sum = 0.0;
    for i in 0..REGIONS {
        for j in 0..REGIONS {
            sum += of_rows[i] * of_columns[j] * ten_terms(&c[i][j], x, y, u);
        }
    }
    sum
}

/// Repeatable numbers in [0, 1), so that rows need no strategy each.
pub struct Numbers(pub u64);

impl Numbers {
    pub fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }
}

fn quantise<const N: usize>(c: &[f64; N]) -> [Coefficient; N] {
    c.map(|c| Coefficient::from_f64(c).unwrap())
}

fn quantise_regions(c: &RegionReals) -> RegionCoefficients {
    c.map(|row| row.map(|terms| quantise(&terms)))
}

/// Identity plus a distortion like that in Li 2014, fig. 6.1.
fn realistic_terms(numbers: &mut Numbers) -> [f64; REGION_TERMS] {
    let mut terms = std::array::from_fn(|_| 0.4 * (numbers.next() - 0.5));
    terms[7] += 1.0;
    terms
}

fn realistic_regions(numbers: &mut Numbers) -> RegionReals {
    std::array::from_fn(|_| std::array::from_fn(|_| realistic_terms(numbers)))
}

/// Largest difference of `fixed` from `exact` in mm, over random depths inside the scale.
fn largest_error_mm(
    (w, h): (usize, usize),
    rows: impl Iterator<Item = usize>,
    numbers: &mut Numbers,
    mut fixed: impl FnMut(u16, &mut [i16]),
    exact: impl Fn((usize, usize), f64) -> f64,
) -> f64 {
    let scale = DepthScale::for_range(FAR_MM, NEAR_MM).unwrap();
    let (centre, span) = (f64::from(scale.centre_mm()), f64::from(scale.half_span_mm()));
    let mut largest = 0.0_f64;
    for row in rows {
        assert!(row < h);
        let depths: Vec<f64> = (0..w).map(|_| centre + span * 0.99 * (2.0 * numbers.next() - 1.0)).collect();
        let mut codes: Vec<i16> = depths.iter().map(|&depth| scale.encode(depth as f32)).collect();
        fixed(row as u16, &mut codes);
        for (column, (&depth, &code)) in depths.iter().zip(&codes).enumerate() {
            let exact = exact((row, column), (depth - centre) / span);
            if exact.abs() < 0.9999 {
                largest = largest.max((f64::from(scale.decode(code)) - centre - span * exact).abs());
            } else if exact.abs() > 1.0001 {
                assert!(scale.decode(code).is_nan(), "{exact} gave {code}");
            }
        }
    }
    largest
}

#[test]
fn regions_agree_with_f64() {
    let mut numbers = Numbers(1);
    let size = (640, 480);
    let c = realistic_regions(&mut numbers);
    let mut table = vec![0; Regions::table_words(640)];
    let mut fixed = Regions::new(quantise_regions(&c), Frame::new(640, 480).unwrap(), &mut table).unwrap();
    let correct = |row, codes: &mut [i16]| fixed.correct_row(row, codes).unwrap();
    let error = largest_error_mm(size, 0..480, &mut numbers, correct, |p, u| regions_f64(&c, size, p, u));
    println!("largest error {error:.6} mm");
    assert!(error < TOLERANCE_MM, "{error} mm");
}

#[test]
fn blend_agrees_with_f64() {
    let mut numbers = Numbers(2);
    let size = (640, 480);
    let c = realistic_regions(&mut numbers);
    let mut table = vec![0; Blend::table_words(640)];
    let mut fixed = Blend::new(quantise_regions(&c), Frame::new(640, 480).unwrap(), &mut table).unwrap();
    let correct = |row, codes: &mut [i16]| fixed.correct_row(row, codes).unwrap();
    let error = largest_error_mm(size, 0..480, &mut numbers, correct, |p, u| blend_f64(&c, size, p, u));
    println!("largest error {error:.6} mm");
    assert!(error < TOLERANCE_MM, "{error} mm");
}

#[test]
fn full_agrees_with_f64() {
    let mut numbers = Numbers(3);
    let size = (640, 480);
    let mut c: [f64; FULL_TERMS] = std::array::from_fn(|_| 0.3 * (numbers.next() - 0.5));
    c[10] += 1.0;
    let mut table = vec![0; Full::table_words(640)];
    let mut fixed = Full::new(quantise(&c), Frame::new(640, 480).unwrap(), &mut table).unwrap();
    let correct = |row, codes: &mut [i16]| fixed.correct_row(row, codes).unwrap();
    let exact = |(row, column), u| twenty_terms(&c, coordinate(column, 640), coordinate(row, 480), u);
    let error = largest_error_mm(size, 0..480, &mut numbers, correct, exact);
    println!("largest error {error:.6} mm");
    assert!(error < TOLERANCE_MM, "{error} mm");
}

fn fingerprint(codes: &[i16]) -> u64 {
    codes.iter().flat_map(|code| code.to_le_bytes()).fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3)
    })
}

/// The board's bits: they may change only with a new firmware version, because stored results would differ.
#[test]
fn bits_are_frozen() {
    let mut numbers = Numbers(4);
    let c = quantise_regions(&realistic_regions(&mut numbers));
    let mut full: [f64; FULL_TERMS] = std::array::from_fn(|_| 0.3 * (numbers.next() - 0.5));
    full[10] += 1.0;
    let frame = Frame::new(101, 77).unwrap();
    let depths: Vec<i16> = (0..101)
        .map(|i| if i % 10 == 9 { NO_VALUE } else { ((numbers.next() - 0.5) * 65_000.0) as i16 })
        .collect();
    let (mut a, mut b, mut f) = (vec![0; 101], vec![0; 303], vec![0; 303]);
    let mut regions = Regions::new(c, frame, &mut a).unwrap();
    let mut blend = Blend::new(c, frame, &mut b).unwrap();
    let mut full = Full::new(quantise(&full), frame, &mut f).unwrap();
    let mut prints = [0; 3];
    for row in 0..77 {
        let mut rows = [depths.clone(), depths.clone(), depths.clone()];
        regions.correct_row(row, &mut rows[0]).unwrap();
        blend.correct_row(row, &mut rows[1]).unwrap();
        full.correct_row(row, &mut rows[2]).unwrap();
        for (print, codes) in prints.iter_mut().zip(&rows) {
            assert!(codes.iter().skip(9).step_by(10).all(|&code| code == NO_VALUE));
            *print ^= fingerprint(codes).rotate_left(u32::from(row) % 64);
        }
    }
    assert_eq!(prints, FROZEN, "{prints:#x?}");
}

const FROZEN: [u64; 3] = [0x686b_ffe7_02ec_8d46, 0x5704_7695_3d08_dcdf, 0x448b_91ad_f41a_d70a];

#[test]
fn rows_may_come_in_any_order() {
    let c = quantise_regions(&realistic_regions(&mut Numbers(5)));
    let frame = Frame::new(40, 31).unwrap();
    let depths: Vec<i16> = (0..40).map(|i| (i - 20) * 900).collect();
    let (mut a, mut b) = (vec![0; 120], vec![0; 120]);
    let mut in_order = Blend::new(c, frame, &mut a).unwrap();
    let mut backwards = Blend::new(c, frame, &mut b).unwrap();
    let one: Vec<Vec<i16>> =
        (0..31).map(|row| corrected(&depths, |d| in_order.correct_row(row, d))).collect();
    let two: Vec<Vec<i16>> =
        (0..31).rev().map(|row| corrected(&depths, |d| backwards.correct_row(row, d))).collect();
    assert!(one.iter().eq(two.iter().rev()));
}

fn corrected(depths: &[i16], correct: impl FnOnce(&mut [i16]) -> Result<(), Error>) -> Vec<i16> {
    let mut depths = depths.to_vec();
    correct(&mut depths).unwrap();
    depths
}

#[test]
fn invalid_inputs_are_errors() {
    assert_eq!(Frame::new(5, 480), Err(Error::FrameSize { width: 5, height: 480 }));
    assert_eq!(Frame::new(640, 8193), Err(Error::FrameSize { width: 640, height: 8193 }));
    assert!(matches!(DepthScale::for_range(900.0, 900.0), Err(Error::EmptyRange { .. })));
    assert!(matches!(DepthScale::for_range(900.0, f32::NAN), Err(Error::EmptyRange { .. })));
    for value in [4.0, -4.0, f64::NAN, f64::INFINITY] {
        assert!(matches!(Coefficient::from_f64(value), Err(Error::CoefficientTooLarge { .. })), "{value}");
    }
    assert!(Coefficient::from_bits(i32::MIN).is_err());
    let frame = Frame::new(640, 480).unwrap();
    let c = RegionCoefficients::default();
    let mut table = [0; 640];
    assert_eq!(
        Blend::new(c, frame, &mut table).unwrap_err(),
        Error::TableTooSmall { given: 640, needed: 1920 }
    );
    let mut regions = Regions::new(c, frame, &mut table).unwrap();
    let mut row = [1; 640];
    assert_eq!(regions.correct_row(480, &mut row), Err(Error::NoSuchRow { row: 480, height: 480 }));
    assert_eq!(regions.correct_row(0, &mut row[1..]), Err(Error::RowLength { pixels: 639, width: 640 }));
    assert_eq!(row, [1; 640]);
}

#[test]
fn scale_takes_no_end_for_a_measurement() {
    let scale = DepthScale::for_range(NEAR_MM, FAR_MM).unwrap();
    assert_eq!(scale.encode(f32::NAN), NO_VALUE);
    assert!(scale.decode(NO_VALUE).is_nan() && scale.decode(i16::MAX).is_nan());
    let (centre, span) = (scale.centre_mm(), scale.half_span_mm());
    assert_eq!(scale.encode(centre + 1.01 * span), NO_VALUE);
    assert_eq!(scale.encode(centre - 1.01 * span), NO_VALUE);
    for step in -100..=100 {
        let depth = centre + 0.0099 * span * step as f32;
        assert!((scale.decode(scale.encode(depth)) - depth).abs() <= span / 65_000.0 + 1e-4, "{depth}");
    }
}

fn extreme() -> impl Strategy<Value = f64> {
    prop_oneof![Just(3.999_999_998), Just(-3.999_999_998), -3.9..3.9]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// With overflow checks, coefficients at the edge of Q2.29 and extreme depths verify the stated ranges.
    #[test]
    fn nothing_overflows(
        c in prop::array::uniform3(prop::array::uniform3(prop::array::uniform10(extreme()))),
        f in prop::array::uniform20(extreme()),
        w in 6_usize..70, h in 6_usize..70, seed in any::<u64>(),
    ) {
        let frame = Frame::new(w as u16, h as u16).unwrap();
        let mut numbers = Numbers(seed);
        let (mut a, mut b, mut t) = (vec![0; 3 * w], vec![0; 3 * w], vec![0; 3 * w]);
        let quantised = quantise_regions(&c);
        let mut regions = Regions::new(quantised, frame, &mut a).unwrap();
        let mut blend = Blend::new(quantised, frame, &mut b).unwrap();
        let terms: FullCoefficients = quantise(&f);
        let mut full = Full::new(terms, frame, &mut t).unwrap();
        for row in [0, h / 3, h / 2, h - 1] {
            let codes: Vec<i16> = (0..w)
                .map(|_| match numbers.next() {
                    n if n < 0.3 => -32_767,
                    n if n < 0.6 => 32_766,
                    n => ((n - 0.5) * 60_000.0) as i16,
                })
                .collect();
            let exact: [Box<dyn Fn(usize, f64) -> f64>; 3] = [
                Box::new(|column, u| regions_f64(&c, (w, h), (row, column), u)),
                Box::new(|column, u| blend_f64(&c, (w, h), (row, column), u)),
                Box::new(|column, u| twenty_terms(&f, coordinate(column, w), coordinate(row, h), u)),
            ];
            let results = [
                corrected(&codes, |d| regions.correct_row(row as u16, d)),
                corrected(&codes, |d| blend.correct_row(row as u16, d)),
                corrected(&codes, |d| full.correct_row(row as u16, d)),
            ];
            for (exact, result) in exact.iter().zip(&results) {
                for (column, (&code, &result)) in codes.iter().zip(result).enumerate() {
                    let expected = exact(column, f64::from(code) / 32_768.0) * 32_768.0;
                    let expected = expected.clamp(-32_768.0, 32_767.0);
                    prop_assert!((expected - f64::from(result)).abs() <= 0.6, "{expected} {result}");
                }
            }
        }
    }
}

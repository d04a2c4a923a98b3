//! Every family, design, kernel size, blur and PSF gives usable operators, also after storage.
#![allow(clippy::unwrap_used)] // Helpers of tests may fail like tests.

use crate::common::{Texture, rig};
use farnear_depth::kernel::LARGEST_SIZE;
use farnear_depth::metrics::{CompareSettings, compare};
use farnear_depth::operators::{Design, DesignError, Family, Operators, Request, design};
use farnear_depth::optics::{Optics, OpticsFile};
use farnear_depth::pipeline::{Settings, depth_from_pair};
use farnear_depth::psf::Psf;
use ndarray::Array2;

fn relative_rmse(operators: &Operators, optics: &Optics) -> f64 {
    let texture = Texture::sand(128, 3);
    let alphas = [-0.95, -0.5, 0.3, 0.8];
    let squares: f64 = alphas
        .iter()
        .map(|alpha| {
            let [far, near] = texture.pair(optics.psf(), optics.max_blur_px(), *alpha);
            let map =
                depth_from_pair(far.view(), near.view(), operators, optics, &Settings::default()).unwrap();
            let truth = Array2::from_elem(far.dim(), optics.depth_mm(*alpha) as f32);
            let settings = CompareSettings { border_px: 16, ..CompareSettings::default() };
            let rmse_mm = compare(map.depth_mm.view(), truth.view(), None, &settings).unwrap().rmse_mm;
            (rmse_mm / optics.depth_per_alpha_mm(*alpha)).powi(2)
        })
        .sum();
    (squares / alphas.len() as f64).sqrt()
}

fn optics(psf: &str, max_blur_px: f64) -> Optics {
    let mut file = OpticsFile::from(rig(psf));
    file.focus.max_blur_px = Some(max_blur_px);
    file.check().unwrap()
}

/// 0.01 is 0.23 mm of the rig's 46 mm. The linear design is the most accurate.
#[test]
fn every_family_and_design_measures_depth() {
    for (family, how, psf, limit) in [
        (Family::Ro, Design::Linear, "pillbox", 0.003),
        (Family::Ro, Design::Thesis, "pillbox", 0.010),
        (Family::Watanabe, Design::Linear, "pillbox", 0.004),
        (Family::Raj, Design::Linear, "pillbox", 0.008),
        (Family::Gro, Design::Linear, "gaussian:k=0.4578", 0.005),
        (Family::Gro, Design::Thesis, "gaussian:k=0.4578", 0.010),
        (Family::Ggro, Design::Linear, "generalised:p=1.8,k=0.4802", 0.007),
        (Family::Ggro, Design::Thesis, "generalised:p=1.8,k=0.4802", 0.015),
    ] {
        let optics = rig(psf);
        let request = Request { family, design: how, ..Request::for_optics(&optics) };
        let operators = design(&request).unwrap();
        let error = relative_rmse(&operators, &optics);
        println!("{}: {error:.4}", operators.name());
        assert!(error < limit, "{}: {error}", operators.name());
    }
}

#[test]
fn other_sizes_blurs_and_exponents_measure_depth_too() {
    for (psf, max_blur_px, kernel_size, limit) in [
        ("gaussian:k=0.4578", 2.703, 5, 0.02),
        ("gaussian:k=0.4578", 2.703, 9, 0.005),
        ("gaussian:k=0.4578", 2.703, 11, 0.005),
        ("gaussian:k=0.4578", 2.703, 13, 0.005),
        ("pillbox", 1.5, 7, 0.01),
        ("pillbox", 4.0, 9, 0.01),
        ("gaussian:k=0.6", 2.0, 7, 0.01),
        ("generalised:p=4,k=0.5091", 2.703, 7, 0.01),
        ("generalised:p=1.2,k=0.5", 2.0, 7, 0.02),
    ] {
        let optics = optics(psf, max_blur_px);
        let request = Request { kernel_size, ..Request::for_optics(&optics) };
        let operators = design(&request).unwrap();
        let error = relative_rmse(&operators, &optics);
        println!("{}: {error:.4}", operators.name());
        assert!(error < limit, "{}: {error}", operators.name());
    }
}

#[test]
fn kernels_have_the_responses_of_their_roles() {
    for psf in ["pillbox", "gaussian:k=0.4578"] {
        let operators = Operators::for_optics(&rig(psf)).unwrap();
        let at = |kernel: &farnear_depth::kernel::Kernel, w: f64| kernel.response(w, 0.0);
        assert!(at(operators.prefilter(), 0.0).abs() < 1e-12, "Q removes the mean exactly");
        let pass = (1..32).map(|i| at(operators.prefilter(), 0.1 * f64::from(i))).fold(0.0, f64::max);
        assert!(
            pass > 5.0 * at(operators.prefilter(), 3.1).abs(),
            "Q suppresses what says little about depth"
        );
        // Gm1 is a low-pass, Gp1 a band-pass.
        assert!(at(operators.gm1(), 0.3) > 2.0 * at(operators.gm1(), 1.5));
        assert!(at(operators.gp1(), 1.2) > 2.0 * at(operators.gp1(), 0.2));
        assert!(at(operators.gp1(), 1.2) > 2.0 * at(operators.gp1(), 3.1));
        // The ratio of the kernels is the slope of the NIR (its linear coefficient).
        let fit = operators.normalised_ratio();
        let i = fit.frequency_rad_px.iter().position(|w| (*w - 0.785).abs() < 0.01).unwrap();
        let ratio =
            at(operators.gp1(), fit.frequency_rad_px[i]) / at(operators.gm1(), fit.frequency_rad_px[i]);
        assert!((ratio / fit.linear[i] - 1.0).abs() < 0.1, "{ratio} for {}", fit.linear[i]);
    }
}

#[test]
fn operators_survive_storage_and_bad_files_are_refused() {
    let optics = rig("generalised:p=1.8,k=0.4802");
    let largest = design(&Request { kernel_size: LARGEST_SIZE, ..Request::for_optics(&optics) }).unwrap();
    assert_eq!(toml::from_str::<Operators>(&toml::to_string(&largest).unwrap()).unwrap(), largest);
    let operators = Operators::for_optics(&optics).unwrap();
    let text = toml::to_string(&operators).unwrap();
    let read: Operators = toml::from_str(&text).unwrap();
    assert_eq!(read, operators);
    let refused = |from: &str, to: &str| {
        assert!(text.contains(from), "{from}");
        toml::from_str::<Operators>(&text.replacen(from, to, 1)).unwrap_err().to_string()
    };
    assert!(refused("format = 1", "format = 2").contains("operators of format 2"));
    assert!(refused("kernel_size = 7", "kernel_size = 9").contains("share one size"));
    assert!(refused("family = \"ggro\"", "family = \"gro\"").contains("made for the gaussian PSF"));
    assert!(refused("k = 0.4802", "k = -1.0").contains("PSF parameter k = -1"));
    assert!(refused("family = \"ggro\"", "family = \"ggro\"\ncolour = 1").contains("unknown field"));
}

#[test]
fn requests_that_cannot_be_met_say_why() {
    let request = Request::for_optics(&rig("pillbox"));
    let refused = |change: fn(&mut Request)| {
        let mut request = request;
        change(&mut request);
        design(&request).unwrap_err()
    };
    assert_eq!(refused(|r| r.max_blur_px = 0.1), DesignError::MaxBlur(0.1));
    assert_eq!(refused(|r| r.max_blur_px = f64::NAN).to_string(), DesignError::MaxBlur(f64::NAN).to_string());
    assert!(refused(|r| r.kernel_size = 8).to_string().contains("kernel size 8"));
    assert!(matches!(refused(|r| r.psf = Psf::Gaussian { k: 0.5 }), DesignError::FamilyNeedsOtherPsf { .. }));
    assert!("pbro".parse::<Family>().unwrap_err().to_string().contains("watanabe, raj"));
    for family in Family::ALL {
        assert_eq!(family.to_string().parse::<Family>().unwrap(), family);
    }
}

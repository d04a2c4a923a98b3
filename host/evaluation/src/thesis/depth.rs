//! Chapters 4 to 6: rational operators and four other methods with one imperfect lens, and its corrections.

mod bench;
mod costs;
mod planes;
mod scenes;
mod shapes;

use anyhow::Result;

use crate::{
    chart::{self, Curve, Plot},
    page::{Page, mm},
    rig,
};
use bench::Bench;

/// The lens' point spread function, as measured in the thesis (section 5.4).
const LENS_PSF: &str = "generalised:p=1.8,k=0.4802";

pub fn measure(page: &mut Page) -> Result<()> {
    page.heading("Chapters 4 to 6: depth from defocus");
    page.paragraph(
        "One lens for all of it: 50 mm with an aperture of 12.8 mm, pixels of 7.4 um, focused at 933 mm and so that blur reaches 2.703 px (section 5.4). Its point spread \
         function is the generalised Gaussian that the thesis measured (p 1.8, k 0.4802), and its focus varies over the field in ellipses around a centre to the \
         lower right, as in fig. 6.1: `alpha_eff = alpha - 0.08 + 0.5 (0.45 - 0.20 alpha) rho2`. Images have 640 x 480 pixels and 8 bit, with the noise of 9,000 \
         electrons; coefficients are smoothed over 7x7, the median has 3x3. Renderer and operators share no formula. Methods know the lens by what calibration \
         finds through it, and nothing else.",
    );
    rig_of_chapter_4(page)?;
    normalised_ratio(page)?;
    let bench = Bench::new()?;
    bench.describe(page)?;
    let planes = planes::Planes::measure(&bench)?;
    planes::operators(page, &planes)?;
    let scenes = scenes::measure(page, &bench, &planes)?;
    planes::depth_dependence(page, &planes)?;
    planes::corrections(page, &planes)?;
    scenes::pictures(page, &scenes)?;
    costs::measure(page, &bench, &planes)?;
    page.subheading("What could not be redone");
    page.paragraph(
        "The stone house, the lion, the soldier, the shell and the bird of figs. 6.9 to 6.14 exist as prints only. Simulated planes cannot show what the thesis' own had and \
         it does not tell: play of the micrometers, the scale of the vernier calliper, the lens' aberrations beyond p and k, and the lamp.",
    );
    Ok(())
}

fn rig_of_chapter_4(page: &mut Page) -> Result<()> {
    page.subheading("The rig (sections 4.3 and 5.4)");
    let optics = rig::optics(LENS_PSF)?;
    let range = optics.working_range();
    let image = |object: f64| 1.0 / (1.0 / optics.focal_length_mm() - 1.0 / object);
    let (far, near) = (image(range.far_mm), image(range.near_mm));
    let row = |what: &str, here: String, li: &str| vec![what.into(), here, li.into()];
    let rows = [
        row("effective f-number", format!("{:.4}", optics.f_number()), "3.9063"),
        row("sensor for the far focus, mm", format!("{far:.4}"), "52.8313"),
        row("distance of the two sensor positions, mm", format!("{:.4}", near - far), "0.1563"),
        row("sensor for the near focus, mm", format!("{near:.4}"), "52.9876"),
        row("near end of the working range, mm", format!("{:.2}", range.near_mm), "886.8"),
        row("depth where both images are blurred alike, mm", format!("{:.2}", optics.depth_mm(0.0)), "-"),
        row(
            "depth that 5 um of the sensor's position are worth, mm",
            format!("{:.2}", 0.005 / (near - far) * (range.far_mm - range.near_mm)),
            "-",
        ),
    ];
    page.table(1, &["", "here", "Li 2014"], &rows);
    page.paragraph(
        "The last line counts: the thesis gives 5 um as the precision to which its sensor is placed by hand (section 5.5), so that its depths can be off by more than a \
         millimetre before anything is computed. The radius of 2.703 px is 20 um (\"10 um\" in section 4.4 is a slip).",
    );
    Ok(())
}

fn normalised_ratio(page: &mut Page) -> Result<()> {
    use farnear_depth::normalised_ratio::{first_non_monotonic, normalised_ratio as ratio};
    use farnear_depth::psf::Psf;
    page.subheading("The normalised image ratio (fig. 5.2)");
    let models = [
        ("pill-box", Psf::PillBox),
        ("Gaussian, k 0.4578", Psf::Gaussian { k: 0.4578 }),
        ("generalised, p 4, k 0.5091", Psf::Generalised { p: 4.0, k: 0.5091 }),
    ];
    let blur_px = rig::optics("pillbox")?.max_blur_px();
    let (mut plots, mut rows) = (Vec::new(), Vec::new());
    for (name, psf) in models {
        let otf = psf.otf(blur_px);
        // Frequencies of a 32-point transform, as in section 5.2.3.
        let curves = (1..=16).map(|i| std::f64::consts::PI * f64::from(i) / 16.0).map(|w| {
            let alphas = (0..=80).map(|j| -1.0 + f64::from(j) / 40.0);
            let points = alphas.map(|alpha| (alpha, ratio(&otf, blur_px, w, alpha)));
            Curve { name: String::new(), points: points.filter(|(_, y)| y.abs() <= 1.25).collect() }
        });
        plots.push(Plot {
            title: name.into(),
            labels: ["normalised depth", "NIR"],
            curves: curves.collect(),
            vertical: Some([-1.25, 1.25]),
        });
        let bend = first_non_monotonic(&otf, blur_px);
        // `first_non_monotonic` is exact to 1 %.
        let bend = if bend.is_finite() { format!("{bend:.2}") } else { "never".into() };
        rows.push(vec![name.into(), bend]);
    }
    page.picture(
        "thesis-nir.png",
        &chart::grid(3, &plots)?,
        "NIR over normalised depth for 16 radial frequencies from 0.196 (dark) to 3.142 rad/px (light), fig. 5.2",
    )?;
    page.table(1, &["PSF", "first frequency whose NIR stops rising, rad/px"], &rows);
    page.paragraph(
        "As in the thesis the high frequencies of the pill-box turn back, those of the Gaussian never do, those of p = 4 do. The sign is that of M = I2 - I1, with which the \
         ratio rises with alpha; eq. 5.2 has the other one. In the thesis all curves stay within [-1, 1]: the pill-box leaves it beyond the common zeros of \
         its transfer functions (cut off at 1.25 here), and its \"0.1963 Hz\" are rad/px.",
    );
    Ok(())
}

fn beside(here: f64, li: Option<f64>) -> String {
    li.map_or_else(|| mm(here), |li| format!("{here:.2} ({li:.2})"))
}

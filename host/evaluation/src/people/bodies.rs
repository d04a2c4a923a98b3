//! The thesis' chapter 7 redone: silhouettes from markers (fig. 7.6) and activities from eight sides (fig. 7.10).

use anyhow::{Context, Result};
use farnear_recognition::synthetic::activities::{ACTIVITIES, performance};
use farnear_silhouettes::mask::{Mask, centre::centred};
use farnear_silhouettes::readers::{self, recording::Choices};
use farnear_silhouettes::silhouette::{
    parts,
    raster::{Point, fill_discs_hull},
    template::Template,
    view::{Canvas, View, draw, extent, views_round},
};
use ndarray::Array2;

use super::{data::Data, sets::RATE_HZ};
use crate::{
    page::Page,
    panels::{self, Scale},
};

const VIEWS: usize = 8;
const RECORDING: &str = "mocap/cmu_02_05.c3d";
const SIZE: [usize; 2] = [570, 420];
const MM_PER_PX: f64 = 3.6;
const CLOSED_MM: f64 = 126.0;

pub fn measure(page: &mut Page, data: &Data) -> Result<()> {
    page.heading("Silhouettes from bodies (figs. 7.6 to 7.10)");
    from_markers(page, data).context("fig. 7.6")?;
    from_eight_sides(page).context("fig. 7.10")?;
    page.paragraph(
        "Not redone: figs. 7.7 and 7.8 are drawings of the axes and of where the cameras stood and show no data; fig. 7.9 wants markers on actors and props at the ten activities, which were never published.",
    );
    Ok(())
}

fn grey(mask: &Mask) -> Array2<f32> {
    mask.mapv(|set| if set { 0.0 } else { 1.0 })
}

/// Fig. 7.6: markers, projected hulls, silhouettes, from four sides.
fn from_markers(page: &mut Page, data: &Data) -> Result<()> {
    let Some(bytes) = data.bytes(RECORDING)? else {
        page.paragraph("Fig. 7.6 is skipped: no recording of markers is at hand.");
        return Ok(());
    };
    let recording = readers::read(&bytes, "c3d", Choices::default())?;
    let template = Template::named("plug-in-gait")?;
    let markers = recording.by_name(recording.frames.len() / 2);
    let (has, of) = template.coverage(&recording.known_names());
    let sides = ["front", "right", "back", "left"];
    let (mut dots, mut hulls, mut whole) = (Vec::new(), Vec::new(), Vec::new());
    for (side, view) in sides.into_iter().zip(views_round(sides.len(), 0.0)) {
        let reach = parts::extent(std::slice::from_ref(&markers), &template, &view);
        let middle = Canvas::fitting(&reach, MM_PER_PX, 0).context("markers at finite places")?.middle_mm;
        let canvas =
            Canvas { height_px: SIZE[0], width_px: SIZE[1], mm_per_px: MM_PER_PX, middle_mm: middle };
        let mut mask = canvas.blank();
        let places: Vec<Point> = markers.values().map(|place| canvas.pixel(view.project(*place))).collect();
        for place in places {
            fill_discs_hull(&mut mask, (place, 4.0), (place, 4.0));
        }
        let drawn = parts::draw(&markers, &template, &view, &canvas, parts::Fill::Hull).mask;
        let closed = parts::close(&drawn, (CLOSED_MM / MM_PER_PX).round() as usize);
        dots.push((format!("{side}: markers"), grey(&mask)));
        hulls.push(("hulls of parts".to_owned(), grey(&drawn)));
        whole.push(("silhouette".to_owned(), grey(&closed)));
    }
    let maps: Vec<_> = dots.into_iter().chain(hulls).chain(whole).collect();
    page.picture(
        "thesis-markers.png",
        &panels::titled(sides.len(), &maps, Scale::Grey(1.0))?,
        "Silhouettes from markers, fig. 7.6: markers, projected hulls of the body's parts, silhouettes after closing, from four sides",
    )?;
    page.paragraph(&format!(
        "A frame of CMU's motion capture ({has} of the template's {of} markers; the thesis' own suit has 77, and 29 on props). As in the thesis heads come out small, for few markers are on them. The template has few markers a part and thickens its parts, so that closing gaps of 126 mm, as the thesis does with its thin ones, fuses the legs here; `farnear silhouettes markers` closes 40 mm with such templates. Sides are the laboratory's axes: the actor faces aside."
    ));
    Ok(())
}

fn from_eight_sides(page: &mut Page) -> Result<()> {
    const SIDE_PX: usize = 200;
    let mut maps = Vec::new();
    for (activity, name) in ACTIVITIES.iter().enumerate() {
        let bodies = performance(0, activity, 0, RATE_HZ);
        let body = &bodies[bodies.len() / 2];
        for (number, view) in views_round(VIEWS, 0.0).into_iter().enumerate() {
            let mask = seen(body, &view).context("a body at a finite place")?;
            let cut_out = centred(mask.view(), SIDE_PX).context("a body that is seen")?;
            let title = if number == 0 { (*name).to_owned() } else { String::new() };
            maps.push((title, grey(&cut_out)));
        }
    }
    page.picture(
        "thesis-views.png",
        &panels::titled(VIEWS, &maps, Scale::Grey(1.0))?,
        "Ten activities from eight sides, 45 deg apart, fig. 7.10: a row per activity, the middle of one synthetic person's performance",
    )?;
    page.paragraph(
        "Drawn from capsules instead of markers, so that heads are round and coats and hair are missing. Like the thesis' silhouettes all are scaled to one size, which makes crouching look large; unlike them, front and back differ only by held objects.",
    );
    Ok(())
}

fn seen(body: &[farnear_silhouettes::silhouette::capsule::Capsule], view: &View) -> Option<Mask> {
    const MM_PER_PX: f64 = 8.0;
    let canvas = Canvas::fitting(&extent(body, view), MM_PER_PX, 2)?;
    Some(draw(body, view, &canvas))
}

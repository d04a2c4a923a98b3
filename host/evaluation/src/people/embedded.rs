//! The thesis' embedding redone: gallery (fig. 9.3), its use by six activities (9.5), spatial objects (9.6).

use anyhow::{Context, Result};
use farnear_recognition::clip::{Clip, Track};
use farnear_recognition::embedding::descriptor::Scaling;
use farnear_recognition::occupancy::OccupancyGrid;
use farnear_recognition::space::{Space, SpaceSettings};
use farnear_recognition::synthetic::activities::{ACTIVITIES, performance};
use farnear_silhouettes::mask::{Mask, centre::centred};
use farnear_silhouettes::silhouette::view::{Canvas, draw, extent, views_round};
use ndarray::{Array2, ArrayView2, Axis, concatenate, s};

use super::sets::RATE_HZ;
use crate::{
    page::Page,
    panels::{self, Panel, Scale},
};

const VIEWS: usize = 8;
const MEMBERS: usize = 20;
const SHOWN: [&str; 6] = ["walk", "drop", "crouch", "bag", "shoot", "dig"];
const BLACK: f32 = 0.0;
const GREY: f32 = 0.72;
const WHITE: f32 = 1.0;

struct Embedded {
    points: Array2<f32>,
    activities: Vec<usize>,
    masks: Vec<Mask>,
}

pub fn measure(page: &mut Page) -> Result<()> {
    let embedded = embedded()?;
    page.subheading("The embedding (figs. 9.3, 9.5 and 9.6)");
    let map = gallery(&embedded);
    let scale = Scale::Grey(WHITE);
    let panel = Panel { title: "first and second dimension".into(), map: map.view(), scale };
    page.picture(
        "thesis-embedding.png",
        &panels::row(&[panel])?,
        "Embedded silhouettes of one synthetic person at ten activities from eight sides, fig. 9.3: dots, and some silhouettes at their places",
    )?;
    page.paragraph(&format!(
        "{} silhouettes, of which 1500 at even steps were laid out by Isomap with 12 neighbours (the thesis: 1500 by Isomap with all others as neighbours, which is principal components). As there, similar silhouettes \
         lie side by side.",
        embedded.masks.len()
    ));
    let objects: Vec<Vec<bool>> =
        (0..ACTIVITIES.len()).map(|activity| visited(&embedded, Some(activity))).collect();
    let place = |name: &str| ACTIVITIES.iter().position(|known| *known == name).context("an activity");
    let mut maps = Vec::new();
    for name in SHOWN {
        maps.push((name.to_owned(), pattern(&embedded, place(name)?)));
    }
    for name in SHOWN {
        maps.push((format!("{name}: {MEMBERS} x {MEMBERS}"), object(&embedded, &objects[place(name)?])));
    }
    page.picture(
        "thesis-objects.png",
        &panels::titled(SHOWN.len(), &maps, scale)?,
        "Patterns of embedded silhouettes of six activities, fig. 9.5 (above), and the spatial objects made of them, fig. 9.6 (below); all silhouettes in grey",
    )?;
    summary(page, &embedded, &objects);
    Ok(())
}

fn summary(page: &mut Page, embedded: &Embedded, objects: &[Vec<bool>]) {
    let cells = |object: &[bool]| object.iter().filter(|visited| **visited).count();
    let all = cells(&visited(embedded, None));
    let counts: Vec<usize> = objects.iter().map(|object| cells(object)).collect();
    let rows: Vec<Vec<String>> = ACTIVITIES
        .iter()
        .enumerate()
        .map(|(activity, name)| {
            let silhouettes = embedded.activities.iter().filter(|own| **own == activity).count();
            vec![(*name).to_owned(), silhouettes.to_string(), counts[activity].to_string()]
        })
        .collect();
    page.table(1, &["activity", "silhouettes", &format!("cells visited, of {all}")], &rows);
    let least =
        counts.iter().enumerate().min_by_key(|(_, count)| **count).map_or(0, |(activity, _)| activity);
    let shared = |a: &[bool], b: &[bool]| {
        let both = a.iter().zip(b).filter(|(a, b)| **a && **b).count();
        let either = a.iter().zip(b).filter(|(a, b)| **a || **b).count();
        both as f64 / either.max(1) as f64
    };
    let mut alike = (0.0, 0, 0);
    for (i, a) in objects.iter().enumerate() {
        for (j, b) in objects.iter().enumerate().skip(i + 1) {
            let share = shared(a, b);
            if share > alike.0 {
                alike = (share, i, j);
            }
        }
    }
    page.paragraph(&format!(
        "The thesis sees the least variety in walking, a variety of postures in digging, and distinguishable patterns. Here the fewest cells are visited by *{}*; walking visits {}, digging {}. The two activities most alike, *{}* and *{}*, share {:.0} % of the \
         cells that either visits: nearly everything begins and ends with walking, so patterns differ only by the remaining cells.",
        ACTIVITIES[least],
        counts[0],
        counts[9],
        ACTIVITIES[alike.1],
        ACTIVITIES[alike.2],
        100.0 * alike.0
    ));
}

fn embedded() -> Result<Embedded> {
    const MM_PER_PX: f64 = 10.0;
    let (mut clips, mut masks, mut activities) = (Vec::new(), Vec::new(), Vec::new());
    for (activity, name) in ACTIVITIES.iter().enumerate() {
        let bodies = performance(0, activity, 0, RATE_HZ);
        let mut views = Vec::new();
        for view in views_round(VIEWS, 0.0) {
            let reach: Vec<_> = bodies.iter().flat_map(|body| extent(body, &view)).collect();
            let canvas = Canvas::fitting(&reach, MM_PER_PX, 2).context("bodies at finite places")?;
            let seen: Vec<Mask> = bodies.iter().map(|body| draw(body, &view, &canvas)).collect();
            views.push(Track::from_masks(&seen, Scaling::default(), true));
            activities.extend(std::iter::repeat_n(activity, seen.len()));
            masks.extend(seen);
        }
        clips.push(Clip { subject: "one".into(), activity: (*name).into(), views });
    }
    let clips: Vec<&Clip> = clips.iter().collect();
    let space = Space::train(&clips, &SpaceSettings::thesis())?;
    let points: Result<Vec<Array2<f32>>, _> =
        clips.iter().flat_map(|clip| &clip.views).map(|track| space.points(track)).collect();
    let points = points?;
    let views: Vec<ArrayView2<'_, f32>> = points.iter().map(|points| points.slice(s![.., ..2])).collect();
    Ok(Embedded { points: concatenate(Axis(0), &views)?, activities, masks })
}

impl Embedded {
    fn places(&self, [rows, columns]: [usize; 2]) -> Vec<[usize; 2]> {
        const MARGIN: f32 = 0.06;
        let place = |value: f32, k: usize, length: usize| {
            let column = self.points.column(k);
            let (low, high) =
                column.iter().fold((f32::INFINITY, f32::NEG_INFINITY), |(l, h), v| (l.min(*v), h.max(*v)));
            let share = (value - low) / (high - low).max(1e-9);
            ((MARGIN + (1.0 - 2.0 * MARGIN) * share) * length as f32) as usize
        };
        self.points
            .rows()
            .into_iter()
            .map(|point| [rows - 1 - place(point[1], 1, rows), place(point[0], 0, columns)])
            .collect()
    }
}

fn dot(map: &mut Array2<f32>, [row, column]: [usize; 2], half: usize, level: f32) {
    for y in row.saturating_sub(half)..=row + half {
        for x in column.saturating_sub(half)..=column + half {
            if let Some(value) = map.get_mut([y, x]) {
                *value = level;
            }
        }
    }
}

fn dots(size: [usize; 2], places: &[[usize; 2]], level: f32) -> Array2<f32> {
    let mut map = Array2::from_elem(size, WHITE);
    places.iter().for_each(|place| dot(&mut map, *place, 2, level));
    map
}

/// Fig. 9.3: all dots, and the silhouette nearest to the centre of each field of a coarse grid.
fn gallery(embedded: &Embedded) -> Array2<f32> {
    const SIZE: [usize; 2] = [1500, 2100];
    const FIELDS: [usize; 2] = [8, 11];
    const SIDE_PX: usize = 130;
    let places = embedded.places(SIZE);
    let mut map = dots(SIZE, &places, GREY);
    for field in (0..FIELDS[0]).flat_map(|row| (0..FIELDS[1]).map(move |column| [row, column])) {
        let middle: [usize; 2] = std::array::from_fn(|k| (2 * field[k] + 1) * SIZE[k] / (2 * FIELDS[k]));
        let inside = |place: &[usize; 2]| (0..2).all(|k| place[k] * FIELDS[k] / SIZE[k] == field[k]);
        let off = |place: &[usize; 2]| (0..2).map(|k| place[k].abs_diff(middle[k]).pow(2)).sum::<usize>();
        let nearest =
            places.iter().enumerate().filter(|(_, place)| inside(place)).min_by_key(|(_, p)| off(p));
        let Some((number, place)) = nearest else { continue };
        let Some(cut_out) = centred(embedded.masks[number].view(), SIDE_PX) else { continue };
        for ((y, x), _) in cut_out.indexed_iter().filter(|(_, set)| **set) {
            let at = [(place[0] + y).checked_sub(SIDE_PX / 2), (place[1] + x).checked_sub(SIDE_PX / 2)];
            if let [Some(y), Some(x)] = at
                && let Some(value) = map.get_mut([y, x])
            {
                *value = BLACK;
            }
        }
    }
    map
}

const SMALL: [usize; 2] = [420, 480];

/// As fig. 9.5 of the thesis: the points of an activity.
fn pattern(embedded: &Embedded, activity: usize) -> Array2<f32> {
    let places = embedded.places(SMALL);
    let mut map = dots(SMALL, &places, GREY);
    for (place, _) in places.iter().zip(&embedded.activities).filter(|(_, own)| **own == activity) {
        dot(&mut map, *place, 3, BLACK);
    }
    map
}

fn visited(embedded: &Embedded, activity: Option<usize>) -> Vec<bool> {
    let grid = OccupancyGrid::new(embedded.points.view(), &[MEMBERS; 2]);
    let of = |own: &usize| activity.is_none_or(|activity| *own == activity);
    let rows: Vec<usize> =
        embedded.activities.iter().enumerate().filter(|(_, own)| of(own)).map(|(row, _)| row).collect();
    grid.pattern(embedded.points.select(Axis(0), &rows).view()).iter().map(|cell| *cell > 0.0).collect()
}

/// As fig. 9.6 of the thesis: the visited cells of the grid.
fn object(embedded: &Embedded, cells: &[bool]) -> Array2<f32> {
    let places = embedded.places(SMALL);
    let mut map = dots(SMALL, &places, GREY);
    let grid = OccupancyGrid::new(embedded.points.view(), &[MEMBERS; 2]);
    // The outermost cells locate the grid in the picture.
    let span = |k: usize| {
        let along = places.iter().map(|place| place[k]);
        (along.clone().min().unwrap_or(0), along.max().unwrap_or(0))
    };
    let ((top, bottom), (left, right)) = (span(0), span(1));
    let [across, up] = [grid.bins[0], grid.bins[1]];
    for (cell, _) in cells.iter().enumerate().filter(|(_, visited)| **visited) {
        let (i, j) = (cell / up, up - 1 - cell % up);
        let edges = |from: usize, to: usize, index: usize, of: usize| {
            (from + index * (to - from) / of)..(from + (index + 1) * (to - from) / of)
        };
        for y in edges(top, bottom, j, up) {
            map.slice_mut(s![y, edges(left, right, i, across)]).fill(BLACK);
        }
    }
    map
}

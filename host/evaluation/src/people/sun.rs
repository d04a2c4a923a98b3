//! Sun position: every formula and the board's fixed point against NREL's published values and SPA.

use anyhow::{Context, Result};
use chrono::{DateTime, TimeDelta, Utc};
use farnear_maths::{angle::BinaryAngle, sun as board};
use farnear_shadow::sun::{Model, Place, SunPosition, parse_time, position};

use super::data::Data;
use crate::page::Page;

/// Below this apparent elevation refraction decides whether the sun is up.
const UP_DEG: f64 = 0.6;
/// Latitude, longitude (degrees, east positive).
const PLACES: [[f64; 2]; 12] = [
    [52.38, -1.56],
    [1.0, 103.8],
    [-33.9, 20.0],
    [67.0, 25.0],
    [40.0, -105.2],
    [-36.84, 174.74],
    [21.3, -157.9],
    [35.7, 139.7],
    [0.0, 0.0],
    [-54.8, -68.3],
    [78.2, 15.6],
    [30.0, 31.2],
];
/// 30.3 hours per step cover all hours and seasons from 2014 to 2039.
const STEP_S: i64 = 109_080;
const STEPS: i64 = 7514;

const FORMULAS: [(&str, Formula); 5] = [
    ("PSA+ (default)", Formula::Host(Model::Psa)),
    ("PSA+ in the board's fixed point", Formula::Board),
    ("Astronomical Almanac", Formula::Host(Model::Almanac)),
    ("Li 2014, units put right", Formula::Host(Model::Thesis)),
    ("SPA", Formula::Host(Model::Spa)),
];

#[derive(Clone, Copy)]
enum Formula {
    Host(Model),
    Board,
}

impl Formula {
    fn position(self, time: DateTime<Utc>, place: Place) -> Result<SunPosition> {
        match self {
            Self::Host(model) => Ok(position(time, place, model)?),
            Self::Board => {
                let angle = |degrees: f64| BinaryAngle::from_degrees(degrees as f32);
                let place = board::Place {
                    latitude: angle(place.latitude_deg),
                    longitude: angle(place.longitude_deg),
                };
                let sun = board::Sun::at(time.timestamp(), &place);
                Ok(SunPosition {
                    elevation_deg: f64::from(sun.elevation_deg()),
                    azimuth_deg: f64::from(sun.azimuth_deg()),
                })
            }
        }
    }
}

#[derive(Default)]
struct Differences {
    count: u32,
    largest: [f64; 2],
    squares: [f64; 2],
}

impl Differences {
    fn add(&mut self, elevation_deg: f64, azimuth_deg: f64) {
        self.count += 1;
        for (k, value) in [elevation_deg, azimuth_deg].into_iter().enumerate() {
            self.largest[k] = self.largest[k].max(value.abs());
            self.squares[k] += value * value;
        }
    }

    fn cells(&self) -> impl Iterator<Item = String> {
        let rms = |k: usize| (self.squares[k] / f64::from(self.count.max(1))).sqrt();
        [self.largest[0], rms(0), self.largest[1], rms(1)].map(|value| format!("{value:.4}")).into_iter()
    }
}

/// SPA's refraction (Reda and Andreas 2004, eq. 42) at 1000 hPa and 10 deg C for a true elevation, degrees.
fn refraction_deg(elevation_deg: f64) -> f64 {
    let argument = elevation_deg + 10.3 / (elevation_deg + 5.11);
    1000.0 / 1010.0 * 1.02 / (60.0 * argument.to_radians().tan())
}

fn turn_deg(a: f64, b: f64) -> f64 {
    (a - b + 180.0).rem_euclid(360.0) - 180.0
}

pub fn measure(page: &mut Page, data: &Data) -> Result<()> {
    page.heading("The sun");
    page.paragraph(&format!(
        "Differences from NREL's Solar Position Algorithm with the sun up, in degrees. First over {} places and the years 2014 to 2039, {} hours apart, without \
         refraction; azimuth is the angle on the sky, times the cosine of the elevation, because in the zenith it has no meaning.",
        PLACES.len(),
        STEP_S as f64 / 3600.0
    ));
    let head = ["formula", "elevation: largest", "RMS", "azimuth: largest", "RMS"];
    let mut rows = Vec::new();
    for (name, formula) in FORMULAS.into_iter().take(4) {
        let found = against_spa(formula)?;
        rows.push(std::iter::once(name.to_owned()).chain(found.cells()).collect());
    }
    page.table(1, &head, &rows);

    let Some(text) = data.text("sun/spa_c_reference.csv")? else {
        page.paragraph("Skipped: NREL's published values (`sun/spa_c_reference.csv`) are not at hand.");
        return Ok(());
    };
    let mut rows = Vec::new();
    let mut count = 0;
    for (name, formula) in FORMULAS {
        let found = against_published(&text, formula)?;
        count = found.count;
        rows.push(std::iter::once(name.to_owned()).chain(found.cells()).collect());
    }
    page.paragraph(&format!(
        "Against {count} values that NREL's own program gives for 1910 to 2210 with the sun at least {UP_DEG} deg up, azimuth unchanged (required: 0.01 in elevation, 0.05 in azimuth); refraction, which they include, is added by SPA's \
         equation 42. SPA here is an independent implementation that \
         estimates how far Earth's rotation lags behind uniform time; the published values take that as 0."
    ));
    page.table(1, &head, &rows);
    Ok(())
}

fn against_spa(formula: Formula) -> Result<Differences> {
    let start = parse_time("2014-01-01T00:10:00Z")?;
    let mut found = Differences::default();
    for step in 0..STEPS {
        let time = start + TimeDelta::seconds(step * STEP_S);
        for [latitude, longitude] in PLACES {
            let place = Place::new(latitude, longitude)?;
            let truth = position(time, place, Model::Spa)?;
            if truth.elevation_deg < 0.0 {
                continue;
            }
            let sun = formula.position(time, place)?;
            let on_sky = truth.elevation_deg.to_radians().cos();
            let azimuth_deg = turn_deg(sun.azimuth_deg, truth.azimuth_deg) * on_sky;
            found.add(sun.elevation_deg - truth.elevation_deg, azimuth_deg);
        }
    }
    Ok(found)
}

fn against_published(text: &str, formula: Formula) -> Result<Differences> {
    let mut found = Differences::default();
    for line in text.lines().filter(|line| !line.starts_with('#') && !line.trim().is_empty()) {
        let fields: Vec<&str> = line.split(',').collect();
        let number = |i: usize| -> Result<f64> {
            fields
                .get(i)
                .and_then(|field| field.trim().parse().ok())
                .with_context(|| format!("field {i} of {line:?}"))
        };
        let apparent = 90.0 - number(4)?;
        if apparent < UP_DEG {
            continue;
        }
        let sun = formula.position(parse_time(fields[0])?, Place::new(number(1)?, number(2)?)?)?;
        found.add(
            sun.elevation_deg + refraction_deg(sun.elevation_deg) - apparent,
            turn_deg(sun.azimuth_deg, number(3)?),
        );
    }
    Ok(found)
}

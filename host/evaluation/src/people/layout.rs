//! Residual variance over dimensions of Isomap, landmark Isomap and principal components (Li 2014, section 9.3.1).

use anyhow::Result;
use farnear_recognition::embedding::{
    descriptor::Scaling, isomap::isomap, landmark::landmark_isomap, pca::Pca,
};
use farnear_recognition::synthetic::activities::clips;
use ndarray::{Array2, ArrayView2, Axis, concatenate};
use rayon::prelude::*;

use crate::{
    chart::{self, Curve},
    page::Page,
};

const GALLERY: usize = 1500;
const PEOPLE: usize = 6;
const NEIGHBOURS: usize = 12;
const DIMENSIONS: usize = 10;
const LANDMARKS: [usize; 3] = [50, 150, 500];

pub fn measure(page: &mut Page) -> Result<()> {
    page.heading("How many dimensions");
    page.paragraph(&format!(
        "{GALLERY} silhouettes of {PEOPLE} synthetic people at all activities in four views, laid out by Isomap with {NEIGHBOURS} neighbours and by principal components. Residual variance is 1 - R2 between \
         the distances of the layout and the distances it is meant to keep (Tenenbaum et al. 2000): path lengths along the \
         neighbour graph for Isomap, straight ones for principal components. Isomap with all {} others as neighbours, as Li (2014) ran it, is the second curve exactly.",
        GALLERY - 1
    ));
    let people = clips(PEOPLE, 4, 8.0, Scaling::default());
    let all: Vec<ArrayView2<f32>> =
        people.iter().flat_map(|clip| &clip.views).map(|view| view.descriptors.view()).collect();
    let all = concatenate(Axis(0), &all)?;
    let rows: Vec<usize> = (0..GALLERY).map(|i| (2 * i + 1) * all.nrows() / (2 * GALLERY)).collect();
    let gallery = all.select(Axis(0), &rows);

    let layouts = layouts(gallery.view())?;
    // Landmarks are only in the table, because their curves overlap.
    let curves: Vec<Curve> = layouts[..layouts.len() - LANDMARKS.len()]
        .iter()
        .map(|(name, values)| Curve {
            name: name.clone(),
            points: values.iter().enumerate().map(|(k, value)| (k as f64 + 1.0, *value)).collect(),
        })
        .collect();
    let png = chart::lines("Residual variance", "dimensions", "1 - R2", &curves)?;
    page.picture(
        "activity-residual-variance.png",
        &png,
        "Residual variance over dimensions for Isomap and PCA",
    )?;
    let shown = [0, 1, 2, 3, 5, 9];
    let row = |(name, values): &(String, Vec<f64>)| {
        std::iter::once(name.clone()).chain(shown.map(|k| format!("{:.4}", values[k]))).collect()
    };
    let rows: Vec<Vec<String>> = layouts.iter().map(row).collect();
    let head: Vec<String> =
        std::iter::once("layout".to_owned()).chain(shown.map(|k| format!("{} dim.", k + 1))).collect();
    page.table(1, &head, &rows);
    Ok(())
}

fn layouts(gallery: ArrayView2<f32>) -> Result<Vec<(String, Vec<f64>)>> {
    let whole = isomap(gallery, NEIGHBOURS, DIMENSIONS)?;
    let principal = Pca::fit(gallery, DIMENSIONS)?.transform(gallery)?;
    let paths = &whole.geodesics;
    let mut found = vec![
        ("Isomap, path lengths".to_owned(), residuals(whole.coordinates.view(), paths)),
        ("PCA, straight distances".to_owned(), residuals(principal.view(), &distances(gallery))),
        ("PCA, path lengths".to_owned(), residuals(principal.view(), paths)),
    ];
    for count in LANDMARKS {
        let laid_out = landmark_isomap(gallery, NEIGHBOURS, count, DIMENSIONS)?;
        let name = format!("landmark Isomap, {count} landmarks, path lengths");
        found.push((name, residuals(laid_out.coordinates.view(), paths)));
    }
    Ok(found)
}

fn distances(rows: ArrayView2<f32>) -> Array2<f32> {
    let n = rows.nrows();
    let values: Vec<f32> = (0..n * n)
        .into_par_iter()
        .map(|at| {
            let (a, b) = (rows.row(at / n), rows.row(at % n));
            a.iter().zip(b).map(|(p, q)| (p - q) * (p - q)).sum::<f32>().sqrt()
        })
        .collect();
    Array2::from_shape_vec((n, n), values).unwrap_or_default()
}

/// Residual variance of the first 1, 2, ... columns.
fn residuals(coordinates: ArrayView2<f32>, distances: &Array2<f32>) -> Vec<f64> {
    let (n, dimensions) = coordinates.dim();
    (1..=dimensions)
        .into_par_iter()
        .map(|used| {
            let [mut sx, mut sy, mut sxx, mut syy, mut sxy, mut count] = [0.0_f64; 6];
            for i in 0..n {
                for j in 0..i {
                    let squared: f32 =
                        (0..used).map(|k| (coordinates[[i, k]] - coordinates[[j, k]]).powi(2)).sum();
                    let (x, y) = (f64::from(squared.sqrt()), f64::from(distances[[i, j]]));
                    sx += x;
                    sy += y;
                    sxx += x * x;
                    syy += y * y;
                    sxy += x * y;
                    count += 1.0;
                }
            }
            let covariance = sxy - sx * sy / count;
            1.0 - covariance * covariance / ((sxx - sx * sx / count) * (syy - sy * sy / count))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_isometry_has_no_residual_and_a_projection_has_one() {
        let points = Array2::from_shape_fn((40, 2), |(i, k)| ((i * (7 + 5 * k)) % 11) as f32);
        let found = residuals(points.view(), &distances(points.view()));
        assert!(found[1].abs() < 1e-9 && found[0] > 0.1, "{found:?}");
    }
}

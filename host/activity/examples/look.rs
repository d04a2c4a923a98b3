#![allow(missing_docs, clippy::all)]
use farnear_activity::readers::skeletons::*;
use farnear_activity::silhouette::{raster::Point, view::*};
use farnear_activity::synthetic::everyday;
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let (set, name, out) = (&a[1], &a[2], &a[3]);
    let gamma: f64 = a.get(4).and_then(|v| v.parse().ok()).unwrap_or(0.0);
    let rows: Vec<Vec<Vec<_>>> = if set == "syn" {
        let k = everyday::ACTIVITIES.iter().position(|x| x.0 == name).unwrap();
        (0..6)
            .map(|seed| {
                let p = everyday::performance(k, seed);
                p.joints.iter().map(|j| p.person.dressed(j)).collect()
            })
            .collect()
    } else {
        let (f, l, n): (_, _, Vec<&str>) = if set == "ut" {
            ("UTKinect_Skeletons.mat", KINECT_20, UTKINECT_ACTIVITIES.to_vec())
        } else {
            ("Florence_3D_Action_Skeletons.mat", FLORENCE_15, FLORENCE_ACTIVITIES.to_vec())
        };
        let b = std::fs::read(format!("/work/shared/data/skeletons/{f}")).unwrap();
        let k = n.iter().position(|x| x == name).unwrap();
        let c = read_cells(&b, &l).unwrap();
        c.iter()
            .filter(|c| c.activity == k)
            .step_by(3)
            .take(6)
            .map(|c| {
                eprintln!("{} frames", c.frames.len());
                c.frames.iter().map(|j| dress(j, &l)).collect()
            })
            .collect()
    };
    let cols = 14;
    let (w, h) = (90usize, 130usize);
    let mut img = image::GrayImage::new((w * cols) as u32, (h * rows.len()) as u32);
    for (r, bodies) in rows.iter().enumerate() {
        let view = View { gamma_deg: gamma, ..View::default() };
        for c in 0..cols {
            let i = c * (bodies.len() - 1) / (cols - 1);
            let reach: Vec<Point> = extent(&bodies[i], &view);
            let mx = reach.iter().map(|p| p[0]).sum::<f64>() / reach.len() as f64;
            let low =
                bodies.iter().flat_map(|b| extent(b, &view)).map(|p| p[1]).fold(f64::INFINITY, f64::min);
            let canvas = Canvas { height_px: h, width_px: w, mm_per_px: 16.0, middle_mm: [mx, low + 1000.0] };
            let m = draw(&bodies[i], &view, &canvas);
            for ((y, x), v) in m.indexed_iter() {
                if *v {
                    img.put_pixel((c * w + x) as u32, (r * h + y) as u32, image::Luma([255]));
                }
            }
        }
    }
    img.save(out).unwrap();
}

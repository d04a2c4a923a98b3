//! Slow exact renderer: traces rays from a pixel through the aperture to the first surface. A telecentric
//! lens maps the aperture point `a` (unit disc) and the sensor point `p` to a ray through the image position
//! `p + b a` at the signed blur radius `b`. It hits a height field at the first `b`, from near to far, with
//! `b >= b_surface(p + b a)`. Uses no convolution, kernel, slab or interpolation of the crate.

use farnear_scene::{Lens, Psf, Scene};
use ndarray::Array2;

pub struct RayCaster<'a> {
    /// Signed blur radius of the surface at an image position.
    pub blur_px: Box<dyn Fn(f64, f64) -> f64 + 'a>,
    /// Smallest and largest signed blur radius.
    pub range_px: (f64, f64),
    /// Radiance at cell centres (half a pixel); linear between, mirrored outside.
    pub texture: &'a Array2<f32>,
    /// Radii in the aperture at evenly spaced quantiles.
    pub radial_quantiles: Vec<f64>,
}

pub fn radial_quantiles(psf: &Psf) -> Vec<f64> {
    let (steps, limit) = (400_000, 12.0);
    let dr = limit / f64::from(steps);
    let density = |r: f64| match *psf {
        Psf::PillBox => f64::from(r <= 1.0),
        Psf::Ring { inner } => f64::from((inner..=1.0).contains(&r)),
        Psf::Gaussian { k } => (-0.5 * (r / k).powi(2)).exp(),
        Psf::Generalised { p, k } => (-(r / k).powf(p) / p).exp(),
    };
    let total: f64 = (0..steps).map(|i| density((f64::from(i) + 0.5) * dr) * (f64::from(i) + 0.5)).sum();
    let count = 20_000;
    let (mut quantiles, mut sum) = (Vec::with_capacity(count), 0.0);
    for i in 0..steps {
        let r = (f64::from(i) + 0.5) * dr;
        sum += density(r) * (f64::from(i) + 0.5) / total;
        while quantiles.len() < count && sum >= (quantiles.len() as f64 + 0.5) / count as f64 {
            quantiles.push(r);
        }
    }
    quantiles.resize(count, quantiles[quantiles.len() - 1]);
    quantiles
}

pub fn scene_blur<'a>(
    scene: &'a Scene,
    lens: &'a Lens,
    camera: &'a farnear_scene::Camera,
    sensor_mm: f64,
) -> Box<dyn Fn(f64, f64) -> f64 + 'a> {
    Box::new(move |x, y| {
        let depth_mm = scene.depth_mm(lens, camera, x, y);
        // Thin lens in another form than the crate's: w = F u / (u - F).
        let image_mm = lens.focal_length_mm * depth_mm / (depth_mm - lens.focal_length_mm);
        let image_mm = match &lens.distortion {
            None => image_mm,
            Some(distortion) => {
                let middle = 0.5 * (lens.sensor_far_mm + lens.sensor_near_mm);
                let half = 0.5 * (lens.sensor_near_mm - lens.sensor_far_mm);
                let alpha = (image_mm - middle) / half;
                let (x, y) = (x / camera.width_px as f64, y / camera.height_px as f64);
                middle + half * distortion.apply(alpha, x, y)
            }
        };
        (sensor_mm - image_mm) / lens.pixel_mm * (lens.aperture_mm / lens.focal_length_mm) / 2.0
    })
}

impl RayCaster<'_> {
    /// Mean radiance over `rays` rays of a four-dimensional low-discrepancy sequence.
    pub fn pixel(&self, row: usize, column: usize, rays: u32) -> f64 {
        // Roberts' R4 sequence: powers of the reciprocal of the root of x^5 = x + 1.
        let g = 1.167_303_978_261_418_7f64;
        let offset = (row * 7919 + column * 104_729) as f64 * 0.618_033_988_75;
        let mut sum = 0.0;
        for i in 0..rays {
            let u = |power: i32| (offset + f64::from(i + 1) * g.powi(-power)).fract();
            let (x, y) = (column as f64 + u(1), row as f64 + u(2));
            let r = self.radial_quantiles[(u(3) * self.radial_quantiles.len() as f64) as usize];
            let (sin, cos) = (u(4) * std::f64::consts::TAU).sin_cos();
            sum += self.trace(x, y, r * cos, r * sin);
        }
        sum / f64::from(rays)
    }

    fn trace(&self, x: f64, y: f64, a: f64, b: f64) -> f64 {
        let (near, far) = self.range_px;
        let inside = |blur: f64| blur >= (self.blur_px)(x + blur * a, y + blur * b);
        let mut low = near;
        if far > near && !inside(near) {
            // Steps of a tenth of a pixel across the surface, then bisection.
            let steps = ((far - near) * a.hypot(b) / 0.1).ceil().max(1.0);
            let mut high = far;
            for step in 1..=steps as u32 {
                let blur = near + (far - near) * f64::from(step) / steps;
                if inside(blur) {
                    high = blur;
                    break;
                }
                low = blur;
            }
            while high - low > 1e-4 {
                let middle = 0.5 * (low + high);
                if inside(middle) { high = middle } else { low = middle }
            }
        }
        self.radiance(x + low * a, y + low * b)
    }

    fn radiance(&self, x: f64, y: f64) -> f64 {
        let (height, width) = self.texture.dim();
        let fold = |cell: f64, size: usize| {
            let cell = (cell as i64).rem_euclid(2 * size as i64) as usize;
            cell.min(2 * size - 1 - cell)
        };
        // Linear between the centres of cells.
        let (column, row) = (2.0 * x - 0.5, 2.0 * y - 0.5);
        let (left, top) = (column.floor(), row.floor());
        let mut sum = 0.0;
        for (i, row_share) in [(top, 1.0 - (row - top)), (top + 1.0, row - top)] {
            for (j, column_share) in [(left, 1.0 - (column - left)), (left + 1.0, column - left)] {
                sum += f64::from(self.texture[[fold(i, height), fold(j, width)]]) * row_share * column_share;
            }
        }
        sum
    }
}

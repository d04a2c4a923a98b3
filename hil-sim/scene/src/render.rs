//! One exposure of a scene from texture, depth, blur and noise.

use ndarray::{Array2, s};
use thiserror::Error;

use crate::blur::{Blur, Cells, MAX_EXACT_LEVELS, kernel_reach_px};
use crate::camera::{Camera, CameraError};
use crate::kernel::CELLS_PER_PIXEL;
use crate::lens::{Lens, LensError};
use crate::maps::Picture;
use crate::psf::Psf;
use crate::scene::{Scene, Shape};
use crate::texture::{Spectrum, Texture};
use crate::view::{self, View};

/// Largest rendered blur radius: memory grows with its square.
const MAX_BLUR_PX: f64 = 600.0;
/// Margin for which the renderer keeps the surface; a wider one is computed on demand.
const KEPT_MARGIN_PX: usize = 8;

/// Why nothing was rendered.
#[derive(Debug, Clone, PartialEq, Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
pub enum RenderError {
    #[error(transparent)]
    Camera(#[from] CameraError),
    #[error(transparent)]
    Lens(#[from] LensError),
    #[error("sensor at {sensor_distance_mm} mm from the lens, expected a finite distance above 0")]
    Sensor { sensor_distance_mm: f64 },
    #[error(
        "the sensor at {sensor_distance_mm} mm blurs the scene over a radius of {blur_px:.0} px, at most {limit_px} px is \
         rendered; focus lies between {far_mm:.3} and {near_mm:.3} mm"
    )]
    Blur { sensor_distance_mm: f64, blur_px: f64, limit_px: f64, far_mm: f64, near_mm: f64 },
}

/// Renders one exposure: codes of shape (height, width), 0 to [`Noise::max_code`](crate::Noise::max_code).
/// Texture depends on `seed`, noise on `seed` and `exposure_number`; `sensor_distance_mm` is from the lens.
/// For many exposures keep a [`Renderer`]. Fails for a lens, scene, camera or position without an image.
pub fn render(
    scene: &Scene,
    lens: &Lens,
    psf: &Psf,
    sensor_distance_mm: f64,
    camera: &Camera,
    seed: u64,
    exposure_number: u32,
) -> Result<Array2<u16>, RenderError> {
    Renderer::new(scene, lens, psf, camera, seed)?.expose(sensor_distance_mm, exposure_number)
}

/// Renders without noise, quantisation and full well, as a fraction of the full well; fails as [`render`].
pub fn render_f32(
    scene: &Scene,
    lens: &Lens,
    psf: &Psf,
    sensor_distance_mm: f64,
    camera: &Camera,
    seed: u64,
) -> Result<Array2<f32>, RenderError> {
    let level = camera.exposure_level as f32;
    Ok(Renderer::new(scene, lens, psf, camera, seed)?.radiance(sensor_distance_mm)? * level)
}

/// True depth at each pixel's centre, mm, shape (height, width).
#[must_use]
pub fn truth(scene: &Scene, lens: &Lens, camera: &Camera) -> Array2<f32> {
    Array2::from_shape_fn((camera.height_px, camera.width_px), |(row, column)| {
        scene.depth_mm(lens, camera, column as f64 + 0.5, row as f64 + 0.5) as f32
    })
}

/// A scene with its texture, for many exposures.
#[derive(Debug, Clone)]
pub struct Renderer {
    scene: Scene,
    lens: Lens,
    psf: Psf,
    camera: Camera,
    seed: u64,
    texture: Paint,
    surface: Surface,
    view: View,
}

#[derive(Debug, Clone)]
enum Paint {
    /// One period of a random texture, in cells.
    Random(Array2<f32>),
    Picture(Picture),
}

/// Image distance of the surface relative to the far setting's sensor distance, mm; one value per cell of the image and
/// [`KEPT_MARGIN_PX`] around it.
#[derive(Debug, Clone)]
enum Surface {
    Plane(f64),
    /// A few distances, nearest surface first, and the index of each cell's.
    Levels(Vec<f32>, Array2<u8>),
    Field(Array2<f32>),
}

impl Surface {
    fn of(field: Array2<f32>) -> Self {
        match distinct_values(&field) {
            Some(values) => {
                let index = field.map(|offset| values.partition_point(|value| value > offset) as u8);
                Self::Levels(values, index)
            }
            None => Self::Field(field),
        }
    }
}

/// The values of a field, descending; `None` for more than [`MAX_EXACT_LEVELS`].
fn distinct_values(field: &Array2<f32>) -> Option<Vec<f32>> {
    let mut values: Vec<f32> = Vec::new();
    let mut last = f32::NAN;
    for &value in field {
        if value == last {
            continue;
        }
        last = value;
        let place = values.partition_point(|&known| known > value);
        if values.get(place) != Some(&value) {
            if values.len() == MAX_EXACT_LEVELS {
                return None;
            }
            values.insert(place, value);
        }
    }
    Some(values)
}

impl Renderer {
    /// Creates the texture; fails as [`render`] unless all of the scene has an image.
    pub fn new(
        scene: &Scene,
        lens: &Lens,
        psf: &Psf,
        camera: &Camera,
        seed: u64,
    ) -> Result<Self, RenderError> {
        camera.check()?;
        let random =
            |spectrum: Spectrum| spectrum.synthesise(camera.width_px, camera.height_px, scene.contrast, seed);
        let texture = match &scene.texture {
            Texture::Sand => Paint::Random(random(Spectrum::Sand)),
            Texture::Fractal => Paint::Random(random(Spectrum::Fractal)),
            Texture::Picture(picture) => Paint::Picture(picture.clone()),
        };
        let surface = match scene.shape {
            Shape::Plane { depth_mm } if lens.distortion.is_none() => {
                Surface::Plane(lens.image_distance_mm(depth_mm)? - lens.sensor_far_mm)
            }
            _ => Surface::of(image_field(scene, lens, camera, KEPT_MARGIN_PX, &View::default())?),
        };
        Ok(Self {
            scene: scene.clone(),
            lens: lens.clone(),
            psf: *psf,
            camera: camera.clone(),
            seed,
            texture,
            surface,
            view: View::default(),
        })
    }

    /// Shifts, rotates or zooms the camera.
    #[must_use]
    pub fn seen_by(mut self, view: View) -> Self {
        self.view = view;
        self
    }

    /// Changes the view, for a moving scene.
    pub fn look(&mut self, view: View) {
        self.view = view;
    }

    /// View of an exposure: the camera's own, times the magnification of a lens that is not telecentric.
    fn view_at(&self, sensor_distance_mm: f64) -> View {
        let grown = if self.lens.telecentric { 1.0 } else { sensor_distance_mm / self.lens.sensor_far_mm };
        View { magnification: self.view.magnification * grown, ..self.view }
    }

    /// One exposure: codes of shape (height, width). Fails for a sensor position without an image.
    pub fn expose(&self, sensor_distance_mm: f64, exposure_number: u32) -> Result<Array2<u16>, RenderError> {
        let radiance = self.radiance(sensor_distance_mm)?;
        Ok(self.camera.expose(radiance.view(), self.seed, exposure_number))
    }

    /// [`Renderer::radiance`] with light: `textured` times the texture plus `even`, as from a blank wall.
    /// [`Camera::expose`] makes the codes.
    pub fn lit_radiance(
        &self,
        sensor_distance_mm: f64,
        (textured, even): (f64, f64),
    ) -> Result<Array2<f32>, RenderError> {
        let mut radiance = self.radiance(sensor_distance_mm)?;
        if (textured, even) != (1.0, 0.0) {
            radiance.mapv_inplace(|radiance| textured.max(0.0) as f32 * radiance + even.max(0.0) as f32);
        }
        Ok(radiance)
    }

    /// Mean radiance per pixel, shape (height, width), scene mean 1; fails as [`Renderer::expose`].
    pub fn radiance(&self, sensor_distance_mm: f64) -> Result<Array2<f32>, RenderError> {
        if !(sensor_distance_mm.is_finite() && sensor_distance_mm > 0.0) {
            return Err(RenderError::Sensor { sensor_distance_mm });
        }
        let blur_px = |offset_mm: f64| {
            self.lens.signed_blur_px(sensor_distance_mm, self.lens.sensor_far_mm + offset_mm) as f32
        };
        let widest = |offsets: &mut dyn Iterator<Item = &f32>| {
            offsets.map(|&offset_mm| blur_px(offset_mm.into()).abs()).fold(0.0, f32::max)
        };
        let widest_px = match &self.surface {
            Surface::Plane(offset_mm) => blur_px(*offset_mm).abs(),
            Surface::Levels(offsets, _) => widest(&mut offsets.iter()),
            Surface::Field(offsets) => widest(&mut offsets.iter()),
        };
        if f64::from(widest_px) > MAX_BLUR_PX {
            return Err(RenderError::Blur {
                sensor_distance_mm,
                blur_px: widest_px.into(),
                limit_px: MAX_BLUR_PX,
                far_mm: self.lens.sensor_far_mm,
                near_mm: self.lens.sensor_near_mm,
            });
        }
        let view = self.view_at(sensor_distance_mm);
        let margin_px = kernel_reach_px(&self.psf, widest_px).max(1);
        let kept = margin_px <= KEPT_MARGIN_PX && view == View::default();
        let wider = match &self.surface {
            Surface::Plane(_) => None,
            _ if kept => None,
            _ => Some(Surface::of(image_field(&self.scene, &self.lens, &self.camera, margin_px, &view)?)),
        };
        let skip = if kept { (KEPT_MARGIN_PX - margin_px) * CELLS_PER_PIXEL } else { 0 };
        let (rows, columns) = cell_grid(&self.camera, margin_px);
        let place = s![skip..skip + rows, skip..skip + columns];
        let blur_px = match wider.as_ref().unwrap_or(&self.surface) {
            Surface::Plane(offset_mm) => Blur::Uniform(blur_px(*offset_mm)),
            Surface::Levels(offsets, index) => {
                let radii = offsets.iter().map(|&offset_mm| blur_px(offset_mm.into())).collect();
                Blur::Levels(radii, index.slice(place))
            }
            Surface::Field(offsets) => {
                Blur::Varying(offsets.slice(place).map(|&offset_mm| blur_px(offset_mm.into())))
            }
        };
        Ok(Cells { margin_px, radiance: self.cell_radiance(margin_px, &view), blur_px }.blurred(&self.psf))
    }

    fn cell_radiance(&self, margin_px: usize, view: &View) -> Array2<f32> {
        let size = cell_grid(&self.camera, margin_px);
        match &self.texture {
            Paint::Random(period) if *view != View::default() => {
                let (width, height) = (self.camera.width_px as f64, self.camera.height_px as f64);
                let placed = view.placed(width, height);
                Array2::from_shape_fn(size, |cell| {
                    let (x_px, y_px) = placed.scene_px(cell_centre_px(cell, margin_px));
                    let cells = CELLS_PER_PIXEL as f64;
                    view::periodic(period, x_px * cells - 0.5, y_px * cells - 0.5)
                })
            }
            Paint::Random(period) => {
                let (height, width) = period.dim();
                let margin = (margin_px * CELLS_PER_PIXEL) as isize;
                let first = |period: usize| (-margin).rem_euclid(period as isize) as usize;
                let rows = (0..height).cycle().skip(first(height)).take(size.0);
                let mut cells = Vec::with_capacity(size.0 * size.1);
                for row in rows.filter_map(|row| period.row(row).to_slice()) {
                    let (mut column, end) = (first(width), cells.len() + size.1);
                    while cells.len() < end {
                        let count = (width - column).min(end - cells.len());
                        cells.extend_from_slice(&row[column..column + count]);
                        column = 0;
                    }
                }
                Array2::from_shape_vec(size, cells).unwrap_or_default()
            }
            Paint::Picture(picture) => Array2::from_shape_fn(size, |cell| {
                let (width, height) = (self.camera.width_px as f64, self.camera.height_px as f64);
                let (x_px, y_px) = view.placed(width, height).scene_px(cell_centre_px(cell, margin_px));
                let (x, y) = (x_px / width, y_px / height);
                picture.radiance(x, y) as f32
            }),
        }
    }
}

fn cell_grid(camera: &Camera, margin_px: usize) -> (usize, usize) {
    let cells = |pixels: usize| (pixels + 2 * margin_px) * CELLS_PER_PIXEL;
    (cells(camera.height_px), cells(camera.width_px))
}

fn cell_centre_px((row, column): (usize, usize), margin_px: usize) -> (f64, f64) {
    let position = |index: usize| (index as f64 + 0.5) / CELLS_PER_PIXEL as f64 - margin_px as f64;
    (position(column), position(row))
}

fn image_field(
    scene: &Scene,
    lens: &Lens,
    camera: &Camera,
    margin_px: usize,
    view: &View,
) -> Result<Array2<f32>, LensError> {
    let placed = view.placed(camera.width_px as f64, camera.height_px as f64);
    let mut field = Array2::zeros(cell_grid(camera, margin_px));
    for (cell, offset_mm) in field.indexed_iter_mut() {
        let (x_px, y_px) = cell_centre_px(cell, margin_px);
        let (scene_x, scene_y) = placed.scene_px((x_px, y_px));
        let image_mm = lens.image_distance_mm(scene.depth_mm(lens, camera, scene_x, scene_y))?;
        let (x, y) = (x_px / camera.width_px as f64, y_px / camera.height_px as f64);
        *offset_mm = (lens.distorted_image_distance_mm(image_mm, x, y) - lens.sensor_far_mm) as f32;
    }
    Ok(field)
}

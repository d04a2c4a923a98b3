//! A run time that keeps its buffers between pairs.

use ndarray::{Array2, ArrayView2, Zip};
use rayon::prelude::*;

use super::fast::{Job, Maps, Tile};
use super::{Backend, DepthMap, RunError, Settings, border_fill, check};
use crate::confidence;
use crate::depth_of_alpha::DepthOfAlpha;
use crate::fill;
use crate::operators::Operators;
use crate::optics::Optics;
use crate::simd;

/// Depth of successive pairs with the same operators, optics and settings. Allocates only when the image size changes.
/// Memory: 12 bytes per pixel, and less than 1 MB per thread.
#[derive(Debug)]
pub struct Processor {
    operators: Operators,
    optics: Optics,
    settings: Settings,
    backend: Backend,
    tiles: Vec<Tile>,
    misfit: Array2<f32>,
    map: DepthMap,
}

impl Processor {
    /// A processor for `optics`. Returns [`RunError`] for unusable windows or operators of another blur.
    pub fn new(operators: &Operators, optics: &Optics, settings: &Settings) -> Result<Self, RunError> {
        check::check_settings(operators, optics, settings)?;
        let empty = || Array2::zeros((0, 0));
        Ok(Self {
            operators: operators.clone(),
            optics: *optics,
            settings: *settings,
            backend: settings.backend.unwrap_or_else(Backend::best),
            tiles: Vec::new(),
            misfit: empty(),
            map: DepthMap {
                depth_mm: empty(),
                confidence: empty(),
                filled: None,
                low_texture_fraction: 0.0,
                warnings: Vec::new(),
            },
        })
    }

    /// Depth of a pair, as [`super::depth_from_pair`]. An error discards the previous map.
    pub fn run(&mut self, far: ArrayView2<f32>, near: ArrayView2<f32>) -> Result<&DepthMap, RunError> {
        if self.settings.thread_count() > 1 {
            // From within the pool: otherwise each parallel stage would wake it again.
            rayon::scope(|_| self.run_here(far, near))?;
        } else {
            self.run_here(far, near)?;
        }
        Ok(&self.map)
    }

    fn run_here(&mut self, far: ArrayView2<f32>, near: ArrayView2<f32>) -> Result<(), RunError> {
        let [far, near] = [&far, &near].map(|image| image.as_standard_layout());
        let threads = self.settings.thread_count();
        let input = check::check(&far, &near, self.backend, threads)?;
        let size = (input.height, input.width);
        if self.map.depth_mm.dim() != size {
            [&mut self.map.depth_mm, &mut self.map.confidence, &mut self.misfit]
                .into_iter()
                .for_each(|map| *map = Array2::zeros(size));
        }
        let invalid = input.invalid(&self.operators, &self.settings);
        let job = Job {
            input: &input,
            invalid: invalid.as_ref(),
            operators: &self.operators,
            settings: &self.settings,
            depth_of: DepthOfAlpha::new(&self.operators, &self.optics),
            backend: self.backend,
        };
        job.run(
            &mut self.tiles,
            Maps {
                depth_mm: self.map.depth_mm.view_mut(),
                texture: self.map.confidence.view_mut(),
                misfit: self.misfit.view_mut(),
            },
        );
        let mut texture = self.settings.fill.then(|| self.map.confidence.clone());
        finish(&mut self.map, &self.misfit, self.backend, threads);
        if let Some(invalid) = &invalid {
            Zip::from(&mut self.map.depth_mm).and(&mut self.map.confidence).and(invalid).par_for_each(
                |depth, confidence, invalid| {
                    if *invalid {
                        (*depth, *confidence) = (f32::NAN, 0.0);
                    }
                },
            );
            if let Some(texture) = &mut texture {
                confidence::withhold(texture, invalid);
            }
        }
        border_fill::fill(&mut self.map, self.operators.kernel_size());
        if let Some(texture) = texture {
            let reach_px = check::reach_px(&self.operators, &self.settings);
            let pair = [far.view(), near.view()];
            fill::fill(&mut self.map, texture.view(), pair, reach_px, self.settings.filling());
        }
        self.map.warnings = input.warnings(&self.operators, &self.optics);
        self.map.warnings.extend(check::after(&self.map, &self.optics));
        Ok(())
    }

    /// The map of the last pair.
    pub fn map(&self) -> &DepthMap {
        &self.map
    }

    /// The map of the last pair, dropping the processor.
    pub fn into_map(self) -> DepthMap {
        self.map
    }
}

fn finish(map: &mut DepthMap, misfit: &Array2<f32>, backend: Backend, threads: usize) {
    let scale = confidence::texture_scale(map.confidence.view());
    let rows = map.confidence.nrows().div_ceil(threads);
    let in_band = |depth: &mut [f32], confidence: &mut [f32], misfit: &[f32]| {
        let [low, without] = simd::confidence_row(backend, confidence, misfit, scale);
        if without > 0 {
            for (depth, _) in depth.iter_mut().zip(confidence).filter(|(_, c)| **c <= 0.0) {
                *depth = f32::NAN;
            }
        }
        low
    };
    let width = map.depth_mm.ncols();
    let low: usize = match (map.depth_mm.as_slice_mut(), map.confidence.as_slice_mut(), misfit.as_slice()) {
        (Some(depth), Some(confidence), Some(misfit)) if threads == 1 => depth
            .chunks_mut(width)
            .zip(confidence.chunks_mut(width))
            .zip(misfit.chunks(width))
            .map(|((d, c), m)| in_band(d, c, m))
            .sum(),
        (Some(depth), Some(confidence), Some(misfit)) => depth
            .par_chunks_mut(rows * width)
            .zip(confidence.par_chunks_mut(rows * width))
            .zip(misfit.par_chunks(rows * width))
            .map(|((d, c), m)| in_band(d, c, m))
            .sum(),
        _ => unreachable!("maps are made in standard layout"),
    };
    map.low_texture_fraction = low as f64 / map.depth_mm.len() as f64;
}

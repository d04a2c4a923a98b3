//! Times of the Rust code in this process, for comparison with Python's: `python/measure.py`.

use std::{hint::black_box, time::Instant};

use farnear_depth::{
    measure::{DepthMethod, MeasureSettings, measure_pair_of_views},
    operators, pipeline,
    prepare::PrepareSettings,
};
use numpy::PyReadonlyArray2;
use pyo3::prelude::*;

use crate::{errors::wrong, optics::Optics};

/// Seconds per run of `depth` for two `float32` images and given operators.
#[pyfunction]
pub fn seconds_of_depth(
    far: PyReadonlyArray2<'_, f32>,
    near: PyReadonlyArray2<'_, f32>,
    optics: &Optics,
    repeats: usize,
) -> PyResult<Vec<f64>> {
    let operators = operators::Operators::for_optics(&optics.0).map_err(wrong)?;
    let settings = MeasureSettings { prepare: PrepareSettings::default(), ..MeasureSettings::default() };
    let run = |_| {
        let start = Instant::now();
        let method = DepthMethod::Rational(&operators);
        let found =
            measure_pair_of_views(far.as_array(), near.as_array(), &optics.0, method, None, &settings);
        black_box(found.map_err(wrong)?);
        Ok(start.elapsed().as_secs_f64())
    };
    (0..repeats).map(run).collect()
}

/// Seconds per run of a `Processor`.
#[pyfunction]
pub fn seconds_of_processor(
    far: PyReadonlyArray2<'_, f32>,
    near: PyReadonlyArray2<'_, f32>,
    optics: &Optics,
    repeats: usize,
) -> PyResult<Vec<f64>> {
    let operators = operators::Operators::for_optics(&optics.0).map_err(wrong)?;
    let settings = pipeline::Settings::default();
    let mut processor = pipeline::Processor::new(&operators, &optics.0, &settings).map_err(wrong)?;
    let run = |_| {
        let start = Instant::now();
        black_box(processor.run(far.as_array(), near.as_array()).map_err(wrong)?);
        Ok(start.elapsed().as_secs_f64())
    };
    (0..repeats).map(run).collect()
}

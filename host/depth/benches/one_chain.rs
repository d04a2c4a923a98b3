//! The run time for a small pair, repeated as often as requested: an emulator counts its instructions.
//! `cargo xtask bench --arm` subtracts two counts to remove the start. The operators are stored
//! (`farnear operators --psf pillbox`), because their design takes longer. Arguments: unit, repetitions.
#![allow(clippy::unwrap_used, missing_docs)] // A benchmark may stop; it has no users.

use std::hint::black_box;

use farnear_depth::operators::Operators;
use farnear_depth::optics::OpticsFile;
use farnear_depth::pipeline::{Backend, Processor, Settings};
use farnear_scene::standard;
use ndarray::Array2;

/// Small, because the emulator logs every instruction. Borders count too: a large pair takes less per pixel.
const SIZE: (usize, usize) = (96, 128);

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with('-')).collect();
    let [unit, times] = &arguments[..] else {
        println!("one_chain: for `cargo xtask bench --arm`");
        return;
    };
    let backend = *Backend::available().iter().find(|b| format!("{b:?}").to_lowercase() == *unit).unwrap();
    let mut file: OpticsFile = toml::from_str(standard::OPTICS).unwrap();
    file.psf = "pillbox".parse().unwrap();
    let optics = file.check().unwrap();
    let operators: Operators = toml::from_str(include_str!("one_chain_operators.toml")).unwrap();
    let pair = [3, 5].map(|seed| {
        Array2::from_shape_fn(SIZE, |(y, x)| ((y * 7 * seed + x * 13 + x * y * seed) % 31) as f32)
    });
    let settings = Settings { threads: 1, backend: Some(backend), ..Settings::default() };
    let mut processor = Processor::new(&operators, &optics, &settings).unwrap();
    for _ in 0..times.parse::<usize>().unwrap() {
        black_box(processor.run(pair[0].view(), pair[1].view()).unwrap().low_texture_fraction);
    }
}

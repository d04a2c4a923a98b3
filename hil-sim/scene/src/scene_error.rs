//! Why a scene, or a map of it, was refused.

use thiserror::Error;

/// Why a scene was refused.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum SceneError {
    /// A name that is no scene.
    #[error("unknown scene {0:?}, expected plane:MM, staircase, slant, cone or sphere")]
    Unknown(String),
    /// An option that the scene does not have, or without a value.
    #[error("scene {scene}: unknown option {option:?}, expected texture=sand|fractal, contrast=NUMBER{more}")]
    Option {
        /// The scene.
        scene: String,
        /// The option.
        option: String,
        /// Options of this scene only.
        more: &'static str,
    },
    /// A value that makes no sense.
    #[error("scene: {name} = {value}, expected {expected}")]
    Value {
        /// The option.
        name: &'static str,
        /// What was given.
        value: String,
        /// What it has to be.
        expected: &'static str,
    },
    /// A map without pixels.
    #[error("scene: the {what} map is {height} x {width}, expected at least 1 x 1")]
    Empty {
        /// `depth` or `texture`.
        what: &'static str,
        /// Rows.
        height: usize,
        /// Columns.
        width: usize,
    },
    /// A picture without any light.
    #[error("scene: the texture map is black")]
    Black,
    /// A scene file that is not TOML or has a wrong key.
    #[error("scene file: {0}")]
    Syntax(String),
    /// A scene file and the maps given with it do not fit.
    #[error("scene file: {what} map {found}")]
    Maps {
        /// `depth` or `texture`.
        what: &'static str,
        /// What is wrong.
        found: &'static str,
    },
    /// A value of a map that is not finite, or not above 0.
    #[error("scene: the {what} map holds {value} at row {row}, column {column}, expected {expected}")]
    MapValue {
        /// `depth` or `texture`.
        what: &'static str,
        /// The value.
        value: f32,
        /// Row.
        row: usize,
        /// Column.
        column: usize,
        /// What it has to be.
        expected: &'static str,
    },
}

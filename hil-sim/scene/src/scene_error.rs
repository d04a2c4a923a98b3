//! Errors of scenes and maps.

use thiserror::Error;

/// Why a scene was rejected.
#[derive(Debug, Clone, PartialEq, Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
pub enum SceneError {
    #[error("unknown scene {0:?}, expected plane:MM, staircase, slant, cone or sphere")]
    Unknown(String),
    #[error("scene {scene}: unknown option {option:?}, expected texture=sand|fractal, contrast=NUMBER{more}")]
    Option { scene: String, option: String, more: &'static str },
    #[error("scene: {name} = {value}, expected {expected}")]
    Value { name: &'static str, value: String, expected: &'static str },
    #[error("scene: the {what} map is {height} x {width}, expected at least 1 x 1")]
    Empty { what: &'static str, height: usize, width: usize },
    #[error("scene: the texture map is black")]
    Black,
    #[error("scene file: {0}")]
    Syntax(String),
    #[error("scene file: {what} map {found}")]
    Maps { what: &'static str, found: &'static str },
    #[error("scene: the {what} map holds {value} at row {row}, column {column}, expected {expected}")]
    MapValue { what: &'static str, value: f32, row: usize, column: usize, expected: &'static str },
}

//! Errors as exceptions.

use std::{error::Error, fmt::Display, io, path::Path, str::FromStr};

use pyo3::{
    create_exception,
    exceptions::{PyRuntimeError, PyValueError},
    prelude::*,
};

create_exception!(
    farnear,
    FarnearError,
    PyValueError,
    "An argument or file cannot be used; the message states the value and what was expected."
);
create_exception!(
    farnear,
    DisconnectedError,
    FarnearError,
    "The neighbour graph of an embedding is disconnected: raise the number of neighbours."
);
create_exception!(farnear, RigError, PyRuntimeError, "The rig, its camera or the way to them failed.");

/// Text of a file; the message of an error names the path.
pub fn read_text(path: &Path) -> PyResult<String> {
    std::fs::read_to_string(path)
        .map_err(|error| io::Error::new(error.kind(), format!("{}: {error}", path.display())).into())
}

/// A library's error with its causes in one line, as a `FarnearError`.
pub fn wrong(error: impl Error) -> PyErr {
    FarnearError::new_err(message(&error))
}

/// An argument that is a name; the message of an error states both.
pub fn parsed<T: FromStr>(name: &str, text: &str) -> PyResult<T>
where
    T::Err: Display,
{
    text.parse::<T>().map_err(|error| FarnearError::new_err(format!("{name} is {text}; {error}")))
}

pub fn rig(error: impl Error) -> PyErr {
    RigError::new_err(message(&error))
}

/// Omits a cause that the error's own text includes.
fn message(error: &dyn Error) -> String {
    let mut message = error.to_string();
    let mut next = error.source();
    while let Some(cause) = next {
        let text = cause.to_string();
        if !message.contains(&text) {
            message = format!("{message}: {text}");
        }
        next = cause.source();
    }
    message
}

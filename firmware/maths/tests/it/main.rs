//! The mathematics through its public API, in one test binary.
#![allow(clippy::unwrap_used, reason = "a helper of tests fails the test")]

mod clsf;
mod clsf_fit;
mod shadow;
mod sun;

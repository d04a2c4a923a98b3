//! The mathematics through its public face, one program for all of it.
#![allow(clippy::unwrap_used, reason = "a helper of tests fails the test")]

mod clsf;
mod clsf_fit;
mod shadow;
mod sun;

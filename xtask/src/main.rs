//! Set-up, demo, tests and measurements of this repository.

fn main() {}

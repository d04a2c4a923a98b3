//! The emulated board running the real firmware inside a simulated rig.

fn main() {}

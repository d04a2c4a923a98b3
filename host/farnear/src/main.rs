//! The command line of the farnear rig.

fn main() {}

//! The rig through its public interface, on a bench that models its hardware, in one program.

mod bench;
mod calibration;
mod coarse;
mod continuous;
mod control;
mod faults;
mod hostile;
mod light;
mod link;
mod maths;
mod power_cuts;
mod program;
mod requests;
mod safety;
mod sessions;

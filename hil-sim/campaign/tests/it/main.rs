//! Scenarios and traces on the emulated board, played by the host model.

mod replay;
mod scenarios;

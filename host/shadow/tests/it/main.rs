mod damaged;
mod detectors;
mod highway;
mod removal;
mod sun;

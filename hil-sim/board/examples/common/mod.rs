use farnear_protocol::{
    Micros, Nanometres,
    message::{Axis, Shot, TriggerMode},
};

/// A far- and a near-focused shot that move only the piezo.
pub fn far_and_near() -> [Shot; 2] {
    [10_000, 166_270].map(|target| Shot {
        axis: Axis::SensorFine,
        target: Nanometres(target),
        exposure: Micros(5_000),
        settle_window: Nanometres(100),
        settle_dwell: Micros(2_000),
        repeat: 1,
        mode: TriggerMode::Hardware,
    })
}

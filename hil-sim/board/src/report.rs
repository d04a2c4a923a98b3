//! State of a rig, for comparison with the firmware's reports.

#[derive(Clone, Copy, PartialEq, Debug)]
pub struct StageReport {
    /// True position from the home edge.
    pub position_um: f64,
    /// Exact sum of STEP and DIR from the true home edge.
    pub microsteps: i64,
    pub lost_microsteps: f64,
    pub step_edges: u64,
    pub last_step_ns: u64,
    pub driver_violations: u64,
}

#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Report {
    pub now_ns: u64,
    /// The firmware has reported its start.
    pub started: bool,
    pub resets: usize,
    pub powered: bool,
    pub coarse: StageReport,
    pub lens: StageReport,
    pub piezo_um: f64,
    /// Largest tension of the piezo stack since power-on; 200 is its blocking force.
    pub piezo_pulled_um: f64,
    pub triggers: u32,
    pub missed_triggers: u32,
    /// Bits flipped by the line, both directions.
    pub flipped_bits: u64,
}

impl Report {
    pub fn step_edges(&self) -> u64 {
        self.coarse.step_edges + self.lens.step_edges
    }

    pub fn last_step_ns(&self) -> u64 {
        self.coarse.last_step_ns.max(self.lens.last_step_ns)
    }
}

//! State of a rig, for comparison with the firmware's reports.

#[derive(Clone, Copy, PartialEq, Debug)]
pub struct StageReport {
    /// True position from the home edge.
    pub position_um: f64,
    /// Sequencer position from the true home edge: the exact sum of STEP and DIR.
    pub microsteps: i64,
    /// Commanded minus actual rotor position.
    pub lost_microsteps: f64,
    /// Rising STEP edges since power-on.
    pub step_edges: u64,
    /// Time of the last edge.
    pub last_step_ns: u64,
    /// STEP or DIR edges that violated the driver's timing.
    pub driver_violations: u64,
}

#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Report {
    /// Virtual time since power-on.
    pub now_ns: u64,
    /// The firmware has reported its start.
    pub started: bool,
    pub resets: usize,
    pub powered: bool,
    pub coarse: StageReport,
    pub lens: StageReport,
    /// True position.
    pub piezo_um: f64,
    /// Largest tension of the piezo stack since power-on; 200 is its blocking force.
    pub piezo_pulled_um: f64,
    /// Triggers since the board's reset.
    pub triggers: u32,
    /// Triggers ignored by a busy camera.
    pub missed_triggers: u32,
    /// Bits flipped by the line, both directions.
    pub flipped_bits: u64,
}

impl Report {
    /// Rising STEP edges of both motors since power-on.
    pub fn step_edges(&self) -> u64 {
        self.coarse.step_edges + self.lens.step_edges
    }

    /// Time of the last edge of either motor.
    pub fn last_step_ns(&self) -> u64 {
        self.coarse.last_step_ns.max(self.lens.last_step_ns)
    }
}

//! How a rig is at a moment: what a test may compare with what the firmware says.

#[derive(Clone, Copy, PartialEq, Debug)]
pub struct StageReport {
    /// Where it really is, micrometres from its true home edge.
    pub position_um: f64,
    /// Where its driver's sequencer stands, microsteps from the true home edge: exactly what STEP and DIR said.
    pub microsteps: i64,
    /// That, less where the rotor is.
    pub lost_microsteps: f64,
    /// Rising edges on its STEP pin since power-on.
    pub step_edges: u64,
    /// When the last of them was.
    pub last_step_ns: u64,
    /// Times that its driver chip was given STEP or DIR sooner than its data sheet allows.
    pub driver_violations: u64,
}

#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Report {
    /// Virtual time since power-on, nanoseconds.
    pub now_ns: u64,
    /// The firmware has said that it started.
    pub started: bool,
    /// Resets of the chip since power-on.
    pub resets: usize,
    /// Whether the chip has power.
    pub powered: bool,
    /// The sensor's stage.
    pub coarse: StageReport,
    pub lens: StageReport,
    /// Where the piezo really is, micrometres.
    pub piezo_um: f64,
    /// How far the piezo's stack was pulled at most since power-on, micrometres: 200 are its blocking force.
    pub piezo_pulled_um: f64,
    /// Triggers since the board's reset.
    pub triggers: u32,
    /// Triggers that the camera was too busy to hear.
    pub missed_triggers: u32,
    /// Bits that the line flipped, both directions.
    pub flipped_bits: u64,
}

impl Report {
    /// Rising edges on both STEP pins since power-on.
    pub fn step_edges(&self) -> u64 {
        self.coarse.step_edges + self.lens.step_edges
    }

    /// When the last of them was.
    pub fn last_step_ns(&self) -> u64 {
        self.coarse.last_step_ns.max(self.lens.last_step_ns)
    }
}

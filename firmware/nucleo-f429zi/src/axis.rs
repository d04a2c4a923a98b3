//! One motorised stage: motor, encoder, end switches.

use embassy_stm32::{
    Peri,
    gpio::{Input, Pin, Pull},
    timer::GeneralInstance4Channel,
};
use farnear_rig::io::{MotorInputs, MotorOutputs};

use crate::{
    encoder::Encoder,
    stepper::{StepInstance, Stepper},
};

/// Normally closed to ground with a pull-up: a broken wire reads as actuated and stops the axis.
pub struct Switches {
    home: Input<'static>,
    far: Input<'static>,
}

impl Switches {
    pub fn new(home: Peri<'static, impl Pin>, far: Peri<'static, impl Pin>) -> Self {
        Self { home: Input::new(home, Pull::Up), far: Input::new(far, Pull::Up) }
    }
}

pub struct Axis<S: StepInstance, E: GeneralInstance4Channel> {
    pub stepper: Stepper<S>,
    pub encoder: Encoder<E>,
    pub switches: Switches,
}

impl<S: StepInstance, E: GeneralInstance4Channel> Axis<S, E> {
    pub fn read(&mut self) -> MotorInputs {
        MotorInputs {
            encoder_counts: self.encoder.counts(),
            home_switch: self.switches.home.is_high(),
            far_switch: self.switches.far.is_high(),
            driver_fault: self.stepper.fault(),
            stepper: self.stepper.state(),
        }
    }

    pub fn apply(&mut self, outputs: &MotorOutputs) {
        self.stepper.apply(outputs);
    }
}

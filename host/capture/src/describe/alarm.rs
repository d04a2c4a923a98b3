use farnear_protocol::message::{Alarm, AlarmRecord, Failure};

use super::{SLOW_READOUT, axis_name, record_name, um};

/// Remedy for a motor that does not follow its steps.
const STALLED: &str = "free the stage and home it again; if the first move fails, compare microsteps, encoder counts and wires \
                       with docs/rig.md";

pub fn alarm_text(alarm: Alarm) -> String {
    match alarm {
        Alarm::EmergencyStop => "the emergency stop was pressed; release it".into(),
        Alarm::Halt => "the host halted the rig".into(),
        Alarm::DriverFault { axis } => format!(
            "the motor driver of the {} reports a fault; check its supply, its temperature and the motor's cable",
            axis_name(axis)
        ),
        Alarm::Following { axis, error } => format!(
            "encoder and steps of the {} disagree by {:.3} um (stall or slip); {STALLED}",
            axis_name(axis),
            um(error)
        ),
        Alarm::StepUnderrun { axis } => {
            format!("the step timer of the {} ran dry; home again, and report this as a bug", axis_name(axis))
        }
        Alarm::UnexpectedSwitch { axis, far } => format!(
            "the {} switch of the {} closed where it should not; check the switch and its cable, and home again",
            if far { "far" } else { "home" },
            axis_name(axis)
        ),
        Alarm::Gauge => {
            "the piezo's strain gauge gives nonsense, or the piezo does not follow; check cables, amplifier and the gauge's scale, and if its flexure has a second mode: `farnear rig settings set piezo_second_mode 1`".into()
        }
        Alarm::HostSilence { request } => {
            format!("the host said nothing for as long as request {request} had allowed; was the cable pulled?")
        }
        Alarm::SupplyLow => "the supply fell too low; check the power supply".into(),
        Alarm::BrownOut => "the supply dipped and the board was reset; check the power supply".into(),
        Alarm::Watchdog => "the firmware stopped responding and was reset; report this as a bug".into(),
        Alarm::Panic => "the firmware stopped itself at a contradiction; report this as a bug".into(),
        Alarm::StackOverflow => "the firmware's stack overflowed; report this as a bug".into(),
        Alarm::QueueOverflow => {
            "more came from the link than the board could take; does another program write to the port?".into()
        }
        Alarm::MotionInterrupted { axis } => format!(
            "power went or the board was reset while the {} moved; its position is lost, home it again",
            axis_name(axis)
        ),
        Alarm::RecordLost { record } => format!(
            "both copies of the {} in the board's memory are bad and defaults are in use; check and set them again",
            record_name(record)
        ),
        Alarm::MemoryMissing => {
            "the board's memory does not answer, so nothing outlasts a loss of power; check it and its wires".into()
        }
        Alarm::ClockLost => {
            "the board's clock (8 MHz from its ST-LINK) did not come or stopped; without it the chip's own is used, and times and speeds are a few per cent off; check the ST-LINK and its solder bridges, and reset the board".into()
        }
    }
}

/// `alarm`: the one that the failure refers to, if known.
pub fn failure_text(reason: Failure, alarm: Option<&AlarmRecord>) -> String {
    let text: String = match reason {
        Failure::Stopped => "it was stopped".into(),
        Failure::HomeSwitchNotFound => {
            "the home switch did not close within the whole travel; check the switch, its cable and that the stage moves".into()
        }
        Failure::HomeSwitchStuck => "the home switch did not open again, or not where it closes; check the switch and its cable".into(),
        Failure::FarSwitch => "the far switch closed; the stage ran past its travel, home it again".into(),
        Failure::HomeSwitch => "the home switch closed where it should not; home again".into(),
        Failure::Following { error } => format!(
            "encoder and steps disagree by {:.3} um (stall or slip); {STALLED}",
            um(error)
        ),
        Failure::NotSettled { error } => {
            format!("it did not settle in time ({:.3} um off at the end); is something shaking the rig?", um(error))
        }
        Failure::NoStrobe => format!(
            "the camera's exposure signal did not come or was shorter than the pulse; is the camera armed and its cable in? \
             {SLOW_READOUT}"
        ),
        Failure::DriverFault => "the motor driver reports a fault; check its supply and temperature".into(),
        Failure::StepUnderrun => "the step timer ran dry; home again, and report this as a bug".into(),
        Failure::Gauge => alarm_text(Alarm::Gauge),
        Failure::Alarm { number } => match alarm {
            Some(record) => alarm_text(record.alarm),
            None => format!("alarm {number} stopped it"),
        },
        Failure::Implausible => {
            "the readings contradict each other or lie outside the settings' ranges (`farnear rig settings list`), so nothing was stored; is something loose or shaking, or is the part another one?".into()
        }
    };
    match alarm {
        Some(record) => format!("{text}; alarm {} is latched", record.number),
        None => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn failures_name_the_settings_and_parts_that_may_cause_them() {
        let error = farnear_protocol::Nanometres(12_500);
        for (reason, cause) in [
            (Failure::Implausible, "farnear rig settings list"),
            (Failure::NoStrobe, "strobe_deadline_us"),
            (Failure::Following { error }, "microsteps"),
            (Failure::Gauge, "the gauge's scale"),
        ] {
            let text = failure_text(reason, None);
            assert!(text.contains(cause), "{text}");
        }
    }
}

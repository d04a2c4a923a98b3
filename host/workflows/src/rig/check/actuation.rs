use std::time::{Duration, Instant};

use farnear_capture::{
    describe::{axis_name, um},
    ready::steppers,
};
use farnear_protocol::message::{Alarm, SettingKey, Status};

use super::{Checkup, Found, failed, passed, passed_over};
use crate::error::Result;

const PATIENCE: Duration = Duration::from_secs(60);
const LOOK: Duration = Duration::from_millis(20);
/// Least rotation of a motor's shaft: a tenth of a turn of a 0.5 mm screw.
const TURNED_UM: f64 = 50.0;

/// Returns `None` after the time-out.
fn wait_for(checkup: &Checkup<'_>, what: impl Fn(&Status) -> bool) -> Result<Option<Status>> {
    let until = Instant::now() + PATIENCE;
    loop {
        let status = checkup.client().status()?;
        if what(&status) {
            return Ok(Some(status));
        }
        if Instant::now() >= until {
            return Ok(None);
        }
        checkup.context.cancel.check("waiting for a switch or shaft to be actuated")?;
        std::thread::sleep(LOOK);
    }
}

pub(super) fn switches(checkup: &mut Checkup<'_>) -> Found {
    let axes = steppers(&checkup.client().hello().capabilities);
    let status = checkup.client().status()?;
    for axis in &axes {
        if status.switches(*axis) == [true, true] {
            return failed(format!(
                "both end switches of the {} read as reached: a plug or a wire is off (they are normally closed to ground)",
                axis_name(*axis)
            ));
        }
    }
    if !checkup.actuation {
        return passed_over("without actuation they are not pressed; homing and the far end show the same");
    }
    for axis in &axes {
        for (which, name) in ["home", "far"].into_iter().enumerate() {
            checkup.info(&format!("press the {name} switch of the {}", axis_name(*axis)));
            let Some(status) = wait_for(checkup, |status| status.switches(*axis)[which])? else {
                return failed(format!("the {name} switch of the {} was not seen", axis_name(*axis)));
            };
            if status.switches(*axis)[1 - which] {
                return failed(format!("both switches of the {} closed at once", axis_name(*axis)));
            }
            checkup.info("seen; release it");
            if wait_for(checkup, |status| !status.switches(*axis)[which])?.is_none() {
                return failed(format!("the {name} switch of the {} does not open again", axis_name(*axis)));
            }
        }
    }
    passed(format!("{} switches open and close", 2 * axes.len()))
}

pub(super) fn emergency_stop(checkup: &mut Checkup<'_>) -> Found {
    if !checkup.client().hello().capabilities.emergency_stop {
        return passed_over("the rig has none: keep the motor supply's plug within reach");
    }
    if checkup.client().status()?.emergency_stop {
        return failed("the input is open: release the button, check its wire (it is normally closed)");
    }
    if !checkup.actuation {
        return passed_over(
            "the input is closed; without actuation it is not pressed (the halt below does the same)",
        );
    }
    checkup.info("press the emergency stop");
    let pressed = wait_for(checkup, |status| status.emergency_stop && status.alarm.is_some())?;
    let Some(record) = pressed.and_then(|status| status.alarm) else {
        return failed("it was not seen, or raised no alarm");
    };
    if record.alarm != Alarm::EmergencyStop {
        return failed(format!("it raised another alarm: {:?}", record.alarm));
    }
    if checkup.client().clear_alarm(record.number).is_ok() {
        return failed("the alarm could be cleared while the button was pressed");
    }
    checkup.info("seen; release it");
    if wait_for(checkup, |status| !status.emergency_stop)?.is_none() {
        return failed("the input does not close again");
    }
    checkup.client().clear_alarm(record.number)?;
    passed("it raises its alarm, which goes only when the button is released and the alarm is cleared")
}

pub(super) fn encoders(checkup: &mut Checkup<'_>) -> Found {
    if !checkup.actuation {
        return passed_over(
            "without actuation the motors are not turned; the first homing would fail with the wrong sense",
        );
    }
    checkup.ask("disconnect the motors from their drivers (supply off), leave the encoders connected")?;
    let axes = steppers(&checkup.client().hello().capabilities);
    for axis in &axes {
        let place = |status: &Status| um(status.axis(*axis).measured);
        let before = place(&checkup.client().status()?);
        checkup.info(&format!(
            "turn the motor of the {} by hand so that its stage moves AWAY from home",
            axis_name(*axis)
        ));
        let turned = wait_for(checkup, |status| (place(status) - before).abs() >= TURNED_UM)?;
        let Some(status) = turned else {
            return failed(format!(
                "the encoder of the {} counted less than {TURNED_UM} um: check its cable",
                axis_name(*axis)
            ));
        };
        if place(&status) < before {
            return failed(format!(
                "the encoder of the {} counts backwards: exchange its A and B",
                axis_name(*axis)
            ));
        }
    }
    passed(format!("{} encoders count up on the way away from home", axes.len()))
}

/// The fast piezo loop damages a stack whose flexure has a second mode, so the data sheet is asked about first.
pub(super) fn piezo_ready(checkup: &mut Checkup<'_>) -> Found {
    if !checkup.client().hello().capabilities.sensor_fine {
        return passed_over("the rig has no piezo");
    }
    if !checkup.actuation {
        return passed_over("without actuation its supplies and its flexure are not asked about");
    }
    if !checkup.yes("are the gauge electronics and the piezo amplifier on?")? {
        return failed("switch the gauge electronics on, then the piezo amplifier");
    }
    let key = SettingKey::PiezoSecondMode;
    if checkup.client().setting(key)?.value != 0 {
        return passed("the loop for a flexure with a second mode is selected");
    }
    if !checkup.yes("does the flexure have one resonance only, and nothing else below 2.5 kHz?")? {
        return failed(format!(
            "the default loop excites a second mode; select the slower one by `farnear rig settings set {} 1`",
            key.name()
        ));
    }
    passed("the loop for a flexure with one resonance is selected")
}

pub(super) fn connect_motors(checkup: &mut Checkup<'_>) -> Found {
    if !checkup.actuation {
        return passed("without actuation they are assumed to be connected");
    }
    checkup.ask("supply off, connect the motors, stages somewhere in the middle, hands off, supply on")?;
    let status = checkup.client().status()?;
    match status.alarm {
        None => passed("no driver reports a fault"),
        Some(record) => failed(format!("alarm {}: {:?}", record.number, record.alarm)),
    }
}

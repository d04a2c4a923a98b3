//! Steps with motion: homing, full speed, halt, piezo, camera.

use farnear_capture::{
    Client, ClientError,
    describe::{axis_name, um},
    expose::{CaptureError, expose},
    ready::steppers,
    sequence::ShotDefaults,
};
use farnear_protocol::{
    Micros, Nanometres, Settle,
    message::{
        Alarm, Axis, Calibration, Limits, Routine, Setting, SettingKey, ShotRecord, StepperKeys,
        strobe_tolerance,
    },
};

use super::{Checkup, EquippedRig, Found, failed, passed, passed_over};

/// A twelfth of the usual speed.
const SLOW_NM_PER_S: i32 = 500_000;
/// Largest difference between two homings.
const REPEATS_UM: f64 = 1.5;
/// Attempts to halt a move: a busy computer may ask after its end.
const HALTS: usize = 3;
/// Exposures of the strobe check.
const EXPOSURES: u16 = 5;

fn range(axis: Axis, limits: &Limits) -> (i32, i32) {
    let (min, max) = limits.of(axis);
    (min.0, max.0)
}

/// Largest position error: the window in which the board reports a move as settled.
fn tolerance_um(axis: Axis) -> f64 {
    um(Settle::of_move(axis).window)
}

fn speed_key(axis: Axis) -> SettingKey {
    StepperKeys::of(axis).unwrap_or(StepperKeys::COARSE).speed
}

/// Homes at a twelfth of the speed, so that wiring errors can be noticed.
pub(super) fn slow_homing(checkup: &mut Checkup<'_>) -> Found {
    let axes = steppers(&checkup.client().hello().capabilities);
    if checkup.actuation {
        checkup
            .ask("keep a hand on the emergency stop: each stage now goes slowly towards its home switch")?;
    }
    for axis in &axes {
        let client = checkup.client();
        let usual = client.setting(speed_key(*axis))?;
        client.set_setting(speed_key(*axis), SLOW_NM_PER_S.clamp(usual.min, usual.max))?;
        let homed = client.home(*axis);
        // Restore the speed in any case.
        if let Err(error) = client.set_setting(speed_key(*axis), usual.value) {
            let (key, value) = (speed_key(*axis).name(), usual.value);
            let homing = homed.err().map(|error| format!("{error}; ")).unwrap_or_default();
            return failed(format!(
                "{homing}{key} may still be {SLOW_NM_PER_S} instead of {value} ({error}); set it back by `farnear rig \
                 settings set {key} {value}`"
            ));
        }
        homed?;
        if checkup.actuation && !checkup.yes(&format!("did the {} move smoothly?", axis_name(*axis)))? {
            return failed(format!("the {} did not move smoothly", axis_name(*axis)));
        }
    }
    passed(format!("{} stages found their home switches", axes.len()))
}

pub(super) fn homing_repeats(checkup: &mut Checkup<'_>) -> Found {
    let client = checkup.client();
    let mut said = Vec::new();
    for axis in steppers(&client.hello().capabilities) {
        let (min, max) = range(axis, &client.hello().limits);
        client.move_to(axis, Nanometres(min + (max - min) / 20))?;
        let shift = um(client.home(axis)?);
        said.push(format!("{} {shift:+.3} um", axis_name(axis)));
        if shift.abs() > REPEATS_UM {
            return failed(format!(
                "the home switch of the {} came {shift:+.3} um off; is it fixed well?",
                axis_name(axis)
            ));
        }
    }
    passed(format!("second homing against the first: {}", said.join(", ")))
}

pub(super) fn full_speed(checkup: &mut Checkup<'_>) -> Found {
    let client = checkup.client();
    let mut said = Vec::new();
    for axis in steppers(&client.hello().capabilities) {
        let (min, max) = range(axis, &client.hello().limits);
        let target = Nanometres(min + (max - min) / 2);
        let moved = client.move_to(axis, target)?;
        let error = um(Nanometres(moved.measured.0 - target.0));
        said.push(format!("{} {error:+.3} um", axis_name(axis)));
        if error.abs() > tolerance_um(axis) {
            return failed(format!("the {} stands {error:+.3} um off", axis_name(axis)));
        }
        if axis == Axis::Lens {
            // The next capture expects the stage where homing leaves it: its position limits the sensor
            // distances.
            client.move_to(axis, Nanometres(min))?;
        }
    }
    passed(format!("to the middle of the travel; off by {}", said.join(", ")))
}

fn clear_alarm(client: &Client) -> Result<(), ClientError> {
    match client.status()?.alarm {
        Some(record) => client.clear_alarm(record.number),
        None => Ok(()),
    }
}

/// Halts in mid-move. The alarm must be latched, refuse requests, and clear.
pub(super) fn halt(checkup: &mut Checkup<'_>) -> Found {
    let client = checkup.client();
    let Some(axis) = steppers(&client.hello().capabilities).first().copied() else {
        return passed_over("the rig has no stepper");
    };
    let (min, max) = range(axis, &client.hello().limits);
    let mut is_halted = false;
    for attempt in 0..HALTS {
        if attempt > 0 {
            clear_alarm(client)?;
            client.home(axis)?;
            client.move_to(axis, Nanometres(min + (max - min) / 2))?;
        }
        let work = client.start_move(axis, Nanometres(min))?;
        client.halt()?;
        match work.moved() {
            Err(ClientError::Failed { alarm: Some(record), .. }) if record.alarm == Alarm::Halt => {
                is_halted = true;
                break;
            }
            Err(error) => return Err(error.into()),
            Ok(_) => {}
        }
    }
    if !is_halted {
        return failed("the move went on");
    }
    if client.move_to(axis, Nanometres(min)).is_ok() {
        return failed("the rig moved though the alarm was latched");
    }
    clear_alarm(client)?;
    let refused = client.move_to(axis, Nanometres(min));
    if refused.is_ok() {
        return failed("the rig moved though its position was lost");
    }
    client.home(axis)?;
    passed("a halt stops a move, latches its alarm and makes the position lost; homing brings it back")
}

pub(super) fn piezo(checkup: &mut Checkup<'_>) -> Found {
    if !checkup.client().hello().capabilities.sensor_fine {
        return passed_over("the rig has no piezo");
    }
    if let Some(reason) = unswept(&checkup.client().setting(SettingKey::FineMaxNm)?) {
        return passed_over(reason);
    }
    match checkup.client().calibrate(Routine::Piezo)? {
        Calibration::Piezo { gain_pm_per_code, hysteresis_ppm, creep_ppm_per_decade } => passed(format!(
            "{gain_pm_per_code} pm a code, hysteresis {:.1} %, creep {:.2} % a decade",
            f64::from(hysteresis_ppm) / 1e4,
            f64::from(creep_ppm_per_decade) / 1e4
        )),
        other => failed(format!("the board measured something else: {other:?}")),
    }
}

/// Why the whole stroke is not swept: a limit excludes its upper end.
fn unswept(fine_max: &Setting) -> Option<String> {
    let Setting { key, value, default, .. } = fine_max;
    (value < default).then(|| {
        format!(
            "{} is {value}, and the sweep drives the whole stroke: set it to {default} for `farnear rig calibrate piezo`, if the piezo \
             has that stroke",
            key.name()
        )
    })
}

pub(super) fn toggle(checkup: &mut Checkup<'_>) -> Found {
    let client = checkup.client();
    if !client.hello().capabilities.sensor_fine {
        return passed_over("the rig has no piezo");
    }
    let (min, max) = range(Axis::SensorFine, &client.hello().limits);
    let mut worst = 0.0_f64;
    for target in [min + 10_000, max - 10_000, min + 10_000, (min + max) / 2] {
        let moved = client.move_to(Axis::SensorFine, Nanometres(target))?;
        worst = worst.max(um(Nanometres(moved.measured.0 - target)).abs());
    }
    if worst > tolerance_um(Axis::SensorFine) {
        return failed(format!("the piezo stands up to {worst:.3} um off"));
    }
    passed(format!("within {:.0} nm of where it was sent", worst * 1e3))
}

pub(super) fn strobe(checkup: &mut Checkup<'_>) -> Found {
    let camera_settings = &checkup.settings.camera;
    let EquippedRig { camera, rig } = &mut checkup.equipped;
    let client = &rig.client;
    if !client.hello().capabilities.strobe {
        return passed_over("the rig measures no strobe");
    }
    let exposure = camera_settings.exposure;
    let defaults = ShotDefaults { exposure, repeat: EXPOSURES, ..ShotDefaults::default() };
    let (min, max) = range(Axis::SensorFine, &client.hello().limits);
    let shot = defaults.shot(Axis::SensorFine, Nanometres((min + max) / 2));
    let mut records: Vec<ShotRecord> = Vec::new();
    let wait = camera_settings.image_wait;
    expose(client, camera.as_mut(), &[shot], wait, |record, _| -> Result<(), CaptureError> {
        records.push(record);
        Ok(())
    })?;
    let off = |record: &ShotRecord| {
        let Micros(asked) = record.exposure;
        record.strobe_end.0.saturating_sub(record.strobe_start.0).abs_diff(u64::from(asked))
    };
    let latency = |record: &ShotRecord| record.strobe_start.0.saturating_sub(record.trigger.0);
    let worst = records.iter().map(off).max().unwrap_or(0);
    let latest = records.iter().map(latency).max().unwrap_or(0);
    if worst > u64::from(strobe_tolerance(exposure).0) {
        return failed(format!("a strobe was {worst} us longer or shorter than the exposure asked for"));
    }
    passed(format!(
        "{} exposures with their images; strobe at most {latest} us after the trigger, {worst} us off in length",
        records.len()
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_piezo_with_a_narrower_limit_is_not_swept() {
        let default = 195_000;
        let setting =
            |value| Setting { key: SettingKey::FineMaxNm, value, default, min: 5_000, max: default };
        assert_eq!(unswept(&setting(default)), None);
        let reason = unswept(&setting(170_000)).unwrap();
        assert!(
            reason.starts_with("fine_max_nm is 170000") && reason.contains("set it to 195000"),
            "{reason}"
        );
    }
}

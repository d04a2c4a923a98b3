use std::collections::{BTreeMap, BTreeSet};

use farnear_protocol::{
    EventKind, Request, Response,
    message::{Axis, PositionState, ProgramState, Routine},
};

use super::{Broken, Case};
use farnear_sim::observer::{Seen, Truth};

/// Screw (2 um), home switch (three standard deviations, 0.9 um), a step and a count.
const STEPPER_UM: f64 = 3.2;
/// Screw play, if a motion ended before its approach from below.
const PLAY_UM: f64 = 4.0;
/// Permitted difference of steps and encoder before an alarm, plus the rotor's swing.
const FOLLOWING_UM: f64 = 6.5;
/// Gauge noise (five standard deviations) and piezo motion until the answer has left.
const PIEZO_UM: f64 = 0.1;

pub fn stated_um(case: &Case<'_>, axis: Axis, at_um: f64) -> f64 {
    match axis {
        Axis::SensorFine => {
            let gauge = &case.parts.gauge;
            // Uncalibrated gauge.
            PIEZO_UM + (gauge.gain - 1.0).abs() * at_um.abs() + gauge.offset_um.abs() + 5.0 * gauge.noise_um
        }
        Axis::SensorCoarse | Axis::Lens => STEPPER_UM + PLAY_UM + FOLLOWING_UM,
    }
}

fn truly_um(truth: &Truth, axis: Axis) -> f64 {
    match axis {
        Axis::SensorCoarse => truth.coarse_um,
        Axis::SensorFine => truth.piezo_um,
        Axis::Lens => truth.lens_um,
    }
}

pub fn position(case: &Case<'_>) -> Vec<Broken> {
    let mut homed: BTreeSet<(u32, &str)> = BTreeSet::new();
    let mut asked: BTreeMap<(u32, u32), Option<Axis>> = BTreeMap::new();
    let mut broken = Vec::new();
    // A repeat returns the first answer, which may be outdated.
    let mut answered = BTreeSet::new();
    for sight in case.sights {
        let off = match &sight.seen {
            Seen::Asked { id, boot, call } => {
                asked.insert((*boot, *id), homes(&call.request));
                continue;
            }
            Seen::Reported { event, boot, truth, .. } => match &event.kind {
                EventKind::Homed { axis, .. } => {
                    homed.insert((*boot, axis.name()));
                    continue;
                }
                EventKind::MoveDone { axis, measured, .. } => {
                    off(case, *axis, measured.0, truth).map(|what| format!("a move is done, {what}"))
                }
                _ => continue,
            },
            Seen::Answered { id, boot, answer, truth } => {
                // The edge is found before the homing ends; calibrations home, too.
                if **answer == Ok(Response::Accepted) {
                    let axis = asked.get(&(*boot, *id)).copied().flatten();
                    homed.extend(axis.map(|axis| (*boot, axis.name())));
                }
                let Ok(Response::Status(status)) = &**answer else { continue };
                if !answered.insert((*boot, *id)) {
                    continue;
                }
                Axis::ALL.into_iter().find_map(|axis| {
                    let reported = status.axis(axis);
                    if reported.state != PositionState::Homed {
                        return None;
                    }
                    if axis != Axis::SensorFine && !homed.contains(&(*boot, axis.name())) {
                        return Some(format!("{axis:?} is called homed and was not homed in boot {boot}"));
                    }
                    // A program's next move may begin before the answer has left.
                    let led = axis == Axis::SensorFine && status.program.state == ProgramState::Running;
                    if reported.moving || led { None } else { off(case, axis, reported.measured.0, truth) }
                })
            }
            _ => continue,
        };
        broken.extend(off.map(|what| Broken { property: "position", at_ns: sight.at_ns, what }));
    }
    broken
}

fn homes(request: &Request) -> Option<Axis> {
    match request {
        Request::Home { axis, .. } => Some(*axis),
        Request::Calibrate { routine, .. } => match routine {
            Routine::Travel { axis } | Routine::Backlash { axis } => Some(*axis),
            Routine::Gauge => Some(Axis::SensorCoarse),
            Routine::Piezo => None,
        },
        _ => None,
    }
}

fn off(case: &Case<'_>, axis: Axis, measured_nm: i32, truth: &Truth) -> Option<String> {
    let (measured_um, true_um) = (1e-3 * f64::from(measured_nm), truly_um(truth, axis));
    let stated_um = stated_um(case, axis, true_um);
    ((measured_um - true_um).abs() > stated_um).then(|| {
        format!("{axis:?} is reported at {measured_um:.3} um but is at {true_um:.3} um; its stated error is {stated_um:.2} um")
    })
}

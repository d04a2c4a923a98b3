use farnear_protocol::{
    RequestError,
    message::{Axis, CorrectionFault, LIGHT_LEVEL_MAX, LIGHT_TIME_MAX, LightFault, ShotFault},
};

use super::{alarm_text, axis_name, program_name, state_name, um};

/// Long because it is one table with a line per reason.
pub fn refusal_text(error: &RequestError) -> String {
    match error {
        RequestError::Version { min, current } => format!("it speaks protocol {min} to {current}"),
        RequestError::Boot { current } => {
            format!("the request was made for another boot; this one is {current}")
        }
        RequestError::Malformed => "it did not understand the request".into(),
        RequestError::IdReused => {
            "the request's id was already used: does another program talk to the board?".into()
        }
        RequestError::NotInSession => "another program has opened a session with it since".into(),
        RequestError::IdNotNew { last } => {
            format!(
                "the request is older than its last one ({last}): does another program talk to the board?"
            )
        }
        RequestError::QueueFull { outstanding } => {
            format!("more than {outstanding} requests wait for their answers: ask again")
        }
        RequestError::Period { min } => {
            format!(
                "the camera takes {} us for an exposure and its read-out; ask for a longer period, or set camera_readout_us for a \
                 faster camera",
                min.0
            )
        }
        RequestError::Light { reason } => format!("the light: {}", light_fault_text(*reason)),
        RequestError::OutOfRange { axis, asked, min, max } => format!(
            "{:.3} um is outside the limits of the {}, {:.3} to {:.3} um",
            um(*asked),
            axis_name(*axis),
            um(*min),
            um(*max)
        ),
        RequestError::NotHomed { axis: axis @ Axis::SensorFine, .. } => format!(
            "the position of the {} is unknown because its gauge is silent: check its converter, cable and supply",
            axis_name(*axis)
        ),
        RequestError::NotHomed { axis, state } => {
            format!("the position of the {} is {}; home it first", axis_name(*axis), state_name(*state))
        }
        RequestError::Busy { request } => {
            format!("it is still busy with request {request}; wait for its end or stop it")
        }
        RequestError::CannotHome { axis } => {
            format!("the {} has no home switch and needs no homing", axis_name(*axis))
        }
        RequestError::Shot { index, reason } => format!("shot {index}: {}", shot_fault_text(*reason)),
        RequestError::EventGone { oldest, next } => {
            format!("it remembers the events from {oldest} to just before {next} only")
        }
        RequestError::Alarm { number, alarm } => format!("alarm {number} is latched: {}", alarm_text(*alarm)),
        RequestError::NoSuchAlarm { latched: 0, last: 0 } => "there never was an alarm".into(),
        RequestError::NoSuchAlarm { latched: 0, last } => {
            format!("no such alarm is latched or kept; the last one was number {last}")
        }
        RequestError::NoSuchAlarm { latched, .. } => {
            format!("the latched alarm is number {latched}: read it, then clear that number")
        }
        RequestError::AlarmRemains { alarm } => {
            format!("the alarm's cause is still there: {}", alarm_text(*alarm))
        }
        RequestError::TooClose { distance, min } => format!(
            "sensor and lens would come within {:.4} mm of each other on the way, at least {:.4} mm are allowed \
             (setting distance_min_nm): move the other one away first, or home it where it stands below its zero",
            um(*distance) / 1e3,
            um(*min) / 1e3
        ),
        RequestError::Silence { min, max } => {
            format!("the keep-alive timeout must lie between {} and {} ms", min.0 / 1000, max.0 / 1000)
        }
        RequestError::Program { state } => {
            format!("the exposure program is {}, which does not go with this", program_name(*state))
        }
        RequestError::SettingRange(setting) => format!(
            "{} must lie between {} and {}; it stays {} (default {})",
            setting.key.name(),
            setting.min,
            setting.max,
            setting.value,
            setting.default
        ),
        RequestError::Correction(fault) => correction_fault_text(*fault).into(),
        RequestError::NotFitted { axis } => format!("this rig has no {}", axis_name(*axis)),
        RequestError::NoSuchRoutine => "this routine is not possible on that axis".into(),
    }
}

fn shot_fault_text(fault: ShotFault) -> &'static str {
    match fault {
        ShotFault::Index => "the index is outside the program, or the program has no shots",
        ShotFault::Missing => "it was never loaded",
        ShotFault::Exposure => "the exposure time is outside the board's limits",
        ShotFault::Settle => {
            "expected a settle window of 1 to 100000 nm, and a dwell in it of 1 to 1000000 us"
        }
        ShotFault::Repeat => "the repeat count is 0",
    }
}

fn correction_fault_text(fault: CorrectionFault) -> &'static str {
    match fault {
        CorrectionFault::None => "no depth correction is open or stored on the board",
        CorrectionFault::Size => "the depth map is too small, or wider than the board's row buffer",
        CorrectionFault::Place => "the row lies outside the depth map, or the pixels outside the row",
        CorrectionFault::Coefficient => "a coefficient is out of its range or number",
        CorrectionFault::Underdetermined => {
            "the samples do not determine the correction: at least four depths, and pixels in every region, are needed"
        }
        CorrectionFault::TooManySamples => {
            "more samples than the board's sums can hold; take fewer pixels of each row"
        }
        CorrectionFault::CoefficientTooLarge => {
            "a coefficient of the fit is too large: the depth scale does not suit the samples"
        }
    }
}

fn light_fault_text(reason: LightFault) -> String {
    match reason {
        LightFault::Level => format!("a brightness exceeds {} %", LIGHT_LEVEL_MAX / 10),
        LightFault::Time => format!("its time is outside 1 us to {} s", LIGHT_TIME_MAX.0 / 1_000_000),
        LightFault::Exposure => {
            "the flash does not end within the exposure; shorten its delay or its length".into()
        }
        LightFault::Mode => "only a shot that the board triggers can have a flash".into(),
    }
}

#[cfg(test)]
mod tests {
    use farnear_protocol::Micros;

    use super::*;

    #[test]
    fn refusals_name_what_can_be_changed() {
        let period = refusal_text(&RequestError::Period { min: Micros(11_000) });
        assert!(period.contains("camera_readout_us"), "{period}");
        let settle = refusal_text(&RequestError::Shot { index: 3, reason: ShotFault::Settle });
        assert!(settle.starts_with("shot 3: ") && settle.contains("100000 nm"), "{settle}");
    }
}

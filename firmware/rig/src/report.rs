use farnear_protocol::message::{
    Axis, Capabilities, Hello, Limits, ProgramState, ProgramStatus, SCHEMA_KEY, Status,
};
use farnear_protocol::{BoardMicros, PROTOCOL_CURRENT, PROTOCOL_MIN};
use heapless::String;

use crate::correction::ROW_PIXELS_MAX;
use crate::program::SHOTS_MAX;
use crate::rig::Rig;
use crate::session::OUTSTANDING;
use crate::settings::STEP_PM;
use crate::work::{Active, WholeWork};

impl Rig {
    pub(crate) fn hello(&self) -> Hello {
        Hello {
            protocol_min: PROTOCOL_MIN,
            protocol_current: PROTOCOL_CURRENT,
            schema_key: SCHEMA_KEY,
            board: cut(self.identity.board),
            firmware: cut(self.identity.firmware),
            unique_id: self.identity.unique_id,
            boot: self.boot,
            reset_cause: self.identity.reset_cause,
            emulated: self.identity.emulated,
            capabilities: Capabilities {
                sensor_coarse: true,
                sensor_fine: true,
                strobe: true,
                lens: true,
                memory: self.store.is_fitted(),
                emergency_stop: true,
            },
            limits: self.limits(),
            last_id: self.session.last_id(),
            outstanding: OUTSTANDING as u8,
        }
    }

    fn limits(&self) -> Limits {
        let settings = &self.settings;
        Limits {
            datum: settings.datum,
            coarse_min: settings.coarse.min,
            coarse_max: settings.coarse.max,
            coarse_step_pm: STEP_PM,
            fine_min: settings.fine.min,
            fine_max: settings.fine.max,
            shots_max: SHOTS_MAX as u8,
            exposure_min: settings.camera.exposure_min,
            exposure_max: settings.camera.exposure_max,
            lens_min: settings.lens.min,
            lens_max: settings.lens.max,
            lens_step_pm: STEP_PM,
            distance_min: settings.distance_min,
            silence_min: settings.link.silence_min,
            silence_max: settings.link.silence_max,
            row_pixels_max: ROW_PIXELS_MAX,
        }
    }

    pub(crate) fn status(&self, now: BoardMicros) -> Status {
        let stage = &self.stage;
        let axis = |axis: Axis| stage.status(axis, self.works.request_on(axis));
        Status {
            time: now,
            coarse: axis(Axis::SensorCoarse),
            fine: axis(Axis::SensorFine),
            lens: axis(Axis::Lens),
            home_switch: stage.coarse.home_closed(),
            far_switch: stage.coarse.far_closed(),
            lens_home_switch: stage.lens.home_closed(),
            lens_far_switch: stage.lens.far_closed(),
            emergency_stop: self.emergency_stop,
            supply_low: self.supply_low,
            alarm: self.alarms.latched().copied(),
            program: self.program_status(),
            next_event: self.events.next_number(),
            triggers: self.camera.triggers(),
            steps: stage.coarse.total_pulses() + stage.lens.total_pulses(),
            link: self.session.counters(),
        }
    }

    pub(crate) fn program_status(&self) -> ProgramStatus {
        if let Some(Active { work: WholeWork::Program(run), .. }) = &self.works.whole {
            return run.status();
        }
        let shots = self.shots.armed();
        let state = if shots == 0 { ProgramState::Idle } else { ProgramState::Armed };
        ProgramStatus { state, shots, index: 0, exposures: 0 }
    }
}

fn cut<const N: usize>(text: &str) -> String<N> {
    let mut out = String::new();
    for character in text.chars() {
        if out.push(character).is_err() {
            break;
        }
    }
    out
}

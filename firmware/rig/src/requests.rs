//! Requests: checks and start. [`Rig::carry_out`] has no wildcard, so that a new request must be handled.

mod checks;
mod exposures;
mod motion;
mod upkeep;

use farnear_maths::clsf::Columns;
use farnear_protocol::BoardMicros;
use farnear_protocol::message::{
    Alarm, Axis, CorrectionFault, Failure, RecordName, Request, RequestError, Response,
};

use crate::correction::Correction;
use crate::notes::Note;
use crate::rig::{Reboot, Rig};
use crate::session::Incoming;
use crate::sun_query;

type Answer = Result<Response, RequestError>;

impl Rig {
    pub(crate) fn carry_out(&mut self, incoming: &Incoming, now: BoardMicros) -> Answer {
        let id = incoming.id;
        match &incoming.request {
            Request::Hello => Ok(Response::Hello(self.hello())),
            Request::OpenSession => Ok(self.open_session(id)),
            Request::SetLinkRate { rate } => self.set_link_rate(*rate, now),
            Request::Status => Ok(Response::Status(self.status(now))),
            Request::ReadEvent { number } => self.read_event(*number),
            Request::Stop => Ok(self.stop()),
            Request::Halt => Ok(self.halt(now)),
            Request::Reboot => Ok(self.reboot(id, now)),
            Request::Home { axis, silence } => self.home(*axis, (id, *silence)),
            Request::Move { axis, target, silence } => self.go(*axis, *target, (id, *silence), now),
            Request::LoadShot { index, shot } => self.load_shot(*index, shot),
            Request::ArmProgram { shots } => self.arm_program(*shots),
            Request::RunProgram { silence } => self.run_program((id, *silence), now),
            Request::RunContinuously { period, exposures, silence } => {
                self.run_continuously(*period, *exposures, (id, *silence), now)
            }
            Request::SetLights { levels, time, silence } => self.set_lights(*levels, (*time, *silence), now),
            Request::SetShotLight { index, light } => self.set_shot_light(*index, *light),
            Request::PauseProgram => self.pause_program(),
            Request::ResumeProgram => self.resume_program(now),
            Request::Calibrate { routine, silence } => self.calibrate(*routine, (id, *silence)),
            Request::ReadAlarm { number } => self.alarms.read(*number).map(Response::Alarm),
            Request::ClearAlarm { number } => self.clear_alarm(*number, now),
            Request::ReadSetting { key } => Ok(Response::Setting(self.values.setting(*key))),
            Request::WriteSetting { key, value } => self.write_setting(*key, *value),
            Request::ReadCounters => Ok(Response::Counters(self.counters())),
            Request::Sun(query) => {
                self.must_stand()?;
                Ok(Response::Sun(sun_query::answer(query)))
            }
            Request::OpenCorrection(info) => accepted(self.correction()?.open(*info)),
            Request::LoadCorrection => answer(self.correction()?.load(), Response::Correction),
            Request::StoreCorrection => self.store_correction(),
            Request::PutCoefficients { first, bits } => accepted(self.correction()?.put(*first, bits)),
            Request::GetCoefficients { first, count } => {
                answer(self.correction()?.get(*first, *count), Response::Coefficients)
            }
            Request::FitSamples { row, first, step, truth, codes } => {
                let columns = Columns { first: *first, step: *step };
                accepted(self.correction()?.add_samples(*row, columns, codes, *truth))
            }
            Request::SolveFit => accepted(self.correction()?.solve()),
            Request::PutRow { first, codes } => accepted(self.correction()?.put_row(*first, codes)),
            Request::CorrectRow { row } => accepted(self.correction()?.correct_row(*row)),
            Request::GetRow { first, count } => {
                answer(self.correction()?.get_row(*first, *count), Response::Row)
            }
        }
    }

    fn open_session(&mut self, request: u32) -> Response {
        self.notes.add(Note::Session { request });
        self.stop()
    }

    fn stop(&mut self) -> Response {
        self.stage.stop();
        self.camera.give_up();
        self.lights.off();
        for axis in Axis::ALL {
            self.works.end(axis, Failure::Stopped);
        }
        self.works.end_whole(None, Failure::Stopped);
        Response::Accepted
    }

    fn halt(&mut self, now: BoardMicros) -> Response {
        self.alarm(Alarm::Halt, now);
        Response::Accepted
    }

    fn reboot(&mut self, request: u32, now: BoardMicros) -> Response {
        self.stop();
        self.reboot.get_or_insert(Reboot { request, waiting_since: now, quiet_since: None });
        Response::Accepted
    }

    /// Rejected during motion, because it may exceed a tick.
    fn correction(&mut self) -> Result<&mut Correction, RequestError> {
        self.must_stand()?;
        Ok(&mut self.correction)
    }

    fn store_correction(&mut self) -> Answer {
        let done = accepted(self.correction()?.store());
        if done.is_ok() {
            self.store.mark(RecordName::Correction);
        }
        done
    }
}

fn answer<T>(found: Result<T, CorrectionFault>, response: impl FnOnce(T) -> Response) -> Answer {
    found.map(response).map_err(RequestError::Correction)
}

fn accepted(done: Result<(), CorrectionFault>) -> Answer {
    answer(done, |()| Response::Accepted)
}

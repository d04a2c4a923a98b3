//! Requests: what each is checked for, and what it starts.

use farnear_maths::clsf::Columns;
use farnear_protocol::message::{
    Alarm, Axis, CorrectionFault, EventKind, Failure, PositionState, RecordName, Request, RequestError,
    Response, Routine, SettingKey, Shot, ShotFault,
};
use farnear_protocol::{BoardMicros, Micros, Nanometres};

use crate::calibrate::Calibrating;
use crate::motion::axis::Stepper;
use crate::motion::home::Homing;
use crate::motion::positioning::Positioning;
use crate::motion::stage::limits;
use crate::program::{Run, SHOTS_MAX};
use crate::rig::{Reboot, Rig};
use crate::session::Incoming;
use crate::sky;
use crate::work::{AXES, Active, AxisWork, WholeWork};

/// What a request is answered.
type Answer = Result<Response, RequestError>;

impl Rig {
    pub(crate) fn carry_out(&mut self, incoming: &Incoming, now: BoardMicros) -> Answer {
        let id = incoming.id;
        match &incoming.request {
            Request::Hello => Ok(Response::Hello(self.hello())),
            Request::Status => Ok(Response::Status(self.status(now))),
            Request::ReadEvent { number } => self.read_event(*number),
            Request::Stop => Ok(self.stop()),
            Request::Halt => {
                self.alarm(Alarm::Halt, now);
                Ok(Response::Accepted)
            }
            Request::Reboot => {
                self.stop();
                self.reboot.get_or_insert(Reboot { request: id, asked: now, quiet_since: None });
                Ok(Response::Accepted)
            }
            Request::Home { axis, silence } => self.home(*axis, (id, *silence)),
            Request::Move { axis, target, silence } => self.go(*axis, *target, (id, *silence), now),
            Request::LoadShot { index, shot } => self.load_shot(*index, shot),
            Request::ArmProgram { shots } => self.arm_program(*shots),
            Request::RunProgram { silence } => self.run_program((id, *silence), now),
            Request::PauseProgram => self.pause_program(),
            Request::ResumeProgram => self.resume_program(now),
            Request::Calibrate { routine, silence } => self.calibrate(*routine, (id, *silence)),
            Request::ReadAlarm { number } => self.alarms.read(*number).map(Response::Alarm),
            Request::ClearAlarm { number } => self.clear_alarm(*number, now),
            Request::ReadSetting { key } => Ok(Response::Setting(self.values.setting(*key))),
            Request::WriteSetting { key, value } => self.write_setting(*key, *value),
            Request::ReadCounters => Ok(Response::Counters(self.counters())),
            Request::Sun(query) => Ok(Response::Sun(sky::answer(query))),
            request => {
                self.must_stand()?;
                self.correct(request).map_err(RequestError::Correction)
            }
        }
    }

    /// Requests about depth correction.
    fn correct(&mut self, request: &Request) -> Result<Response, CorrectionFault> {
        let correction = &mut self.correction;
        match request {
            Request::OpenCorrection(info) => correction.open(*info)?,
            Request::LoadCorrection => return correction.load().map(Response::Correction),
            Request::StoreCorrection => {
                correction.store()?;
                self.store.mark(RecordName::Correction);
            }
            Request::PutCoefficients { first, bits } => correction.put(*first, bits)?,
            Request::GetCoefficients { first, count } => {
                return correction.get(*first, *count).map(Response::Coefficients);
            }
            Request::FitSamples { row, first, step, truth, codes } => {
                let columns = Columns { first: *first, step: *step };
                correction.add_samples(*row, columns, codes, *truth)?;
            }
            Request::SolveFit => correction.solve()?,
            Request::PutRow { first, codes } => correction.put_row(*first, codes)?,
            Request::CorrectRow { row } => correction.correct_row(*row)?,
            Request::GetRow { first, count } => {
                return correction.get_row(*first, *count).map(Response::Row);
            }
            _ => {} // every other request is carried out above
        }
        Ok(Response::Accepted)
    }

    fn stop(&mut self) -> Response {
        self.stage.stop();
        self.camera.give_up();
        for axis in AXES {
            self.works.end(axis, Failure::Stopped);
        }
        self.works.end_whole(None, Failure::Stopped);
        Response::Accepted
    }

    fn home(&mut self, axis: Axis, (request, silence): (u32, Micros)) -> Answer {
        if axis == Axis::SensorFine {
            return Err(RequestError::CannotHome { axis });
        }
        self.may_move(silence)?;
        self.must_be_free(axis)?;
        self.must_not_come_close(axis, Nanometres(0))?;
        let work = AxisWork::Home(Homing::new());
        *self.works.on(axis) = Some(Active { request, silence, work });
        Ok(Response::Accepted)
    }

    fn go(
        &mut self,
        axis: Axis,
        target: Nanometres,
        (request, silence): (u32, Micros),
        now: BoardMicros,
    ) -> Answer {
        self.may_move(silence)?;
        self.must_be_inside(axis, target)?;
        self.must_be_homed(axis)?;
        self.must_be_free(axis)?;
        self.must_not_come_close(axis, self.lowest_to(axis, target))?;
        let settled = Positioning::plain(&self.settings, axis);
        let positioning = Positioning::start(&mut self.stage, &self.settings, (axis, target), settled, now);
        let work = AxisWork::Move { target, positioning };
        *self.works.on(axis) = Some(Active { request, silence, work });
        Ok(Response::Accepted)
    }

    fn load_shot(&mut self, index: u8, shot: &Shot) -> Answer {
        self.no_program_runs()?;
        self.must_be_inside(shot.axis, shot.target)?;
        self.shots
            .load(index, *shot, &self.settings)
            .map_err(|reason| RequestError::Shot { index, reason })?;
        self.store.mark(RecordName::Program);
        Ok(Response::Accepted)
    }

    fn arm_program(&mut self, count: u8) -> Answer {
        self.no_program_runs()?;
        self.check_program(count)?;
        self.shots.arm(count);
        Ok(Response::Accepted)
    }

    fn run_program(&mut self, (request, silence): (u32, Micros), now: BoardMicros) -> Answer {
        self.may_move(silence)?;
        self.all_must_be_free()?;
        let count = self.shots.armed();
        let Some(first) = self.shots.get(0).copied().filter(|_| count > 0) else {
            return Err(RequestError::Program { state: self.program_status().state });
        };
        self.check_program(count)?; // since it was armed axes may have lost their positions, or moved
        let run = Run::start(count, first, &mut self.stage, &self.settings, now);
        self.works.whole = Some(Active { request, silence, work: WholeWork::Program(run) });
        Ok(Response::Accepted)
    }

    /// Whether the first `count` shots can be run from here.
    fn check_program(&self, count: u8) -> Result<(), RequestError> {
        if count == 0 || usize::from(count) > SHOTS_MAX {
            return Err(RequestError::Shot { index: count, reason: ShotFault::Index });
        }
        let mut at = AXES.map(|axis| self.lowest(axis));
        for index in 0..count {
            let missing = RequestError::Shot { index, reason: ShotFault::Missing };
            let shot = self.shots.get(index).ok_or(missing)?;
            self.must_be_inside(shot.axis, shot.target)?; // the limits may have changed
            self.must_be_homed(shot.axis)?;
            let place = shot.axis as usize;
            let lowest = self.with_approach(shot.axis, shot.target).min(at[place]);
            let others = AXES.iter().zip(at).filter(|(axis, _)| **axis != shot.axis);
            let others: i64 = others.map(|(_, position)| i64::from(position.0)).sum();
            self.must_be_apart(others + i64::from(lowest.0))?;
            at[place] = shot.target;
        }
        Ok(())
    }

    fn pause_program(&mut self) -> Answer {
        match &mut self.works.whole {
            Some(Active { work: WholeWork::Program(run), .. }) => {
                run.pause();
                Ok(Response::Accepted)
            }
            _ => Err(RequestError::Program { state: self.program_status().state }),
        }
    }

    fn resume_program(&mut self, now: BoardMicros) -> Answer {
        match &mut self.works.whole {
            Some(Active { work: WholeWork::Program(run), .. }) if run.is_pausing() => {
                run.resume(&mut self.stage, &self.settings, now);
                Ok(Response::Accepted)
            }
            _ => Err(RequestError::Program { state: self.program_status().state }),
        }
    }

    fn calibrate(&mut self, routine: Routine, (request, silence): (u32, Micros)) -> Answer {
        let work = Calibrating::new(routine).ok_or(RequestError::NoSuchRoutine)?;
        self.may_move(silence)?;
        self.all_must_be_free()?;
        if let Some(axis) = work.stepper() {
            self.must_not_come_close(axis, Nanometres(0))?;
        }
        self.works.whole = Some(Active { request, silence, work: WholeWork::Calibration(work) });
        Ok(Response::Accepted)
    }

    fn clear_alarm(&mut self, number: u32, now: BoardMicros) -> Answer {
        let (stage, emergency_stop, supply_low) = (&self.stage, self.emergency_stop, self.supply_low);
        self.alarms.clear(number, |alarm| match alarm {
            Alarm::EmergencyStop => emergency_stop,
            Alarm::SupplyLow => supply_low,
            Alarm::DriverFault { axis } => stage.stepper(*axis).is_some_and(Stepper::driver_fault),
            _ => false,
        })?;
        self.store.mark(RecordName::Alarms);
        self.events.push(now, EventKind::AlarmCleared { number });
        Ok(Response::Accepted)
    }

    fn write_setting(&mut self, key: SettingKey, value: i32) -> Answer {
        self.must_stand()?;
        self.all_must_be_free()?;
        self.values.set(key, value).map_err(RequestError::SettingRange)?;
        self.apply_settings();
        Ok(Response::Setting(self.values.setting(key)))
    }

    /// Takes changed settings over, and has them kept.
    pub(crate) fn apply_settings(&mut self) {
        self.settings = self.parts.with(&self.values);
        self.stage.apply(&self.settings);
        self.camera.apply(self.settings.camera);
        self.shots.arm(0); // it was checked with other numbers
        self.store.mark(RecordName::Settings);
    }

    fn read_event(&self, number: u32) -> Answer {
        match self.events.get(number) {
            Some(event) => Ok(Response::Event(event.clone())),
            None => {
                Err(RequestError::EventGone { oldest: self.events.oldest(), next: self.events.next_number() })
            }
        }
    }

    /// Nothing forbids motion, and the host's deadline is sensible.
    fn may_move(&self, silence: Micros) -> Result<(), RequestError> {
        if let Some(record) = self.alarms.latched() {
            return Err(RequestError::Alarm { number: record.number, alarm: record.alarm });
        }
        let (min, max) = (self.settings.link.silence_min, self.settings.link.silence_max);
        if (min..=max).contains(&silence) { Ok(()) } else { Err(RequestError::Silence { min, max }) }
    }

    fn must_be_free(&self, axis: Axis) -> Result<(), RequestError> {
        let reboot = self.reboot.map(|reboot| reboot.request);
        match self.works.request_on(axis).or(reboot) {
            Some(request) => Err(RequestError::Busy { request }),
            None => Ok(()),
        }
    }

    fn all_must_be_free(&self) -> Result<(), RequestError> {
        AXES.into_iter().try_for_each(|axis| self.must_be_free(axis))
    }

    /// Nothing moves: what takes longer than a tick harms nobody.
    fn must_stand(&self) -> Result<(), RequestError> {
        match self.works.any() {
            Some(request) => Err(RequestError::Busy { request }),
            None => Ok(()),
        }
    }

    fn no_program_runs(&self) -> Result<(), RequestError> {
        match &self.works.whole {
            Some(Active { request, .. }) => Err(RequestError::Busy { request: *request }),
            None => Ok(()),
        }
    }

    fn must_be_homed(&self, axis: Axis) -> Result<(), RequestError> {
        match self.stage.state(axis) {
            PositionState::Homed => Ok(()),
            state => Err(RequestError::NotHomed { axis, state }),
        }
    }

    fn must_be_inside(&self, axis: Axis, asked: Nanometres) -> Result<(), RequestError> {
        let (min, max) = limits(&self.settings, axis);
        if (min..=max).contains(&asked) {
            Ok(())
        } else {
            Err(RequestError::OutOfRange { axis, asked, min, max })
        }
    }

    /// The lowest that an axis comes on the way it is on.
    fn lowest(&self, axis: Axis) -> Nanometres {
        self.stage.stepper(axis).map_or_else(|| self.stage.fine.lowest(), Stepper::lowest)
    }

    /// The lowest that an axis comes on its way to a target.
    fn lowest_to(&self, axis: Axis, target: Nanometres) -> Nanometres {
        self.with_approach(axis, target).min(self.stage.measured(axis))
    }

    /// The lowest that an axis comes where it comes to a target from below.
    fn with_approach(&self, axis: Axis, target: Nanometres) -> Nanometres {
        let approach = self.stage.stepper(axis).map_or(0, |stepper| stepper.approach().0);
        Nanometres(target.0.saturating_sub(approach))
    }

    /// With an axis at its lowest, and the others on their ways, sensor and lens stay apart. To move apart is always
    /// allowed.
    fn must_not_come_close(&self, axis: Axis, lowest: Nanometres) -> Result<(), RequestError> {
        let others = AXES.into_iter().filter(|other| *other != axis);
        let others: i64 = others.map(|other| i64::from(self.lowest(other).0)).sum();
        let homed = self.stage.state(axis) == PositionState::Homed;
        if homed && lowest >= self.stage.measured(axis) {
            return Ok(());
        }
        self.must_be_apart(others + i64::from(lowest.0))
    }

    /// The sum of the positions leaves the smallest distance.
    fn must_be_apart(&self, positions: i64) -> Result<(), RequestError> {
        let min = self.settings.distance_min;
        let distance = i64::from(self.settings.datum.0) + positions;
        if distance >= i64::from(min.0) {
            return Ok(());
        }
        let distance = distance.clamp(i64::from(i32::MIN), i64::from(i32::MAX)) as i32;
        Err(RequestError::TooClose { distance: Nanometres(distance), min })
    }
}

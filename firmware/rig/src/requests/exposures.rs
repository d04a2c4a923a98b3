use farnear_protocol::message::{
    Axis, LightLevels, RecordName, RequestError, Response, Shot, ShotFault, ShotLight,
};
use farnear_protocol::{BoardMicros, Micros};

use super::Answer;
use crate::light;
use crate::program::{Run, SHOTS_MAX, pace::Pace};
use crate::rig::Rig;
use crate::work::{Active, WholeWork};

impl Rig {
    pub(super) fn load_shot(&mut self, index: u8, shot: &Shot) -> Answer {
        self.no_program_runs()?;
        self.must_be_inside(shot.axis, shot.target)?;
        self.shots
            .load(index, *shot, &self.settings)
            .map_err(|reason| RequestError::Shot { index, reason })?;
        self.store.mark(RecordName::Program);
        Ok(Response::Accepted)
    }

    pub(super) fn set_lights(
        &mut self,
        levels: LightLevels,
        (time, silence): (Micros, Micros),
        now: BoardMicros,
    ) -> Answer {
        if levels.is_on() {
            self.may_move(silence)?; // no alarm, and a silence within its limits
        }
        self.lights.set(levels, (time, silence), now).map_err(|reason| RequestError::Light { reason })?;
        Ok(Response::Accepted)
    }

    pub(super) fn set_shot_light(&mut self, index: u8, light: Option<ShotLight>) -> Answer {
        self.no_program_runs()?;
        let missing = RequestError::Shot { index, reason: ShotFault::Missing };
        let shot = self.shots.get(index).ok_or(missing)?;
        if let Some(light) = &light {
            light::check(light, shot).map_err(|reason| RequestError::Light { reason })?;
        }
        self.shots.set_light(index, light);
        Ok(Response::Accepted)
    }

    pub(super) fn arm_program(&mut self, count: u8) -> Answer {
        self.no_program_runs()?;
        self.check_program(count, 1)?;
        self.shots.arm(count);
        Ok(Response::Accepted)
    }

    pub(super) fn run_program(&mut self, request: (u32, Micros), now: BoardMicros) -> Answer {
        self.run(None, request, now)
    }

    pub(super) fn run_continuously(
        &mut self,
        period: Micros,
        exposures: u32,
        request: (u32, Micros),
        now: BoardMicros,
    ) -> Answer {
        let shots = (0..self.shots.armed()).filter_map(|index| self.shots.get(index));
        let min = shots.map(|shot| self.camera.period(shot.exposure)).max().unwrap_or_default();
        if period.0 > 0 && period < min {
            return Err(RequestError::Period { min });
        }
        self.run(Some(Pace::new(period, exposures)), request, now)
    }

    /// Endless with a pace.
    fn run(&mut self, pace: Option<Pace>, (request, silence): (u32, Micros), now: BoardMicros) -> Answer {
        self.may_move(silence)?;
        self.all_must_be_free()?;
        let count = self.shots.armed();
        let Some(first) = self.shots.get(0).copied().filter(|_| count > 0) else {
            return Err(RequestError::Program { state: self.program_status().state });
        };
        // Axes may have moved since arming. The second round starts where the first ends.
        self.check_program(count, if pace.is_some() { 2 } else { 1 })?;
        let first = (first, self.shots.light(0));
        let run = Run::start((count, first), pace, &mut self.stage, &self.settings, now);
        self.works.whole = Some(Active { request, silence, work: WholeWork::Program(run) });
        Ok(Response::Accepted)
    }

    pub(super) fn check_program(&self, count: u8, rounds: u8) -> Result<(), RequestError> {
        if count == 0 || usize::from(count) > SHOTS_MAX {
            return Err(RequestError::Shot { index: count, reason: ShotFault::Index });
        }
        let mut at = Axis::ALL.map(|axis| self.lowest(axis));
        for index in (0..rounds).flat_map(|_| 0..count) {
            let missing = RequestError::Shot { index, reason: ShotFault::Missing };
            let shot = self.shots.get(index).ok_or(missing)?;
            self.must_be_inside(shot.axis, shot.target)?; // the limits may have changed
            self.must_be_homed(shot.axis)?;
            let place = shot.axis as usize;
            at[place] = self.with_approach(shot.axis, shot.target).min(at[place]);
            self.must_be_apart(|axis| at[axis as usize])?;
            at[place] = shot.target;
        }
        Ok(())
    }

    pub(super) fn pause_program(&mut self) -> Answer {
        match &mut self.works.whole {
            Some(Active { work: WholeWork::Program(run), .. }) => {
                run.pause();
                Ok(Response::Accepted)
            }
            _ => Err(RequestError::Program { state: self.program_status().state }),
        }
    }

    pub(super) fn resume_program(&mut self, now: BoardMicros) -> Answer {
        match &mut self.works.whole {
            Some(Active { work: WholeWork::Program(run), .. }) if run.is_pausing() => {
                run.resume(&mut self.stage, &self.settings, now);
                Ok(Response::Accepted)
            }
            _ => Err(RequestError::Program { state: self.program_status().state }),
        }
    }
}

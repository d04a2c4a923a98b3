//! Requests that move an axis, or have the board move it.

use farnear_protocol::message::{Axis, RequestError, Response, Routine};
use farnear_protocol::{BoardMicros, Micros, Nanometres};

use super::Answer;
use crate::calibrate::Calibrating;
use crate::motion::home::Homing;
use crate::motion::positioning::Positioning;
use crate::rig::Rig;
use crate::work::{Active, AxisWork, WholeWork};

impl Rig {
    pub(super) fn home(&mut self, axis: Axis, (request, silence): (u32, Micros)) -> Answer {
        if axis == Axis::SensorFine {
            return Err(RequestError::CannotHome { axis });
        }
        self.may_move(silence)?;
        self.must_be_free(axis)?;
        if axis == Axis::SensorCoarse {
            self.must_be_free(Axis::SensorFine)?; // it moves the switch's tab
        }
        self.must_not_come_close(axis, self.lowest_of_homing(axis))?;
        let work = AxisWork::Home(Homing::new());
        *self.works.on(axis) = Some(Active { request, silence, work });
        Ok(Response::Accepted)
    }

    pub(super) fn go(
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
        if axis == Axis::SensorFine && self.works.homes(Axis::SensorCoarse) {
            self.must_be_free(Axis::SensorCoarse)?;
        }
        self.must_not_come_close(axis, self.lowest_to(axis, target))?;
        let settle = self.settings.settle(axis);
        let positioning = Positioning::start(&mut self.stage, &self.settings, (axis, target), settle, now);
        let work = AxisWork::Move { target, positioning };
        *self.works.on(axis) = Some(Active { request, silence, work });
        Ok(Response::Accepted)
    }

    pub(super) fn calibrate(&mut self, routine: Routine, (request, silence): (u32, Micros)) -> Answer {
        let work = Calibrating::new(routine).ok_or(RequestError::NoSuchRoutine)?;
        self.may_move(silence)?;
        work.places().iter().try_for_each(|place| self.must_be_inside(Axis::SensorFine, *place))?;
        self.all_must_be_free()?;
        self.routine_must_not_come_close(work.axes())?;
        self.works.whole = Some(Active { request, silence, work: WholeWork::Calibration(work) });
        Ok(Response::Accepted)
    }
}

//! A leg: travel that a switch may end. Homing and calibrations consist of legs.

use farnear_protocol::Nanometres;

use crate::motion::axis::{Purpose, Stepper};
use crate::motion::steps;
use crate::motion::switch::Place;

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Until {
    Arrival,
    /// The home switch closes (`true`) or opens.
    Home(bool),
    /// The far switch closes (`true`) or opens.
    Far(bool),
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct Leg {
    until: Until,
    edge: Option<Place>,
}

impl Leg {
    pub(crate) const REST: Self = Self { until: Until::Arrival, edge: None };

    /// Starts a travel of `way_nm` (positive = away from the home switch) at a speed.
    pub(crate) fn start(
        axis: &mut Stepper,
        (way_nm, speed): (i32, u32),
        purpose: Purpose,
        until: Until,
    ) -> Self {
        let target = axis.position().wrapping_add(steps::to_steps(Nanometres(way_nm)));
        axis.go_steps(target, speed, purpose);
        Self { until, edge: None }
    }

    /// Continues while the axis has no fault; brakes at the switch's edge. `true` once at rest.
    pub(crate) fn is_over(&mut self, axis: &mut Stepper) -> bool {
        let met = match self.until {
            Until::Arrival => false,
            Until::Home(closed) => axis.home_closed() == closed,
            Until::Far(closed) => axis.far_closed() == closed,
        };
        if met && self.edge.is_none() {
            self.edge = Some(axis.changed(matches!(self.until, Until::Far(_))));
            axis.stop();
        }
        axis.is_still()
    }

    pub(crate) const fn edge(&self) -> Option<Place> {
        self.edge
    }
}

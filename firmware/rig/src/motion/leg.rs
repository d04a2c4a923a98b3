//! A leg: a way on a stepper axis that a switch may end early. Homing and the calibrations are made of legs.

use farnear_protocol::Nanometres;

use crate::motion::axis::{Purpose, Stepper};
use crate::motion::steps;
use crate::motion::switch::Place;

/// What ends a leg before its way is over.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Until {
    Arrival,
    /// The home switch closes (`true`) or opens.
    Home(bool),
    /// The far switch closes (`true`) or opens.
    Far(bool),
}

/// A leg under way.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct Leg {
    until: Until,
    edge: Option<Place>,
}

impl Leg {
    /// No way: over as soon as the axis stands, whoever moves it.
    pub(crate) const REST: Self = Self { until: Until::Arrival, edge: None };

    /// Sets off from where the axis stands, over `way_nm` (positive = away from the home switch) at a speed.
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

    /// Goes on while the axis has no fault: brakes where the switch did what was waited for. `true` once the axis stands.
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

    /// Where the switch did it; `None` where the whole way was gone without.
    pub(crate) const fn edge(&self) -> Option<Place> {
        self.edge
    }
}

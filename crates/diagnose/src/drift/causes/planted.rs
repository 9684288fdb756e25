//! A detected drift added to the model, so that the next fit is linearised about it and no longer about an unchanged machine.

use crate::drift::causes::cause::{Cause, FOULING_FLOW_SHARE};
use crate::drift::causes::time_history::Course;
use mapper_observe::channels::DRIVERS;
use mapper_observe::perturbation::Perturbation;
use mapper_physics::machine::params::{BoundaryConditions, Params};

/// A cause with its time history, and its rate or step.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Planted {
    pub cause: Cause,
    pub course: Course,
    pub size: f64,
}

impl Planted {
    /// Whether the model includes it: the drift of an output sensor is already linear.
    pub fn is_in_model(&self) -> bool {
        self.machine_changes() || self.input_drifts()
    }

    /// Whether the machine changes over time.
    pub fn machine_changes(&self) -> bool {
        matches!(self.cause, Cause::Fouling | Cause::BearingFriction)
    }

    /// Whether a model input was misread.
    pub fn input_drifts(&self) -> bool {
        self.cause.channels().iter().any(|channel| DRIVERS.contains(channel))
    }

    /// The mean machine over a part of the campaign, campaign time, s.
    pub fn drift_machine(&self, params: &mut Params, from_s: f64, to_s: f64) {
        let now = self.size * self.course.mean(from_s, to_s);
        match self.cause {
            Cause::Fouling => {
                Perturbation::Efficiency.turn(params, now);
                Perturbation::Flow.turn(params, FOULING_FLOW_SHARE * now);
            }
            Cause::BearingFriction => Perturbation::Friction.turn(params, now),
            Cause::Sensors(_) => {}
        }
    }

    /// Subtracts the drift of a sensor from the input that it measures.
    pub fn undrift(&self, boundary: &mut BoundaryConditions, t_s: f64) {
        for channel in self.cause.channels().iter().filter(|channel| DRIVERS.contains(channel)) {
            Perturbation::Input(*channel).shift(boundary, -self.size * self.course.at(t_s));
        }
    }
}

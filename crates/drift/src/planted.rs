//! A drift that was found, put into the model, so that the next fit is linear around it and no longer around a machine
//! that never changed.

use crate::cause::{Cause, FOULING_FLOW_SHARE};
use crate::time_history::Course;
use mapper_observe::channels::DRIVERS;
use mapper_observe::perturbation::Perturbation;
use mapper_physics::params::{BoundaryConditions, Params};

/// A cause with its course, and its rate or step.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Planted {
    pub cause: Cause,
    pub course: Course,
    pub size: f64,
}

impl Planted {
    /// Whether the model has it at all: what the sensor of an output adds is linear as it is.
    pub fn is_in_model(&self) -> bool {
        self.machine_changes() || self.input_drifts()
    }

    /// Whether the machine is another one from moment to moment.
    pub fn machine_changes(&self) -> bool {
        matches!(self.cause, Cause::Fouling | Cause::BearingFriction)
    }

    /// Whether something that drives the model was read wrong.
    pub fn input_drifts(&self) -> bool {
        self.cause.channels().iter().any(|channel| DRIVERS.contains(channel))
    }

    /// The machine as it is on average over a part of the campaign, time of the campaign, s.
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

    /// Takes the drift of a sensor off the input that was read with it.
    pub fn undrift(&self, boundary: &mut BoundaryConditions, t_s: f64) {
        for channel in self.cause.channels().iter().filter(|channel| DRIVERS.contains(channel)) {
            Perturbation::Input(*channel).shift(boundary, -self.size * self.course.at(t_s));
        }
    }
}

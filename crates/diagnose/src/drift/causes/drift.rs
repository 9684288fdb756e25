//! A drift: its cause with a time history and a size, and its effect on machine and inputs.

use crate::drift::causes::cause::{Cause, FOULING_FLOW_SHARE};
use mapper_inference::time_history::TimeHistory;
use mapper_observe::channels::INPUT_CHANNELS;
use mapper_observe::perturbation::Perturbation;
use mapper_physics::machine::params::{BoundaryConditions, Params};

/// A cause with its time history and size.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Drift {
    pub cause: Cause,
    pub history: TimeHistory,
    /// Rate per hour, or step; in the unit of the cause.
    pub size: f64,
}

impl Drift {
    /// Size at a campaign time, s; in the unit of the cause.
    pub fn at(&self, t_s: f64) -> f64 {
        self.size * self.history.at(t_s)
    }

    /// Whether a model run depends on it. The drift of an output sensor is linear in the readings, so no run is needed.
    pub fn acts_on_model(&self) -> bool {
        self.acts_on_machine() || self.acts_on_inputs()
    }

    /// Whether the machine changes over time.
    pub fn acts_on_machine(&self) -> bool {
        matches!(self.cause, Cause::Fouling | Cause::BearingFriction)
    }

    /// Whether the sensor of a model input drifts.
    pub fn acts_on_inputs(&self) -> bool {
        self.cause.channels().iter().any(|channel| INPUT_CHANNELS.contains(channel))
    }

    /// Applies its mean between two campaign times, s, to the machine.
    pub fn apply_to(&self, params: &mut Params, from_s: f64, to_s: f64) {
        let mean = self.size * self.history.mean(from_s, to_s);
        match self.cause {
            Cause::Fouling => {
                Perturbation::Efficiency.adjust_machine(params, mean);
                Perturbation::Flow.adjust_machine(params, FOULING_FLOW_SHARE * mean);
            }
            Cause::BearingFriction => Perturbation::Friction.adjust_machine(params, mean),
            Cause::Sensors(_) => {}
        }
    }

    /// Subtracts the drift of a sensor from the input that it measures.
    pub fn subtract_from(&self, boundary: &mut BoundaryConditions, t_s: f64) {
        for channel in self.cause.channels().iter().filter(|channel| INPUT_CHANNELS.contains(channel)) {
            Perturbation::Input(*channel).adjust_boundary(boundary, -self.at(t_s));
        }
    }
}

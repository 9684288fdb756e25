//! What a fit has found, put into the model, so that the next fit is linear around it and no longer around the nominal
//! machine.

use crate::blocks::CampaignStep;
use crate::knob::Knob;
use crate::{Cause, Course};
use mapper_core::Channel;
use mapper_physics::params::{BoundaryConditions, Params};

/// Over which steps a knob is turned.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Over {
    Campaign,
    Run(usize),
    Condition(usize),
}

impl Over {
    pub fn holds(self, step: &CampaignStep) -> bool {
        match self {
            Over::Campaign => true,
            Over::Run(run) => step.run == run,
            Over::Condition(condition) => step.condition == condition,
        }
    }
}

/// Knobs that are turned, and a drift.
#[derive(Debug, Clone, Default)]
pub(crate) struct Planted {
    pub turns: Vec<(Knob, Over, f64)>,
    /// Cause, course, and rate or step.
    pub drift: Option<(Cause, Course, f64)>,
}

impl Planted {
    /// By how much a knob is turned there; 0 where it is not.
    pub fn by(&self, knob: Knob, over: Over) -> f64 {
        self.turns.iter().find(|turn| (turn.0, turn.1) == (knob, over)).map_or(0.0, |turn| turn.2)
    }

    /// Turns that hold within a step.
    pub fn at(&self, step: &CampaignStep) -> impl Iterator<Item = (Knob, f64)> {
        self.turns.iter().filter(|turn| turn.1.holds(step)).map(|turn| (turn.0, turn.2))
    }

    /// Whether the machine is another one from moment to moment.
    pub fn machine_changes(&self) -> bool {
        matches!(self.drift, Some((Cause::Fouling | Cause::BearingFriction, ..)))
    }

    /// The machine's own drift, in the middle of a stretch of the campaign.
    pub fn drift_machine(&self, params: &mut Params, from_s: f64, to_s: f64) {
        let Some((cause, course, size)) = self.drift else { return };
        let now = size * course.mean(from_s, to_s);
        match cause {
            Cause::Fouling => {
                Knob::Efficiency.turn(params, now);
                Knob::Flow.turn(params, crate::cause::FOULING_FLOW_SHARE * now);
            }
            Cause::BearingFriction => Knob::Friction.turn(params, now),
            Cause::Sensor(_) => {}
        }
    }

    /// Takes the drift of a sensor off an input that was read with it.
    pub fn undrift(&self, boundary: &mut BoundaryConditions, t_s: f64) {
        if let Some((Cause::Sensor(channel), course, size)) = self.drift {
            Knob::Input(channel).shift(boundary, -size * course.at(t_s));
        }
    }

    /// Whether an input drifts.
    pub fn drifting_input(&self) -> Option<Channel> {
        match self.drift {
            Some((Cause::Sensor(channel), ..)) if crate::knob::INPUTS.contains(&channel) => Some(channel),
            _ => None,
        }
    }
}

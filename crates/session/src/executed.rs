//! The plan as it was run, where what was measured had a say in it.

use crate::resume::AGAIN_FROM;
use mapper_core::{Plan, PlanStep, StepMarker};
use mapper_runner::{ObserverError, RunObserver};

/// The steps that were made.
#[derive(Debug, Default)]
pub(crate) struct StepsMade {
    /// Steps that other parts of the run have made, and how much later than they this one's stand, s.
    before: Vec<StepMarker>,
    later_s: f64,
    markers: Vec<StepMarker>,
}

impl RunObserver for StepsMade {
    fn on_step_end(&mut self, marker: &StepMarker) -> Result<(), ObserverError> {
        self.markers.push(*marker);
        Ok(())
    }
}

impl StepsMade {
    /// What other parts of the run have made, in one time; this one's stands so much later, s.
    pub(crate) fn go_on(&mut self, before: Vec<StepMarker>, later_s: f64) {
        (self.before, self.later_s) = (before, later_s);
    }

    /// All in order, without those that were made once more to go on.
    fn all(&self) -> impl Iterator<Item = StepMarker> + '_ {
        let later = |marker: &StepMarker| StepMarker {
            start_s: marker.start_s + self.later_s,
            end_s: marker.end_s + self.later_s,
            ..*marker
        };
        self.before.iter().copied().chain(self.markers.iter().map(later)).filter(|m| m.index < AGAIN_FROM)
    }

    /// The steps of `plan` that were made, in the order and with the times in which they were; what was put in between them by
    /// others is left out.
    pub(crate) fn plan(&self, plan: &Plan) -> Plan {
        let mut open: Vec<&PlanStep> = plan.steps.iter().collect();
        // A soak is not in a plan's times.
        let soak_s = self.all().next().map_or(0.0, |first| first.start_s - plan.warm_up_s);
        let mut steps: Vec<PlanStep> = Vec::new();
        for marker in self.all() {
            let same = |step: &&PlanStep| marker.to == Some(step.to) && marker.kind == step.kind;
            let Some(place) = open.iter().position(same) else { continue };
            let step = open.remove(place);
            let dwell_s = marker.end_s - marker.start_s;
            let mut made = PlanStep {
                index: steps.len(),
                from: marker.from,
                start_s: marker.start_s - soak_s,
                dwell_s,
                ..step.clone()
            };
            made.predicted.minutes = dwell_s / 60.0;
            steps.push(made);
        }
        let mut executed = Plan { steps, ..plan.clone() };
        executed.figures.minutes = executed.duration_s() / 60.0;
        executed
    }
}

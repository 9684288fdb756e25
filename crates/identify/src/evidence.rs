//! What each step of a recording shows on its own: its end state, its dynamic fit, and the checks that its readings fail.

use crate::reading_checks::ends::{Ends, FailedCheck};
use crate::reading_checks::failed_checks;
use crate::single_step::dynamic::{self, Estimate};
use crate::step_data::end_state::{EndState, end_state};
use crate::step_outcome::findings::Findings;
use crate::{IdentifyConfig, StepError};
use mapper_core::{Channel, Event, EventKind, Recording, StepMarker, Warning};

pub(crate) struct Evidence {
    pub(crate) states: Vec<Result<EndState, StepError>>,
    pub(crate) findings: Vec<Findings>,
    /// Fit of each step alone, with its findings; empty without housing temperature.
    pub(crate) alone: (Vec<Estimate>, Vec<Findings>),
    pub(crate) failed_checks: Vec<FailedCheck>,
    /// Ends of the steps that no check refused.
    pub(crate) ends: Vec<Option<Ends>>,
}

impl Evidence {
    pub(crate) fn of(recording: &Recording, config: &IdentifyConfig) -> Self {
        let mut findings = vec![Findings::new(); recording.steps.len()];
        let states: Vec<Result<EndState, StepError>> = recording
            .steps
            .iter()
            .zip(&mut findings)
            .map(|(step, findings)| {
                let (start_s, end_s) = (step.start_s, step.end_s);
                if !(start_s.is_finite() && end_s.is_finite() && start_s < end_s) {
                    return Err(StepError::NoDuration { step: step.index, start_s, end_s });
                }
                let state = end_state(recording, step, config, findings)?;
                speed_not_reached(recording, step, &state, findings);
                Ok(state)
            })
            .collect();
        let alone = if recording.require(Channel::Tc).is_ok() {
            dynamic::alone(recording, &states, config)
        } else {
            Default::default()
        };
        let (failed_checks, ends) = failed_checks(recording, config);
        Evidence { states, findings, alone, failed_checks, ends }
    }

    /// Whether the recording contradicts itself beyond its failed checks: if half of it is already refused, the remainder does for that reason.
    pub(crate) fn is_whole(&self) -> bool {
        self.failed_checks.iter().all(|failed_check| 2 * failed_check.steps.len() <= self.ends.len())
    }

    /// Whether every step failed a check.
    pub(crate) fn is_refused(&self) -> bool {
        (0..self.states.len())
            .all(|step| self.failed_checks.iter().any(|failed_check| failed_check.steps.contains(&step)))
    }

    pub(crate) fn known(&self) -> Vec<Option<EndState>> {
        self.states.iter().map(|state| state.as_ref().ok().copied()).collect()
    }
}

/// Adds the run's remarks that a step's speed was not reached: the point is valid, but elsewhere on the map.
fn speed_not_reached(recording: &Recording, step: &StepMarker, state: &EndState, findings: &mut Findings) {
    let reported = |event: &Event| {
        event.kind == EventKind::SpeedNotReached && event.t_s > step.start_s && event.t_s <= step.end_s
    };
    if let (Some(asked), true) = (step.to, recording.events.iter().any(reported)) {
        findings.remark(Warning::SpeedNotReached {
            requested_rpm: asked.speed_rpm,
            reached_rpm: state.speed_rpm,
        });
    }
}

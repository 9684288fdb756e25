//! The steps of every case: the campaign's points in their own order.

use crate::blind::error::BlindError;
use mapper_campaign::Campaign;
use mapper_core::{OperatingPoint, PlanStep, Predicted, StepKind};
use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::simulation::model::Model;
use mapper_physics::simulation::steady;
use mapper_runner::{StepSource, StepSourceError};

/// One step for each point with the P3 that the nominal model needs. Only the steady state is predicted.
pub(crate) fn steps_of_case(campaign: &Campaign, nominal: &Model) -> Result<Vec<PlanStep>, BlindError> {
    let (timing, dwell_s) = (&campaign.timing, campaign.timing.dwell.fixed_or_usual_s());
    let mut from: Option<OperatingPoint> = None;
    let points = campaign.points.iter().enumerate();
    points
        .map(|(index, point)| {
            let boundary =
                BoundaryConditions { valve_opening_ratio: point.valve_opening_ratio, ..campaign.boundary };
            let steady_state = steady::hold_speed(nominal, point.speed_rpm, &boundary)?;
            let outputs = &steady_state.outputs;
            Ok(PlanStep {
                index,
                kind: StepKind::Point,
                from: from.replace(*point),
                to: *point,
                p3_pa: steady_state.boundary.p3_pa,
                t3_k: boundary.t3_k,
                oil_temperature_k: boundary.oil_temperature_k,
                dwell_s,
                start_s: timing.warm_up_s + index as f64 * dwell_s,
                predicted: Predicted::settled(
                    outputs.flow_kg_s,
                    outputs.pressure_ratio,
                    outputs.t2_k,
                    dwell_s,
                ),
            })
        })
        .collect()
}

/// Yields these steps.
pub(crate) struct StepsOfCase<'a> {
    left: std::slice::Iter<'a, PlanStep>,
    warm_up_s: f64,
}

impl<'a> StepsOfCase<'a> {
    pub(crate) fn new(steps: &'a [PlanStep], warm_up_s: f64) -> Self {
        StepsOfCase { left: steps.iter(), warm_up_s }
    }
}

impl StepSource for StepsOfCase<'_> {
    fn warm_up_s(&self) -> f64 {
        self.warm_up_s
    }

    fn cool_down_s(&self) -> f64 {
        0.0
    }

    fn next_step(&mut self) -> Result<Option<PlanStep>, StepSourceError> {
        Ok(self.left.next().cloned())
    }
}

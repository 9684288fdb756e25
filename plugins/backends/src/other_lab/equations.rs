//! Connects the equations of this lab with the rig of the virtual lab.

use super::motion::Motion;
use super::structure::{NAME, OtherStructure};
use crate::virtual_lab::{LabSettings, RunningMachine, SecondOrder, Structure, StructureError};
use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::simulation::model::{Model, State};
use mapper_physics::simulation::simulate::Watch;
use mapper_physics::simulation::steady;
use std::sync::Arc;

/// Replaces the equations and sensors of a virtual lab by those of this lab.
pub fn apply_structure(lab: &mut LabSettings, structure: OtherStructure) {
    let sensors = structure.sensors();
    lab.second_order = sensors
        .into_iter()
        .map(|(channel, frequency_hz, damping_ratio)| (channel, SecondOrder { frequency_hz, damping_ratio }))
        .collect();
    lab.structure = Arc::new(structure);
}

impl Structure for OtherStructure {
    fn name(&self) -> &'static str {
        NAME
    }

    fn start(&self, model: &Model, t_s: f64, state: State, watch: Watch) -> Box<dyn RunningMachine> {
        Box::new(Motion::new(model, self.clone(), t_s, state, watch))
    }

    fn settled(
        &self,
        model: &Model,
        t_s: f64,
        boundary: &BoundaryConditions,
        watch: Watch,
    ) -> Result<Box<dyn RunningMachine>, StructureError> {
        // Start from the steady state of the lumped model, and settle to that of these equations.
        let lumped = steady::settle_under(model, boundary)?;
        let mut motion = Motion::new(model, self.clone(), t_s, lumped.state, watch);
        motion.settle(boundary)?;
        Ok(Box::new(motion))
    }
}

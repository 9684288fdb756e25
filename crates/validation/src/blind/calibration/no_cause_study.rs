//! Measures signatures with the diagnosis itself, on a recording without causes.

use crate::blind::cases::{Case, CaseKind, Cause, SignatureMeter};
use crate::blind::error::BlindError;
use crate::blind::virtual_runs::Schedule;
use mapper_campaign::{Campaign, nominal_model};
use mapper_core::NoiseColour;
use mapper_diagnose::gap::{EffectVisibility, RigRecording};
use mapper_observe::Declared;
use mapper_physics::rig::effect::Effect;
use mapper_physics::simulation::model::Model;
use mapper_recording::ChannelMap;
use std::sync::Arc;

/// The visibility of `effects` on a recording of the campaign with noise, offsets, tolerances and weather but without a cause. Equal seeds give
/// equal recordings.
///
/// # Errors
/// [`BlindError`] if the campaign has no nominal model or cannot be run.
pub fn visibility(
    campaign: &Campaign,
    effects: Vec<Arc<dyn Effect>>,
    seed: u64,
) -> Result<EffectVisibility, BlindError> {
    let nominal = nominal_model(campaign)?;
    let schedule = Schedule::new(campaign, &nominal)?;
    visibility_on(campaign, &schedule, &nominal, effects, seed)
}

/// The uncertainties and tolerances that the campaign declares: those from which the lab of a case draws.
pub(crate) fn declared(campaign: &Campaign) -> Declared {
    Declared {
        sensors: mapper_session::declared(campaign, &ChannelMap::native()),
        noise_colour: NoiseColour::default(),
        tolerances: campaign.tolerances,
        nominal: campaign.boundary,
        common_offsets: Vec::new(),
    }
}

/// [`visibility`] on a schedule of the campaign. Other weather changes the signatures by a few per cent.
pub(crate) fn visibility_on(
    campaign: &Campaign,
    schedule: &Schedule<'_>,
    nominal: &Model,
    effects: Vec<Arc<dyn Effect>>,
    seed: u64,
) -> Result<EffectVisibility, BlindError> {
    let case = Case {
        name: "without_causes".to_owned(),
        kind: CaseKind::None,
        causes: Vec::new(),
        sigmas: Vec::new(),
        seed,
    };
    let recorded = RigRecording::simulated(schedule.record(&case)?, declared(campaign), nominal.clone());
    EffectVisibility::new(recorded, effects).map_err(BlindError::signatures)
}

impl SignatureMeter for EffectVisibility {
    fn lengths(&self, causes: &[Cause]) -> Vec<f64> {
        let values: Vec<(String, Vec<f64>)> = causes.iter().map(Cause::id_and_values).collect();
        EffectVisibility::lengths(self, &values).unwrap_or_else(|| vec![0.0; causes.len()])
    }
}

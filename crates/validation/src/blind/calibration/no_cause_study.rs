//! Measures signatures with the diagnosis itself, on a recording without causes.

use crate::blind::cases::case::Case;
use crate::blind::cases::cause::Cause;
use crate::blind::cases::kind::CaseKind;
use crate::blind::cases::strength::SignatureMeter;
use crate::blind::error::BlindError;
use crate::blind::virtual_runs::case_run::Schedule;
use mapper_campaign::{Campaign, nominal_model};
use mapper_core::NoiseColour;
use mapper_diagnose::gap::best_fit::signature::lengths;
use mapper_diagnose::gap::residuals::study::{EffectValues, Study};
use mapper_diagnose::gap::residuals::whiten::Linearised;
use mapper_observe::Declared;
use mapper_observe::averages::time_table::Table;
use mapper_physics::rig::effect::Effect;
use mapper_physics::simulation::model::Model;
use mapper_recording::ChannelMap;
use std::sync::Arc;

/// Records the campaign with noise, offsets, tolerances and weather but without a cause, and linearises the study for `effects`. Equal
/// seeds give equal recordings.
///
/// # Errors
/// [`BlindError`] if the campaign has no nominal model or cannot be run.
pub fn study_without_causes(
    campaign: &Campaign,
    effects: Vec<Arc<dyn Effect>>,
    seed: u64,
) -> Result<(Study, Linearised), BlindError> {
    let nominal = nominal_model(campaign)?;
    let StudySignatureMeter { study, linearised } =
        StudySignatureMeter::new(campaign, &Schedule::new(campaign, &nominal)?, &nominal, effects, seed)?;
    Ok((study, linearised))
}

/// Measures signatures on one recording of the campaign with noise, offsets, tolerances and weather but
/// without a cause. Other weather changes the signatures by a few per cent.
pub(crate) struct StudySignatureMeter {
    study: Study,
    linearised: Linearised,
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

impl StudySignatureMeter {
    /// Records a case without causes and linearises its study.
    pub(crate) fn new(
        campaign: &Campaign,
        schedule: &Schedule<'_>,
        nominal: &Model,
        effects: Vec<Arc<dyn Effect>>,
        seed: u64,
    ) -> Result<StudySignatureMeter, BlindError> {
        let case = Case {
            name: "without_causes".to_owned(),
            kind: CaseKind::None,
            causes: Vec::new(),
            sigmas: Vec::new(),
            seed,
        };
        let recording = schedule.record(&case)?;
        let table = Table::new(&recording).ok_or(BlindError::NothingRecorded)?;
        let study = Study::new(&recording, table, declared(campaign), nominal.clone(), effects);
        let linearised = Linearised::new(&study).map_err(BlindError::signatures)?;
        Ok(StudySignatureMeter { study, linearised })
    }
}

impl SignatureMeter for StudySignatureMeter {
    fn lengths(&self, causes: &[Cause]) -> Vec<f64> {
        let index_of = |cause: &Cause| {
            self.study.effects.iter().position(|effect| effect.info().id == cause.effect.info().id)
        };
        let values: Option<EffectValues> =
            causes.iter().map(|cause| Some((index_of(cause)?, cause.values.clone()))).collect();
        let measured = values.and_then(|values| lengths(&self.study, &self.linearised, &values).ok());
        measured.unwrap_or_else(|| vec![0.0; causes.len()])
    }
}

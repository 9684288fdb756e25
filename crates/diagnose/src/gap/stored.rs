//! What a file keeps of a diagnosis. With the same recording, campaign and effects it is the diagnosis again, without the search.

use crate::closure::select::ClosureKey;
use crate::drift::DriftReport;
use crate::gap::best_fit::fitted_causes::{CauseFit, Fits};
use crate::gap::calibrated_model::Found;
use crate::gap::diagnose::Diagnosed;
use crate::gap::preconditions::{GapError, Zeroed};
use crate::gap::report::{Candidate, Diagnosis};
use crate::gap::request::RigRecording;
use crate::gap::residuals::nuisance::{Hypothesis, from_step, growing_from, onset_step};
use crate::gap::residuals::study::Study;
use mapper_inference::hypotheses::{Shape, TimeHistory};
use mapper_physics::rig::effect::Effect;
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// The fits of a diagnosis, as a file keeps them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StoredFits {
    null: StoredFit,
    /// All candidates, also those that are not listed.
    causes: Vec<(Candidate, StoredFit)>,
    closure: Option<StoredFit>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct StoredFit {
    /// Tolerances in their declared sigmas, in the order of the study.
    tolerances: Vec<f64>,
    effects: Vec<StoredEffect>,
    covariance: Option<Vec<Vec<f64>>>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct StoredEffect {
    cause: StoredCause,
    values: Vec<f64>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
enum StoredCause {
    Effect {
        id: String,
        #[serde(with = "mapper_core::test_plan::step_number")]
        begins: Option<usize>,
        grows: bool,
    },
    Closure(ClosureKey),
}

/// Why the fits of a file do not belong to a recording.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum RestoreError {
    #[error("effect `{0}` of the diagnosis is not in the effect library; add it with --effect")]
    Effect(String),
    #[error("the diagnosis has other tolerances or parameters than this recording; diagnose it again")]
    Other,
    #[error(transparent)]
    Gap(#[from] GapError),
}

impl Diagnosed {
    /// The fits for a file.
    pub fn stored(&self) -> StoredFits {
        let Fits { null, causes, closure } = &self.fits;
        let stored = |fit: &CauseFit| self.stored_fit(fit);
        StoredFits {
            null: stored(null),
            causes: self.diagnosis.candidates.iter().cloned().zip(causes.iter().map(stored)).collect(),
            closure: closure.as_ref().map(stored),
        }
    }

    fn stored_fit(&self, fit: &CauseFit) -> StoredFit {
        let study = &self.study;
        let last = fit.hypothesis.effects.len().saturating_sub(1);
        let effect = |(place, (index, values)): (usize, &(usize, Vec<f64>))| {
            let history = study.histories[*index];
            let of_library = || StoredCause::Effect {
                id: study.effects[*index].info().id.to_string(),
                begins: onset_step(history),
                grows: matches!(history.shape, Shape::Ramp(_)),
            };
            let key = fit.closure.as_ref().filter(|_| place == last);
            let cause = key.map_or_else(of_library, |key| StoredCause::Closure(key.clone()));
            StoredEffect { cause, values: values.clone() }
        };
        let rows = |all: &DMatrix<f64>| all.row_iter().map(|row| row.iter().copied().collect()).collect();
        StoredFit {
            tolerances: fit.hypothesis.nuisances.clone(),
            effects: fit.hypothesis.effects.iter().enumerate().map(effect).collect(),
            covariance: fit.covariance.as_ref().map(rows),
        }
    }

    /// A diagnosis from its report and its fits. The recording must be the one that was diagnosed, without a reference recording.
    pub fn restored(
        (diagnosis, drift, found): (Diagnosis, Option<DriftReport>, Option<Found>),
        stored: StoredFits,
        rig: &RigRecording,
        effects: Vec<Arc<dyn Effect>>,
    ) -> Result<Diagnosed, RestoreError> {
        let zeroed = Zeroed::new(rig, drift.as_ref());
        let mut study = zeroed.study(rig, effects)?;
        let all = || stored.causes.iter().map(|(_, fit)| fit).chain(&stored.closure);
        let is_late = |one: &StoredEffect| matches!(one.cause, StoredCause::Effect { begins: Some(_), .. });
        if all().any(|fit| fit.effects.iter().any(is_late)) {
            study.add_onsets();
        }
        let mut fit = |stored: &StoredFit| stored.restored(&mut study);
        let null = fit(&stored.null)?;
        let causes = stored.causes.iter().map(|(_, stored)| fit(stored)).collect::<Result<_, _>>()?;
        let closure = stored.closure.as_ref().map(fit).transpose()?;
        let candidates = stored.causes.into_iter().map(|(candidate, _)| candidate).collect();
        Ok(Diagnosed {
            diagnosis: Diagnosis { candidates, ..diagnosis },
            drift,
            zero: zeroed.zero,
            found,
            study,
            fits: Fits { null, causes, closure },
            library: None,
        })
    }
}

impl StoredFit {
    fn restored(&self, study: &mut Study) -> Result<CauseFit, RestoreError> {
        if self.tolerances.len() != study.nuisances.len() {
            return Err(RestoreError::Other);
        }
        let mut effects = Vec::with_capacity(self.effects.len());
        for StoredEffect { cause, values } in &self.effects {
            let index = match cause {
                StoredCause::Closure(key) => key.add_to(study).ok_or(RestoreError::Other)?,
                StoredCause::Effect { id, begins, grows } => {
                    let steps = study.steps.len();
                    let history = match begins {
                        None => TimeHistory::THROUGHOUT,
                        Some(first) if *grows && *first < steps => growing_from(*first, steps),
                        Some(first) => from_step(*first),
                    };
                    let is_it = |index: &usize| {
                        study.effects[*index].info().id == id.as_str() && study.histories[*index] == history
                    };
                    let index = (0..study.effects.len()).find(is_it);
                    index.ok_or_else(|| RestoreError::Effect(id.clone()))?
                }
            };
            if study.effects[index].info().parameters.len() != values.len() {
                return Err(RestoreError::Other);
            }
            effects.push((index, values.clone()));
        }
        let n = effects.iter().map(|(_, values)| values.len()).sum();
        let square = |rows: &Vec<Vec<f64>>| rows.len() == n && rows.iter().all(|row| row.len() == n);
        if self.covariance.as_ref().is_some_and(|rows| !square(rows)) {
            return Err(RestoreError::Other);
        }
        let covariance = self.covariance.as_ref().map(|rows| DMatrix::from_fn(n, n, |i, j| rows[i][j]));
        let closure = match self.effects.last() {
            Some(StoredEffect { cause: StoredCause::Closure(key), .. }) => Some(key.clone()),
            _ => None,
        };
        let hypothesis = Hypothesis { nuisances: self.tolerances.clone(), effects };
        Ok(CauseFit { hypothesis, covariance, closure })
    }
}

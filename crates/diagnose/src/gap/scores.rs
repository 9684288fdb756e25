//! What a calibration needs of a diagnosis whose causes are known, and how visible causes are on a recording.

use crate::gap::best_fit::coordinate::coordinates;
use crate::gap::best_fit::fit::{Fit, lengths};
use crate::gap::causes::additions::Calibration;
use crate::gap::causes::probabilities::weight;
use crate::gap::diagnose::Diagnosed;
use crate::gap::library_fits::LibraryFits;
use crate::gap::preconditions::{GapError, Problem};
use crate::gap::request::RigRecording;
use crate::gap::residuals::study::{EffectValues, Study, members};
use crate::gap::residuals::whiten::Linearised;
use mapper_observe::averages::Table;
use mapper_physics::rig::effect::Effect;
use std::collections::BTreeSet;
use std::sync::Arc;

/// The scores of a diagnosis, from which probabilities are made.
#[derive(Debug, Clone, PartialEq)]
pub struct Scores {
    /// Score of no cause, prior included.
    pub nothing: f64,
    /// Each candidate, the ids of its effects, with its score, prior included.
    pub candidates: Vec<(BTreeSet<String>, f64)>,
    /// Features of the logistic of an unmodelled cause.
    pub features: [f64; 2],
    /// Error of each parameter in its own standard errors and its search coordinate; empty if the true causes are not the best.
    pub errors_sigma: Vec<f64>,
}

impl Diagnosed {
    /// The scores of a recording whose causes are known: ids and values. `None` for a diagnosis from a file.
    pub fn scores(&self, calibration: &Calibration, truth: &[(String, Vec<f64>)]) -> Option<Scores> {
        let LibraryFits { study, null, fits, adequacy, .. } = self.library.as_ref()?;
        let names = |fit: &Fit| -> BTreeSet<String> {
            members(&fit.hypothesis).into_iter().map(|i| study.effects[i].info().id.to_string()).collect()
        };
        let causes: BTreeSet<String> = truth.iter().map(|(id, _)| id.clone()).collect();
        let named = fits.first().filter(|fit| names(fit) == causes);
        Some(Scores {
            nothing: weight(calibration, study, null),
            candidates: fits.iter().map(|fit| (names(fit), weight(calibration, study, fit))).collect(),
            features: adequacy.features(),
            errors_sigma: named.map_or_else(Vec::new, |fit| errors_sigma(study, fit, truth)),
        })
    }
}

fn errors_sigma(study: &Study, fit: &Fit, truth: &[(String, Vec<f64>)]) -> Vec<f64> {
    let coordinates = coordinates(&study.effects, &fit.hypothesis);
    let mut place = 0;
    let mut errors = Vec::new();
    for (index, values) in &fit.hypothesis.effects {
        let id = &study.effects[*index].info().id;
        let truth = truth.iter().find(|(cause, _)| id == cause.as_str()).map(|(_, values)| values);
        for (number, value) in values.iter().enumerate() {
            let (coordinate, variance) = (&coordinates[place], fit.covariance[(place, place)]);
            if let Some(truth) = truth.and_then(|truth| truth.get(number)) {
                errors.push((coordinate.of(*truth) - coordinate.of(*value)) / variance.sqrt());
            }
            place += 1;
        }
    }
    errors.retain(|error| error.is_finite());
    errors
}

/// A recording without causes, on which the visibility of effects is measured.
#[derive(Debug)]
pub struct EffectVisibility {
    study: Study,
    linearised: Linearised,
}

impl EffectVisibility {
    /// Linearises the recording for candidate effects.
    pub fn new(recorded: RigRecording, effects: Vec<Arc<dyn Effect>>) -> Result<EffectVisibility, GapError> {
        // A calculated recording has all channels, and may be as short as its cases.
        let (recording, declared) = (&recorded.recording, recorded.declared());
        let table = Table::new(recording).ok_or(Problem::Empty)?;
        let study = Study::new(recording, table, declared, recorded.model, effects);
        let linearised = Linearised::new(&study)?;
        Ok(EffectVisibility { study, linearised })
    }

    /// Length of the signature of each cause, in sigmas, given the others; `None` if the model cannot follow them.
    pub fn lengths(&self, causes: &[(String, Vec<f64>)]) -> Option<Vec<f64>> {
        let index_of = |id: &str| self.study.effects.iter().position(|effect| effect.info().id == id);
        let values: Option<EffectValues> =
            causes.iter().map(|(id, values)| Some((index_of(id)?, values.clone()))).collect();
        lengths(&self.study, &self.linearised, &values?).ok()
    }
}

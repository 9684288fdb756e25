//! The file form of a case: causes by their id.

use crate::blind::cases::case::Case;
use crate::blind::cases::cause::Cause;
use crate::blind::cases::kind::CaseKind;
use crate::blind::outside::{OutsideUse, outside_kinds};
use mapper_physics::rig::effect::Effect;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// A case whose causes are stored by their ids.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StoredCase {
    /// Name of its files.
    pub name: String,
    /// Its kind.
    pub kind: CaseKind,
    /// Id and values of each cause.
    pub causes: Vec<(String, Vec<f64>)>,
    /// Length of each cause's signature in the presence of the others, in sigmas.
    pub sigmas: Vec<f64>,
    /// Seed of its noise, offsets, tolerances and weather.
    pub seed: u64,
}

impl From<&Case> for StoredCase {
    fn from(case: &Case) -> Self {
        let named = |cause: &Cause| (cause.effect.info().id.to_string(), cause.values.clone());
        StoredCase {
            name: case.name.clone(),
            kind: case.kind,
            causes: case.causes.iter().map(named).collect(),
            sigmas: case.sigmas.clone(),
            seed: case.seed,
        }
    }
}

impl StoredCase {
    /// The case with its causes looked up in the catalogue and among all outside causes.
    ///
    /// # Errors
    /// The id of a cause that is in neither, or has other parameters.
    pub fn case(&self, catalogue: &[Arc<dyn Effect>]) -> Result<Case, String> {
        let mut known = catalogue.to_vec();
        known.extend([OutsideUse::Check, OutsideUse::Calibration].into_iter().flat_map(outside_kinds));
        let cause = |(id, values): &(String, Vec<f64>)| {
            let fits = |effect: &&Arc<dyn Effect>| {
                effect.info().id == *id && effect.info().parameters.len() == values.len()
            };
            let effect = known.iter().find(fits).ok_or_else(|| id.clone())?.clone();
            Ok(Cause { effect, values: values.clone() })
        };
        Ok(Case {
            name: self.name.clone(),
            kind: self.kind,
            causes: self.causes.iter().map(cause).collect::<Result<_, String>>()?,
            sigmas: self.sigmas.clone(),
            seed: self.seed,
        })
    }
}

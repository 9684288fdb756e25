//! How strongly a recording would show effects: the length of each one's signature in sigmas.
//!
//! The signature is what the effect changes in the whitened values; what tolerances, offsets and the other effects can
//! imitate is projected out, tolerances only as far as their declared size goes. An effect of length 2 is hidden, one of
//! 24 is plain.

use crate::fit::Selection;
use crate::select::Projector;
use crate::study::{EffectValues, PredictError, Study};
use crate::whiten::Linearised;

/// Length of the signature of each of `effects` (indices into the study's effects, with values), beside the others.
///
/// # Errors
/// [`PredictError`] where the model cannot follow the recording with these effects.
pub fn lengths(
    study: &Study,
    linearised: &Linearised,
    effects: &EffectValues,
) -> Result<Vec<f64>, PredictError> {
    let mut with = study.nothing();
    with.effects.clone_from(effects);
    let all = study.predict(&with)?;
    let mut signatures = Vec::with_capacity(effects.len());
    for place in 0..effects.len() {
        let mut without = with.clone();
        without.effects.remove(place);
        let rest = study.predict(&without)?;
        let mut change: Vec<f64> = all.values.iter().zip(&rest.values).map(|(a, b)| a - b).collect();
        linearised.whiten(study, &mut change);
        signatures.push(change);
    }
    let everywhere = Selection::all(study);
    let length = |place: usize| {
        let mut others = signatures.clone();
        let own = others.remove(place);
        let projector = Projector::new(study, linearised, &everywhere, &others)?;
        let right = projector.right(&own);
        Some(projector.product(&own, &right, &own, &right).max(0.0).sqrt())
    };
    // Equations that cannot be solved leave nothing to tell by.
    Ok((0..effects.len()).map(|place| length(place).unwrap_or(0.0)).collect())
}

//! How strongly a recording would show effects: the length of each one's signature in sigmas.
//!
//! A recording without noise that has the effects is told; its misfit at the best without one of them is the squared length
//! of that one's signature: what tolerances, offsets and the other effects can imitate is projected out, tolerances only as
//! far as their declared size goes. An effect of length 2 is hidden, one of 24 is plain.

use crate::fit::{Effort, fit};
use crate::selection::Selection;
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
    let mut told = study.clone();
    told.measured = study.predict(&with)?.values;
    // By runs of the model, not by a straight line: a tolerance that acts as the effect does follows it round every bend.
    // As far as it has to: what is priced by its declared size needs no other bound here.
    let effort = Effort { iterations: 5, enough: 0.5, most_sigmas: 60.0 };
    let everywhere = Selection::all(study);
    (0..effects.len())
        .map(|place| {
            let mut without = with.clone();
            without.effects.remove(place);
            Ok(fit(&told, linearised, &without, &everywhere, effort)?.cost.max(0.0).sqrt())
        })
        .collect()
}

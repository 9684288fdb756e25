//! Visibility of effects in a recording: the length of each one's signature in sigmas.
//!
//! Uses a noise-free recording with the effects. The best misfit without one of them is its squared signature length. The other effects,
//! offsets and tolerances (limited by their declared size) are thereby projected out. An effect of length 2 is hidden, one of 24 is
//! obvious.

use crate::gap::best_fit::fit::{Effort, fit};
use crate::gap::best_fit::selection::Selection;
use crate::gap::residuals::study::{EffectValues, PredictError, Study};
use crate::gap::residuals::whiten::Linearised;

/// Signature length of each of `effects` (indices into the study's effects, with values), given the others.
///
/// # Errors
/// [`PredictError`] if the model cannot follow the recording with these effects.
pub fn lengths(
    study: &Study,
    linearised: &Linearised,
    effects: &EffectValues,
) -> Result<Vec<f64>, PredictError> {
    let mut with = study.nothing();
    with.effects.clone_from(effects);
    let mut noise_free = study.clone();
    noise_free.measured = study.predict(&with)?.values;
    // Uses model runs rather than a linearisation, because a tolerance that imitates the effect follows its nonlinearity. The declared size
    // already penalises tolerances, so the bound is wide.
    let effort =
        Effort { iterations: 5, enough: 0.5, max_sigmas: 60.0, max_sigmas_of_rig: 60.0, exact: true };
    let everywhere = Selection::all(study);
    (0..effects.len())
        .map(|place| {
            let mut without = with.clone();
            without.effects.remove(place);
            Ok(fit(&noise_free, linearised, &without, &everywhere, effort)?.cost.max(0.0).sqrt())
        })
        .collect()
}

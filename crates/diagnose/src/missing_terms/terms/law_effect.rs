//! Wraps terms as an effect, so that the effect fit also fits laws.

use crate::gap::best_fit::fit::MAX_SIGMAS;
use crate::gap::best_fit::normal::PRIOR_STEPS;
use crate::missing_terms::terms::term::{Term, put_into};
use mapper_physics::rig::effect::{Effect, EffectError, EffectInfo, EffectParameter, NamedValues, Rig};
use std::borrow::Cow;

/// Maximum distance of a coefficient from zero, in steps.
pub const MAX_STEPS: f64 = PRIOR_STEPS * MAX_SIGMAS;

/// Some terms of one part of the machine, each with a coefficient.
#[derive(Debug, Clone)]
pub struct LawEffect {
    info: EffectInfo,
    terms: Vec<Term>,
}

impl LawEffect {
    /// The effect of one or more terms.
    pub fn new(terms: Vec<Term>) -> LawEffect {
        let parameters = terms
            .iter()
            .enumerate()
            .map(|(place, term)| EffectParameter {
                name: Cow::Owned(format!("c{}", place + 1)),
                unit: Cow::Borrowed(term.unit),
                low: if term.positive { 0.0 } else { -MAX_STEPS * term.step },
                high: MAX_STEPS * term.step,
                neutral: 0.0,
                typical_step: term.step,
            })
            .collect();
        let info = EffectInfo {
            name: Cow::Borrowed("a law that is proposed"),
            id: Cow::Borrowed("law"),
            description: Cow::Borrowed("terms that were found"),
            equation: Cow::Borrowed("as its terms"),
            source: Cow::Borrowed("found by regression"),
            submodel: terms.first().map_or(mapper_physics::rig::effect::Submodel::Shaft, Term::submodel),
            also_shows_in: Vec::new(),
            parameters,
        };
        LawEffect { info, terms }
    }
}

impl Effect for LawEffect {
    fn info(&self) -> &EffectInfo {
        &self.info
    }

    fn prepare(&self, values: &NamedValues<'_>, rig: &mut Rig) -> Result<(), EffectError> {
        let with: Vec<(Term, f64)> =
            self.terms.iter().cloned().zip(values.iter().map(|(_, value)| value)).collect();
        Ok(put_into(rig, &with)?)
    }
}

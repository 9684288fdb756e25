//! An effect that only sets parameters: a row of text and a function.

use mapper_physics::effect::{Effect, EffectInfo, EffectParameter, Rig, Submodel};
use mapper_physics::hooks::TooManyExtraStates;
use std::borrow::Cow;

/// Sets an effect's values, which are as many as its parameters.
type Prepare = fn(&[f64], &mut Rig);

/// One effect of the catalogue.
#[derive(Debug, Clone)]
pub(crate) struct Catalogued {
    info: EffectInfo,
    prepare: Prepare,
}

impl Catalogued {
    pub(crate) fn new(
        id: &'static str,
        description: &'static str,
        equation: &'static str,
        source: &'static str,
        submodel: Submodel,
        parameters: Vec<EffectParameter>,
        prepare: Prepare,
    ) -> Self {
        let [id, description, equation, source] = [id, description, equation, source].map(Cow::Borrowed);
        Catalogued { info: EffectInfo { id, description, equation, source, submodel, parameters }, prepare }
    }
}

impl Effect for Catalogued {
    fn info(&self) -> &EffectInfo {
        &self.info
    }

    fn prepare(&self, values: &[f64], rig: &mut Rig) -> Result<(), TooManyExtraStates> {
        (self.prepare)(values, rig);
        Ok(())
    }
}

/// A parameter with its range, the value at which the effect is not there, and a plain step away from it.
pub(crate) fn parameter(
    name: &'static str,
    unit: &'static str,
    [low, high]: [f64; 2],
    neutral: f64,
    typical_step: f64,
) -> EffectParameter {
    EffectParameter { name: Cow::Borrowed(name), unit: Cow::Borrowed(unit), low, high, neutral, typical_step }
}

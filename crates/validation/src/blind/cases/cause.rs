//! Causes of a case: deviations from the nominal machine.

use mapper_physics::rig::effect::Effect;
use std::sync::Arc;

/// One cause with its strength.
#[derive(Debug, Clone)]
pub struct Cause {
    /// The effect.
    pub effect: Arc<dyn Effect>,
    /// Its values.
    pub values: Vec<f64>,
}

impl Cause {
    /// The id of the effect, and its values.
    pub(crate) fn id_and_values(&self) -> (String, Vec<f64>) {
        (self.effect.info().id.to_string(), self.values.clone())
    }
}

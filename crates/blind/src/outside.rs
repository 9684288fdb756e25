//! Causes that are no candidates of the diagnosis: reserved ones for the check, other ones for calibration.
//!
//! They are effects like those of the catalogue and never part of it.

mod back_plate;
mod clearance;
mod coolant_passage;
mod coulomb_friction;
mod flow_dependent_htc;
mod mount_conduction;
mod outlet_duct;
mod slow_housing_probe;
mod slow_pressure_line;
mod speed_gain;

use mapper_physics::effect::{Effect, EffectInfo, EffectParameter, Rig, Submodel};
use mapper_physics::hooks::{Hooks, TooManyExtraStates};
use std::borrow::Cow;
use std::sync::Arc;

/// What an outside cause is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OutsideUse {
    /// Reserved for the check; never seen by anything that is tuned.
    Check,
    /// For tuning thresholds.
    Calibration,
}

/// The causes of one use.
pub fn outside_kinds(wanted: OutsideUse) -> Vec<Arc<dyn Effect>> {
    match wanted {
        OutsideUse::Check => vec![
            Arc::new(coolant_passage::effect()),
            Arc::new(outlet_duct::effect()),
            Arc::new(clearance::effect()),
            Arc::new(back_plate::effect()),
            Arc::new(slow_pressure_line::effect()),
        ],
        OutsideUse::Calibration => vec![
            Arc::new(mount_conduction::effect()),
            Arc::new(coulomb_friction::effect()),
            Arc::new(flow_dependent_htc::effect()),
            Arc::new(slow_housing_probe::effect()),
            Arc::new(speed_gain::effect()),
        ],
    }
}

/// Puts a strength into a rig.
type Prepare = fn(f64, &mut Rig) -> Result<(), TooManyExtraStates>;

/// One outside cause with one strength.
#[derive(Debug, Clone)]
struct Outside {
    info: EffectInfo,
    prepare: Prepare,
}

impl Outside {
    /// `id` begins with `X_`: that is how answers tell outside causes.
    fn new(
        [id, description, equation]: [&'static str; 3],
        submodel: Submodel,
        [name, unit]: [&'static str; 2],
        [low, high, neutral, typical_step]: [f64; 4],
        prepare: Prepare,
    ) -> Self {
        let [name, unit] = [name, unit].map(Cow::Borrowed);
        let parameters = vec![EffectParameter { name, unit, low, high, neutral, typical_step }];
        let [id, description, equation] = [id, description, equation].map(Cow::Borrowed);
        let source = Cow::Borrowed("withheld from the diagnosis");
        Outside { info: EffectInfo { id, description, equation, source, submodel, parameters }, prepare }
    }
}

impl Effect for Outside {
    fn info(&self) -> &EffectInfo {
        &self.info
    }

    fn prepare(&self, values: &[f64], rig: &mut Rig) -> Result<(), TooManyExtraStates> {
        values.iter().try_for_each(|value| (self.prepare)(*value, rig))
    }
}

/// Adds hooks to a rig.
fn hook(rig: &mut Rig, hooks: impl Hooks + 'static) -> Result<(), TooManyExtraStates> {
    rig.hook(hooks)
}

//! Causes that are not candidates of the diagnosis: reserved ones for the check, other ones for calibration.
//!
//! They are effects like those of the catalogue, but never part of it. Their ids begin with `X_`, which identifies them in
//! the answers.

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

use mapper_physics::rig::effect::Effect;
use mapper_physics::rig::effect_kind::effect_of;
use std::sync::Arc;

/// Purpose of an outside cause.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OutsideUse {
    /// Reserved for the check; never used for tuning.
    Check,
    /// For tuning thresholds.
    Calibration,
}

/// The causes with this purpose.
pub fn outside_kinds(wanted: OutsideUse) -> Vec<Arc<dyn Effect>> {
    match wanted {
        OutsideUse::Check => vec![
            effect_of::<coolant_passage::CoolantPassage>(),
            effect_of::<outlet_duct::OutletDuct>(),
            effect_of::<clearance::Clearance>(),
            effect_of::<back_plate::BackPlate>(),
            effect_of::<slow_pressure_line::SlowPressureLine>(),
        ],
        OutsideUse::Calibration => vec![
            effect_of::<mount_conduction::MountConduction>(),
            effect_of::<coulomb_friction::CoulombFriction>(),
            effect_of::<flow_dependent_htc::FlowDependentHtc>(),
            effect_of::<slow_housing_probe::SlowHousingProbe>(),
            effect_of::<speed_gain::SpeedGain>(),
        ],
    }
}

/// Source of all outside causes.
const WITHHELD: &str = "withheld from the diagnosis";

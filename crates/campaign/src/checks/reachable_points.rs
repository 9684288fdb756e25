//! Checks of a whole campaign: contradictions, points that cannot be reached, and doubts.

use crate::campaign::Campaign;
use crate::checking::{Check, Files};
use crate::elements;
use crate::elements::turbocharger::machine::NominalTableError;
use mapper_core::OperatingPoint;
use mapper_physics::compressor_map::characteristic::CompressorCharacteristic;
use mapper_physics::compressor_map::closed_form_map::ClosedFormMap;
use mapper_physics::operating_point::reach::{describe_obstacles, reach};
use mapper_physics::simulation::model::Model;
use mapper_yaml::{Notes, Step, Tree};
use std::sync::Arc;

/// A point that cannot be measured.
#[derive(Debug, Clone, PartialEq)]
pub struct UnreachablePoint {
    /// Index in [`Campaign::points`].
    pub point: usize,
    /// Reason, with values and units.
    pub reason: String,
    /// The remedy.
    pub remedy: String,
    /// Key of the limit below `limits` that is in the way, if one is.
    pub limit: Option<&'static [&'static str]>,
}

/// The nominal model of a campaign, on its map.
///
/// # Errors
/// [`NominalTableError`] if the map file's text is not a map; this cannot happen in a checked campaign.
pub fn nominal_model(campaign: &Campaign) -> Result<Model, NominalTableError> {
    let params = campaign.machine.params;
    let map: Arc<dyn CompressorCharacteristic> = match campaign.machine.map.table() {
        None => Arc::new(ClosedFormMap { wheel_diameter_m: params.compressor.wheel_diameter_m }),
        Some(table) => Arc::new(table?),
    };
    Ok(Model::new(params, map))
}

/// The points that cannot be measured, each with all reasons; see [`mapper_physics::operating_point::reach`].
pub fn unreachable_points(campaign: &Campaign, model: &Model) -> Vec<UnreachablePoint> {
    let check_point = |(index, point): (usize, &OperatingPoint)| {
        let (boundary, limits) = (&campaign.boundary, &campaign.limits);
        let obstacles = reach(model, *point, boundary, campaign.follow_outlet, limits).err()?;
        let (krpm, opening) = point.shown();
        let krpm = (krpm * 1e2).round() / 1e2;
        Some(UnreachablePoint {
            point: index,
            reason: format!("{krpm} krpm at opening {opening} {}", describe_obstacles(&obstacles)),
            remedy: obstacles.first()?.remedy().to_owned(),
            limit: obstacles.first()?.limit(),
        })
    };
    campaign.points.iter().enumerate().filter_map(check_point).collect()
}

/// Checks everything that needs more than one value.
pub(crate) fn check_consistency(tree: &Tree, files: Files<'_>, notes: &mut Notes) {
    let mut check = Check { tree, files, notes };
    elements::rig::backend::check(&mut check);
    elements::rig::limits::check(&mut check);
    elements::rig::guards::check(&mut check);
    elements::identification::check(&mut check);
    elements::timing::check(&mut check);
    elements::repeats::check_repeats(&mut check);
    elements::rig::sensors::check(&mut check);
    elements::output::check(&mut check);
    elements::turbocharger::machine::check(&mut check);
    elements::turbocharger::gas::check(&mut check);
    elements::repeats::check_sequence(&mut check);
    elements::grid::check(&mut check);
}

/// An unusual or impossible setting of a campaign.
#[derive(Debug, Clone, PartialEq)]
pub struct Concern {
    /// Whether it is an error, so that the campaign cannot run; otherwise a warning.
    pub is_error: bool,
    /// The key, as a path.
    pub at: Vec<Step>,
    /// Description, with values and units.
    pub message: String,
    /// The remedy.
    pub remedy: String,
}

impl Concern {
    /// A warning at the key with this path.
    pub fn warning(path: &[&str], message: String, remedy: String) -> Self {
        let at = path.iter().map(|key| Step::from(*key)).collect();
        Concern { is_error: false, at, message, remedy }
    }
}

/// A length in mm, rounded to 0.1 um.
pub(crate) fn to_mm(length_m: f64) -> f64 {
    (1e7 * length_m).round() / 1e4
}

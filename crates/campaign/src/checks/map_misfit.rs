//! Compares the nominal map with the wheel, and the grid with what the machine reaches.

use crate::campaign::Campaign;
use crate::checking::{Check, Files};
use crate::elements;
use crate::elements::turbocharger::machine::NominalTableError;
use mapper_core::{OperatingPoint, ReferenceState};
use mapper_physics::compressor_map::closed_form_map::{ClosedFormMap, CompressorCharacteristic, head_ratio};
use mapper_physics::compressor_map::tabulated_map::TabulatedMap;
use mapper_physics::gas::air;
use mapper_physics::operating_point::reach::{describe_obstacles, reach};
use mapper_physics::simulation::model::Model;
use mapper_yaml::{Notes, Step, Tree};
use std::f64::consts::PI;
use std::sync::Arc;

/// Maximum ratio, either way, of a compressor's choke flow to the scaled reference machine's at equal tip speed. Confused units differ by
/// more: lb/min and kg/s by 132, g/s and kg/s by 1000.
const MAX_FLOW_RATIO: f64 = 10.0;
/// Maximum isentropic head over the square of the tip speed: the work of a wheel without swirl at its inlet and without forward blades (Euler's
/// equation), which no loss or slip reaches.
const MAX_HEAD_COEFFICIENT: f64 = 1.0;
/// Minimum peak efficiency of a map. Judgement: half of that of a poor compressor (0.6).
const MIN_PEAK_EFFICIENCY: f64 = 0.3;

/// Why a map cannot be that of a compressor with this wheel; its text continues "the map `FILE`: ".
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum MapMisfit {
    #[error(
        "the highest pressure ratio at {:.1} krpm is {pressure_ratio:.3}, but a compressor has more than 1", .speed_rpm / 1e3
    )]
    NoCompression { speed_rpm: f64, pressure_ratio: f64 },
    #[error("the highest efficiency is {:.1} %, but compressors reach 60 % and more", 100.0 * .peak)]
    Efficiency { peak: f64 },
    /// Choke flow of the map, and of a similar compressor.
    #[error(
        "the flow is about {} times too {} for a wheel of {} mm: it is read as {} kg/s at choke and {:.1} krpm, where {} kg/s would be usual",
        factor(*.found_kg_s, *.usual_kg_s), large_or_small(*.found_kg_s, *.usual_kg_s),
        to_mm(*.wheel_m), two_digits(*.found_kg_s), .speed_rpm / 1e3, two_digits(*.usual_kg_s)
    )]
    Flow { found_kg_s: f64, usual_kg_s: f64, speed_rpm: f64, wheel_m: f64 },
    /// More head than a wheel can give at its tip speed.
    #[error(
        "a pressure ratio of {pressure_ratio:.2} needs a tip speed of more than {:.0} m/s, and a wheel of {} mm has {:.0} m/s at {} krpm: \
         the speeds are too low or the wheel is too small by a factor of at least {:.1}",
        .needed_m_s, to_mm(*.wheel_m), .tip_m_s, two_digits(.speed_rpm / 1e3), .needed_m_s / .tip_m_s
    )]
    TipSpeed { pressure_ratio: f64, needed_m_s: f64, tip_m_s: f64, speed_rpm: f64, wheel_m: f64 },
}

impl MapMisfit {
    /// A highest efficiency (fraction) that no compressor has.
    pub fn of_peak_efficiency(peak: f64) -> Option<Self> {
        (peak < MIN_PEAK_EFFICIENCY).then_some(MapMisfit::Efficiency { peak })
    }

    /// The remedy.
    pub fn remedy(&self) -> &'static str {
        match self {
            MapMisfit::NoCompression { .. } => {
                "if the column holds the pressure ratio minus 1, add 1; if columns are exchanged, correct the heading"
            }
            MapMisfit::Efficiency { .. } => {
                "write efficiencies as fractions or with `%` in the heading; if columns are exchanged, correct the heading"
            }
            MapMisfit::Flow { .. } => {
                "name the unit in the heading of the flow's column, e.g. `flow [lb/min]`; or correct \
                 `machine.geometry.compressor.wheel_diameter`"
            }
            MapMisfit::TipSpeed { .. } => {
                "name the unit in the heading of the speed's column, e.g. `speed [1/s]`; or correct \
                 `machine.geometry.compressor.wheel_diameter`"
            }
        }
    }
}

/// The first reason why `map` cannot be that of a compressor with a wheel of this diameter.
pub fn find_map_misfit(map: &TabulatedMap, wheel_diameter_m: f64) -> Option<MapMisfit> {
    let (first, last) = (map.lines().first()?, map.lines().last()?);
    if first.surge_pressure_ratio <= 1.0 {
        return Some(MapMisfit::NoCompression {
            speed_rpm: first.speed_corrected_rpm,
            pressure_ratio: first.surge_pressure_ratio,
        });
    }
    let efficiencies = map.lines().iter().flat_map(|line| &line.nodes).map(|node| node.efficiency);
    let peak = efficiencies.fold(0.0, f64::max);
    if let Some(poor) = MapMisfit::of_peak_efficiency(peak) {
        return Some(poor);
    }
    let speed_rpm = last.speed_corrected_rpm;
    let (found_kg_s, usual_kg_s) = (
        map.choke_flow_corrected_kg_s(speed_rpm),
        ClosedFormMap { wheel_diameter_m }.choke_flow_corrected_kg_s(speed_rpm),
    );
    let ratio = found_kg_s / usual_kg_s;
    if !(1.0 / MAX_FLOW_RATIO..=MAX_FLOW_RATIO).contains(&ratio) {
        return Some(MapMisfit::Flow { found_kg_s, usual_kg_s, speed_rpm, wheel_m: wheel_diameter_m });
    }
    let heat_capacity_j_kgk =
        air::GAS_CONSTANT_J_KGK * air::HEAT_CAPACITY_RATIO / (air::HEAT_CAPACITY_RATIO - 1.0);
    let pressure_ratio = last.surge_pressure_ratio;
    let head_j_kg = heat_capacity_j_kgk * ReferenceState::SAE.t_ref_k * head_ratio(pressure_ratio);
    let needed_m_s = (head_j_kg / MAX_HEAD_COEFFICIENT).sqrt();
    let tip_m_s = PI * wheel_diameter_m * speed_rpm / 60.0;
    (needed_m_s > tip_m_s).then_some(MapMisfit::TipSpeed {
        pressure_ratio,
        needed_m_s,
        tip_m_s,
        speed_rpm,
        wheel_m: wheel_diameter_m,
    })
}

/// Factor between two values, rounded to one significant digit.
fn factor(found: f64, usual: f64) -> f64 {
    let value = found.max(usual) / found.min(usual);
    let unit = 10f64.powi(value.log10().floor() as i32);
    (value / unit).round() * unit
}

fn large_or_small(found: f64, usual: f64) -> &'static str {
    if found > usual { "large" } else { "small" }
}

/// A number with two significant digits.
pub(crate) fn two_digits(value: f64) -> String {
    let digits = (1.0 - value.abs().log10().floor()).max(0.0);
    if digits > 4.0 { format!("{value:.1e}") } else { format!("{value:.*}", digits as usize) }
}

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
        Some(UnreachablePoint {
            point: index,
            reason: format!("{} {}", point.in_words(), describe_obstacles(&obstacles)),
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

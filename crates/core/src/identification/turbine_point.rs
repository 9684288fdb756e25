//! The turbine at the points of a compressor test.

use crate::enums::named_enum;
use crate::{UncertaintyBudget, Verdict};
use serde::{Deserialize, Serialize};

named_enum! {
    /// Why a turbine point is not good.
    pub enum TurbineDoubt {
        /// The compressor's point is doubtful or unusable, and so is the power that it takes from the shaft.
        CompressorPoint = "compressor_point",
        /// The compressor's efficiency is apparent, so that heat to its housing counts as power.
        ApparentEfficiency = "apparent_efficiency",
        /// The efficiency is not between 0 and 1.
        Impossible = "impossible",
        /// The interval is too wide.
        WideInterval = "wide_interval",
    }
}

/// The turbine at the end of a step: a mean over its last seconds. Pressures are total at the inlet (station 3) and as tapped at the
/// outlet (station 4). Intervals are of 95 %.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TurbinePoint {
    /// Index of the step, from 0; files have its number, from 1.
    #[serde(with = "crate::test_plan::step_number")]
    pub step: usize,
    /// Position of the vanes, fraction of their range; `None` for fixed geometry.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub vane_position: Option<f64>,
    /// Shaft speed over the root of the inlet's total temperature, rpm/K^0.5.
    pub speed_parameter_rpm_sqrt_k: f64,
    /// Flow parameter `m sqrt(T3)/P3`, kg K^0.5/(s kPa).
    pub flow_parameter_kg_sqrt_k_s_kpa: f64,
    /// Lower end of its interval.
    pub flow_low: f64,
    /// Upper end of its interval.
    pub flow_high: f64,
    /// Expansion ratio P3/P4, total to static.
    pub expansion_ratio: f64,
    /// One standard error of the expansion ratio.
    pub expansion_ratio_standard_error: f64,
    /// Blade speed at the inlet of the wheel over the spouting velocity of the isentropic drop from T3'.
    pub blade_speed_ratio: f64,
    /// Power to the shaft, W: of the compressor and of the shaft's acceleration. It does not contain bearing friction. `None` without an
    /// efficiency of the compressor.
    pub power_w: Option<f64>,
    /// Heat that the gas gives to the turbine housing before the wheel, W.
    pub heat_w: f64,
    /// One standard error of this heat, W.
    pub heat_standard_error_w: f64,
    /// Total temperature before the wheel, T3', K.
    pub t3_prime_k: f64,
    /// Turbine efficiency times mechanical efficiency, fraction: `power_w` over the isentropic power from T3', total to static. `None` without
    /// an efficiency of the compressor.
    pub efficiency: Option<f64>,
    /// Lower end of its interval.
    pub efficiency_low: Option<f64>,
    /// Upper end of its interval.
    pub efficiency_high: Option<f64>,
    /// Sources of the efficiency's uncertainty.
    pub budget: Option<UncertaintyBudget>,
    /// Errors that the points share.
    pub common: TurbineCommonErrors,
    /// Whether to use the point.
    pub verdict: Verdict,
    /// Reasons for a verdict other than good.
    pub doubts: Vec<TurbineDoubt>,
}

/// The heat balance of the turbine housing, one mass, fitted to the rate of its temperature. Each number with the ends of its 95 % interval.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TurbineHousing {
    /// Reynolds number at which the law of h is given, on the diameter of the inlet.
    pub reynolds: f64,
    /// `a Re^b` there; `Nu = a Re^b Pr^(1/3) (mu/mu_wall)^0.14`.
    pub nusselt: [f64; 3],
    /// Exponent b.
    pub exponent: [f64; 3],
    /// Heat capacity over the declared one.
    pub capacity_ratio: [f64; 3],
    /// Heat to the cell over the declared one.
    pub external_heat_ratio: [f64; 3],
    /// Conductance to the bearing housing over the declared one.
    pub bearing_conductance_ratio: [f64; 3],
    /// Correlations of the five, of the exponent and of the logarithms of the others, in this order.
    pub correlations: Vec<Vec<f64>>,
}

/// Signed changes of a turbine point by one standard deviation of each error that all points share. The errors are independent and have the
/// same places at every point.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct TurbineCommonErrors {
    /// Of the flow parameter's logarithm.
    pub ln_flow_changes: Vec<f64>,
    /// Of the expansion ratio's logarithm.
    pub ln_expansion_ratio_changes: Vec<f64>,
    /// Of the efficiency, fraction.
    pub efficiency_changes: Vec<f64>,
}

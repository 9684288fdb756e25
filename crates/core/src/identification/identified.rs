//! Identified points: efficiency and heat-transfer coefficient with interval, verdict, and the budget of their uncertainty; remarks on results.

use crate::enums::{coded_enum, named_enum};
use crate::{Channel, OperatingPoint, StepKind, Warning};
use serde::{Deserialize, Serialize};

named_enum! {
    /// Method that identified a point.
    pub enum Method {
        /// Apparent efficiency from the temperature rise at the end of the step (conventional mapping).
        Steady = "steady",
        /// Efficiency and heat-transfer coefficient from the transient (Burke et al., eqs. 1-3).
        Dynamic = "dynamic",
        /// All points of a campaign together: like `Dynamic`, with shared parameters fitted over all of them.
        Joint = "joint",
        /// Steady points, with the heat to the measured housing removed by eqs. 1-3 and a known law of convection.
        Corrected = "corrected",
        /// Read from a map that does not state its method.
        Imported = "imported",
    }
}

/// Whether a point's results may be used.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// Use it.
    Good,
    /// Use it with care: `warnings` give the reasons.
    Doubtful,
    /// Do not use the point: its results are absent or meaningless; `warnings` give the reasons.
    Unusable,
}

impl Verdict {
    /// The verdict after a warning: doubtful, or still unusable.
    pub fn doubted(self) -> Self {
        match self {
            Verdict::Good | Verdict::Doubtful => Verdict::Doubtful,
            Verdict::Unusable => Verdict::Unusable,
        }
    }
}

/// The part of a recording that was used.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Window {
    /// Start, run time, s.
    pub start_s: f64,
    /// End, run time, s.
    pub end_s: f64,
}

/// Standard errors of a quantity, by origin: noise averages out with more samples, bias does not.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct EstimateUncertainty {
    /// One standard error from noise, serial correlation of the residual included; unit of the quantity.
    pub noise_standard_error: f64,
    /// One standard error from declared fixed sensor offsets and gains, and from the estimated error of the method's own
    /// assumptions (a constant h although the flow still changes); unit of the quantity.
    pub bias_standard_error: f64,
}

impl EstimateUncertainty {
    /// Root sum of squares of both; unit of the quantity.
    pub fn combined_standard_error(&self) -> f64 {
        self.noise_standard_error.hypot(self.bias_standard_error)
    }
}

/// 97.5 % quantile of the standard normal distribution. Source: its definition.
const Z_975: f64 = 1.959_963_984_540_054;

/// The 95 % interval of a normally distributed estimate: value -/+ 1.96 standard errors.
pub fn confidence_interval_95(value: f64, standard_error: f64) -> (f64, f64) {
    let half = half_width_95(standard_error);
    (value - half, value + half)
}

/// Half the width of the 95 % interval of a normally distributed estimate, in the unit of its standard error.
pub fn half_width_95(standard_error: f64) -> f64 {
    Z_975 * standard_error
}

/// The standard error whose 95 % interval this is: the reverse of [`confidence_interval_95`].
pub fn standard_error_of(low: f64, high: f64) -> f64 {
    0.5 * (high - low) / Z_975
}

/// An identified point of the map. Missing results are `None`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct IdentifiedPoint {
    /// Index of the step, from 0; files have its number, from 1.
    #[serde(with = "crate::test_plan::step_number")]
    pub step: usize,
    /// Whether the step was made for the map, or to detect drift.
    #[serde(default)]
    pub kind: StepKind,
    /// The target of the plan; `None` in imported recordings.
    pub target: Option<OperatingPoint>,
    /// Measured shaft speed at the end of the step, rpm.
    pub speed_rpm: f64,
    /// Commanded valve opening relative to the nominal area, or that of the flow if the valve does not follow; NaN (null in files) if unknown.
    #[serde(rename = "valve", deserialize_with = "nan_where_null")]
    pub valve_opening_ratio: f64,
    /// Compressor mass flow at the end of the step, kg/s.
    pub flow_kg_s: f64,
    /// Corrected mass flow at the end of the step, kg/s (the map contains the reference state).
    pub flow_corrected_kg_s: f64,
    /// Corrected shaft speed at the end of the step, rpm.
    pub speed_corrected_rpm: f64,
    /// Total pressure ratio P2/P1 at the end of the step.
    pub pressure_ratio: f64,
    /// Inlet total temperature (station 1) at the end of the step, K.
    pub t1_k: f64,
    /// Inlet total pressure (station 1) at the end of the step, Pa.
    pub p1_pa: f64,
    /// Isentropic efficiency, total to total, fraction: adiabatic for `dynamic` and `joint`, apparent for `steady`.
    pub eta: Option<f64>,
    /// Lower end of the 95 % interval of `eta`.
    pub eta_low: Option<f64>,
    /// Upper end of the 95 % interval of `eta`.
    pub eta_high: Option<f64>,
    /// Half of the 95 % range that is efficiency for the method but may be recirculation, recovery of the T2 probe or heat behind the wheel,
    /// fraction. Not part of the interval.
    #[serde(default)]
    pub eta_allowance: Option<f64>,
    /// Standard errors of `eta` by origin, fraction.
    pub eta_uncertainty: Option<EstimateUncertainty>,
    /// Heat-transfer coefficient between gas and compressor housing, W/(m2 K); `None` for `steady`.
    pub h_w_m2k: Option<f64>,
    /// Lower end of the 95 % interval of `h_w_m2k`.
    pub h_low_w_m2k: Option<f64>,
    /// Upper end of the 95 % interval of `h_w_m2k`.
    pub h_high_w_m2k: Option<f64>,
    /// Standard errors of `h_w_m2k` by origin, W/(m2 K).
    pub h_uncertainty: Option<EstimateUncertainty>,
    /// The part of these errors that the recording's other points share.
    #[serde(default)]
    pub common: CommonErrors,
    /// Method that identified it.
    pub method: Method,
    /// Whether to use it.
    pub verdict: Verdict,
    /// Reasons for a verdict other than good, and remarks.
    #[serde(serialize_with = "crate::json_messages::serialize")]
    pub warnings: Vec<Warning>,
    /// Part of the recording used.
    pub window: Option<Window>,
    /// Root mean square of the T2 residual, K.
    pub residual_rms_k: Option<f64>,
    /// Change of T2 over the window, K.
    pub dt2_k: Option<f64>,
    /// Change of the housing temperature over the window, K.
    pub dtc_k: Option<f64>,
}

impl IdentifiedPoint {
    /// Distances from `eta` to the ends of its 95 % interval, fraction: the interval of a mixture of models is not symmetric.
    pub fn eta_margins_95(&self) -> Option<Margins> {
        Some(Margins::new(self.eta?, self.eta_low?, self.eta_high?))
    }

    /// The same of `h_w_m2k`, W/(m2 K).
    pub fn h_margins_95_w_m2k(&self) -> Option<Margins> {
        Some(Margins::new(self.h_w_m2k?, self.h_low_w_m2k?, self.h_high_w_m2k?))
    }

    /// Standard error of `eta` that no other point shares, fraction; `None` without an interval.
    pub fn eta_own_standard_error(&self) -> Option<f64> {
        let all = standard_error_of(self.eta_low?, self.eta_high?);
        let common = self.common.eta_standard_error();
        Some((all * all - common * common).max(0.0).sqrt())
    }
}

/// Ratio of the distances to both ends of an interval up to which it is written with one number. Judgement: a half more on one side is what a
/// reader must know.
const SYMMETRIC_RATIO: f64 = 1.5;

/// Distances from a value to the ends of its interval, in the unit of the value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Margins {
    /// To the lower end, >= 0.
    pub below: f64,
    /// To the upper end, >= 0.
    pub above: f64,
}

impl Margins {
    /// Of a value in the interval from `low` to `high`. A value outside, as a bound may leave it, has no distance to that end.
    pub fn new(value: f64, low: f64, high: f64) -> Self {
        let distance = |difference: f64| if difference < 0.0 { 0.0 } else { difference };
        Margins { below: distance(value - low), above: distance(high - value) }
    }

    /// Distance to the farther end: an interval of this half width about the value contains the whole.
    pub fn farther(self) -> f64 {
        self.below.max(self.above)
    }

    /// Whether one number describes both ends.
    pub fn is_symmetric(self) -> bool {
        self.farther() <= SYMMETRIC_RATIO * self.below.min(self.above)
    }

    /// In another unit of `per_unit` to one of this.
    #[must_use]
    pub fn scaled(self, per_unit: f64) -> Self {
        Margins { below: per_unit * self.below, above: per_unit * self.above }
    }
}

/// Reads a number that is null in files if it is unknown.
pub fn nan_where_null<'de, D: serde::Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    Ok(Option::<f64>::deserialize(deserializer)?.unwrap_or(f64::NAN))
}

/// Expected result of the method for one step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MethodResult {
    /// Efficiency without noise, fraction.
    pub eta: f64,
    /// Standard error from declared noise and offsets, fraction.
    pub sigma_eta: f64,
    /// Heat-transfer coefficient without noise, W/(m2 K).
    pub h_w_m2k: f64,
    /// Standard error, W/(m2 K).
    pub sigma_h_w_m2k: f64,
}

/// Expected results of the method for all steps of a campaign.
#[derive(Debug, Clone, PartialEq)]
pub struct MethodResults {
    /// One result for each step, on a machine with the declared parameters.
    pub steps: Vec<Option<MethodResult>>,
    /// Standard error of each efficiency that the method reports after such a recording, fraction: it includes the values of alpha_A, probe,
    /// heating/cooling ratio and h before the wheel that these steps cannot exclude.
    pub reported_sigma_eta: Vec<Option<f64>>,
    /// The same on a machine whose alpha_A, probe and heating/cooling ratio each differ from the declaration by one standard deviation of
    /// such machines; empty if all of them are fixed.
    pub undeclared_sigma_eta: Vec<Option<f64>>,
    /// Efficiency error (rms, one sigma, fraction) that remains if the method has to identify the model parameters from these steps
    /// instead of relying on their declared values.
    pub parameter_error_eta: f64,
    /// Largest such error at which points can still be good, fraction.
    pub max_parameter_error_eta: f64,
}

/// Signed effects of a recording's common errors on one of its points.
///
/// Entry `k` of a list is the change due to one standard deviation of error `k`; error `k` is the same at every point of the
/// recording, and errors of different `k` are independent. The covariance of two points is therefore the sum of the products of
/// their entries. The variance of one point is the sum of the squares of its entries plus its own part, which no other
/// point shares. The lists of `eta` and of `h` number their errors independently.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct CommonErrors {
    /// Changes of `eta`, fraction; empty if no shared errors are known.
    pub eta_changes: Vec<f64>,
    /// Changes of `h`, W/(m2 K); empty if no shared errors are known.
    pub h_changes_w_m2k: Vec<f64>,
    /// Standard error that all corrected flows share (gain and offset of the flow meter, offsets of P1 and T1), ratio to
    /// the flow.
    pub flow_corrected_standard_error_ratio: f64,
    /// Standard error that all pressure ratios share (offsets and gains of P1 and P2), absolute.
    pub pressure_ratio_standard_error: f64,
}

impl CommonErrors {
    /// Standard error of `eta` from shared errors, fraction.
    pub fn eta_standard_error(&self) -> f64 {
        self.eta_changes.iter().map(|change| change * change).sum::<f64>().sqrt()
    }
}

/// One source of uncertainty.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct BudgetRow {
    /// Name, e.g. `offset of T1`.
    pub source: String,
    /// Standard uncertainty of the source, in `unit`.
    pub standard_uncertainty: f64,
    /// Unit of the source.
    pub unit: String,
    /// Change of the number per unit of the source.
    pub sensitivity: f64,
    /// Product of the two, in the unit of the number.
    pub contribution: f64,
    /// Degrees of freedom of the standard uncertainty; `None` for a declared uncertainty, which counts as exactly known.
    pub degrees_of_freedom: Option<f64>,
}

/// All sources of one number. They are independent of each other.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct UncertaintyBudget {
    /// The number.
    pub value: f64,
    /// The sources.
    pub rows: Vec<BudgetRow>,
    /// Half of its 95 % interval.
    pub expanded_uncertainty: f64,
    /// Ratio of that to the combined standard uncertainty.
    pub coverage_factor: f64,
    /// Degrees of freedom of the combined standard uncertainty by the formula of Welch and Satterthwaite; `None` if all are known exactly.
    pub degrees_of_freedom: Option<f64>,
}

impl UncertaintyBudget {
    /// The budget of a number with this half of its 95 % interval.
    pub fn of(value: f64, rows: Vec<BudgetRow>, expanded_uncertainty: f64) -> Self {
        let mut budget =
            UncertaintyBudget { value, rows, expanded_uncertainty, ..UncertaintyBudget::default() };
        let combined = budget.combined_standard_uncertainty();
        budget.coverage_factor = expanded_uncertainty / combined;
        let share = |row: &BudgetRow| Some(row.contribution.powi(4) / row.degrees_of_freedom?);
        let shares: f64 = budget.rows.iter().filter_map(share).sum();
        budget.degrees_of_freedom = (shares > 0.0).then(|| combined.powi(4) / shares);
        budget
    }

    /// Root of the sum of squares of the contributions, in the unit of the number.
    pub fn combined_standard_uncertainty(&self) -> f64 {
        self.rows.iter().map(|row| row.contribution * row.contribution).sum::<f64>().sqrt()
    }
}

/// The budgets of one point.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PointBudgets {
    /// Index of the step, from 0; files have its number, from 1.
    #[serde(with = "crate::test_plan::step_number")]
    pub step: usize,
    /// Efficiency, fraction.
    pub eta: Option<UncertaintyBudget>,
    /// What is efficiency for the method but may be something else, fraction.
    #[serde(default)]
    pub eta_allowance: Option<UncertaintyBudget>,
    /// Heat-transfer coefficient, W/(m2 K).
    pub h_w_m2k: Option<UncertaintyBudget>,
    /// Pressure ratio.
    pub pressure_ratio: UncertaintyBudget,
}

coded_enum! {
/// A remark on the results as a whole, by its stable code. `reason` is the message of the underlying error.
ResultRemark {
    /// A recording could be read in parts only; `file` is given if there are several.
    "recording_incomplete" RecordingIncomplete { file: Option<String>, reason: String },
    /// Channels of the usual method are missing, so that the efficiencies are those of conventional mapping.
    "conventional_mapping" ConventionalMapping { usual: Method, missing: Vec<Channel> },
    /// Parameters of `joint` keep their declared values; the result depends on them.
    "held_fixed" HeldFixed { parameters: Vec<String> },
    /// Gauge pressures are added to an ambient pressure that was not measured.
    "unknown_ambient_pressure" UnknownAmbientPressure { pressure_pa: f64, sigma_pa: f64 },
    /// The recording starts with the machine at rest, and the campaign does not use this as a zero.
    "unused_rest" UnusedRest { start_s: f64, end_s: f64 },
    /// All sensors of a kind contradict the cell's instrument at rest: `channel` is one of them, `reading` their common reading, `reference` that of
    /// the cell, `common_sigma` the resulting uncertainty of all of them, in the channel's unit.
    "cell_contradicts" CellContradicts { channel: Channel, reading: f64, reference: f64, common_sigma: f64 },
    /// A sensor has a periodic error at rest, amplitude in the channel's unit: pick-up that the sampling folds to a low frequency.
    "periodic_error" PeriodicError { channel: Channel, period_s: f64, amplitude: f64 },
    /// All speeds are those of the declared map or grid times `blades`/`set`: the speed sensor may be set to a wrong number of blades.
    "blade_count" BladeCount { blades: usize, set: usize },
    /// The points are corrected for a cause that the diagnosis names.
    "corrected" Corrected { causes: Vec<String>, probability: f64 },
    /// The intervals contain what causes of a gap would change for which the points are not corrected; largest standard uncertainty of an
    /// efficiency.
    "widened_by_gap" WidenedByGap { causes: Vec<String>, largest_sigma: f64 },
    /// The drift of a sensor was subtracted.
    "drift_subtracted" DriftSubtracted { reason: String },
    /// No map can be made from the points.
    "no_map" NoMap { reason: String },
    /// The map has no fitted surface.
    "map_not_fitted" MapNotFitted { reason: String },
    /// A map format was not written.
    "format_not_written" FormatNotWritten { reason: String },
    /// Another run has no map to compare with.
    "nothing_to_compare" NothingToCompare { run: String },
}
}

impl ResultRemark {
    /// Whether all efficiencies depend on it, so that it is shown next to their verdict.
    pub fn concerns_all_points(&self) -> bool {
        use ResultRemark::{
            CellContradicts, ConventionalMapping, Corrected, DriftSubtracted, HeldFixed, PeriodicError,
            UnknownAmbientPressure, WidenedByGap,
        };
        matches!(
            self,
            ConventionalMapping { .. }
                | HeldFixed { .. }
                | UnknownAmbientPressure { .. }
                | CellContradicts { .. }
                | PeriodicError { .. }
                | Corrected { .. }
                | WidenedByGap { .. }
                | DriftSubtracted { .. }
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The example of GUM H.1 (end gauge): contributions of 25, 9.7, 2.9 and 16.6 nm with 18, 25.6, exact and 2 degrees of freedom, rows of
    /// equal kind combined: 32 nm (31.7 without rounding) and 16 effective degrees of freedom, as the guide says with its 50 for the thermal row.
    #[test]
    fn an_interval_has_one_number_only_if_its_ends_are_alike() {
        let lopsided = Margins::new(0.731, 0.729, 0.740);
        assert!((lopsided.below - 0.002).abs() < 1e-12 && (lopsided.above - 0.009).abs() < 1e-12);
        assert!(!lopsided.is_symmetric());
        assert!(Margins::new(0.731, 0.721, 0.743).is_symmetric());
        // A value at its bound.
        assert_eq!(Margins::new(0.0, 0.0, 0.1), Margins { below: 0.0, above: 0.1 });
    }

    #[test]
    fn the_end_gauge_of_the_guide_has_its_combined_uncertainty() {
        let row = |contribution: f64, degrees_of_freedom: Option<f64>| BudgetRow {
            source: String::new(),
            standard_uncertainty: contribution,
            unit: "nm".to_owned(),
            sensitivity: 1.0,
            contribution,
            degrees_of_freedom,
        };
        let rows =
            vec![row(25.0, Some(18.0)), row(9.7, Some(25.6)), row(2.9, Some(50.0)), row(16.6, Some(2.0))];
        let budget = UncertaintyBudget::of(50_000_838.0, rows, 93.0);
        assert!((budget.combined_standard_uncertainty() - 31.7).abs() < 0.1, "{budget:?}");
        let freedom = budget.degrees_of_freedom.unwrap();
        assert!((16.0..17.5).contains(&freedom), "{freedom}");
    }
}

//! From a recording to points, one for each step, in three stages: what each step shows ([`Evidence`]), the estimates with the faults that
//! explain contradictions ([`Estimated`]), and the points.

use crate::config::missing;
use crate::estimates::Estimated;
use crate::evidence::Evidence;
use crate::faults::found_fault::{FoundFault, Suspect};
use crate::faults::nominal_rig::NominalRig;
use crate::joint::DynamicEfficiency;
use crate::points::points_with_budgets;
use crate::single_step::dynamic::FittedReadings;
use crate::step_data::humidity::with_measured_humidity;
use crate::turbine::turbine_points;
use crate::{IdentifyConfig, IdentifyError, StepError};
use mapper_core::{IdentifiedPoint, PointBudgets, Recording, ThermalModel, TurbineHousing, TurbinePoint};

/// Identifies every step of a recording, in order. Steps without a known position on the map are left out; [`identify_each`] names them with
/// the reason.
///
/// The state of a point (speed, flow, pressure ratio, T1, P1) is the mean over the last
/// [`end_mean_s`](crate::Thresholds::end_mean_s) of its step.
pub fn identify(
    recording: &Recording,
    config: &IdentifyConfig,
) -> Result<Vec<IdentifiedPoint>, IdentifyError> {
    Ok(identify_each(recording, config)?.into_iter().filter_map(Result::ok).collect())
}

/// Like [`identify`], with the reason for every step that gives no point.
pub fn identify_each(
    recording: &Recording,
    config: &IdentifyConfig,
) -> Result<Vec<Result<IdentifiedPoint, StepError>>, IdentifyError> {
    Ok(identify_recording(recording, config, None)?.points)
}

/// Result of the identification of a recording.
#[derive(Debug)]
pub struct Identified {
    /// One for each step, in order; with the reason if a step gives no point.
    pub points: Vec<Result<IdentifiedPoint, StepError>>,
    /// Shared parameters of the points; `None` if the method has none.
    pub thermal: Option<ThermalModel>,
    /// Result of the dynamic method for the same steps, if it gives one and was not the requested method.
    pub dynamic: Vec<DynamicEfficiency>,
    /// Faults of sensors or machine that explain contradictions in the recording; empty if there are none.
    pub faults: Vec<FoundFault>,
    /// One standard error of the size of each possible fault, in the fault's unit; infinite if the recording does not determine it. A fault of
    /// six standard errors is found in 95 of 100 recordings.
    pub detectable: Vec<(Suspect, f64)>,
    /// Uncertainty budgets of the points, in order.
    pub budgets: Vec<PointBudgets>,
    /// Each step, by its index, with the readings that the fit predicts.
    pub fitted: Vec<(usize, Vec<FittedReadings>)>,
    /// The turbine at the points whose turbine side was measured.
    pub turbine: Vec<TurbinePoint>,
    /// The heat balance of the turbine housing.
    pub turbine_housing: Option<TurbineHousing>,
}

/// Like [`identify_each`], with the shared parameters of the points (joint method alone). Compared with a declared rig, if one is given: points
/// are then doubtful if flow, speed or efficiencies differ from it by more than its tolerances.
pub fn identify_recording(
    recording: &Recording,
    config: &IdentifyConfig,
    nominal: Option<NominalRig<'_>>,
) -> Result<Identified, IdentifyError> {
    config.check()?;
    let config = &with_measured_humidity(recording, config);
    let missing = missing(recording, config.method);
    if !missing.is_empty() {
        return Err(IdentifyError::MissingChannels { method: config.method, missing });
    }
    if recording.steps.is_empty() {
        return Err(IdentifyError::NoSteps);
    }
    let evidence = Evidence::of(recording, config);
    let estimated = Estimated::of(evidence, recording, config, nominal.as_ref());
    let Estimated { steps, estimates, thermal, dynamic, faults, detectable } = estimated;
    let (points, budgets) = points_with_budgets(recording, steps, &estimates, &faults, config);
    let of_steps = points.iter().zip(&estimates);
    let with_errors =
        of_steps.filter_map(|(point, estimate)| Some((point.as_ref().ok()?, estimate.eta_errors.as_slice())));
    let (turbine, turbine_housing) = turbine_points(recording, with_errors, config);
    let fits = estimates.into_iter().map(|estimate| estimate.fitted);
    let fitted = recording.steps.iter().map(|step| step.index).zip(fits).collect();
    Ok(Identified { points, thermal, dynamic, faults, detectable, budgets, fitted, turbine, turbine_housing })
}

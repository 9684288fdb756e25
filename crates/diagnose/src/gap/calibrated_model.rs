//! Calibrated model: machine, effects and tolerances from a diagnosis, its forecasts, and their verification.

use crate::gap::best_fit::coordinate::coordinates;
use crate::gap::best_fit::fit::{Fit, changes_near, effect_changes};
use crate::gap::causes::additions::Calibration;
use crate::gap::next_experiment::{SimulatedRig, simulated_steps};
use crate::gap::preconditions::{GapError, Prepared};
use crate::gap::request::RigRecording;
use crate::gap::residuals::nuisance::{Nuisance, OFFSET_PREFIX, OUTPUTS};
use crate::gap::residuals::study::{Hypothesis, PredictError, Study};
use crate::gap::residuals::true_inputs::{Actuators, LinearisedMachine};
use crate::gap::residuals::whiten::{Linearised, dot, nuisance_changes};
use mapper_core::{Channel, half_width_95};
use mapper_identify::BLOCK_S;
use mapper_numerics::least_squares::FINE;
use mapper_observe::model_inputs::lagged_command::Response;
use mapper_physics::rig::effect::Effect;
use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::sync::Arc;

/// An effect with its values.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FoundEffect {
    /// Its id.
    pub id: String,
    /// One value per parameter, in its unit.
    pub values: Vec<f64>,
}

/// A tolerance or offset with its value.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FoundTolerance {
    /// Name of the tolerance.
    pub name: String,
    /// Fitted value, in the unit of the changed quantity; ratios for gains and scales.
    pub value: f64,
    /// Prior standard deviation.
    pub sigma: f64,
}

impl FoundTolerance {
    /// The channel whose offset it is; `None` for other tolerances.
    pub fn offset_of(&self) -> Option<Channel> {
        self.name.strip_prefix(OFFSET_PREFIX)?.parse().ok()
    }
}

/// A machine as identified by a diagnosis.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Found {
    /// Named effects; empty if none is named.
    pub effects: Vec<FoundEffect>,
    /// All tolerances and offsets.
    pub tolerances: Vec<FoundTolerance>,
    /// Covariance of the tolerances in sigmas, then of the effects in search coordinates (typical steps, or logarithms over decades).
    pub covariance: Vec<Vec<f64>>,
    /// Why this is not the best explanation of the recording; `None` if it is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub doubt: Option<String>,
}

/// Errors that prevent the verification of a calibrated model.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum CalibratedModelError {
    #[error(
        "the diagnosis has {theirs} tolerances, this campaign and recording have {ours} or others: use the campaign, channels and sensors of the diagnosis"
    )]
    Tolerances { theirs: usize, ours: usize },
    #[error("effect `{0}` of the diagnosis is not in the effect library; add it with --effect")]
    Effect(String),
    #[error(
        "the covariance of the diagnosis does not have {0} rows and columns, one for each tolerance and parameter"
    )]
    Covariance(usize),
    #[error(transparent)]
    Gap(#[from] GapError),
    #[error(transparent)]
    Predict(#[from] PredictError),
}

impl Found {
    /// The machine of a fit without its closure term; `None` if the covariance cannot be formed.
    pub(crate) fn of(study: &Study, fit: &Fit, doubt: Option<String>) -> Option<Found> {
        let Hypothesis { nuisances, mut effects } = fit.hypothesis.clone();
        // The closure term is the last effect, and `study` does not have it.
        effects.retain(|(index, _)| *index < study.effects.len());
        let size = nuisances.len() + effects.iter().map(|(_, values)| values.len()).sum::<usize>();
        let covariance = fit.precision.clone().cholesky()?.inverse();
        let covariance = covariance.view((0, 0), (size, size));
        let tolerance = |(nuisance, sigmas): (&Nuisance, &f64)| FoundTolerance {
            name: nuisance.kind.to_string(),
            value: nuisance.value(*sigmas),
            sigma: nuisance.sigma,
        };
        let found = |(index, values): (usize, Vec<f64>)| FoundEffect {
            id: study.effects[index].info().id.to_string(),
            values,
        };
        Some(Found {
            effects: effects.into_iter().map(found).collect(),
            tolerances: study.nuisances.iter().zip(&nuisances).map(tolerance).collect(),
            covariance: covariance.row_iter().map(|row| row.iter().copied().collect()).collect(),
            doubt,
        })
    }

    /// The hypothesis for another recording, whose initial state is unknown, with its covariance.
    fn hypothesis(&self, study: &Study) -> Result<(Hypothesis, DMatrix<f64>), CalibratedModelError> {
        let same = study.nuisances.len() == self.tolerances.len()
            && study
                .nuisances
                .iter()
                .zip(&self.tolerances)
                .all(|(n, found)| n.kind.to_string() == found.name);
        if !same {
            let (theirs, ours) = (self.tolerances.len(), study.nuisances.len());
            return Err(CalibratedModelError::Tolerances { theirs, ours });
        }
        let mut effects = Vec::new();
        for found in &self.effects {
            let index = (0..study.catalogue).find(|i| study.effects[*i].info().id == found.id.as_str());
            let index = index.ok_or_else(|| CalibratedModelError::Effect(found.id.clone()))?;
            effects.push((index, found.values.clone()));
        }
        let n = self.tolerances.len() + effects.iter().map(|(_, values)| values.len()).sum::<usize>();
        if self.covariance.len() != n || self.covariance.iter().any(|row| row.len() != n) {
            return Err(CalibratedModelError::Covariance(n));
        }
        let mut covariance = DMatrix::from_fn(n, n, |i, j| self.covariance[i][j]);
        let mut nuisances = Vec::with_capacity(self.tolerances.len());
        for (i, found) in self.tolerances.iter().enumerate() {
            if study.nuisances[i].kind.is_start() {
                covariance.row_mut(i).fill(0.0);
                covariance.column_mut(i).fill(0.0);
                covariance[(i, i)] = 1.0;
                nuisances.push(0.0);
            } else {
                nuisances.push((found.value - study.nuisances[i].centre) / study.nuisances[i].sigma);
            }
        }
        Ok((Hypothesis { nuisances, effects }, covariance))
    }
}

/// Verification of one channel's forecast.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ChannelCheck {
    /// Root mean square of measured minus forecast, in the channel's unit.
    pub rms: f64,
    /// Residual relative to the noise: 1 is pure noise.
    pub ratio: f64,
    /// Share of the values within the 95 % band.
    pub inside: f64,
    pub unit: String,
}

/// Verification of a forecast.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ForecastCheck {
    /// Residual of all channels relative to the noise: 1 is pure noise.
    pub ratio: f64,
    /// Share of all values within the 95 % band.
    pub inside: f64,
    /// Number of values.
    pub values: usize,
    /// Each channel.
    pub channels: BTreeMap<String, ChannelCheck>,
}

impl ForecastCheck {
    /// Compares a driven calibrated model with a recording that it was not fitted to: decorrelated block means, bands of noise and model.
    pub fn new(
        recorded: &RigRecording,
        effects: Vec<Arc<dyn Effect>>,
        found: &Found,
        calibration: &Calibration,
    ) -> Result<ForecastCheck, CalibratedModelError> {
        let study = &Prepared::new(recorded, calibration).zeroed.study(recorded, effects)?;
        let (hypothesis, covariance) = found.hypothesis(study)?;
        let nominal = Linearised::new(study)?;
        let there = nominal.at(study, &hypothesis)?;
        let at = coordinates(&study.effects, &hypothesis);
        let mut columns = there.columns.clone();
        columns.extend(effect_changes(study, &nominal, &hypothesis, &there.base, &at, FINE));
        let residual = nominal.residual(study, &there.base);
        let spread = |row: usize| {
            let j = DVector::from_fn(columns.len(), |i, _| columns[i][row]);
            1.0 + (covariance.clone() * &j).dot(&j).max(0.0)
        };
        let inside: Vec<f64> = residual
            .iter()
            .enumerate()
            .map(|(row, r)| f64::from(u8::from(r.abs() < half_width_95(spread(row).sqrt()))))
            .collect();
        let mut channels = BTreeMap::new();
        for (output, channel) in OUTPUTS.iter().enumerate() {
            let rows: Vec<usize> =
                study.groups.iter().filter(|g| g.output == output).flat_map(|g| g.rows.clone()).collect();
            if rows.is_empty() {
                continue;
            }
            let mean =
                |of: &dyn Fn(usize) -> f64| rows.iter().map(|row| of(*row)).sum::<f64>() / rows.len() as f64;
            let held = ChannelCheck {
                rms: mean(&|row| (study.measured[row] - there.base.values[row]).powi(2)).sqrt(),
                ratio: mean(&|row| residual[row] * residual[row]).sqrt(),
                inside: mean(&|row| inside[row]),
                unit: channel.unit().to_owned(),
            };
            channels.insert(channel.symbol().to_owned(), held);
        }
        let n = residual.len().max(1) as f64;
        Ok(ForecastCheck {
            ratio: (dot(&residual, &residual) / n).sqrt(),
            inside: inside.iter().sum::<f64>() / n,
            values: residual.len(),
            channels,
        })
    }
}

/// Forecast at the end of a step.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Expected {
    /// Index of the step, from 0; files use its number, from 1.
    #[serde(with = "mapper_core::test_plan::step_number")]
    pub step: usize,
    /// Each channel: value and half the width of its 95 % band, in the channel's unit.
    pub channels: BTreeMap<String, [f64; 2]>,
}

impl Found {
    /// Forecasts the ends of planned steps under the campaign's inputs. `planned`: a recording that has only steps.
    pub fn forecast(
        &self,
        planned: RigRecording,
        effects: Vec<Arc<dyn Effect>>,
    ) -> Result<Vec<Expected>, CalibratedModelError> {
        let declared = planned.declared();
        let lag = Response::lag(planned.tolerances.actuator_lag_s);
        let judged = planned.tolerances_declared;
        let rig = SimulatedRig {
            channels: declared.sensors.keys().copied().collect(),
            declared,
            model: planned.model,
            effects,
            actuators: Actuators { p3: lag, valve: Response::lag(0.0), judged },
        };
        let steps = planned.recording.steps;
        let rest = steps.first().and_then(|step| step.to);
        let study = rest.and_then(|rest| simulated_steps(rig, steps, &rest, BLOCK_S, |_| None));
        study.map_or_else(|| Ok(Vec::new()), |study| forecast(&study, self))
    }
}

/// Forecasts the ends of a study's steps; the bands include model uncertainty and the noise of a reading.
fn forecast(study: &Study, found: &Found) -> Result<Vec<Expected>, CalibratedModelError> {
    let (hypothesis, covariance) = found.hypothesis(study)?;
    let here = study.predict(&hypothesis)?;
    let machine = LinearisedMachine::of(&here.run);
    let mut columns = nuisance_changes(study, &hypothesis, &here, &machine);
    let at = coordinates(&study.effects, &hypothesis);
    columns.extend(changes_near(study, &machine, &hypothesis, &here, &at, FINE));
    let mut expected: Vec<Expected> =
        (0..study.steps.len()).map(|step| Expected { step, channels: BTreeMap::new() }).collect();
    for group in &study.groups {
        let Some(row) = group.rows.clone().last() else { continue };
        let j = DVector::from_fn(columns.len(), |i, _| columns[i][row]);
        let noise = study.declared.noise_sigma(OUTPUTS[group.output]);
        let sigma = ((covariance.clone() * &j).dot(&j).max(0.0) + noise * noise).sqrt();
        let channel = OUTPUTS[group.output].symbol().to_owned();
        expected[group.step].channels.insert(channel, [here.values[row], half_width_95(sigma)]);
    }
    Ok(expected)
}

//! Causes as fitted, and what they do to the readings of a recording and to the efficiencies identified from them.

use crate::closure::select::ClosureKey;
use crate::gap::best_fit::coordinate::{coordinates, hypothesis_at, unknowns};
use crate::gap::best_fit::fit::Fit;
use crate::gap::report::MapEffect;
use crate::gap::residuals::nuisance::{Circumstances, OUTPUTS};
use crate::gap::residuals::study::{Hypothesis, PredictError, Study};
use mapper_core::{Channel, IdentifiedPoint, Method, Recording, Series, half_width_95};
use mapper_identify::{IdentifyConfig, identify};
use mapper_observe::averages::{INPUT_CHANNELS, boundary_condition};
use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::rig::effect::{EffectError, Rig};
use mapper_physics::simulation::steady::Inputs;
use nalgebra::DMatrix;
use std::collections::BTreeMap;

#[derive(Debug, Clone)]
pub(crate) struct CauseFit {
    /// Tolerances and effects, by their index in the study.
    pub(crate) hypothesis: Hypothesis,
    /// Covariance of the effects' search coordinates; `None` if the recording does not determine them.
    pub(crate) covariance: Option<DMatrix<f64>>,
    /// The closure term that is its last effect, if any.
    pub(crate) closure: Option<ClosureKey>,
}

impl CauseFit {
    pub(crate) fn of(fit: &Fit, closure: Option<&ClosureKey>) -> CauseFit {
        let covariance = Some(&fit.covariance).filter(|all| all.iter().all(|one| one.is_finite()));
        let covariance = covariance.cloned();
        CauseFit { hypothesis: fit.hypothesis.clone(), covariance, closure: closure.cloned() }
    }
}

/// The fits on which everything rests that follows from a diagnosis.
#[derive(Debug, Clone)]
pub(crate) struct Fits {
    pub(crate) null: CauseFit,
    pub(crate) causes: Vec<CauseFit>,
    /// That of the closure term, also of one that is not probable.
    pub(crate) closure: Option<CauseFit>,
}

#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Changes {
    /// Start of the first step, s. Earlier readings, from which a zero may have been taken, stay unchanged.
    start_s: f64,
    /// Change of each channel along the recording, in its unit.
    channels: BTreeMap<Channel, Series>,
}

impl Changes {
    pub(crate) fn of(study: &Study, hypothesis: &Hypothesis) -> Result<Changes, PredictError> {
        let (start_s, end_s) = study.followed_s();
        let times_s = study.table.t_s[study.table.range(start_s, end_s)].to_vec();
        let with = |step: usize| study.rig(hypothesis, step);
        // An input sensor's error does not act on the machine; the machine's own map, shaft, turbine and valve are measured, not biased.
        let bare = Hypothesis { effects: Vec::new(), ..hypothesis.clone() };
        let without = |step: usize| -> Result<(Rig, Circumstances), EffectError> {
            let (mut rig, circumstances) = study.rig(&bare, step)?;
            let (own, Circumstances { perturbations, paths, valve, .. }) = with(step)?;
            rig.model.take_characteristics(&own.model);
            rig.instruments.valve = own.instruments.valve;
            Ok((rig, Circumstances { perturbations, paths, valve, ..circumstances }))
        };
        let mut changes = vec![vec![0.0; times_s.len()]; OUTPUTS.len()];
        study.read(hypothesis, with, &times_s, |index, output, reading, _| {
            changes[output][index] += reading;
        })?;
        study.read(hypothesis, without, &times_s, |index, output, reading, _| {
            changes[output][index] -= reading;
        })?;
        let series = |values: Vec<f64>| Series { t_s: times_s.clone(), values };
        // P3 is also an input, of which only the error of its sensor counts.
        let outputs = OUTPUTS.iter().zip(changes).filter(|(channel, _)| !INPUT_CHANNELS.contains(channel));
        let mut channels: BTreeMap<Channel, Series> =
            outputs.map(|(channel, values)| (*channel, series(values))).collect();
        let mut of_inputs = INPUT_CHANNELS.map(|_| Vec::with_capacity(times_s.len()));
        for t_s in &times_s {
            let step = study.steps.iter().rposition(|step| step.marker.start_s <= *t_s).unwrap_or(0);
            let inputs = |hypothesis: &Hypothesis| -> Result<BoundaryConditions, EffectError> {
                Ok(study.true_inputs(&study.rig(hypothesis, step)?.1).at(*t_s))
            };
            let (mut with, mut without) = (inputs(hypothesis)?, inputs(&bare)?);
            for (channel, values) in INPUT_CHANNELS.into_iter().zip(&mut of_inputs) {
                let value = |boundary: &mut BoundaryConditions| {
                    boundary_condition(boundary, channel).map_or(0.0, |value| *value)
                };
                values.push(value(&mut without) - value(&mut with));
            }
        }
        channels.extend(
            INPUT_CHANNELS.into_iter().zip(of_inputs).map(|(channel, values)| (channel, series(values))),
        );
        channels.retain(|_, change| change.values.iter().any(|value| *value != 0.0));
        let start_s = study.steps.first().map_or(start_s, |first| first.marker.start_s);
        Ok(Changes { start_s, channels })
    }

    pub(crate) fn are_none(&self) -> bool {
        self.channels.is_empty()
    }

    /// The recording without these changes; the nearest where the model does not follow: the first start and the last end.
    pub(crate) fn subtracted_from(&self, mut recording: Recording) -> Recording {
        for (channel, change) in &self.channels {
            let own = recording.series.get_mut(channel).into_iter();
            let elements = recording.elements.iter_mut().filter(|(element, _)| element.channel == *channel);
            for series in own.chain(elements.map(|(_, series)| series)) {
                for index in series.range(self.start_s, f64::INFINITY) {
                    series.values[index] -= change.interpolate(series.t_s[index]).unwrap_or(0.0);
                }
            }
        }
        recording
    }
}

/// The hypotheses one standard deviation away in each independent direction of a fit's effects; `None` if they are not determined.
pub(crate) fn one_sigma_away(study: &Study, fit: &CauseFit) -> Option<Vec<Hypothesis>> {
    let coordinates = coordinates(&study.effects, &fit.hypothesis);
    let mode = unknowns(&fit.hypothesis, &coordinates);
    let nuisances = fit.hypothesis.nuisances.len();
    let root = fit.covariance.clone()?.cholesky()?.l();
    let moved = root.column_iter().map(|direction| {
        let mut moved = mode.clone();
        for (index, by) in direction.iter().enumerate() {
            moved[nuisances + index] += by;
        }
        hypothesis_at(&fit.hypothesis, &coordinates, &moved)
    });
    Some(moved.collect())
}

/// The largest error of an efficiency, identified from each step by itself, that a cause makes; `None` if no step gives one.
pub(crate) fn map_effect(
    study: &Study,
    fit: &CauseFit,
    recording: &Recording,
    config: &IdentifyConfig,
) -> Option<MapEffect> {
    let config = IdentifyConfig { method: Method::Dynamic, ..config.clone() };
    let without = |hypothesis: &Hypothesis| -> Option<Vec<IdentifiedPoint>> {
        let changes = Changes::of(study, hypothesis).ok()?;
        identify(&changes.subtracted_from(recording.clone()), &config).ok()
    };
    let eta = |points: &[IdentifiedPoint], step: usize| points.iter().find(|point| point.step == step)?.eta;
    let (before, after) = (identify(recording, &config).ok()?, without(&fit.hypothesis)?);
    let moved = one_sigma_away(study, fit)?.iter().map(without).collect::<Option<Vec<_>>>()?;
    let effects = before.iter().filter_map(|point| {
        let corrected = eta(&after, point.step)?;
        let squares = moved.iter().filter_map(|moved| Some((eta(moved, point.step)? - corrected).powi(2)));
        Some(MapEffect {
            step: point.step,
            speed_rpm: point.speed_rpm,
            valve: point.valve_opening_ratio,
            eta_error: point.eta? - corrected,
            half_interval: half_width_95(squares.sum::<f64>().sqrt()),
        })
    });
    effects.max_by(|a, b| a.eta_error.abs().total_cmp(&b.eta_error.abs()))
}

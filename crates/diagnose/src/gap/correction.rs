//! Readings as they would have been without the causes that a diagnosis names.
//!
//! The model with the fitted causes and the same model without them follow the recording under the same true inputs. The difference of their
//! readings is subtracted from the measured readings, so that an efficiency identified from the result is that of the machine alone. The
//! difference depends on the model's map only as far as a cause depends on the operating point.

use crate::gap::best_fit::coordinate::{coordinates, parameters, set_parameter};
use crate::gap::best_fit::fit::Fit;
use crate::gap::diagnose::Diagnosed;
use crate::gap::findings::report::{Candidate, Verdict};
use crate::gap::residuals::nuisance::{Circumstances, OUTPUTS};
use crate::gap::residuals::study::{Hypothesis, PredictError, Study, members};
use mapper_core::{Channel, Recording, Series};
use mapper_observe::channels::{DRIVERS, boundary_condition};
use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::rig::effect::{EffectError, Rig};
use mapper_physics::simulation::inputs::Inputs;
use serde::Serialize;
use std::collections::BTreeMap;

/// What causes add to the readings of a recording.
#[derive(Debug, Clone, PartialEq)]
pub struct Changes {
    /// Start of the first step, s: at rest before it, a zero has been taken from the readings as they are.
    start_s: f64,
    /// For each channel its change along the recording, in the channel's unit.
    channels: BTreeMap<Channel, Series>,
}

impl Changes {
    /// What the effects of a hypothesis add to the readings of its study.
    ///
    /// # Errors
    /// [`PredictError`] if the model cannot follow.
    pub fn of(study: &Study, hypothesis: &Hypothesis) -> Result<Changes, PredictError> {
        let (start_s, end_s) = study.followed_s();
        let times_s = study.table.t_s[study.table.range(start_s, end_s)].to_vec();
        let with = |step: usize| study.rig(hypothesis, step);
        // The inputs are what they were: an error of their sensors is known, and does not act on the machine.
        let bare = Hypothesis { effects: Vec::new(), ..hypothesis.clone() };
        let without = |step: usize| -> Result<(Rig, Circumstances), EffectError> {
            let (rig, circumstances) = study.rig(&bare, step)?;
            let Circumstances { knobs, paths, .. } = with(step)?.1;
            Ok((rig, Circumstances { knobs, paths, ..circumstances }))
        };
        let mut changes = vec![vec![0.0; times_s.len()]; OUTPUTS.len()];
        study.read(hypothesis, with, &times_s, |index, output, reading, _| {
            changes[output][index] += reading;
        })?;
        study.read(hypothesis, without, &times_s, |index, output, reading, _| {
            changes[output][index] -= reading;
        })?;
        let series = |values: Vec<f64>| Series { t_s: times_s.clone(), values };
        // P3 is an input as well: only an error of its sensor counts.
        let outputs = OUTPUTS.iter().zip(changes).filter(|(channel, _)| !DRIVERS.contains(channel));
        let mut channels: BTreeMap<Channel, Series> =
            outputs.map(|(channel, values)| (*channel, series(values))).collect();
        let mut of_inputs = DRIVERS.map(|_| Vec::with_capacity(times_s.len()));
        for t_s in &times_s {
            let step = study.steps.iter().rposition(|step| step.marker.start_s <= *t_s).unwrap_or(0);
            let inputs = |hypothesis: &Hypothesis| -> Result<BoundaryConditions, EffectError> {
                Ok(study.true_inputs(&study.rig(hypothesis, step)?.1).at(*t_s))
            };
            let (mut with, mut without) = (inputs(hypothesis)?, inputs(&bare)?);
            for (channel, values) in DRIVERS.into_iter().zip(&mut of_inputs) {
                let value = |boundary: &mut BoundaryConditions| {
                    boundary_condition(boundary, channel).map_or(0.0, |value| *value)
                };
                values.push(value(&mut without) - value(&mut with));
            }
        }
        channels
            .extend(DRIVERS.into_iter().zip(of_inputs).map(|(channel, values)| (channel, series(values))));
        channels.retain(|_, change| change.values.iter().any(|value| *value != 0.0));
        let start_s = study.steps.first().map_or(start_s, |first| first.marker.start_s);
        Ok(Changes { start_s, channels })
    }

    /// The recording without these changes. Readings before the first step stay; where the model does not follow, at the start of the first
    /// step and the end of the last, the changes are the nearest.
    pub fn subtracted_from(&self, mut recording: Recording) -> Recording {
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

/// For each independent direction of the uncertainty of a fit's effects the hypothesis one standard deviation away; `None` if the recording
/// does not determine them.
pub fn one_sigma_away(study: &Study, fit: &Fit) -> Option<Vec<Hypothesis>> {
    let coordinates = coordinates(&study.effects, &fit.hypothesis);
    let values = parameters(&fit.hypothesis);
    let root = fit.covariance.clone().cholesky()?.l();
    let count = coordinates.len().min(root.nrows());
    let moved = (0..count)
        .map(|direction| {
            let mut moved = fit.hypothesis.clone();
            for (place, (coordinate, value)) in coordinates.iter().zip(&values).enumerate().take(count) {
                let by = root[(place, direction)];
                set_parameter(&mut moved, place, coordinate.value(coordinate.of(*value) + by));
            }
            moved
        })
        .collect();
    Some(moved)
}

/// Probability below which no map is corrected by a cause. Judgement: of the diagnoses that give more than this, 94 % are right on 2000
/// simulated campaigns (docs/validation/gap.md).
pub const NEEDED_PROBABILITY: f64 = 0.9;

/// A map before and after its correction for causes.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CorrectedMap {
    /// The causes, most probable first; more than one if a recording does not distinguish them.
    pub causes: Vec<Candidate>,
    /// Why nothing was corrected; `None` if it was.
    pub refused: Option<NotCorrected>,
    /// Points in order of their steps.
    pub points: Vec<PointCorrection>,
}

/// Why a map is not corrected.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "reason", rename_all = "snake_case")]
pub enum NotCorrected {
    /// The diagnosis names no cause.
    NoCause,
    /// The open causes together are less probable than [`NEEDED_PROBABILITY`].
    Improbable {
        /// Their probability.
        probability: f64,
    },
    /// The recording does not determine how large the causes are.
    Undetermined,
    /// Causes that the recording does not distinguish correct differently by more than the interval.
    Ambiguous {
        /// Number of the step where they differ most, relative to its interval.
        step: usize,
        /// Their largest difference there, fraction.
        difference: f64,
        /// Half of the 95 % interval there, fraction.
        half_interval: f64,
    },
}

/// Efficiency of a point before and after: value and ends of the 95 % interval, fraction.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PointCorrection {
    /// Number of the step, from 1.
    pub step: usize,
    /// Shaft speed, rpm.
    pub speed_rpm: f64,
    /// Valve opening.
    pub valve: f64,
    /// As recorded; `None` without a result.
    pub before: Option<[f64; 3]>,
    /// Without the causes; `None` without a result or a correction.
    pub after: Option<[f64; 3]>,
    /// Standard uncertainty of the correction, fraction.
    pub correction_sigma: f64,
}

impl Diagnosed {
    /// The open causes with their fits: the most probable first, as many as it takes to [`NEEDED_PROBABILITY`], and their probability
    /// together. None if the diagnosis names no cause of its library.
    pub fn open_causes(&self) -> (Vec<(&Candidate, &Fit)>, f64) {
        let mut causes: Vec<(&Candidate, &Fit)> = Vec::new();
        let mut probability = 0.0;
        if !matches!(self.diagnosis.verdict, Verdict::Explained | Verdict::PartlyExplained) {
            return (causes, probability);
        }
        let id = |index: &usize| self.study.effects[*index].info().id.to_string();
        for candidate in &self.diagnosis.candidates {
            if probability >= NEEDED_PROBABILITY {
                break;
            }
            let is_its = |fit: &&Fit| {
                let ids: Vec<String> = members(&fit.hypothesis).iter().map(id).collect();
                ids.len() == candidate.effects.len() && ids.iter().all(|id| candidate.effects.contains(id))
            };
            let Some(fit) = self.fits.iter().find(is_its) else { break };
            probability += candidate.probability;
            causes.push((candidate, fit));
        }
        (causes, probability)
    }
}

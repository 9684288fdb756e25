//! The readings of all runs compared with the model, and their responses to perturbations and causes.

use crate::drift::causes::{Cause, Drift, FOULING_FLOW_SHARE, is_relative};
use crate::drift::drive::{PERTURBATIONS, Prediction, difference_step};
use crate::drift::runs::{CampaignStep, Segment};
use mapper_core::Channel;
use mapper_inference::hypotheses::{Shape, TimeHistory};
use mapper_observe::averages::{INPUT_CHANNELS, OUTPUTS};
use mapper_observe::declared::Declared;
use mapper_observe::perturbation::Perturbation;
use nalgebra::{DMatrix, DVector};
use std::collections::BTreeMap;

/// Changes of the compared means, by segment, then, at the end of each step, of the efficiency (fraction), then of h, W/(m2 K).
pub(crate) type Response = DVector<f64>;

/// Means of [`OUTPUTS`] over a segment, measured and by the nominal model.
#[derive(Debug, Clone)]
pub(crate) struct SegmentMeans {
    pub segment: Segment,
    pub measured: [Option<f64>; OUTPUTS.len()],
    pub nominal: [f64; OUTPUTS.len()],
}

#[derive(Clone)]
pub(crate) struct Readings {
    pub runs: usize,
    pub steps: Vec<CampaignStep>,
    /// End of the first visit of a repeated point, campaign time, s: an earlier change is in every visit. `None` without repeats.
    pub unseen_before_s: Option<f64>,
    /// The compared segments.
    pub segments: Vec<Segment>,
    /// Compared channels, as positions in [`OUTPUTS`].
    pub columns: Vec<usize>,
    /// Reading minus model, channel by channel, segment by segment; one column.
    pub difference: DMatrix<f64>,
    /// Readings and points of the model; NaN for the points of steps that it cannot follow.
    pub model: Response,
    /// Response to each of [`PERTURBATIONS`], per unit.
    pub responses: Vec<Response>,
    /// Mean of each recorded input.
    pub input_levels: BTreeMap<Channel, f64>,
    /// Positions of the compared segments in `all`.
    pub kept: Vec<usize>,
    pub all: Vec<SegmentMeans>,
}

impl Readings {
    /// Number of compared means; each is a row.
    pub(crate) fn row_count(&self) -> usize {
        self.segments.len() * self.columns.len()
    }

    /// Positions of a step's efficiency and heat-transfer coefficient in a [`Response`].
    pub(crate) fn point_positions(&self, step: usize) -> [usize; 2] {
        let eta = self.row_count() + step;
        [eta, eta + self.steps.len()]
    }

    /// Step that an element of a [`Response`] belongs to.
    pub(super) fn step_of(&self, position: usize) -> usize {
        match position.checked_sub(self.row_count()) {
            Some(point) => point % self.steps.len(),
            None => self.segments[position / self.columns.len()].step,
        }
    }

    /// A response of the readings alone: `value` of each row and of its channel's position in [`OUTPUTS`].
    pub(crate) fn response_of_rows(&self, value: impl Fn(usize, usize) -> f64) -> Response {
        let rows = self.row_count();
        Response::from_fn(rows + 2 * self.steps.len(), |position, _| {
            if position < rows { value(position, self.columns[position % self.columns.len()]) } else { 0.0 }
        })
    }

    pub(super) fn response(&self, perturbation: Perturbation) -> Option<&Response> {
        self.responses.get(PERTURBATIONS.iter().position(|other| *other == perturbation)?)
    }

    /// Start of the campaign and end of its last step, campaign time, s.
    pub(super) fn span_s(&self) -> (f64, f64) {
        let start = self.steps.first().map_or(0.0, |step| step.start_s + step.offset_s);
        let end = self.steps.last().map_or(0.0, |step| step.end_s + step.offset_s);
        (start, end)
    }

    /// Response to a constant cause of unit size; `None` if no reading responds.
    pub(super) fn signature(&self, cause: Cause) -> Option<Response> {
        self.signature_of(cause, |_| true)
    }

    /// The part of a signature that a model run with the drift contains: all but the drift of output sensors.
    pub(crate) fn model_signature(&self, cause: Cause) -> Option<Response> {
        self.signature_of(cause, |channel| INPUT_CHANNELS.contains(channel))
    }

    fn signature_of(&self, cause: Cause, counts: impl Fn(&Channel) -> bool) -> Option<Response> {
        let signature = match cause {
            Cause::Sensors(channels) => channels
                .iter()
                .filter(|channel| counts(channel))
                .filter_map(|channel| self.sensor_signature(*channel))
                .reduce(|sum, other| sum + other)?,
            Cause::Fouling => {
                self.response(Perturbation::Efficiency)?
                    + self.response(Perturbation::Flow)? * FOULING_FLOW_SHARE
            }
            Cause::BearingFriction => self.response(Perturbation::Friction)?.clone(),
        };
        signature.iter().take(self.row_count()).any(|value| *value != 0.0).then_some(signature)
    }

    fn sensor_signature(&self, channel: Channel) -> Option<Response> {
        // An input that reads too high drives the model too high: the true value is lower.
        if INPUT_CHANNELS.contains(&channel) {
            return Some(self.response(Perturbation::Input(channel))? * -1.0);
        }
        let is_compared = self.columns.iter().any(|column| OUTPUTS[*column] == channel);
        is_compared.then(|| {
            self.response_of_rows(|row, output| match OUTPUTS[output] == channel {
                true if is_relative(channel) => self.model[row],
                true => 1.0,
                false => 0.0,
            })
        })
    }

    /// Whether a cause can have such a history: a step before the end of the first visit is a constant to all repeats.
    pub(super) fn is_seen(&self, history: &TimeHistory) -> bool {
        history.shape != Shape::Step || self.unseen_before_s.is_none_or(|end_s| history.onset >= end_s)
    }

    pub(super) fn mean_of(&self, row: usize, history: TimeHistory) -> f64 {
        let segment = &self.segments[row / self.columns.len()];
        let offset_s = self.steps[segment.step].offset_s;
        history.mean(segment.start_s + offset_s, segment.end_s + offset_s)
    }

    /// Change of the readings by a cause of size 1 with this signature and time history.
    pub(super) fn column(&self, signature: &Response, history: TimeHistory) -> DVector<f64> {
        DVector::from_fn(self.row_count(), |row, _| signature[row] * self.mean_of(row, history))
    }

    /// The same readings with another prediction; `None` if it does not cover all compared segments.
    pub(crate) fn with_prediction(&self, base: &Prediction, perturbed: &[Prediction]) -> Option<Readings> {
        let rows = self.row_count();
        let model = self.response_to(base);
        let response = |(perturbation, prediction): (&Perturbation, &Prediction)| {
            let mut response = (self.response_to(prediction) - &model) / difference_step(*perturbation);
            // Steps that the model cannot follow give no point.
            response.iter_mut().skip(rows).filter(|value| !value.is_finite()).for_each(|value| *value = 0.0);
            response
        };
        let columns = self.columns.len();
        let measured = |row: usize| self.all[self.kept[row / columns]].measured[self.columns[row % columns]];
        let difference = DMatrix::from_fn(rows, 1, |row, _| measured(row).unwrap_or(f64::NAN) - model[row]);
        let is_complete = difference.iter().all(|value| value.is_finite());
        let responses = PERTURBATIONS.iter().zip(perturbed).map(response).collect();
        is_complete.then(|| Readings { difference, model, responses, ..self.clone() })
    }

    fn response_to(&self, prediction: &Prediction) -> Response {
        let (rows, columns, steps) = (self.row_count(), self.columns.len(), self.steps.len());
        Response::from_fn(rows + 2 * steps, |position, _| match position.checked_sub(rows) {
            None => prediction.means[self.kept[position / columns]][self.columns[position % columns]],
            Some(point) if point < steps => prediction.step_ends[point].0,
            Some(point) => prediction.step_ends[point - steps].1,
        })
    }

    /// Subtracts the linear effect of a drift with this signature from the model.
    pub(crate) fn subtract_from_model(&mut self, signature: &Response, drift: &Drift) {
        for row in 0..self.row_count() {
            self.difference[row] += signature[row] * (drift.size * self.mean_of(row, drift.history));
        }
        for step in 0..self.steps.len() {
            let end_s = self.steps[step].end_s + self.steps[step].offset_s;
            for position in self.point_positions(step) {
                self.model[position] -= signature[position] * drift.at(end_s);
            }
        }
    }
}

/// Factor on declared tolerances: repeats distinguish a constant from drift whatever its size, so a wide prior costs nothing. Bound: the
/// turbine housing, whose initial state takes an hour to decay, may start 20 K off.
const TOLERANCE_FACTOR: f64 = 4.0;

/// Deviations of each operating point from the smooth model, common to its repeats: one standard deviation. Judgement: a tenth to a
/// third of the declared tolerances, which hold for the whole machine.
const OWN_DEVIATIONS: [(Perturbation, f64); 4] = [
    (Perturbation::Efficiency, 0.005),
    (Perturbation::Flow, 0.004),
    (Perturbation::TurbineEfficiency, 0.006),
    (Perturbation::CompressorConvection, 0.03),
];

/// The same for a speed, rpm. Bound: the ripple of speed controllers.
const OWN_SPEED_RPM: f64 = 40.0;
/// The same for P2, Pa. Bound: the setting of a valve repeats to so much.
const OWN_P2_PA: f64 = 50.0;
/// The same for a flow, as a ratio of the reading. Bound: the linearity of flow meters.
const OWN_FLOW_RATIO: f64 = 1e-3;
/// The same for T2, for Tc, and for the turbine's temperatures, K. Bound: the error of a lumped housing at another point.
const OWN_T2_K: f64 = 0.1;
/// As [`OWN_T2_K`]. Bound: as there.
const OWN_TC_K: f64 = 0.2;
/// As [`OWN_T2_K`]. Bound: as there.
const OWN_TURBINE_K: f64 = 0.4;

/// The same for a channel with this reading, in its unit.
fn own_deviation(channel: Channel, reading: f64) -> f64 {
    match channel {
        Channel::ShaftSpeed => OWN_SPEED_RPM,
        Channel::P2 => OWN_P2_PA,
        Channel::CompressorFlow | Channel::TurbineFlow => OWN_FLOW_RATIO * reading,
        Channel::T2 => OWN_T2_K,
        Channel::Tc => OWN_TC_K,
        _ => OWN_TURBINE_K,
    }
}

/// Sizes of the deviations of the operating points, relative to those of a model within tolerance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct OwnFactors {
    pub all: f64,
    /// Further factor of the turbine side, whose slow variations it scales too.
    pub turbine: f64,
}

impl OwnFactors {
    fn of(self, is_turbine: bool) -> f64 {
        if is_turbine { self.all * self.turbine } else { self.all }
    }

    fn of_channel(self, channel: Channel) -> f64 {
        self.of(matches!(channel, Channel::TurbineFlow | Channel::Tt | Channel::T4))
    }
}

/// Responses to all constants of a campaign, each of one standard deviation.
pub(crate) fn constants(readings: &Readings, declared: &Declared, factors: OwnFactors) -> Vec<Response> {
    let mut constants = Vec::new();
    for (perturbation, response) in PERTURBATIONS.iter().zip(&readings.responses) {
        let sigma = match perturbation {
            Perturbation::Input(channel) => {
                let level = readings.input_levels.get(channel).copied().unwrap_or(0.0);
                declared_error(declared, *channel, level)
            }
            perturbation => TOLERANCE_FACTOR * perturbation.tolerance(&declared.tolerances),
        };
        if sigma <= 0.0 {
            continue;
        }
        // Each run has its own initial state.
        let of_one_run = matches!(perturbation, Perturbation::StartTc | Perturbation::StartTt);
        for run in 0..if of_one_run { readings.runs } else { 1 } {
            let acts_in = |step: usize| !of_one_run || readings.steps[step].run == run;
            constants.push(response_in(readings, response, sigma, &acts_in));
        }
    }
    for (output, channel) in OUTPUTS.iter().enumerate() {
        let error = |reading: f64| declared_error(declared, *channel, reading);
        constants.push(channel_response(readings, output, &error, &|_| true));
    }
    let conditions = readings.steps.iter().map(|step| step.condition + 1).max().unwrap_or(0);
    for condition in 0..conditions {
        let acts_in = |step: usize| readings.steps[step].condition == condition;
        for (perturbation, sigma) in OWN_DEVIATIONS {
            if let Some(response) = readings.response(perturbation) {
                let sigma = factors.of(perturbation == Perturbation::TurbineEfficiency) * sigma;
                constants.push(response_in(readings, response, sigma, &acts_in));
            }
        }
        for (output, channel) in OUTPUTS.iter().enumerate() {
            let factor = factors.of_channel(*channel);
            let deviation = |reading: f64| factor * own_deviation(*channel, reading);
            constants.push(channel_response(readings, output, &deviation, &acts_in));
        }
    }
    add_slow_variations(readings, declared, factors, &mut constants);
    constants.retain(|constant| constant.iter().take(readings.row_count()).any(|value| *value != 0.0));
    constants
}

/// Declared constant error of a reading, one standard deviation.
fn declared_error(declared: &Declared, channel: Channel, reading: f64) -> f64 {
    declared.of(channel).fixed_sigma(channel, reading)
}

/// Knot distance of slow variations, s. Bound: several steps of a minute, so that variations explain no single step, and a fraction of the
/// hour in which turbine housings settle.
const KNOT_S: f64 = 480.0;
/// Slow variation of the turbine side, K. Bound: model errors of its housing take an hour to decay.
const TURBINE_VARIATION: [(Channel, f64); 2] = [(Channel::Tt, 0.2), (Channel::T4, 0.1)];
/// Maximum number of intervals between knots. Bound: effort; eight hours.
const MAX_INTERVALS: f64 = 60.0;

/// Adds time histories, linear between knots, of the air around the housings and of the turbine side. No drift has one, so none is hidden.
fn add_slow_variations(
    readings: &Readings,
    declared: &Declared,
    factors: OwnFactors,
    constants: &mut Vec<Response>,
) {
    let ambient_k = Perturbation::Ambient.tolerance(&declared.tolerances);
    let (start_s, end_s) = readings.span_s();
    let count = ((end_s - start_s) / KNOT_S).ceil().clamp(1.0, MAX_INTERVALS);
    for knot in 0..=count as usize {
        let hat = |segment: &Segment| {
            let t_s = 0.5 * (segment.start_s + segment.end_s) + readings.steps[segment.step].offset_s;
            let place = (t_s - start_s) / (end_s - start_s).max(1.0) * count;
            (1.0 - (place - knot as f64).abs()).max(0.0)
        };
        let variation = |value: &dyn Fn(usize, usize) -> f64| {
            readings.response_of_rows(|row, output| {
                let size = hat(&readings.segments[row / readings.columns.len()]);
                if size > 0.0 { size * value(row, output) } else { 0.0 }
            })
        };
        if let Some(ambient) = readings.response(Perturbation::Ambient) {
            constants.push(variation(&|row, _| ambient_k * ambient[row]));
        }
        for (channel, sigma) in TURBINE_VARIATION {
            let size = factors.of(true) * sigma;
            constants.push(variation(&|_, output| if OUTPUTS[output] == channel { size } else { 0.0 }));
        }
    }
}

/// A response of this many units in some steps.
fn response_in(
    readings: &Readings,
    response: &Response,
    units: f64,
    acts_in: &dyn Fn(usize) -> bool,
) -> Response {
    let value = |position: usize| {
        if acts_in(readings.step_of(position)) { units * response[position] } else { 0.0 }
    };
    Response::from_fn(response.len(), |position, _| value(position))
}

/// An error of one channel in some steps; `error` of its reading.
fn channel_response(
    readings: &Readings,
    output: usize,
    error: &dyn Fn(f64) -> f64,
    acts_in: &dyn Fn(usize) -> bool,
) -> Response {
    readings.response_of_rows(|row, column| {
        if column == output && acts_in(readings.step_of(row)) { error(readings.model[row]) } else { 0.0 }
    })
}

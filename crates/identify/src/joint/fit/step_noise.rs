//! The covariance of a step's residuals, and the whitening by it.
//!
//! The rows of T2 and those of Tc share the noise of every smoothed input, Tc's above all, so one covariance has both. It is the sum of: the noise
//! of T2; the noise of Tc, by its own rows and by the wall temperature that the gas sees; the noise of T1, pressures and flow as it passes
//! smoothing and model; the error of the surface's slope; and an unknown Tc at the first row.

use crate::IdentifyConfig;
use crate::joint::fit::solve::{Member, Problem};
use crate::joint::fit::whitening::Whitening;
use crate::joint::step_model::linearised::{Linearised, SmoothedInput};
use crate::joint::step_model::parameters::{
    ALPHA, EXPONENT, LN_COEFFICIENT, LN_HEATING_COOLING_RATIO, LN_INNER_CONDUCTANCE, LOGIT_INNER, PREHEAT,
    PROBE_MM2, Place, SHARED, SharedVector, TC_GAIN, TC_LAG,
};
use crate::joint::step_model::rows::StepRows;
use crate::joint::step_model::smoothing::{Basis, FLOW, P1, P2, SMOOTHED_COUNT, T1, TC};
use mapper_core::Channel;
use mapper_numerics::parallel;
use mapper_numerics::statistics::rms;
use nalgebra::{DMatrix, DVector};

/// Error of a reading that no noise describes, K: rounding and the equations. Bound: a tenth of the resolution of a logger, 0.01 K.
const FLOOR_K: f64 = 1e-3;
/// Error of Tc at the first row, K. Bound: far above its noise, so that it is unknown, and small enough for the numerics.
const UNKNOWN_START_K: f64 = 10.0;
/// Error of the surface's slope within a step, ratio, one standard deviation. Judgement: surfaces through a few points bend differently from
/// maps.
const SLOPE_SIGMA: f64 = 0.05;
/// Parameters of a step that its residual determines. Source: degrees of freedom: efficiency, first reading, h and heat.
const FITTED_PER_STEP: f64 = 3.0;
/// Minimum noise of a block mean without declared noise, K. Bound: rounding of readings to 0.001 K.
const MIN_NOISE_K: f64 = 3e-4;

/// The smoothed channels in the order of their places, with the channel of their noise.
const INPUTS: [(usize, SmoothedInput, Channel); SMOOTHED_COUNT] = [
    (T1, SmoothedInput::T1, Channel::T1),
    (TC, SmoothedInput::Tc, Channel::Tc),
    (P1, SmoothedInput::P1, Channel::P1),
    (P2, SmoothedInput::P2, Channel::P2),
    (FLOW, SmoothedInput::Flow, Channel::CompressorFlow),
];

/// How the noise of a smoothed input acts on the expected sum of squares: one value for each of its functions and each row.
struct InputWeight {
    place: usize,
    input: SmoothedInput,
    weights: DMatrix<f64>,
}

/// Parameters on which the effect of input noise depends, with the step of the derivative. Bound: small against the change of the effect.
const BY_INPUT_NOISE: [(Place, f64); 10] = [
    (LN_COEFFICIENT, 1e-3),
    (EXPONENT, 1e-3),
    (ALPHA, 1e-3),
    (PROBE_MM2, 1e-2),
    (LN_HEATING_COOLING_RATIO, 1e-3),
    (PREHEAT, 1e-2),
    (TC_LAG, 1e-2),
    (TC_GAIN, 1e-3),
    (LOGIT_INNER, 1e-2),
    (LN_INNER_CONDUCTANCE, 1e-2),
];

/// Sets the whitening of each step at the current parameters, and the expected sum of squares of input noise as a function of them.
///
/// T1, Tc, flow and pressures drive the prediction with what smoothing leaves of their noise, which the real gas does not see. A lagging probe, a
/// lagging Tc, a gain of Tc or a smaller h removes some of it from the residual. Least squares with fixed weights would therefore find a lag on every rig. The fit
/// subtracts the expected sum of squares of this noise (corrected least squares, e.g. Carroll et al., Measurement Error in Nonlinear Models, ch. 7).
pub(crate) fn set(problem: &mut Problem<'_>, config: &IdentifyConfig) -> Option<()> {
    let predictions = problem.predictions(&problem.shared, &problem.locals(), None);
    let walls = problem.walls(&predictions);
    let problem_now = &*problem;
    let wanted: Vec<(Place, f64)> =
        BY_INPUT_NOISE.into_iter().filter(|(index, _)| problem_now.active[*index]).collect();
    let places: Vec<usize> = (0..problem_now.members.len()).collect();
    let found = parallel::map(&places, |i| {
        let member = &problem_now.members[*i];
        let residual: Vec<f64> =
            member.measured_k.iter().zip(&predictions[*i].readings_k).map(|(a, b)| a - b).collect();
        let linearised = |shared: &SharedVector| {
            let wall = walls[*i].as_ref();
            problem_now.model.linearised(&member.history, shared, &member.local, Some(false), wall).0
        };
        let here = linearised(&problem_now.shared);
        let (covariance, inputs) = covariance(problem_now, member, &here, &residual, config);
        let inverse = mapper_numerics::least_squares::inverse(&covariance.clone().cholesky()?);
        let weights: Vec<InputWeight> = inputs.into_iter().map(|input| input.weight(&inverse)).collect();
        let mut slopes = [0.0; SHARED];
        if !weights.is_empty() && member.contributes {
            let smoothing = member.history.step.smoothing.as_ref()?;
            let expected = |linearised: &Linearised<'_>, shared: &SharedVector| -> f64 {
                weights
                    .iter()
                    .map(|weight| {
                        let responses =
                            responses(linearised, weight.input, &smoothing.channels[weight.place], shared);
                        weight.weights.dot(&responses.transpose())
                    })
                    .sum()
            };
            let now = expected(&here, &problem_now.shared);
            for (index, step) in &wanted {
                let mut moved = problem_now.shared;
                moved[*index] += step;
                slopes[*index] = (expected(&linearised(&moved), &moved) - now) / step;
            }
        }
        Some((Whitening::new(covariance)?, slopes))
    });
    let mut slopes = [0.0; SHARED];
    for (member, found) in problem.members.iter_mut().zip(found) {
        let (whitening, own) = found?;
        member.whitening = whitening;
        slopes.iter_mut().zip(own).for_each(|(sum, own)| *sum += own);
    }
    problem.input_noise = slopes;
    problem.input_noise_at = problem.shared;
    Some(())
}

/// A smoothed input in a step's covariance.
struct InputPart<'a> {
    place: usize,
    input: SmoothedInput,
    variance: f64,
    basis: &'a Basis,
    /// Change of the rows by each row of the input.
    by_rows: DMatrix<f64>,
    noise: &'a DMatrix<f64>,
}

impl InputPart<'_> {
    /// Derivative of the trace of inverse covariance times covariance by the input's responses.
    fn weight(&self, inverse: &DMatrix<f64>) -> InputWeight {
        let through = self.basis.values.tr_mul(self.noise) * self.by_rows.transpose() * inverse;
        InputWeight { place: self.place, input: self.input, weights: through * (2.0 * self.variance) }
    }
}

/// Changes of a step's rows by each function of a smoothed input.
fn responses(
    linearised: &Linearised<'_>,
    input: SmoothedInput,
    basis: &Basis,
    shared: &SharedVector,
) -> DMatrix<f64> {
    let columns: Vec<DVector<f64>> = (0..basis.values.ncols())
        .map(|k| {
            let (values, slopes) = (basis.values.column(k), basis.slopes.column(k));
            let (values, slopes): (Vec<f64>, Vec<f64>) =
                (values.iter().copied().collect(), slopes.iter().copied().collect());
            DVector::from_vec(linearised.by_input(input, &values, &slopes, shared))
        })
        .collect();
    DMatrix::from_columns(&columns)
}

/// The covariance that a step's rows have before anything is fitted.
pub(crate) fn start(step: &StepRows, rows: usize, config: &IdentifyConfig) -> Option<Whitening> {
    let noise_k = |channel: Channel| config.sensor(channel).noise_sigma.max(usual_noise_k());
    let count = step.rows.len();
    let mut covariance = DMatrix::zeros(rows, rows);
    for (from, channel) in [(0, Channel::T2), (count, Channel::Tc)] {
        if from + count <= rows {
            let own = noise_k(channel).powi(2) * &step.noise;
            covariance.view_mut((from, from), (count, count)).copy_from(&own);
        }
    }
    if rows > count {
        covariance.view_mut((count, count), (count, count)).add_scalar_mut(UNKNOWN_START_K.powi(2));
    }
    floor(&mut covariance);
    Whitening::new(covariance)
}

/// Noise of a thermocouple, K. Refined from the residual.
fn usual_noise_k() -> f64 {
    mapper_observe::declared::usual_noise_sigma(Channel::T2)
}

fn floor(covariance: &mut DMatrix<f64>) {
    for i in 0..covariance.nrows() {
        covariance[(i, i)] += FLOOR_K * FLOOR_K;
    }
}

/// The covariance, and the parts of it that smoothed inputs have.
fn covariance<'a>(
    problem: &Problem<'_>,
    member: &Member<'a>,
    linearised: &Linearised<'_>,
    residual: &[f64],
    config: &IdentifyConfig,
) -> (DMatrix<f64>, Vec<InputPart<'a>>) {
    let step = member.history.step;
    let mut parts = Vec::new();
    let (count, rows) = (step.rows.len(), residual.len());
    let mut sum = DMatrix::zeros(rows, rows);
    let undeclared = |part: &[f64]| {
        let square: f64 = part.iter().map(|r| r * r).sum();
        DMatrix::identity(count, count)
            * (square / (count as f64 - FITTED_PER_STEP).max(1.0)).max(MIN_NOISE_K * MIN_NOISE_K)
    };
    // Without a declaration the residual gives the noise.
    let own = |channel: Channel, part: &[f64]| {
        let sigma = config.sensor(channel).noise_sigma;
        if sigma > 0.0 { sigma * sigma * &step.noise } else { undeclared(part) }
    };
    sum.view_mut((0, 0), (count, count)).copy_from(&own(Channel::T2, &residual[..count]));
    let tc_sigma_k = config.sensor(Channel::Tc).noise_sigma;
    if rows > count && (tc_sigma_k == 0.0 || step.smoothing.is_none()) {
        let part = &residual[count..];
        let mean_k = part.iter().sum::<f64>() / count as f64;
        let about: Vec<f64> = part.iter().map(|r| r - mean_k).collect();
        sum.view_mut((count, count), (count, count)).copy_from(&own(Channel::Tc, &about));
    }
    if let Some(smoothing) = &step.smoothing {
        for (place, input, channel) in INPUTS {
            let sigma = config.sensor(channel).noise_sigma;
            let basis = &smoothing.channels[place];
            if sigma == 0.0 || basis.values.nrows() != count || basis.values.ncols() == 0 {
                continue;
            }
            let responses = responses(linearised, input, basis, &problem.shared);
            let mut by_rows = &responses * basis.values.transpose();
            if input == SmoothedInput::Tc && rows > count {
                // An error of Tc as read moves its own row against the prediction.
                for i in 0..count {
                    by_rows[(count + i, i)] -= 1.0;
                }
            }
            if input == SmoothedInput::Tc {
                sum += sigma * sigma * &by_rows * &step.noise * by_rows.transpose();
            } else {
                let own = basis.values.tr_mul(&(&step.noise * &basis.values));
                sum += sigma * sigma * &responses * own * responses.transpose();
            }
            parts.push(InputPart {
                place,
                input,
                variance: sigma * sigma,
                basis,
                by_rows,
                noise: &step.noise,
            });
        }
    }
    let shape = DVector::from_vec(linearised.by_surface(&member.history, &problem.shared));
    sum += SLOPE_SIGMA * SLOPE_SIGMA * &shape * shape.transpose();
    if rows > count {
        sum.view_mut((count, count), (count, count)).add_scalar_mut(UNKNOWN_START_K.powi(2));
    }
    floor(&mut sum);
    (sum, parts)
}

/// Mean square of a step's whitened residual: of T2, and of Tc given T2.
pub(crate) fn mean_squares(member: &Member<'_>, whitened: &[f64]) -> (f64, Option<f64>) {
    let count = member.history.step.rows.len();
    let (t2, tc) = whitened.split_at(count.min(whitened.len()));
    let square = |part: &[f64]| rms(part).map_or(0.0, |rms| rms * rms);
    (square(t2), (!tc.is_empty()).then(|| square(tc)))
}

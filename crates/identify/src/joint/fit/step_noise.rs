//! The covariance of a step's residuals, and the whitening by it.
//!
//! The rows of T2 and those of Tc share the noise of every smoothed input, Tc's above all, so one covariance has both. It is the sum of: the noise
//! of T2; the noise of Tc, by its own rows and by the wall temperature that the gas sees; the noise of T1, pressures and flow as it passes
//! smoothing and model; the error of the surface's slope; and an unknown Tc at the first row.

use crate::IdentifyConfig;
use crate::joint::fit::input_noise::{BY_INPUT_NOISE, InputNoise, Whitening};
use crate::joint::fit::solve::{Member, Problem};
use crate::joint::step_model::gas_path::Wanted;
use crate::joint::step_model::linearised::{Linearised, SmoothedInput, StepHistory};
use crate::joint::step_model::parameters::{ETA, LOCAL, SHARED, SharedVector, TC_LAG};
use crate::joint::step_model::rows::{Basis, FLOW, P1, P2, SMOOTHED_COUNT, Smoothing, StepRows, T1, TC};
use mapper_core::Channel;
use mapper_numerics::parallel;
use mapper_numerics::statistics::rms;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

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

/// Error of the slope of Tc that smoothing leaves, ratio to its root mean square in the window. A lag times it is the temperature that the
/// thermocouple has not reached: without this error the covariance is nearly singular, because a decay with the lag itself moves no
/// reading. Bound: functions of 3 and 8 s follow a decay of 2 to 5 s within a hundredth.
const SMOOTHED_SLOPE_RATIO: f64 = 0.01;
/// Time over which that error keeps its sign, s. Bound: between the two functions' times.
const SMOOTHED_SLOPE_S: f64 = 5.0;

/// Steps whose covariances are found before the old ones are dropped. Bound: enough for the cores of a computer, few of a long recording.
const AT_ONCE: usize = 16;

/// The smoothed channels in the order of their places, with the channel of their noise.
const INPUTS: [(usize, SmoothedInput, Channel); SMOOTHED_COUNT] = [
    (T1, SmoothedInput::T1, Channel::T1),
    (TC, SmoothedInput::Tc, Channel::Tc),
    (P1, SmoothedInput::P1, Channel::P1),
    (P2, SmoothedInput::P2, Channel::P2),
    (FLOW, SmoothedInput::Flow, Channel::CompressorFlow),
];

/// Sets the whitening of each step at the current parameters, and the expected sum of squares of input noise as a function of them.
///
/// T1, Tc, flow and pressures drive the prediction with what smoothing leaves of their noise, which the real gas does not see. A lagging probe, a
/// lagging Tc, a gain of Tc or a smaller h removes some of it from the residual. Least squares with fixed weights would therefore find a lag on
/// every rig, and take the noise of the derivatives for information. The fit subtracts the expected sum of squares of this noise (corrected
/// least squares, e.g. Carroll et al., Measurement Error in Nonlinear Models, ch. 7), as far as the parameters of the steps do not explain it.
pub(crate) fn set(problem: &mut Problem<'_>, config: &IdentifyConfig) -> Option<()> {
    let predictions = problem.predictions(&problem.shared, &problem.locals(), None);
    let parts = problem.parts(&predictions);
    let mut sum = InputNoise { at: problem.shared, ..InputNoise::none() };
    let places: Vec<usize> = (0..problem.members.len()).collect();
    for places in places.chunks(AT_ONCE) {
        let problem_now = &*problem;
        let found = parallel::map(places, |i| {
            let member = &problem_now.members[*i];
            let readings_k = &predictions[*i].readings_k;
            let residual: Vec<f64> = member.measured_k.iter().zip(readings_k).map(|(a, b)| a - b).collect();
            let linearised = |shared: &SharedVector, wanted: Wanted, known: Option<&Linearised<'_>>| {
                let (history, at) = (&member.history, (shared, &member.local));
                let paths = (known.is_none(), known);
                problem_now.model.linearised(history, at, Some(wanted), parts[*i].as_ref(), paths).0
            };
            let here = linearised(&problem_now.shared, Wanted::Law, None);
            let (covariance, inputs) = covariance(problem_now, member, &here, &residual, config);
            let whitening = Whitening::new(covariance)?;
            let noise = match member.history.step.smoothing.as_ref() {
                Some(smoothing) if member.contributes && !inputs.is_empty() => {
                    let own = OwnPart::of(problem_now, member, &here, &whitening)?;
                    Some(input_noise(
                        problem_now,
                        &inputs,
                        (&member.history, smoothing),
                        (&whitening, &own),
                        &|moved| linearised(moved, Wanted::Readings, Some(&here)),
                    )?)
                }
                _ => None,
            };
            Some((whitening, noise))
        });
        for (i, found) in places.iter().zip(found) {
            let (whitening, noise) = found?;
            problem.members[*i].whitening = whitening;
            if let Some((slopes, square)) = noise {
                sum.slope.iter_mut().zip(slopes).for_each(|(sum, own)| *sum += own);
                sum.square += square;
            }
        }
    }
    problem.input_noise = sum;
    Some(())
}

/// What the parameters of a step explain of its whitened rows.
struct OwnPart {
    columns: DMatrix<f64>,
    factor: Cholesky<f64, Dyn>,
}

impl OwnPart {
    fn of(
        problem: &Problem<'_>,
        member: &Member<'_>,
        linearised: &Linearised<'_>,
        whitening: &Whitening,
    ) -> Option<Self> {
        let columns: Vec<DVector<f64>> =
            (0..LOCAL).map(|index| DVector::from_vec(linearised.by_local(index))).collect();
        let columns = whitening.apply(&DMatrix::from_columns(&columns));
        let mut matrix = columns.tr_mul(&columns);
        for (index, prior) in member.priors.iter().enumerate() {
            let sigma = if index == ETA { problem.surface_sigma } else { prior.sigma };
            matrix[(index, index)] += 1.0 / (sigma * sigma);
        }
        Some(OwnPart { columns, factor: matrix.cholesky()? })
    }

    /// Whitened columns as the triangular factor sees them: the inner product of these is the explained part.
    fn explained(&self, whitened: &DMatrix<f64>) -> DMatrix<f64> {
        let mut along = self.columns.tr_mul(whitened);
        self.factor.l_dirty().solve_lower_triangular_mut(&mut along);
        along
    }
}

/// Slopes and squares of the expected sum of squares of a step's input noise, without what its own parameters explain.
fn input_noise<'a>(
    problem: &Problem<'_>,
    inputs: &[InputPart<'_>],
    (history, smoothing): (&StepHistory<'_>, &Smoothing),
    (whitening, own): (&Whitening, &OwnPart),
    linearised: &dyn Fn(&SharedVector) -> Linearised<'a>,
) -> Option<(SharedVector, DMatrix<f64>)> {
    let count = BY_INPUT_NOISE.len();
    // Per input: the rows that its noise has now, by its functions, and the factor of the functions' noise.
    let mut now = Vec::with_capacity(inputs.len());
    for part in inputs {
        let basis = &smoothing.channels[part.place].values;
        let of_functions = part.variance * basis.tr_mul(&(part.noise * basis));
        let factor = of_functions.cholesky()?.unpack();
        let rows = whitening.apply(&(part.variance * &part.by_rows * (part.noise * basis)));
        let along = own.explained(&rows);
        now.push((rows, along, factor));
    }
    let mut slopes = [0.0; SHARED];
    let mut moved_by: Vec<Option<(DMatrix<f64>, DMatrix<f64>)>> = Vec::with_capacity(count);
    for (index, step) in BY_INPUT_NOISE {
        if !problem.active[index] {
            moved_by.push(None);
            continue;
        }
        let mut moved = problem.shared;
        moved[index] += step;
        let there = linearised(&moved);
        let mut parts = Vec::with_capacity(inputs.len());
        for (part, (rows, along, factor)) in inputs.iter().zip(&now) {
            let basis = &smoothing.channels[part.place];
            let change = whitening
                .apply(&((responses((&there, history), part.input, basis, &moved) - &part.responses) / step));
            slopes[index] += 2.0 * (change.dot(rows) - own.explained(&change).dot(along));
            parts.push(change * factor);
        }
        let columns: Vec<DVector<f64>> =
            parts.iter().flat_map(|part| part.column_iter().map(|column| column.into_owned())).collect();
        let all = DMatrix::from_columns(&columns);
        let explained = own.explained(&all);
        moved_by.push(Some((all, explained)));
    }
    let square = DMatrix::from_fn(count, count, |a, b| match (&moved_by[a], &moved_by[b]) {
        (Some((all, explained)), Some((other, other_explained))) => {
            all.dot(other) - explained.dot(other_explained)
        }
        _ => 0.0,
    });
    Some((slopes, square))
}

/// A smoothed input in a step's covariance.
struct InputPart<'a> {
    place: usize,
    input: SmoothedInput,
    variance: f64,
    /// Change of the rows by each function of the input.
    responses: DMatrix<f64>,
    /// Change of the rows by each row of the input.
    by_rows: DMatrix<f64>,
    noise: &'a DMatrix<f64>,
}

/// Changes of a step's rows by each function of a smoothed input.
fn responses(
    (linearised, history): (&Linearised<'_>, &StepHistory<'_>),
    input: SmoothedInput,
    basis: &Basis,
    shared: &SharedVector,
) -> DMatrix<f64> {
    let columns: Vec<DVector<f64>> = (0..basis.values.ncols())
        .map(|k| {
            let (values, slopes) = (basis.values.column(k), basis.slopes.column(k));
            let (values, slopes): (Vec<f64>, Vec<f64>) =
                (values.iter().copied().collect(), slopes.iter().copied().collect());
            DVector::from_vec(linearised.by_input(history, input, &values, &slopes, shared))
        })
        .collect();
    DMatrix::from_columns(&columns)
}

/// Sets the whitening that each step has before anything is fitted.
pub(crate) fn begin(problem: &mut Problem<'_>, config: &IdentifyConfig) -> Option<()> {
    for member in &mut problem.members {
        member.whitening = start(member.history.step, member.measured_k.len(), config)?;
    }
    Some(())
}

fn start(step: &StepRows, rows: usize, config: &IdentifyConfig) -> Option<Whitening> {
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
            let responses = responses((linearised, &member.history), input, basis, &problem.shared);
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
                responses,
                by_rows,
                noise: &step.noise,
            });
        }
    }
    let shape = DVector::from_vec(linearised.by_surface(&member.history, &problem.shared));
    sum += SLOPE_SIGMA * SLOPE_SIGMA * &shape * shape.transpose();
    if rows > count {
        let mut tc = sum.view_mut((count, count), (count, count));
        tc.add_scalar_mut(UNKNOWN_START_K.powi(2));
        let slope_k_s = rms(step.rows.iter().map(|row| row.tc_slope_k_s)).unwrap_or(0.0);
        let left_k = SMOOTHED_SLOPE_RATIO * slope_k_s * problem.shared[TC_LAG];
        for (i, a) in step.rows.iter().enumerate() {
            for (j, b) in step.rows.iter().enumerate() {
                tc[(i, j)] += left_k * left_k * (-(a.t_s - b.t_s).abs() / SMOOTHED_SLOPE_S).exp();
            }
        }
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

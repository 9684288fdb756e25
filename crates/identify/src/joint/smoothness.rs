//! What the smoothness of an efficiency map says of the offsets.
//!
//! A fixed error of a temperature or pressure changes the efficiencies found by about one over the square of the speed: by
//! points at the slowest speed line and by tenths at the fastest. A map that bends so is unlikely, and how unlikely, the
//! points themselves say: the true efficiencies are taken for a Gaussian process over speed and flow (Rasmussen and
//! Williams, Gaussian Processes for Machine Learning, 2006, ch. 2 and 5) whose amplitude and lengths are averaged over with
//! the weights that the points give them. On a map that bends much by itself the offsets then keep their declared spread;
//! on a flat one they lose about half of it. Everything that errs with the efficiencies is corrected along with them.

use crate::joint::parameters::{
    ETA, EXPONENT, FLOW_GAIN, LN_COEFFICIENT, LN_DEVIATION, OFFSETS, SHARED, SURFACE, SharedVector,
};
use crate::joint::rows::StepRows;
use crate::joint::solve::{Covariance, Problem};
use crate::joint::surface::SurfaceScale;
use mapper_core::{EstimateUncertainty, ReferenceState};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// Standard deviations of the efficiencies about their mean, fraction: what maps of compressors show along a valve opening
/// and across.
const AMPLITUDES: [f64; 3] = [0.05, 0.1, 0.2];
/// Lengths over which efficiency changes with speed, in halves of the range of the points.
const SPEED_LENGTHS: [f64; 4] = [0.7, 1.0, 1.4, 2.0];
/// The same with flow at equal speed.
const FLOW_LENGTHS: [f64; 5] = [0.35, 0.5, 0.7, 1.0, 2.0];
/// What no smooth function follows, fraction.
const ROUGHNESSES: [f64; 2] = [1e-3, 4e-3];
/// Efficiency that small Reynolds numbers and leakage cost beyond that, fraction, one standard deviation, times the
/// middle speed over the speed, squared, less 1: it can not be told from an offset at all.
const SLOW_LOSS: f64 = 1e-2;
/// Mean of efficiencies and its standard deviation, fraction: any.
const MEAN: (f64, f64) = (0.65, 1.0);
/// Points from which on the weights are found from a part of them: the effort grows with the cube.
const MANY: usize = 120;
/// Points beyond which offsets keep their declared spread: the effort would be minutes.
const MOST: usize = 500;
/// Standard deviations by which a point may lie off what the others say before it is left out.
const FAR_SIGMAS: f64 = 4.0;
/// Share of the weight below which amplitude and lengths are not worth a solution.
const LEAST_WEIGHT: f64 = 0.01;

/// Declared standard deviations by which the offsets may have to be moved for a smooth map.
pub(crate) const STRAIN_SIGMAS: f64 = 3.0;

/// A number with its error by origin.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Judged {
    pub(crate) value: f64,
    pub(crate) uncertainty: EstimateUncertainty,
}

/// The numbers of all points, and the offsets.
#[derive(Debug, Clone)]
pub(crate) struct Smoothed {
    pub(crate) eta: Vec<Judged>,
    /// ln of h at the step's end, over what the fit has.
    pub(crate) ln_h: Vec<Judged>,
    /// For each shared parameter that was fitted or carried: by how much it moves, and its standard error then.
    pub(crate) shared: Vec<(f64, f64)>,
    /// How far the offsets were moved, in declared standard deviations.
    pub(crate) strain: f64,
}

/// A number that errs with the parameters: its covariance with every point's efficiency, its variance, its covariances
/// with the shared parameters.
struct Quantity {
    value: f64,
    by_eta: DVector<f64>,
    /// The part of `by_eta` that smoothness may speak of: what offsets and a step's own noise bring.
    by_smooth: DVector<f64>,
    variance: f64,
    by_shared: DVector<f64>,
}

/// One choice of amplitude and lengths, solved.
struct Solved {
    weight: f64,
    factors: Cholesky<f64, Dyn>,
    /// Inverse covariance times what the points are off the mean.
    drive: DVector<f64>,
}

/// Judges all numbers; as the fit has them where no offset is carried or the map is not followed.
pub(crate) fn smoothed(
    problem: &Problem<'_>,
    covariance: &Covariance,
    steps: &[StepRows],
    reference: ReferenceState,
) -> Smoothed {
    let (etas, ln_hs) = quantities(problem, covariance, steps);
    let shared: Vec<Quantity> = (0..covariance.fitted.len()).map(|row| of_shared(covariance, row)).collect();
    let carried: Vec<usize> =
        (0..covariance.fitted.len()).filter(|row| is_offset(covariance.fitted[*row])).collect();
    let places: Vec<(f64, f64)> = steps.iter().map(|step| step.end.place).collect();
    let scale = SurfaceScale::of(&places, reference);
    let few = etas.len() <= MOST;
    let solved = match scale.filter(|_| few && problem.setting.shaped && !carried.is_empty()) {
        None => Vec::new(),
        Some(scale) => {
            let coordinates: Vec<(f64, f64, f64)> = places
                .iter()
                .map(|place| {
                    let (u, v) = scale.coordinates(*place);
                    (u, v, scale.slowness(*place))
                })
                .collect();
            solve(&etas, &coordinates, problem)
        }
    };
    // Errors that offsets and what is assumed bring, before and after.
    let biased: Vec<usize> = (0..covariance.fitted.len())
        .filter(|row| (OFFSETS..SURFACE).contains(&covariance.fitted[*row]))
        .collect();
    let bias_of = |quantity: &Quantity, pull: Option<&DVector<f64>>| -> f64 {
        biased
            .iter()
            .map(|row| {
                let sigma2 = covariance.shared[(*row, *row)];
                let mut share = quantity.by_shared[*row];
                if let Some(pull) = pull {
                    share -=
                        pull.iter().zip(&etas).map(|(pull, eta)| pull * eta.by_shared[*row]).sum::<f64>();
                }
                share * share / sigma2
            })
            .sum()
    };
    let judge = |quantity: &Quantity| -> Judged {
        let parts: Vec<(f64, f64, f64, f64)> = if solved.is_empty() {
            vec![(1.0, quantity.value, quantity.variance, bias_of(quantity, None))]
        } else {
            solved
                .iter()
                .map(|one| {
                    let pull = one.factors.solve(&quantity.by_smooth);
                    let gain = 2.0 * quantity.by_eta.dot(&pull) - quantity.by_smooth.dot(&pull);
                    let bias = bias_of(quantity, Some(&pull));
                    let value = quantity.value - quantity.by_smooth.dot(&one.drive);
                    (one.weight, value, quantity.variance - gain, bias)
                })
                .collect()
        };
        let value: f64 = parts.iter().map(|(weight, value, _, _)| weight * value).sum();
        let variance: f64 =
            parts.iter().map(|(weight, own, variance, _)| weight * (variance + (own - value).powi(2))).sum();
        let bias: f64 = parts.iter().map(|(weight, _, _, bias)| weight * bias).sum::<f64>().min(variance);
        Judged {
            value,
            uncertainty: EstimateUncertainty {
                noise_standard_error: (variance - bias).max(0.0).sqrt(),
                bias_standard_error: bias.max(0.0).sqrt(),
            },
        }
    };
    let shared: Vec<(f64, f64)> = shared
        .iter()
        .map(&judge)
        .map(|judged| (judged.value, judged.uncertainty.combined_standard_error()))
        .collect();
    let strain = carried
        .iter()
        .map(|row| shared[*row].0.powi(2) / covariance.shared[(*row, *row)])
        .sum::<f64>()
        .sqrt();
    Smoothed {
        eta: etas.iter().map(&judge).collect(),
        ln_h: ln_hs.iter().map(&judge).collect(),
        shared,
        strain,
    }
}

fn is_offset(index: usize) -> bool {
    (OFFSETS..=FLOW_GAIN).contains(&index)
}

fn of_shared(covariance: &Covariance, row: usize) -> Quantity {
    let by_shared: DVector<f64> = covariance.shared.column(row).into_owned();
    let by_eta = DVector::from_iterator(
        covariance.answers.len(),
        covariance.answers.iter().map(|answer| answer.row(ETA).transpose().dot(&by_shared)),
    );
    let by_smooth = by_offsets(covariance, &by_shared);
    Quantity { value: 0.0, by_eta, by_smooth, variance: covariance.shared[(row, row)], by_shared }
}

/// Covariance of a quantity with every point's efficiency through the offsets alone.
fn by_offsets(covariance: &Covariance, by_shared: &DVector<f64>) -> DVector<f64> {
    let carried: Vec<(usize, f64)> = (0..covariance.fitted.len())
        .filter(|row| is_offset(covariance.fitted[*row]))
        .map(|row| (row, by_shared[row] / covariance.shared[(row, row)]))
        .collect();
    let of_step = |(_, mixed): &(_, nalgebra::Matrix4xX<f64>)| {
        carried.iter().map(|(row, factor)| factor * mixed[(ETA, *row)]).sum::<f64>()
    };
    DVector::from_iterator(covariance.own.len(), covariance.own.iter().map(of_step))
}

/// Covariance of one of a step's numbers with its efficiency when all that is shared is known.
fn alone(covariance: &Covariance, step: usize, index: usize) -> f64 {
    let (own, mixed) = &covariance.own[step];
    own[(index, ETA)] - mixed.row(index).dot(&covariance.answers[step].row(ETA))
}

/// Efficiency, and ln h over what the fit has, of every step.
fn quantities(
    problem: &Problem<'_>,
    covariance: &Covariance,
    steps: &[StepRows],
) -> (Vec<Quantity>, Vec<Quantity>) {
    let count = problem.members.len();
    let answers: Vec<DVector<f64>> =
        covariance.answers.iter().map(|answer| answer.row(ETA).transpose()).collect();
    let etas: Vec<Quantity> = (0..count)
        .map(|i| {
            let (own, mixed) = &covariance.own[i];
            let by_shared: DVector<f64> = mixed.row(ETA).transpose();
            let mut by_eta =
                DVector::from_iterator(count, answers.iter().map(|answer| answer.dot(&by_shared)));
            by_eta[i] = own[(ETA, ETA)];
            let mut by_smooth = by_offsets(covariance, &by_shared);
            by_smooth[i] += alone(covariance, i, ETA);
            let value = problem.members[i].local[ETA];
            Quantity { value, by_eta, by_smooth, variance: own[(ETA, ETA)], by_shared }
        })
        .collect();
    let ln_hs = (0..count)
        .map(|i| {
            let (own, mixed) = &covariance.own[i];
            let mut weights = [0.0; SHARED];
            if problem.setting.with_law {
                let at = |shared: &SharedVector| {
                    problem.setting.h_at_end(&steps[i].end, shared, &problem.members[i].local)
                };
                let (h_w_m2k, ln_re) = at(&problem.shared);
                weights[LN_COEFFICIENT] = 1.0;
                weights[EXPONENT] = ln_re;
                // The law is evaluated at the readings: an error of the flow is one of h by itself.
                for index in covariance.fitted.iter().copied().filter(|index| is_offset(*index)) {
                    let step = 0.1 * problem.priors[index].sigma;
                    let mut moved = problem.shared;
                    moved[index] += step;
                    weights[index] = (at(&moved).0 / h_w_m2k).ln() / step;
                }
            }
            let weights = DVector::from_iterator(
                covariance.fitted.len(),
                covariance.fitted.iter().map(|k| weights[*k]),
            );
            let deviation: DVector<f64> = mixed.row(LN_DEVIATION).transpose();
            let by_shared = &deviation + &covariance.shared * &weights;
            let mut by_eta =
                DVector::from_iterator(count, answers.iter().map(|answer| answer.dot(&by_shared)));
            by_eta[i] = own[(LN_DEVIATION, ETA)] + mixed.row(ETA).transpose().dot(&weights);
            let variance = own[(LN_DEVIATION, LN_DEVIATION)] + weights.dot(&(&by_shared + &deviation));
            let mut by_smooth = by_offsets(covariance, &by_shared);
            by_smooth[i] += alone(covariance, i, LN_DEVIATION);
            Quantity { value: 0.0, by_eta, by_smooth, variance, by_shared }
        })
        .collect();
    (etas, ln_hs)
}

/// All choices of amplitude and lengths that have a say.
fn solve(etas: &[Quantity], coordinates: &[(f64, f64, f64)], problem: &Problem<'_>) -> Vec<Solved> {
    let mut used: Vec<bool> = problem.members.iter().map(|member| member.shares).collect();
    let every = used.len().div_ceil(MANY).max(1);
    let mut choices = Vec::new();
    for amplitude in AMPLITUDES {
        for speed_length in SPEED_LENGTHS {
            for flow_length in FLOW_LENGTHS {
                choices.extend(ROUGHNESSES.map(|rough| [amplitude, speed_length, flow_length, rough]));
            }
        }
    }
    loop {
        let sample: Vec<usize> = (0..used.len()).filter(|i| used[*i]).step_by(every).collect();
        let evidence: Vec<f64> = choices
            .iter()
            .map(|choice| evidence(etas, coordinates, &sample, choice).unwrap_or(f64::NEG_INFINITY))
            .collect();
        let best = evidence.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        if !best.is_finite() {
            return Vec::new();
        }
        let relative: Vec<f64> = evidence.iter().map(|evidence| (evidence - best).exp()).collect();
        let total: f64 = relative.iter().sum();
        let solved: Option<Vec<Solved>> = choices
            .iter()
            .zip(&relative)
            .filter(|(_, weight)| **weight > LEAST_WEIGHT * total)
            .map(|(choice, weight)| {
                // What does not take part is given an error that leaves it without a say.
                let matrix = matrix(etas, coordinates, &(0..etas.len()).collect::<Vec<_>>(), choice, &used);
                let factors = matrix.cholesky()?;
                let off = DVector::from_iterator(etas.len(), etas.iter().map(|eta| eta.value - MEAN.0));
                Some(Solved { weight: *weight, drive: factors.solve(&off), factors })
            })
            .collect();
        let Some(mut solved) = solved else { return Vec::new() };
        let total: f64 = solved.iter().map(|one| one.weight).sum();
        solved.iter_mut().for_each(|one| one.weight /= total);
        let left = used.iter().filter(|used| **used).count();
        match farthest(&solved, &used) {
            // Never more than a fifth: then it is the map that is rough.
            Some(index) if 5 * (used.len() - left + 1) <= used.len() => used[index] = false,
            _ => return solved,
        }
    }
}

/// The point farthest off what the others say of it, where that is too far.
fn farthest(solved: &[Solved], used: &[bool]) -> Option<usize> {
    let best = solved.iter().max_by(|a, b| a.weight.total_cmp(&b.weight))?;
    let inverse = best.factors.inverse();
    (0..used.len())
        .filter(|i| used[*i])
        .map(|i| (i, best.drive[i].abs() / inverse[(i, i)].max(f64::MIN_POSITIVE).sqrt()))
        .filter(|(_, sigmas)| *sigmas > FAR_SIGMAS)
        .max_by(|a, b| a.1.total_cmp(&b.1))
        .map(|(i, _)| i)
}

/// Covariance of the efficiencies found at some of the points.
fn matrix(
    etas: &[Quantity],
    coordinates: &[(f64, f64, f64)],
    points: &[usize],
    [amplitude, speed_length, flow_length, roughness]: &[f64; 4],
    used: &[bool],
) -> DMatrix<f64> {
    DMatrix::from_fn(points.len(), points.len(), |row, column| {
        let (i, j) = (points[row], points[column]);
        let ((u, v, slow), (other_u, other_v, other_slow)) = (coordinates[i], coordinates[j]);
        let (by_speed, by_flow) = ((u - other_u) / speed_length, (v - other_v) / flow_length);
        let own = if i == j { roughness * roughness + if used[i] { 0.0 } else { 1e4 } } else { 0.0 };
        0.5 * (etas[i].by_eta[j] + etas[j].by_eta[i])
            + amplitude * amplitude * (-0.5 * (by_speed * by_speed + by_flow * by_flow)).exp()
            + SLOW_LOSS * SLOW_LOSS * slow * other_slow
            + MEAN.1 * MEAN.1
            + own
    })
}

/// Logarithm of the density of the points under a choice, but for a constant.
fn evidence(
    etas: &[Quantity],
    coordinates: &[(f64, f64, f64)],
    points: &[usize],
    choice: &[f64; 4],
) -> Option<f64> {
    let factors = matrix(etas, coordinates, points, choice, &vec![true; etas.len()]).cholesky()?;
    let off = DVector::from_iterator(points.len(), points.iter().map(|i| etas[*i].value - MEAN.0));
    let ln_determinant: f64 = factors.l_dirty().diagonal().iter().map(|x| x.ln()).sum();
    Some(-0.5 * off.dot(&factors.solve(&off)) - ln_determinant)
}

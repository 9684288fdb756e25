//! What a smooth efficiency map implies for the offsets.
//!
//! A constant error of a temperature or pressure changes the fitted efficiencies in proportion to about one over the square of the speed: by
//! points at the slowest speed line and by tenths at the fastest. A map of that shape is unlikely, and the points themselves determine how
//! unlikely. The true efficiencies are a Gaussian process over speed and flow (Rasmussen and Williams, Gaussian Processes for Machine
//! Learning, 2006, ch. 2 and 5). Its amplitude and lengths are averaged with their posterior weights. On a strongly curved map the offsets
//! keep their declared spread; on a flat one they lose about half of it. All quantities correlated with the efficiencies are corrected too.

use crate::faults::balances::efficiency::{FittedEfficiencies, FittedQuantity};
use crate::faults::end_readings::{CHANNELS, MAX_CORRELATED_ROWS};
use crate::faults::smooth::ANY_ROUGHNESS;
use crate::joint::fit::refinements::{Gain, Refinements};
use crate::joint::fit::solve::{Covariance, Problem};
use crate::joint::fit::start::SURFACE_SIGMA;
use crate::joint::step_model::parameters::{FLOW_GAIN, LOCAL, OFFSET_CHANNELS, OFFSETS, SURFACE};
use crate::joint::step_model::rows::StepRows;
use crate::joint::step_model::surface::{SLOW_LOSS, SurfaceScale};
use crate::joint::uncertainty::budget::{self, ReportedError};
use crate::joint::uncertainty::common_part::common_part;
use crate::joint::uncertainty::quantity::{Quantity, is_offset, of_shared, quantities};
use mapper_core::{BudgetRow, Channel, Dimension, EstimateUncertainty, confidence_interval_95};
use mapper_inference::mixture::MIN_WEIGHT;
use mapper_numerics::parallel;
use mapper_numerics::statistics::{EXCLUDE_SIGMAS, mean, median};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// Additional variance of a point that is not used. Bound: a million times that of any efficiency.
const UNUSED_VARIANCE: f64 = 1e4;

/// Standard deviations of the efficiencies about their mean, fraction. Bound: the range of compressor maps along a valve opening and
/// across.
const AMPLITUDES: [f64; 3] = [0.05, 0.1, 0.2];
/// Correlation lengths of efficiency over speed, in halves of the range of the points. Bound: the data choose among them; shorter ones
/// are roughness, longer ones a plane.
const SPEED_LENGTHS: [f64; 4] = [0.7, 1.0, 1.4, 2.0];
/// The same over flow at equal speed. Bound: the data choose among them.
const FLOW_LENGTHS: [f64; 5] = [0.35, 0.5, 0.7, 1.0, 2.0];
/// Deviation from any smooth function, fraction: of machines in simulation, and of a measured map.
const ROUGHNESSES: [f64; 2] = [SURFACE_SIGMA, ANY_ROUGHNESS];

/// A number with its error by origin.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct SmoothedValue {
    pub(crate) value: f64,
    pub(crate) uncertainty: EstimateUncertainty,
    /// Its 95 % interval: symmetric about the value for a normal distribution, otherwise the shortest one.
    pub(crate) interval: (f64, f64),
    /// Standard error without the interval's excess over the mixture, and that excess, which all numbers share.
    error: f64,
    added: f64,
}

/// The numbers of all points, and the offsets.
#[derive(Debug, Clone)]
pub(crate) struct Smoothed {
    pub(crate) eta: Vec<SmoothedValue>,
    /// ln of h at the step's end, relative to the fitted value.
    pub(crate) ln_h: Vec<SmoothedValue>,
    /// Effect of each common error of the points on every point's efficiency, and on its ln h.
    pub(crate) common: [Vec<Vec<f64>>; 2],
    /// Shift and resulting standard error of each shared parameter that was fitted or propagated.
    pub(crate) shared: Vec<(f64, f64)>,
    /// Sources of the uncertainty of each point's efficiency and of its ln h.
    pub(crate) budgets: Vec<[Vec<BudgetRow>; 2]>,
}

impl Smoothed {
    /// Median standard error of the efficiencies, fraction; infinite without any.
    pub(crate) fn middle_error(&self) -> f64 {
        let errors = self.eta.iter().map(|judged| judged.uncertainty.combined_standard_error());
        median(errors).unwrap_or(f64::INFINITY)
    }
}

/// Solution for one choice of amplitude and lengths.
struct Solved {
    weight: f64,
    factors: Cholesky<f64, Dyn>,
    /// Inverse covariance times the deviation of the points from the mean.
    drive: DVector<f64>,
    /// Change of ln of the weight per change of each point's efficiency.
    ln_weight: DVector<f64>,
}

/// Corrects all numbers; returns the fitted ones if no offset is propagated or the map does not support it.
pub(crate) fn smoothed(
    problem: &Problem<'_>,
    covariance: &Covariance,
    refined: Option<(&Refinements, &Gain)>,
    steps: &[StepRows],
) -> Smoothed {
    let (etas, ln_hs) = quantities(problem, covariance, steps);
    let carried = (0..covariance.fitted.len()).any(|row| is_offset(covariance.fitted[row]));
    let places: Vec<(f64, f64)> = steps.iter().map(|step| step.end.place).collect();
    let scale = SurfaceScale::of(&places);
    // With more, the computation would take minutes: offsets keep their declared spread.
    let few = etas.len() <= MAX_CORRELATED_ROWS;
    let slowness: Vec<f64> =
        scale.iter().flat_map(|scale| places.iter().map(|place| scale.slowness(*place))).collect();
    let solved = match scale.filter(|_| few && carried) {
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
    let mut smoothed = judged(covariance, refined, &etas, &ln_hs, &solved);
    smoothed.budgets =
        budgets((covariance, refined), &smoothed, (&etas, &ln_hs), (&solved, &slowness), steps);
    smoothed
}

/// The efficiencies from the steps alone, and the effect of reading errors on them: an error that the smoothness prior has removed no longer
/// counts against a map. Steps excluded from the shared parameters are left out.
pub(crate) fn as_measured(problem: &Problem<'_>, steps: &[StepRows]) -> Option<FittedEfficiencies> {
    let problem = &problem.without_a_surface()?;
    let covariance = &problem.covariance()?;
    let (etas, ln_hs) = quantities(problem, covariance, steps);
    let kept: Vec<usize> = (0..etas.len()).filter(|i| problem.members[*i].contributes).collect();
    let ln_h = |i: &usize| {
        problem.setting.h_at_end(&steps[*i].end, &problem.shared, &problem.members[*i].local).0.ln()
    };
    let fitted = |quantities: &[Quantity], value: &dyn Fn(&usize) -> f64| {
        let (without, by_reading) = without_readings(covariance, quantities, &kept, steps);
        FittedQuantity { values: kept.iter().map(value).collect(), covariance: without, by_reading }
    };
    Some(FittedEfficiencies {
        positions: kept.iter().map(|i| steps[*i].position).collect(),
        eta: fitted(&etas, &|i| etas[*i].value),
        ln_h: fitted(&ln_hs, &ln_h),
    })
}

/// Covariance of a quantity over the kept steps without the declared errors of the readings, and its sensitivities to them.
fn without_readings(
    covariance: &Covariance,
    quantities: &[Quantity],
    kept: &[usize],
    steps: &[StepRows],
) -> (DMatrix<f64>, Vec<[Option<f64>; 7]>) {
    // If the error is known, the efficiency rises by the amount that the error had lowered it.
    let answer = |i: usize, row: usize| quantities[i].by_shared[row] / covariance.shared[(row, row)];
    let carried: Vec<usize> =
        (0..covariance.fitted.len()).filter(|row| is_offset(covariance.fitted[*row])).collect();
    let by_readings = |i: usize, j: usize| {
        let one = |row: &usize| answer(i, *row) * answer(j, *row) * covariance.shared[(*row, *row)];
        carried.iter().map(one).sum::<f64>()
    };
    let by_reading = |i: usize| {
        CHANNELS.map(|channel| {
            let row = carried.iter().find(|row| channel_of(covariance.fitted[**row]) == Some(channel))?;
            let per_unit = -answer(i, *row);
            let flow_kg_s = steps[i].end.flow_kg_s;
            // The parameter of the flow meter is a gain.
            Some(if channel == Channel::CompressorFlow { per_unit / flow_kg_s } else { per_unit })
        })
    };
    let matrix = DMatrix::from_fn(kept.len(), kept.len(), |i, j| {
        let (one, other) = (&quantities[kept[i]], &quantities[kept[j]]);
        let all = if i == j {
            one.variance
        } else {
            0.5 * (one.answer.dot(&other.by_shared) + other.answer.dot(&one.by_shared))
        };
        all - by_readings(kept[i], kept[j])
    });
    (matrix, kept.iter().map(|i| by_reading(*i)).collect())
}

/// The channel whose error a shared parameter describes.
fn channel_of(index: usize) -> Option<Channel> {
    if index == FLOW_GAIN {
        return Some(Channel::CompressorFlow);
    }
    OFFSET_CHANNELS.get(index.checked_sub(OFFSETS)?).copied()
}

fn judged(
    covariance: &Covariance,
    refined: Option<(&Refinements, &Gain)>,
    etas: &[Quantity],
    ln_hs: &[Quantity],
    solved: &[Solved],
) -> Smoothed {
    let shared: Vec<Quantity> = (0..covariance.fitted.len()).map(|row| of_shared(covariance, row)).collect();
    // Errors from offsets and assumptions, before and after.
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
                    share -= pull.iter().zip(etas).map(|(pull, eta)| pull * eta.by_shared[*row]).sum::<f64>();
                }
                share * share / sigma2
            })
            .sum()
    };
    let judge = |quantity: &Quantity| -> SmoothedValue {
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
        let mixed = refined
            .and_then(|(refinements, gain)| refinements.interval(gain, &quantity.answer, value, variance));
        let error = variance.max(0.0).sqrt();
        let (interval, added) = mixed.unwrap_or_else(|| (confidence_interval_95(value, error), 0.0));
        let uncertainty = EstimateUncertainty {
            noise_standard_error: (variance + added * added - bias).max(0.0).sqrt(),
            bias_standard_error: bias.max(0.0).sqrt(),
        };
        SmoothedValue { value, uncertainty, interval, error, added }
    };
    let shared: Vec<(f64, f64)> = shared
        .iter()
        .map(&judge)
        .map(|judged| (judged.value, judged.uncertainty.combined_standard_error()))
        .collect();
    let (eta, ln_h) = (parallel::map(etas, judge), parallel::map(ln_hs, judge));
    let best = solved.iter().max_by(|a, b| a.weight.total_cmp(&b.weight));
    let common = [(etas, &eta), (ln_hs, &ln_h)].map(|(quantities, judged)| {
        let (covariance, own) = together(quantities, etas, best);
        let errors: Vec<f64> = judged.iter().map(|one| one.error).collect();
        let mut changes = common_part(&covariance, &own, &errors);
        if refined.is_some() {
            changes.iter_mut().zip(judged).for_each(|(changes, one)| changes.push(one.added));
        }
        changes
    });
    Smoothed { eta, ln_h, common, shared, budgets: Vec::new() }
}

/// The budgets of all points, in the units of the quantities.
fn budgets(
    (covariance, refined): (&Covariance, Option<(&Refinements, &Gain)>),
    smoothed: &Smoothed,
    (etas, ln_hs): (&[Quantity], &[Quantity]),
    (solved, slowness): (&[Solved], &[f64]),
    steps: &[StepRows],
) -> Vec<[Vec<BudgetRow>; 2]> {
    let steps: Vec<(usize, &StepRows)> = steps.iter().enumerate().collect();
    parallel::map(&steps, |(i, step)| {
        let of = |quantities: &[Quantity], judged: &[SmoothedValue]| {
            let quantity = &quantities[*i];
            let degrees_of_freedom = step.rows.len().saturating_sub(LOCAL).max(1) as f64;
            let reported =
                ReportedError { error: judged[*i].error, added: judged[*i].added, degrees_of_freedom };
            let pulls = Pulls::of(covariance, (quantity, etas), solved);
            let correction = |changes: &DVector<f64>, source: Option<usize>| {
                // Efficiency that is lost is a higher rise.
                pulls.correction(etas, changes, source.is_none_or(is_of_rise))
            };
            budget::rows(
                covariance,
                refined,
                (quantity, etas, *i),
                (&correction, pulls.pull[*i], slowness),
                &reported,
            )
        };
        [of(etas, &smoothed.eta), of(ln_hs, &smoothed.ln_h)]
    })
}

/// Response of the correction of a quantity to changes of the points' efficiencies.
struct Pulls {
    /// Change per change of each point's efficiency, with the sensitivities to the offsets as they are.
    pull: DVector<f64>,
    /// For each declared error: whether it is one of the measured rise, and the changes of the correction per relative change of each point's
    /// sensitivity to it.
    by_sensitivity: Vec<(bool, DVector<f64>)>,
}

impl Pulls {
    fn of(covariance: &Covariance, (quantity, etas): (&Quantity, &[Quantity]), solved: &[Solved]) -> Self {
        let count = etas.len();
        let correction = |one: &Solved| quantity.by_smooth.dot(&one.drive);
        let mean: f64 = solved.iter().map(|one| one.weight * correction(one)).sum();
        let choices: Vec<DVector<f64>> =
            solved.iter().map(|one| one.factors.solve(&quantity.by_smooth)).collect();
        let pull = solved.iter().zip(&choices).fold(DVector::zeros(count), |sum, (one, choice)| {
            // An error that makes the points less smooth also moves weight to rougher choices, which correct it less.
            sum + one.weight * (choice + (correction(one) - mean) * &one.ln_weight)
        });
        let rows = (0..covariance.fitted.len()).filter(|row| is_offset(covariance.fitted[*row]));
        let by_sensitivity = rows
            .map(|row| {
                let sigma2 = covariance.shared[(row, row)];
                let of = |quantity: &Quantity| quantity.by_shared[row] / sigma2;
                let sensitivity = DVector::from_iterator(count, etas.iter().map(of));
                let mut changes = DVector::zeros(count);
                for (one, choice) in solved.iter().zip(&choices) {
                    let left = of(quantity) - choice.dot(&sensitivity);
                    let implied = sensitivity.dot(&one.drive);
                    let weight = one.weight * sigma2;
                    changes += weight * (left * &one.drive - implied * choice);
                }
                changes.component_mul_assign(&sensitivity);
                (is_of_rise(covariance.fitted[row]), changes)
            })
            .collect();
        Pulls { pull, by_sensitivity }
    }

    /// Change of the correction by changes of the efficiencies. Efficiency is the isentropic over the measured rise: a change of the measured rise
    /// changes the sensitivities in proportion to the efficiency, and those to errors of the measured rise by twice as much; a change of the
    /// isentropic rise, only those.
    fn correction(&self, etas: &[Quantity], changes: &DVector<f64>, is_of_rise: bool) -> f64 {
        let relative = etas.iter().zip(changes.iter()).map(|(eta, change)| change / eta.value);
        let relative = DVector::from_iterator(etas.len(), relative);
        let power = |to_rise: bool| f64::from(u8::from(is_of_rise) + u8::from(to_rise));
        let by_sensitivity = self.by_sensitivity.iter();
        self.pull.dot(changes)
            + by_sensitivity.map(|(to_rise, by)| power(*to_rise) * by.dot(&relative)).sum::<f64>()
    }
}

/// Whether a declared error is one of the measured temperature rise; otherwise of the isentropic one.
fn is_of_rise(index: usize) -> bool {
    channel_of(index).is_some_and(|channel| channel.info().dimension == Dimension::Temperature)
}

/// Covariance of a quantity over all steps after the correction by the best choice, and the part of its diagonal that is each step's own.
fn together(quantities: &[Quantity], etas: &[Quantity], best: Option<&Solved>) -> (DMatrix<f64>, Vec<f64>) {
    let count = quantities.len();
    let mut matrix = DMatrix::from_fn(count, count, |i, j| {
        let (one, other) = (&quantities[i], &quantities[j]);
        // The noise of different steps is independent.
        if i == j { one.variance } else { one.answer.dot(&other.by_shared) }
    });
    let mut own: Vec<f64> = quantities.iter().map(|quantity| quantity.own_variance).collect();
    let Some(best) = best else { return (matrix, own) };
    let columns = |of: fn(&Quantity) -> &DVector<f64>| {
        DMatrix::from_columns(&quantities.iter().map(|quantity| of(quantity).clone()).collect::<Vec<_>>())
    };
    let (by_eta, by_smooth) = (columns(|quantity| &quantity.by_eta), columns(|quantity| &quantity.by_smooth));
    let pulls = best.factors.solve(&by_smooth);
    let cross = pulls.tr_mul(&by_eta);
    matrix += by_smooth.tr_mul(&pulls) - &cross - cross.transpose();
    for (i, own) in own.iter_mut().enumerate() {
        let pull = pulls[(i, i)];
        *own += pull * (pull * etas[i].own_variance - 2.0 * quantities[i].own_with_eta);
    }
    (matrix, own)
}

/// All choices of amplitude and lengths with sufficient weight.
fn solve(etas: &[Quantity], coordinates: &[(f64, f64, f64)], problem: &Problem<'_>) -> Vec<Solved> {
    let mut used: Vec<bool> = problem.members.iter().map(|member| member.contributes).collect();
    let level = mean(etas.iter().map(|eta| eta.value)).unwrap_or(0.0);
    let mut choices = Vec::new();
    for amplitude in AMPLITUDES {
        for speed_length in SPEED_LENGTHS {
            for flow_length in FLOW_LENGTHS {
                choices.extend(ROUGHNESSES.map(|rough| [amplitude, speed_length, flow_length, rough]));
            }
        }
    }
    // The cost grows with the cube: many points get their weights from a subset.
    let most = MAX_CORRELATED_ROWS as f64 / (choices.len() as f64).cbrt();
    let every = (used.len() as f64 / most).ceil().max(1.0) as usize;
    loop {
        let sample: Vec<usize> = (0..used.len()).filter(|i| used[*i]).step_by(every).collect();
        let found = parallel::map(&choices, |choice| evidence((etas, level), coordinates, &sample, choice));
        let best = found.iter().flatten().map(|(evidence, _)| *evidence).fold(f64::NEG_INFINITY, f64::max);
        if !best.is_finite() {
            return Vec::new();
        }
        let relative = |evidence: f64| (evidence - best).exp();
        let total: f64 = found.iter().flatten().map(|(evidence, _)| relative(*evidence)).sum();
        let solved: Option<Vec<Solved>> = choices
            .iter()
            .zip(&found)
            .filter_map(|(choice, found)| Some((choice, found.as_ref()?)))
            .filter(|(_, (evidence, _))| relative(*evidence) > MIN_WEIGHT * total)
            .map(|(choice, (evidence, drive))| {
                // Excluded points get an error so large that they have no weight.
                let matrix = matrix(etas, coordinates, &(0..etas.len()).collect::<Vec<_>>(), choice, &used);
                let factors = matrix.cholesky()?;
                let off = DVector::from_iterator(etas.len(), etas.iter().map(|eta| eta.value - level));
                let mut ln_weight = DVector::zeros(etas.len());
                sample.iter().zip(drive.iter()).for_each(|(place, drive)| ln_weight[*place] = -drive);
                Some(Solved { weight: relative(*evidence), drive: factors.solve(&off), factors, ln_weight })
            })
            .collect();
        let Some(mut solved) = solved else { return Vec::new() };
        let total: f64 = solved.iter().map(|one| one.weight).sum();
        solved.iter_mut().for_each(|one| one.weight /= total);
        let left = used.iter().filter(|used| **used).count();
        match farthest(&solved, &used) {
            // At most a fifth is left out: beyond that, the map itself is rough.
            Some(index) if 5 * (used.len() - left + 1) <= used.len() => used[index] = false,
            _ => return solved,
        }
    }
}

/// The point that differs most from its prediction by the others, if beyond the limit.
fn farthest(solved: &[Solved], used: &[bool]) -> Option<usize> {
    let best = solved.iter().max_by(|a, b| a.weight.total_cmp(&b.weight))?;
    let inverse = best.factors.inverse();
    (0..used.len())
        .filter(|i| used[*i])
        .map(|i| (i, best.drive[i].abs() / inverse[(i, i)].max(f64::MIN_POSITIVE).sqrt()))
        .filter(|(_, sigmas)| *sigmas > EXCLUDE_SIGMAS)
        .max_by(|a, b| a.1.total_cmp(&b.1))
        .map(|(i, _)| i)
}

/// Covariance of the efficiencies at a subset of the points.
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
        let own =
            if i == j { roughness * roughness + if used[i] { 0.0 } else { UNUSED_VARIANCE } } else { 0.0 };
        0.5 * (etas[i].by_eta[j] + etas[j].by_eta[i])
            + amplitude * amplitude * (-0.5 * (by_speed * by_speed + by_flow * by_flow)).exp()
            // It cannot be distinguished from an offset.
            + SLOW_LOSS * SLOW_LOSS * slow * other_slow
            // Any level: an uninformative prior about the mean of the points.
            + 1.0
            + own
    })
}

/// Log density of the points under a choice, up to a constant, and inverse covariance times the deviation of the points from the mean.
fn evidence(
    (etas, level): (&[Quantity], f64),
    coordinates: &[(f64, f64, f64)],
    points: &[usize],
    choice: &[f64; 4],
) -> Option<(f64, DVector<f64>)> {
    let factors = matrix(etas, coordinates, points, choice, &vec![true; etas.len()]).cholesky()?;
    let off = DVector::from_iterator(points.len(), points.iter().map(|i| etas[*i].value - level));
    let ln_determinant: f64 = factors.l_dirty().diagonal().iter().map(|x| x.ln()).sum();
    let drive = factors.solve(&off);
    Some((-0.5 * off.dot(&drive) - ln_determinant, drive))
}

//! Which cause, with which course: every one is tried against what is constant, and chance is simulated.

use crate::low_rank::LowRank;
use crate::report::{Alternative, DetectionLimit};
use crate::study::Readings;
use crate::{Cause, CauseKind, Course, CourseKind, DriftError};
use nalgebra::{DMatrix, DVector};
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;

/// Onsets that are tried over a campaign.
const ONSETS: usize = 36;
/// Onsets on the fine grid of the cause that is found.
const FINE_ONSETS: usize = 280;
/// Drift-free campaigns that set the threshold.
const NULL_CAMPAIGNS: usize = 300;
/// Share of drift-free campaigns that may be flagged.
const FALSE_ALARMS: f64 = 0.01;
/// Prior of sensors that seldom drift against those that do.
const SELDOM: f64 = 0.25;
/// A cause less probable than this is not called by its name alone.
const CLEAR: f64 = 0.5;
/// A stretch stands out when it lies so many times as far from the model as the middle one.
const FAR_OUT: f64 = 5.0;
const LEAVE_OUT_ROUNDS: usize = 4;
/// Factor on the variance of what is left out.
const AS_GOOD_AS_NOTHING: f64 = 1e8;
/// How far, relative, the size of a change of the machine may be off: its signature is that of a small change that has
/// always been there, while the metal lags behind a real one and answers to a large one differently.
const MACHINE_SIZE_ERROR: f64 = 0.12;
/// 95 % quantile of chi-square with one degree of freedom.
const CHI2_95: f64 = 3.841_458_820_694_124;
/// Half width of a 95 % interval in standard deviations.
const Z_975: f64 = 1.959_963_984_540_054;

/// What is found.
pub(crate) struct Decision {
    /// Whether chance is exceeded.
    pub flagged: bool,
    /// Whether the cause stands out from the others.
    pub clear: bool,
    /// Best cause.
    pub cause: Cause,
    /// Its best course.
    pub course: Course,
    /// Rate or step.
    pub size: f64,
    pub low: f64,
    pub high: f64,
    pub onset_low_s: f64,
    pub onset_high_s: f64,
    pub evidence: f64,
    pub threshold: f64,
    /// No drift and all causes, most probable first.
    pub probabilities: Vec<Alternative>,
    pub limits: Vec<DetectionLimit>,
    /// Stretches that the model cannot follow, and all.
    pub left_out: (usize, usize),
    /// Noise as found, for the constants.
    pub noise: LowRank,
    /// Readings less model, whitened.
    pub whitened: DMatrix<f64>,
    /// The cause with its course for size 1, whitened.
    pub whitened_cause: DMatrix<f64>,
}

struct Candidate {
    cause: usize,
    course: Course,
}

/// All candidates weighed against the readings.
struct Weighed {
    /// Evidence of each (twice the log of the likelihood ratio at its best size).
    evidence: Vec<f64>,
    /// Best size of each, and one standard deviation of it.
    size: Vec<f64>,
    sigma: Vec<f64>,
}

pub(crate) fn decide(
    readings: &Readings,
    mut own: Vec<DMatrix<f64>>,
    columns: &DMatrix<f64>,
    seed: u64,
) -> Result<Decision, DriftError> {
    let causes: Vec<(Cause, Vec<f64>)> = Cause::ALL
        .into_iter()
        .filter_map(|cause| Some((cause, readings.signature(cause)?.readings)))
        .filter(|(_, readings)| readings.iter().any(|value| *value != 0.0))
        .collect();
    let (start_s, end_s) = readings.span_s();
    let candidates: Vec<Candidate> = (0..causes.len())
        .flat_map(|cause| {
            courses(start_s, end_s, ONSETS).into_iter().map(move |course| Candidate { cause, course })
        })
        .collect();
    let shown = DMatrix::from_fn(readings.difference.len(), candidates.len(), |row, column| {
        let Candidate { cause, course } = &candidates[column];
        causes[*cause].1[row] * mean_of(readings, row, *course)
    });
    let difference = DMatrix::from_column_slice(readings.difference.len(), 1, &readings.difference);

    let left_out = leave_out(&mut own, readings, columns, &difference, &shown)?;
    // Twice: the noise that the best explanation leaves says how much more there is than declared.
    let mut noise = LowRank::new(&own, columns)?;
    inflate(&mut own, readings, &noise, &difference, &shown);
    noise = LowRank::new(&own, columns)?;

    let whitened = noise.whiten(difference);
    let whitened_shown = noise.whiten(shown);
    let inverse_shown = noise.inverse_times(&whitened_shown);
    let weighed = weigh(&causes, &candidates, &whitened, &whitened_shown, &inverse_shown);
    let threshold = threshold(&causes, &candidates, &noise, &whitened_shown, &inverse_shown, seed);

    let probabilities = probabilities(&causes, &candidates, &weighed, end_s - start_s);
    let best = (0..candidates.len())
        .max_by(|a, b| weighed.evidence[*a].total_cmp(&weighed.evidence[*b]))
        .ok_or_else(|| DriftError::Numbers {
            message: "no cause shows in the channels recorded".to_owned(),
        })?;
    let evidence = weighed.evidence[best];
    let flagged = evidence > threshold;
    // Among causes, the most probable one: it need not be that of the single best course.
    let top = probabilities
        .iter()
        .find_map(|alternative| alternative.cause)
        .unwrap_or(causes[candidates[best].cause].0);
    let top_probability =
        probabilities.iter().find(|other| other.cause == Some(top)).map_or(0.0, |other| other.probability);
    let of_top = |index: &usize| causes[candidates[*index].cause].0 == top;
    let best_of_top = (0..candidates.len())
        .filter(of_top)
        .max_by(|a, b| weighed.evidence[*a].total_cmp(&weighed.evidence[*b]))
        .unwrap_or(best);
    let cause_index = candidates[best_of_top].cause;
    let kind = candidates[best_of_top].course.kind;

    let fine: Vec<Candidate> = courses(start_s, end_s, FINE_ONSETS)
        .into_iter()
        .filter(|course| course.kind == kind)
        .map(|course| Candidate { cause: cause_index, course })
        .collect();
    let fine_shown = noise.whiten(DMatrix::from_fn(readings.difference.len(), fine.len(), |row, column| {
        causes[cause_index].1[row] * mean_of(readings, row, fine[column].course)
    }));
    let fine_inverse = noise.inverse_times(&fine_shown);
    let profile = weigh(&causes, &fine, &whitened, &fine_shown, &fine_inverse);
    let peak =
        (0..fine.len()).max_by(|a, b| profile.evidence[*a].total_cmp(&profile.evidence[*b])).unwrap_or(0);
    let within: Vec<usize> =
        (0..fine.len()).filter(|index| profile.evidence[*index] > profile.evidence[peak] - CHI2_95).collect();
    let extreme = |value: &dyn Fn(usize) -> f64, sign: f64| {
        sign * within.iter().map(|index| sign * value(*index)).fold(f64::NEG_INFINITY, f64::max)
    };
    let (mut low, mut high) = (
        extreme(&|index| profile.size[index] - Z_975 * profile.sigma[index], -1.0),
        extreme(&|index| profile.size[index] + Z_975 * profile.sigma[index], 1.0),
    );
    if top.kind() == CauseKind::Machine {
        let size = profile.size[peak];
        let wider = |end: f64| size + (end - size).signum() * (end - size).hypot(MACHINE_SIZE_ERROR * size);
        (low, high) = (wider(low), wider(high));
    }
    let limits = limits(&causes, &candidates, &weighed, threshold, start_s, end_s);
    Ok(Decision {
        flagged,
        clear: top_probability >= CLEAR,
        cause: top,
        course: fine[peak].course,
        size: profile.size[peak],
        low,
        high,
        onset_low_s: extreme(&|index| fine[index].course.onset_s, -1.0),
        onset_high_s: extreme(&|index| fine[index].course.onset_s, 1.0),
        evidence,
        threshold,
        probabilities,
        limits,
        left_out: (left_out, readings.blocks.len()),
        whitened_cause: fine_shown.columns(peak, 1).into_owned(),
        noise,
        whitened,
    })
}

/// Ramps from the start on, steps from after it; both until there is too little left to see them.
fn courses(start_s: f64, end_s: f64, count: usize) -> Vec<Course> {
    let length_s = end_s - start_s;
    let mut courses = Vec::new();
    for index in 0..count {
        let share = index as f64 / count as f64;
        if share <= 0.88 {
            courses.push(Course { kind: CourseKind::Ramp, onset_s: start_s + share * length_s });
        }
        // A step at the very start is a constant.
        if (0.04..=0.97).contains(&share) {
            courses.push(Course { kind: CourseKind::Step, onset_s: start_s + share * length_s });
        }
    }
    courses
}

fn mean_of(readings: &Readings, row: usize, course: Course) -> f64 {
    let block = &readings.blocks[row / readings.columns.len()];
    let offset_s = readings.steps[block.step].offset_s;
    course.mean(block.start_s + offset_s, block.end_s + offset_s)
}

/// Evidence, size and its standard deviation of each candidate.
fn weigh(
    causes: &[(Cause, Vec<f64>)],
    candidates: &[Candidate],
    whitened: &DMatrix<f64>,
    shown: &DMatrix<f64>,
    inverse: &DMatrix<f64>,
) -> Weighed {
    let along = inverse.tr_mul(whitened);
    let mut weighed = Weighed { evidence: Vec::new(), size: Vec::new(), sigma: Vec::new() };
    for (index, candidate) in candidates.iter().enumerate() {
        let information = shown.column(index).dot(&inverse.column(index));
        let (evidence, size) = evidence(causes[candidate.cause].0, along[(index, 0)], information);
        weighed.evidence.push(evidence);
        weighed.size.push(size);
        weighed.sigma.push(if information > 0.0 { information.sqrt().recip() } else { f64::INFINITY });
    }
    weighed
}

/// Evidence and best size; a bearing takes power and never gives any.
fn evidence(cause: Cause, along: f64, information: f64) -> (f64, f64) {
    if information <= 0.0 || !information.is_finite() || (cause == Cause::BearingFriction && along < 0.0) {
        return (0.0, 0.0);
    }
    (along * along / information, along / information)
}

/// What one drift-free campaign in a hundred reaches: campaigns of noise and constants alone, a Gumbel distribution
/// through the best evidence of each.
fn threshold(
    causes: &[(Cause, Vec<f64>)],
    candidates: &[Candidate],
    noise: &LowRank,
    shown: &DMatrix<f64>,
    inverse: &DMatrix<f64>,
    seed: u64,
) -> f64 {
    let mut rng = Pcg64::seed_from_u64(seed);
    let mut draw = |rows: usize| {
        DMatrix::from_fn(rows, NULL_CAMPAIGNS, |_, _| -> f64 { StandardNormal.sample(&mut rng) })
    };
    let readings = draw(inverse.nrows()) + noise.shown(&draw(noise.constants_count()));
    let along = inverse.tr_mul(&readings);
    let information: Vec<f64> =
        (0..candidates.len()).map(|index| shown.column(index).dot(&inverse.column(index))).collect();
    let best: Vec<f64> = along
        .column_iter()
        .map(|campaign| {
            candidates
                .iter()
                .enumerate()
                .map(|(index, candidate)| {
                    evidence(causes[candidate.cause].0, campaign[index], information[index]).0
                })
                .fold(0.0, f64::max)
        })
        .collect();
    let count = best.len() as f64;
    let mean = best.iter().sum::<f64>() / count;
    let variance = best.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / (count - 1.0);
    // Gumbel: standard deviation pi/sqrt(6) beta, mean mu + 0.5772 beta, quantile mu - beta ln(-ln q).
    let beta = variance.sqrt() * 6.0_f64.sqrt() / std::f64::consts::PI;
    const EULER: f64 = 0.577_215_664_901_532_9;
    mean - EULER * beta - beta * (-(1.0 - FALSE_ALARMS).ln()).ln()
}

/// Bayes factors over onset and course, with a prior of the size: most probable first.
fn probabilities(
    causes: &[(Cause, Vec<f64>)],
    candidates: &[Candidate],
    weighed: &Weighed,
    length_s: f64,
) -> Vec<Alternative> {
    let log_factor = |index: usize| {
        let Candidate { cause, course } = &candidates[index];
        let usual = match course.kind {
            CourseKind::Ramp => causes[*cause].0.usual_size() * 3600.0 / length_s,
            CourseKind::Step => causes[*cause].0.usual_size(),
        };
        let spread = (usual / weighed.sigma[index]).powi(2);
        0.5 * weighed.evidence[index] * spread / (1.0 + spread) - 0.5 * (1.0 + spread).ln()
    };
    let mut logs: Vec<(Option<Cause>, f64)> = vec![(None, 0.0)];
    for (position, (cause, _)) in causes.iter().enumerate() {
        let own: Vec<f64> = (0..candidates.len())
            .filter(|index| candidates[*index].cause == position)
            .map(log_factor)
            .collect();
        let largest = own.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let mean = own.iter().map(|log| (log - largest).exp()).sum::<f64>() / own.len().max(1) as f64;
        let usual = Cause::ALL.iter().take(8).any(|other| other == cause);
        let prior: f64 = if usual { 1.0 } else { SELDOM };
        logs.push((Some(*cause), largest + mean.ln() + (prior / Cause::ALL.len() as f64).ln()));
    }
    let largest = logs.iter().map(|(_, log)| *log).fold(f64::NEG_INFINITY, f64::max);
    let sum: f64 = logs.iter().map(|(_, log)| (log - largest).exp()).sum();
    let mut probabilities: Vec<Alternative> = logs
        .into_iter()
        .map(|(cause, log)| Alternative { cause, probability: (log - largest).exp() / sum })
        .collect();
    probabilities.sort_by(|a, b| b.probability.total_cmp(&a.probability));
    probabilities
}

/// Steady drift over the whole campaign whose expected evidence meets the threshold.
fn limits(
    causes: &[(Cause, Vec<f64>)],
    candidates: &[Candidate],
    weighed: &Weighed,
    threshold: f64,
    start_s: f64,
    end_s: f64,
) -> Vec<DetectionLimit> {
    candidates
        .iter()
        .enumerate()
        .filter(|(_, candidate)| {
            candidate.course.kind == CourseKind::Ramp && candidate.course.onset_s <= start_s
        })
        .map(|(index, candidate)| DetectionLimit {
            cause: causes[candidate.cause].0,
            change: threshold.max(0.0).sqrt() * weighed.sigma[index] * (end_s - start_s) / 3600.0,
            unit: causes[candidate.cause].0.unit(),
        })
        .collect()
}

/// Leaves out stretches that stand far out of all others even beside the best explanation: the model cannot follow the
/// machine there (surge, a valve at its stop). Gives their number.
fn leave_out(
    own: &mut [DMatrix<f64>],
    readings: &Readings,
    columns: &DMatrix<f64>,
    difference: &DMatrix<f64>,
    shown: &DMatrix<f64>,
) -> Result<usize, DriftError> {
    let count = readings.columns.len();
    let mut out = vec![false; own.len()];
    for _ in 0..LEAVE_OUT_ROUNDS {
        let noise = LowRank::new(own, columns)?;
        let left = unexplained(&noise, difference, shown);
        let sizes: Vec<f64> = (0..own.len())
            .map(|block| {
                left.rows(block * count, count).iter().map(|value| value * value).sum::<f64>() / count as f64
            })
            .collect();
        let mut kept: Vec<f64> =
            (0..own.len()).filter(|block| !out[*block]).map(|block| sizes[block]).collect();
        kept.sort_by(f64::total_cmp);
        let usual = kept.get(kept.len() / 2).copied().unwrap_or(1.0).max(1.0);
        let far: Vec<usize> = (0..own.len())
            .filter(|block| !out[*block] && sizes[*block] > FAR_OUT * FAR_OUT * usual)
            .collect();
        if far.is_empty() {
            break;
        }
        for block in far {
            out[block] = true;
            own[block] *= AS_GOOD_AS_NOTHING;
        }
    }
    Ok(out.iter().filter(|out| **out).count())
}

/// What constants and the best cause leave, whitened.
fn unexplained(noise: &LowRank, difference: &DMatrix<f64>, shown: &DMatrix<f64>) -> DMatrix<f64> {
    let whitened = noise.whiten(difference.clone());
    let whitened_shown = noise.whiten(shown.clone());
    let inverse_difference = noise.inverse_times(&whitened);
    let along = whitened_shown.tr_mul(&inverse_difference);
    let inverse_shown = noise.inverse_times(&whitened_shown);
    let mut best = (0.0, 0, 0.0);
    for index in 0..shown.ncols() {
        let information = whitened_shown.column(index).dot(&inverse_shown.column(index));
        if information > 0.0 {
            let evidence = along[(index, 0)].powi(2) / information;
            if evidence > best.0 {
                best = (evidence, index, along[(index, 0)] / information);
            }
        }
    }
    let explained = &whitened - whitened_shown.columns(best.1, 1) * best.2;
    noise.inverse_times(&explained)
}

/// Raises each channel's own noise to what the best explanation leaves.
fn inflate(
    own: &mut [DMatrix<f64>],
    readings: &Readings,
    noise: &LowRank,
    difference: &DMatrix<f64>,
    shown: &DMatrix<f64>,
) {
    let left = unexplained(noise, difference, shown);
    let count = readings.columns.len();
    let rows = left.nrows() as f64;
    // Constants take their share of the degrees of freedom.
    let free = (1.0 - noise.degrees_of_freedom() / rows).max(0.2);
    let factors: Vec<f64> = (0..count)
        .map(|column| {
            let own: Vec<f64> = left.iter().skip(column).step_by(count).map(|value| value * value).collect();
            (own.iter().sum::<f64>() / own.len().max(1) as f64 / free).max(1.0).sqrt()
        })
        .collect();
    let scale = DMatrix::from_diagonal(&DVector::from_vec(factors));
    for covariance in own {
        *covariance = &scale * &*covariance * &scale;
    }
}

//! All causes with all their time histories, as hypotheses of one likelihood; its noise with constants.

use crate::drift::causes::{Cause, RATE_PER_H};
use crate::drift::readings::{Readings, Response};
use crate::drift::runs::Unsolvable;
use mapper_inference::hypotheses::{Hypothesis, Likelihood, Priors, Shape, TimeHistory};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// Prior probability of a drift in a campaign. Bound: repeats are made if drift is expected; equal odds.
const EXPECTED_DRIFTS: f64 = 0.5;
/// Prior weight of a rare cause, relative to the others. Judgement: the compressor, its sensors and the flow meters drift; the other sensors are better
/// maintained, and few sensors share a part that drifts.
const RARE_CAUSE_WEIGHT: f64 = 0.25;

/// Number of fine onsets in a step of the grid, tried up to one grid step to either side of a detected cause. Bound: a step of P2 dated 40 s late leaves a
/// residual of twenty standard errors in one segment, which other causes would absorb.
const FINE_PER_GRID: usize = 8;

/// Number of onsets in the grid over a campaign. Bound: effort; the fit refines the onset of a detected cause.
pub(crate) const ONSETS: usize = 36;
/// Number of onsets of the fit over a campaign: closer than the compared segments.
pub(crate) const FINE_ONSETS: usize = ONSETS * FINE_PER_GRID;
/// Last onset of a ramp, as a share of a campaign. Bound: later, the remaining time does not suffice to detect it.
const LAST_RAMP_SHARE: f64 = 0.88;
/// First and last onset of a step, as shares of a campaign. Bound: at the start a step is a constant; at the end no repeat shows it.
const STEP_SHARES: std::ops::RangeInclusive<f64> = 0.04..=0.97;

/// A cause, by its position among the observable ones, with a time history.
#[derive(Debug, Clone, Copy)]
pub(crate) struct DatedCause {
    pub cause: usize,
    pub history: TimeHistory,
}

/// The observable causes, and all their time histories.
pub(crate) struct Candidates {
    pub causes: Vec<Cause>,
    pub all: Vec<DatedCause>,
    /// Change of the readings by each at size 1 (rate per hour, or step), a column each.
    pub columns: DMatrix<f64>,
    pub priors: Priors,
}

impl Candidates {
    /// All causes with the onsets of the grid, and finer onsets about those that are `known`.
    pub(super) fn new(readings: &Readings, known: &[(Cause, TimeHistory)]) -> Result<Candidates, Unsolvable> {
        let observable: Vec<(Cause, Response)> =
            Cause::all().into_iter().filter_map(|cause| Some((cause, readings.signature(cause)?))).collect();
        let (start_s, end_s) = readings.span_s();
        let mut histories = time_histories(start_s, end_s, ONSETS);
        histories.retain(|history| readings.is_seen(history));
        let mut all: Vec<DatedCause> = (0..observable.len())
            .flat_map(|cause| histories.iter().map(move |history| DatedCause { cause, history: *history }))
            .collect();
        let on_grid = all.len();
        let spacing_s = (end_s - start_s) / ONSETS as f64;
        for (known, history) in known {
            let Some(cause) = observable.iter().position(|(cause, _)| cause == known) else { continue };
            let fine = FINE_PER_GRID as f64;
            let shifts_s = (0..2 * FINE_PER_GRID).map(|part| ((part as f64 + 0.5) / fine - 1.0) * spacing_s);
            let onsets_s = shifts_s.map(|by_s| history.onset + by_s).chain([history.onset]);
            let within = onsets_s.filter(|onset_s| (start_s..end_s).contains(onset_s));
            let dated = within.map(|onset| TimeHistory { onset, ..*history });
            let seen = dated.filter(|history| readings.is_seen(history));
            all.extend(seen.map(|history| DatedCause { cause, history }));
        }
        if all.is_empty() {
            return Err(Unsolvable::NothingShows);
        }
        let weight = |cause: &Cause| if is_rare(*cause) { RARE_CAUSE_WEIGHT } else { 1.0 };
        let weights: f64 = observable.iter().map(|(cause, _)| weight(cause)).sum();
        let hypothesis = |(position, candidate): (usize, &DatedCause)| {
            let cause = observable[candidate.cause].0;
            // Fine onsets share the prior of their onset of the grid.
            let share = if position < on_grid { 1.0 } else { 0.5 / FINE_PER_GRID as f64 };
            let prior = share * EXPECTED_DRIFTS * weight(&cause) / weights / histories.len() as f64;
            Hypothesis {
                family: candidate.cause,
                sigma: cause.prior_sigma(candidate.history.shape, end_s - start_s),
                ln_prior: prior.ln(),
                at_least_zero: cause.is_at_least_zero(),
            }
        };
        let hypotheses = all.iter().enumerate().map(hypothesis).collect();
        let column =
            |DatedCause { cause, history }: &DatedCause| readings.column(&observable[*cause].1, *history);
        let columns: Vec<DVector<f64>> = all.iter().map(column).collect();
        Ok(Candidates {
            columns: DMatrix::from_columns(&columns),
            causes: observable.iter().map(|(cause, _)| *cause).collect(),
            priors: Priors { always: Vec::new(), hypotheses },
            all,
        })
    }

    /// Likelihood of the readings for all candidates, under this noise with its constants.
    pub(super) fn likelihood(&self, noise: &LowRank, difference: &DMatrix<f64>) -> Likelihood {
        let columns = noise.whiten(self.columns.clone());
        let inverse = noise.inverse_times(&columns);
        let gradient = inverse.tr_mul(&noise.whiten(difference.clone()));
        // `tr_mul` computes dot products one by one: five times as slow for a thousand columns.
        Likelihood::of(columns.transpose() * &inverse, gradient.column(0).into_owned())
    }

    pub(super) fn cause(&self, index: usize) -> Cause {
        self.causes[self.all[index].cause]
    }
}

fn is_rare(cause: Cause) -> bool {
    use mapper_core::Channel::{CompressorFlow, P2, T1, T2, Tc, TurbineFlow};
    match cause {
        Cause::Sensors([channel]) => ![T1, T2, Tc, P2, CompressorFlow, TurbineFlow].contains(channel),
        Cause::Sensors(_) => true,
        Cause::Fouling | Cause::BearingFriction => false,
    }
}

/// Ramps and steps with `count` onsets, as long as the remaining time suffices to detect them.
pub(crate) fn time_histories(start_s: f64, end_s: f64, count: usize) -> Vec<TimeHistory> {
    let length_s = end_s - start_s;
    let mut histories = Vec::new();
    for index in 0..count {
        let share = index as f64 / count as f64;
        let onset = start_s + share * length_s;
        if share <= LAST_RAMP_SHARE {
            histories.push(TimeHistory { onset, shape: RATE_PER_H });
        }
        if STEP_SHARES.contains(&share) {
            histories.push(TimeHistory { onset, shape: Shape::Step });
        }
    }
    histories
}

/// Noise with covariance D + U U'.
#[derive(Debug, Clone)]
pub(crate) struct LowRank {
    /// Lower Cholesky factor of each segment's own covariance.
    factors: Vec<DMatrix<f64>>,
    /// U, whitened by D: one column for each constant, scaled by its standard deviation.
    columns: DMatrix<f64>,
    /// I + U'U.
    inner: Cholesky<f64, Dyn>,
}

impl LowRank {
    /// `own` are the covariances of the segments, `columns` the effects of the constants on the readings.
    pub(super) fn new(own: &[DMatrix<f64>], columns: &DMatrix<f64>) -> Result<Self, Unsolvable> {
        let factors = own
            .iter()
            .map(|covariance| Some(Cholesky::new(covariance.clone())?.l()))
            .collect::<Option<Vec<_>>>()
            .ok_or(Unsolvable::NoNoise)?;
        let mut whitened = columns.clone();
        whiten_by(&factors, &mut whitened);
        if whitened.iter().any(|value| !value.is_finite()) {
            return Err(Unsolvable::NotFinite);
        }
        let inner = DMatrix::identity(whitened.ncols(), whitened.ncols()) + whitened.transpose() * &whitened;
        let inner = Cholesky::new(inner).ok_or(Unsolvable::Dependent)?;
        Ok(LowRank { factors, columns: whitened, inner })
    }

    /// Whitens by D alone, column by column.
    pub(crate) fn whiten(&self, mut values: DMatrix<f64>) -> DMatrix<f64> {
        whiten_by(&self.factors, &mut values);
        values
    }

    pub(crate) fn inverse_times(&self, whitened: &DMatrix<f64>) -> DMatrix<f64> {
        whitened - &self.columns * self.constants(whitened)
    }

    /// Most probable constants, in standard deviations, for whitened readings.
    pub(super) fn constants(&self, whitened: &DMatrix<f64>) -> DMatrix<f64> {
        self.inner.solve(&(self.columns.transpose() * whitened))
    }

    /// Posterior variance of a linear function of the constants.
    pub(super) fn variance(&self, weights: &DVector<f64>) -> f64 {
        weights.dot(&self.inner.solve(weights))
    }

    /// ln of the determinant of the covariance, whitened by D.
    pub(super) fn ln_determinant(&self) -> f64 {
        self.inner.ln_determinant()
    }

    /// Degrees of freedom used by the constants: the trace of the projection onto them.
    pub(super) fn degrees_of_freedom(&self) -> f64 {
        self.columns.ncols() as f64 - self.inner.inverse().trace()
    }
}

fn whiten_by(factors: &[DMatrix<f64>], values: &mut DMatrix<f64>) {
    let mut row = 0;
    for factor in factors {
        let size = factor.nrows();
        let mut part = values.rows_mut(row, size);
        // The factor of a positive definite matrix has no zero on its diagonal.
        let _ = factor.solve_lower_triangular_mut(&mut part);
        row += size;
    }
}

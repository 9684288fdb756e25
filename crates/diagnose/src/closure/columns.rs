//! Changes of the recording due to each term and source term, their products step by step, and the evidence of a few of them.

use crate::closure::term::{ClosureEffect, Term};
use crate::gap::best_fit::fit::Fit;
use crate::gap::residuals::nuisance::OUTPUTS;
use crate::gap::residuals::study::{Hypothesis, Study};
use crate::gap::residuals::whiten::{Linearised, rows_of_step};
use mapper_core::Channel;
use mapper_numerics::least_squares::DifferenceStep;
use mapper_numerics::{ROUNDING, parallel};
use nalgebra::{DMatrix, DVector};
use std::sync::Arc;

/// Squared length of a change that counts as none. Bound: a millionth of a sigma over the whole recording.
const NO_CHANGE: f64 = 1e-12;
/// Relative increase of the diagonal of a covariance. Bound: rounding of its factorisation.
const JITTER_RATIO: f64 = 1e-9;

/// Base hypothesis of the search: the null hypothesis, or a library cause that stays free during the search.
#[derive(Debug)]
pub(crate) struct Base<'a> {
    pub(crate) study: &'a Study,
    pub(crate) linearised: &'a Linearised,
    /// Nuisances and effects of the base.
    pub(crate) hypothesis: Hypothesis,
    pub(crate) residual: Vec<f64>,
    /// Whitened derivatives with respect to the base's effects.
    pub(crate) free: Vec<Vec<f64>>,
}

impl<'a> Base<'a> {
    /// The null hypothesis.
    pub(crate) fn nothing(study: &'a Study, linearised: &'a Linearised) -> Base<'a> {
        let residual = linearised.residual(study, &linearised.base);
        Base { study, linearised, hypothesis: study.nothing(), residual, free: Vec::new() }
    }

    /// A fitted cause.
    pub(crate) fn at_fit(study: &'a Study, linearised: &'a Linearised, fit: &Fit) -> Base<'a> {
        Base {
            study,
            linearised,
            hypothesis: fit.hypothesis.clone(),
            residual: fit.residual.clone(),
            free: fit.effect_columns.clone(),
        }
    }

    /// Whitened change for one step of each term's coefficient; `None` if the model cannot run with it or does not change.
    pub(crate) fn changes(&self, terms: &[Term]) -> Vec<Option<Vec<f64>>> {
        let mut changes = self.raw_changes(terms);
        for change in &mut changes {
            if let Some(values) = change {
                self.linearised.whiten(self.study, values);
                if values.iter().map(|c| c * c).sum::<f64>() < NO_CHANGE {
                    *change = None;
                }
            }
        }
        changes
    }

    /// Unwhitened changes, in the channels' units.
    pub(crate) fn raw_changes(&self, terms: &[Term]) -> Vec<Option<Vec<f64>>> {
        let mut own = self.study.clone();
        let first = own.effects.len();
        let runs = runs(terms);
        for run in &runs {
            let together = run.iter().map(|place| terms[*place].clone()).collect();
            own.add(Arc::new(ClosureEffect::new(together)));
        }
        let places: Vec<usize> = (0..runs.len()).collect();
        let distance = DifferenceStep::Coarse.distance();
        let changes = parallel::map(&places, |place| {
            let mut there = self.hypothesis.clone();
            let values = runs[*place].iter().map(|term| distance * terms[*term].step).collect();
            there.effects.push((first + place, values));
            let there = own.predict_linearly(&there, &self.linearised.machine).ok()?;
            let base = &self.linearised.base.values;
            let change = there.values.iter().zip(base).map(|(t, b)| (t - b) / distance);
            Some(change.collect::<Vec<f64>>())
        });
        let mut of_terms: Vec<Option<Vec<f64>>> = vec![None; terms.len()];
        for (run, change) in runs.iter().zip(changes) {
            for term in run {
                let sensor = terms[*term].sensor();
                of_terms[*term] = change.clone().map(|change| match sensor {
                    Some(channel) => self.of_sensor(channel, &change),
                    None => change,
                });
            }
        }
        of_terms
    }

    fn of_sensor(&self, channel: Channel, change: &[f64]) -> Vec<f64> {
        let mut own = vec![0.0; change.len()];
        for group in self.study.groups.iter().filter(|group| OUTPUTS[group.output] == channel) {
            own[group.rows.clone()].copy_from_slice(&change[group.rows.clone()]);
        }
        own
    }
}

/// Terms that share a run, by index: terms of different sensors do not interact.
fn runs(terms: &[Term]) -> Vec<Vec<usize>> {
    let mut runs: Vec<Vec<usize>> = Vec::new();
    for (place, term) in terms.iter().enumerate() {
        let can_join = |run: &&mut Vec<usize>| {
            term.sensor().is_some()
                && run
                    .iter()
                    .all(|other| terms[*other].sensor().is_some() && terms[*other].sensor() != term.sensor())
        };
        match runs.iter_mut().find(can_join) {
            Some(run) => run.push(place),
            None => runs.push(vec![place]),
        }
    }
    runs
}

/// Products of columns over the rows of each step.
#[derive(Debug)]
pub(crate) struct Products {
    steps: Vec<DMatrix<f64>>,
    /// Values of the nuisances, in their sigmas; they come first.
    nuisances: DVector<f64>,
    /// Number of free columns after the nuisances.
    free: usize,
}

impl Products {
    /// Products of nuisances and other free columns, `columns`, and the residual, in this order.
    pub(crate) fn new(base: &Base<'_>, columns: &[Vec<f64>]) -> Products {
        let all: Vec<&[f64]> = base
            .linearised
            .columns
            .iter()
            .chain(&base.free)
            .chain(columns)
            .chain(std::iter::once(&base.residual))
            .map(Vec::as_slice)
            .collect();
        let places: Vec<usize> = (0..base.study.steps.len()).collect();
        let steps = parallel::map(&places, |step| {
            let rows = rows_of_step(base.study, *step);
            let block = DMatrix::from_fn(rows.len(), all.len(), |i, j| all[j][rows.start + i]);
            block.tr_mul(&block)
        });
        let nuisances = DVector::from_column_slice(&base.hypothesis.nuisances);
        Products { steps, nuisances, free: base.free.len() }
    }

    /// Products of the columns (the residual last) over the selected steps, nuisances and free columns projected out as far as priors allow.
    pub(crate) fn projected(&self, counts: &[bool]) -> Option<DMatrix<f64>> {
        let size = self.steps.first()?.nrows();
        let (u, n) = (self.nuisances.len(), self.nuisances.len() + self.free);
        let mut sum = DMatrix::zeros(size, size);
        for (step, _) in self.steps.iter().zip(counts).filter(|(_, counts)| **counts) {
            sum += step;
        }
        let mut own = sum.view((0, 0), (n, n)).into_owned();
        for i in 0..n {
            own[(i, i)] += if i < u { 1.0 } else { ROUNDING };
        }
        let mut across = sum.view((0, n), (n, size - n)).into_owned();
        let mut rest = sum.view((n, n), (size - n, size - n)).into_owned();
        // The prior terms count as residuals.
        let last = size - n - 1;
        for i in 0..u {
            across[(i, last)] -= self.nuisances[i];
        }
        rest[(last, last)] += self.nuisances.norm_squared();
        Some(rest - across.tr_mul(&own.cholesky()?.solve(&across)))
    }
}

/// Fit of some terms to the projected products: log evidence relative to none, and the coefficients in steps.
#[derive(Debug, Clone)]
pub(crate) struct LinearEvidence {
    /// Log evidence relative to no term.
    pub(crate) gain: f64,
    /// Coefficients, steps.
    pub(crate) coefficients: DVector<f64>,
}

/// Evidence of the terms at `places` of the projected products, whose last row and column belong to the residual; `prior_sigma` in steps.
pub(crate) fn linear_evidence(
    products: &DMatrix<f64>,
    places: &[usize],
    prior_sigma: f64,
) -> Option<LinearEvidence> {
    let last = products.nrows() - 1;
    let k = places.len();
    let mut matrix = DMatrix::from_fn(k, k, |i, j| products[(places[i], places[j])]);
    let right = DVector::from_fn(k, |i, _| products[(places[i], last)]);
    for i in 0..k {
        matrix[(i, i)] += prior_sigma.powi(-2);
    }
    let cholesky = matrix.cholesky()?;
    let coefficients = cholesky.solve(&right);
    let half_ln_determinant: f64 = cholesky.l_dirty().diagonal().iter().map(|d| d.ln()).sum();
    let gain = 0.5 * right.dot(&coefficients) - half_ln_determinant - k as f64 * prior_sigma.ln();
    Some(LinearEvidence { gain, coefficients })
}

/// Evidence for coefficients with the common prior covariance `scale^2 shape`.
pub(crate) fn weigh_process(
    products: &DMatrix<f64>,
    right: &DVector<f64>,
    covariance: &DMatrix<f64>,
) -> Option<Posterior> {
    let k = right.len();
    // With K = R R', I + R' G R is well conditioned for any K.
    let mut jittered = covariance.clone();
    for i in 0..k {
        jittered[(i, i)] *= 1.0 + JITTER_RATIO;
    }
    let root = jittered.cholesky()?.l();
    let mut inner = root.tr_mul(&(products * &root));
    for i in 0..k {
        inner[(i, i)] += 1.0;
    }
    let cholesky = inner.cholesky()?;
    let asked = root.tr_mul(right);
    let answer = cholesky.solve(&asked);
    let half_ln_determinant: f64 = cholesky.l_dirty().diagonal().iter().map(|d| d.ln()).sum();
    let gain = 0.5 * asked.dot(&answer) - half_ln_determinant;
    let mean = &root * answer;
    let covariance = &root * cholesky.solve(&root.transpose());
    Some(Posterior { gain, mean, covariance })
}

/// Posterior of a Gaussian process.
#[derive(Debug, Clone)]
pub(crate) struct Posterior {
    /// Log evidence relative to no process.
    pub(crate) gain: f64,
    /// Mean of the coefficients, in steps.
    pub(crate) mean: DVector<f64>,
    /// Their covariance, in steps.
    pub(crate) covariance: DMatrix<f64>,
}

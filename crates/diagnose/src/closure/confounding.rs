//! Distinguishability before any rig runs: which balance's source term could imitate which effect.

use crate::closure::columns::{Base, Products, weigh_process};
use crate::closure::residual_source::{balances, columns, covariance};
use crate::gap::best_fit::coordinate::typical;
use crate::gap::best_fit::normal::{PRIOR_STEPS, Selection};
use crate::gap::residuals::study::Study;
use crate::gap::residuals::whiten::Linearised;
use crate::gap::residuals::whiten::NO_ENERGY;
use mapper_numerics::parallel;
use nalgebra::DVector;

/// The matrix of effects against balances.
#[derive(Debug, Clone)]
pub struct Signatures {
    /// The balances, in words.
    pub balances: Vec<String>,
    /// Each effect's id, its signature length at one typical step in sigmas (nuisances projected out), and a share per balance. The share
    /// is the part of its energy that a source term in that balance could reproduce: 1 means that this balance alone explains it, 0 that it
    /// is unaffected.
    pub effects: Vec<(String, f64, Vec<f64>)>,
}

/// The matrix for the effects of a study, on its recording's inputs.
pub(crate) fn signatures(study: &Study, linearised: &Linearised) -> Signatures {
    let base = Base::nothing(study, linearised);
    let everywhere = Selection::all(study).steps;
    let places: Vec<usize> = (0..study.effects.len()).collect();
    let changes: Vec<Vec<f64>> = parallel::map(&places, |place| {
        let parameters = &study.effects[*place].info().parameters;
        // For two interacting parameters, a point inside their range.
        let values = parameters.iter().map(typical).collect();
        let mut with = study.nothing();
        with.effects.push((*place, values));
        let there =
            study.predict(&with).map_or_else(|_| linearised.base.values.clone(), |there| there.values);
        let mut change: Vec<f64> = there.iter().zip(&linearised.base.values).map(|(t, b)| t - b).collect();
        linearised.whiten(study, &mut change);
        change
    });
    let shape =
        covariance(study, &study.points(&study.nothing()).unwrap_or_default()) * (PRIOR_STEPS * PRIOR_STEPS);
    let balances = balances(study);
    let shares: Vec<Vec<(f64, f64)>> = parallel::map(&balances, |balance| {
        let mut all: Vec<Vec<f64>> = columns(&base, *balance);
        for column in &mut all {
            linearised.whiten(study, column);
        }
        let k = all.len();
        all.extend(changes.iter().cloned());
        let Some(products) = Products::new(&base, &all).projected(&everywhere) else { return Vec::new() };
        let own = products.view((0, 0), (k, k)).into_owned();
        (0..changes.len())
            .map(|effect| {
                let right = DVector::from_fn(k, |i, _| products[(i, k + effect)]);
                let energy = products[(k + effect, k + effect)].max(0.0);
                let taken = weigh_process(&own, &right, &shape).map_or(0.0, |found| right.dot(&found.mean));
                (energy, if energy > NO_ENERGY { (taken / energy).clamp(0.0, 1.0) } else { 0.0 })
            })
            .collect()
    });
    let effects = places
        .iter()
        .map(|effect| {
            let of = |row: &Vec<(f64, f64)>| row.get(*effect).copied().unwrap_or((0.0, 0.0));
            let sigma = shares.first().map_or(0.0, |row| of(row).0.sqrt());
            (
                study.effects[*effect].info().id.to_string(),
                sigma,
                shares.iter().map(|row| of(row).1).collect(),
            )
        })
        .collect();
    let balances = balances.iter().map(|balance| balance.properties().words).collect();
    Signatures { balances, effects }
}

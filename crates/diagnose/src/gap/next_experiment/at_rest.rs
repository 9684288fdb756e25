//! Expected result of a soak, in which temperature sensors differ only by their offsets.
//!
//! The housing temperatures while the machine cools down also depend on the heat to oil and cell. They are not used, because the model cannot simulate the
//! run-down of the shaft.

use crate::gap::best_fit::coordinate::{coordinates, effect_neighbours, nuisance_neighbours};
use crate::gap::best_fit::fit::Fit;
use crate::gap::best_fit::normal::misfit_increases;
use crate::gap::findings::experiment::AtRest;
use crate::gap::residuals::study::{Hypothesis, Study};
use mapper_core::Channel;
use mapper_numerics::least_squares::descent::FINE;
use mapper_observe::perturbation::UNINFORMATIVE;
use nalgebra::DMatrix;

/// Misfit increase of each fit (column) after refitting to a soak, if another fit (row) were true, in squared sigmas.
pub(crate) fn apart_at_rest(recorded: &Study, soak: &AtRest, fits: &[&Fit]) -> Option<Vec<Vec<f64>>> {
    let sensors: Vec<(Channel, f64)> = AtRest::CHANNELS
        .into_iter()
        .zip(soak.left_sigma_k)
        .filter(|(channel, _)| recorded.table.column(*channel).is_some())
        .collect();
    if sensors.len() < 2 {
        return None;
    }
    let predicted = fits
        .iter()
        .map(|fit| {
            let here = offsets(recorded, &sensors, &fit.hypothesis)?;
            let mut columns = changes(recorded, &sensors, &fit.hypothesis, &here)?;
            columns.push(sensors.iter().map(|(_, sigma)| 1.0 / sigma).collect());
            let known = fit.precision.nrows();
            let mut precision = DMatrix::zeros(columns.len(), columns.len());
            precision.view_mut((0, 0), (known, known)).copy_from(&fit.precision);
            // The common temperature of all sensors is unknown.
            precision[(known, known)] = UNINFORMATIVE.powi(-2);
            Some((here, columns, precision))
        })
        .collect::<Option<Vec<_>>>()?;
    misfit_increases(&predicted)
}

/// Offsets of the sensors, in units of their remaining uncertainty.
fn offsets(study: &Study, sensors: &[(Channel, f64)], hypothesis: &Hypothesis) -> Option<Vec<f64>> {
    sensors.iter().map(|(channel, sigma)| Some(study.offset_at_end(hypothesis, *channel)? / sigma)).collect()
}

/// Changes of these offsets for one sigma of each nuisance and for a unit of each effect coordinate.
fn changes(
    study: &Study,
    sensors: &[(Channel, f64)],
    hypothesis: &Hypothesis,
    here: &[f64],
) -> Option<Vec<Vec<f64>>> {
    let coordinates = coordinates(&study.effects, hypothesis);
    nuisance_neighbours(hypothesis, FINE)
        .chain(effect_neighbours(hypothesis, &coordinates, FINE))
        .map(|(moved, step)| {
            let there = offsets(study, sensors, &moved)?;
            Some(there.iter().zip(here).map(|(there, here)| (there - here) / step).collect())
        })
        .collect()
}

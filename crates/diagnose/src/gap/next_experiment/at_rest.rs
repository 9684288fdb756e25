//! Expected result of a soak: all temperature sensors read the same temperature, apart from their offsets.
//!
//! Housing temperatures during the cool-down would also contain heat to oil and cell. They are not used, because the model cannot simulate
//! the shaft's run-down.

use crate::gap::best_fit::coordinate::{Coordinate, coordinates, parameters, set_parameter};
use crate::gap::best_fit::fit::Fit;
use crate::gap::best_fit::normal::misfit;
use crate::gap::findings::experiment::AtRest;
use crate::gap::residuals::study::{Hypothesis, Study};
use mapper_core::Channel;
use mapper_inference::descent::FINE;
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
    let predicted: Option<Vec<_>> = fits
        .iter()
        .map(|fit| {
            let here = readings(recorded, &sensors, &fit.hypothesis)?;
            let mut columns = changes(recorded, &sensors, &fit.hypothesis, &here)?;
            columns.push(sensors.iter().map(|(_, sigma)| 1.0 / sigma).collect());
            let known = fit.precision.nrows();
            let mut precision = DMatrix::zeros(columns.len(), columns.len());
            precision.view_mut((0, 0), (known, known)).copy_from(&fit.precision);
            // The common temperature of all sensors is unknown.
            precision[(known, known)] = UNINFORMATIVE.powi(-2);
            Some((here, columns, precision))
        })
        .collect();
    let predicted = predicted?;
    let of_truth = |truth: &Vec<f64>| -> Option<Vec<f64>> {
        let of_rival = |(here, columns, precision): &(Vec<f64>, Vec<Vec<f64>>, DMatrix<f64>)| {
            let difference: Vec<f64> = truth.iter().zip(here).map(|(a, b)| a - b).collect();
            misfit(&difference, columns, precision)
        };
        predicted.iter().map(of_rival).collect()
    };
    predicted.iter().map(|(truth, ..)| of_truth(truth)).collect()
}

/// Offsets of the sensors, in units of each remaining uncertainty.
fn readings(study: &Study, sensors: &[(Channel, f64)], hypothesis: &Hypothesis) -> Option<Vec<f64>> {
    sensors.iter().map(|(channel, sigma)| Some(study.offset_at_end(hypothesis, *channel)? / sigma)).collect()
}

/// Offset changes for one sigma of each nuisance and one unit of each effect coordinate.
fn changes(
    study: &Study,
    sensors: &[(Channel, f64)],
    hypothesis: &Hypothesis,
    here: &[f64],
) -> Option<Vec<Vec<f64>>> {
    let slope = |moved: &Hypothesis, step: f64| -> Option<Vec<f64>> {
        let there = readings(study, sensors, moved)?;
        Some(there.iter().zip(here).map(|(there, here)| (there - here) / step).collect())
    };
    let of_nuisance = |index: usize| {
        let mut moved = hypothesis.clone();
        moved.nuisances[index] += FINE;
        slope(&moved, FINE)
    };
    let values = parameters(hypothesis);
    let of_parameter = |(place, coordinate): (usize, &Coordinate)| {
        let (next, step) = coordinate.next_to(values[place], FINE);
        let mut moved = hypothesis.clone();
        set_parameter(&mut moved, place, next);
        slope(&moved, step)
    };
    let coordinates = coordinates(&study.effects, hypothesis);
    let effects = coordinates.iter().enumerate().map(of_parameter);
    (0..study.nuisances.len()).map(of_nuisance).chain(effects).collect()
}

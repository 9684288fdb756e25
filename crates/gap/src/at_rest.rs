//! What a soak would show: at rest all temperature sensors read alike, but for their offsets.
//!
//! The housings on their way there would tell of heat to oil and cell as well; they are not used, for the model has no
//! rundown of the shaft that leads there.

use crate::coordinate::{Coordinate, coordinates, parameters, set_parameter};
use crate::experiment::AtRest;
use crate::fit::Fit;
use crate::misfit::misfit;
use crate::study::{Hypothesis, Study};
use mapper_core::Channel;
use nalgebra::DMatrix;

/// One sigma of what all sensors read together, in the units of what is left of them: nobody knows it.
const COMMON_SIGMA: f64 = 1e4;
/// Part of a typical step over which slopes are taken; readings are straight in offsets.
const BESIDE: f64 = 0.02;

/// By how much a soak would raise the misfit of each fit (column), fitted again, were another (row) true, in squared sigmas.
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
            precision[(known, known)] = COMMON_SIGMA.powi(-2);
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

/// What the sensors read too much, in what is left of each.
fn readings(study: &Study, sensors: &[(Channel, f64)], hypothesis: &Hypothesis) -> Option<Vec<f64>> {
    sensors.iter().map(|(channel, sigma)| Some(study.offset_at_end(hypothesis, *channel)? / sigma)).collect()
}

/// The same for a sigma of each nuisance and a unit of each effect's coordinate.
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
        moved.nuisances[index] += BESIDE;
        slope(&moved, BESIDE)
    };
    let values = parameters(hypothesis);
    let of_parameter = |(place, coordinate): (usize, &Coordinate)| {
        let at = coordinate.of(values[place]);
        // To the side where there is room.
        let ahead = coordinate.of(coordinate.value(at + BESIDE)) - at;
        let step = if ahead.abs() > 0.5 * BESIDE { ahead } else { -BESIDE };
        let mut moved = hypothesis.clone();
        set_parameter(&mut moved, place, coordinate.value(at + step));
        slope(&moved, step)
    };
    let coordinates = coordinates(study, hypothesis);
    let effects = coordinates.iter().enumerate().map(of_parameter);
    (0..study.nuisances.len()).map(of_nuisance).chain(effects).collect()
}

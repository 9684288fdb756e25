//! Errors of the model's equations, measured by a fault-free recording, as a campaign declares them.

use crate::gap::model_error::baseline_assumptions::Declaration;
use crate::gap::model_error::fitted_tolerances::fitted_tolerances;
use crate::gap::model_error::structure::variation;
use crate::gap::residuals::nuisance::{JUMP_S, NuisanceKind, OUTPUTS, nuisances};
use crate::gap::residuals::study::{PredictError, Study};
use crate::gap::residuals::whiten::Linearised;
use mapper_numerics::statistics::mean;

/// Errors of each output after fitting the tolerances, which without a declaration would take up most of the errors: those of the nominal
/// model are declared for the fit.
pub(crate) fn measured_structure(study: &Study) -> Result<[Declaration; OUTPUTS.len()], PredictError> {
    let nominal = declarations(study, &study.predict(&study.nothing())?.values);
    let mut declared = study.clone();
    for (channel, error) in OUTPUTS.iter().zip(&nominal) {
        if let Some(ratio) = declared.declared.tolerances.structure.of_mut(*channel) {
            *ratio = error.structure_ratio;
        }
        if let Some(offset) = error.offset {
            declared.declared.sensors.entry(*channel).or_default().offset_sigma = offset;
        }
    }
    declared.nuisances = nuisances(&declared.declared);
    let mut fitted = fitted_tolerances(&declared, &Linearised::new(&declared)?)?;
    let mut delay_s = [0.0; OUTPUTS.len()];
    for (nuisance, sigmas) in declared.nuisances.iter().zip(&mut fitted.nuisances) {
        match nuisance.kind {
            NuisanceKind::Delay(output) => delay_s[output] = std::mem::take(sigmas) * nuisance.sigma,
            NuisanceKind::Structure(..) => *sigmas = 0.0,
            NuisanceKind::Offset(channel) if OUTPUTS.contains(&channel) => *sigmas = 0.0,
            _ => {}
        }
    }
    let mut measured = declarations(study, &declared.predict(&fitted)?.values);
    for (error, delay_s) in measured.iter_mut().zip(delay_s) {
        error.structure_ratio = error.structure_ratio.max(delay_s.abs() / JUMP_S);
    }
    Ok(measured)
}

/// Mean and standard deviation of each output's errors, beyond the declared offset and relative to the variation of the readings.
fn declarations(study: &Study, predicted: &[f64]) -> [Declaration; OUTPUTS.len()] {
    std::array::from_fn(|output| {
        let groups = study.groups.iter().filter(|group| group.output == output);
        let errors =
            groups.flat_map(|group| group.rows.clone()).map(|row| study.measured[row] - predicted[row]);
        let (Some(offset), Some((_, sigma))) = (mean(errors.clone()), variation(study, output)) else {
            return Declaration::default();
        };
        let spread = mean(errors.map(|error| (error - offset).powi(2))).map_or(0.0, f64::sqrt);
        let beyond = offset.abs() > study.declared.offset_sigma(OUTPUTS[output]);
        Declaration {
            offset: beyond.then_some(offset.abs()),
            structure_ratio: if sigma > 0.0 { (spread / sigma).min(1.0) } else { 0.0 },
        }
    })
}

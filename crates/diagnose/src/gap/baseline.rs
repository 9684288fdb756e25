//! Errors of the model's equations, measured by a fault-free baseline recording of the same rig.

use crate::gap::best_fit::fit::MAX_SIGMAS;
use crate::gap::best_fit::normal::{Selection, dot_over, nuisance_products};
use crate::gap::experiment::GapWarning;
use crate::gap::preconditions::{GapError, Problem, Zeroed, another_machine, checked_study};
use crate::gap::residuals::nuisance::{Hypothesis, JUMP_S, NuisanceKind, OUTPUTS, nuisances};
use crate::gap::residuals::study::{Group, PredictError, Study};
use crate::gap::residuals::whiten::{Linearised, dot};
use crate::gap::structure::{covariance_of_errors, variation};
use mapper_core::unit_factors::PA_PER_KPA;
use mapper_core::{Channel, jump_ratio};
use mapper_identify::LONGEST_BRIDGE_S;
use mapper_numerics::least_squares::ROUNDS;
use mapper_numerics::statistics::mean;
use mapper_observe::averages::mean_reading;
use mapper_observe::model_inputs::step_timing::with_command_times;
use mapper_observe::perturbation::UNINFORMATIVE;
use mapper_physics::simulation::model::Model;
use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

pub(crate) struct Changed {
    pub(crate) study: Study,
    pub(crate) baseline: Baseline,
    pub(crate) warnings: Vec<GapWarning>,
}

impl Study {
    pub(crate) fn changes_since(
        self,
        name: String,
        baseline: &Zeroed,
        model: Model,
        tolerances_declared: bool,
    ) -> Result<Changed, GapError> {
        let recording = &with_command_times(&baseline.recording);
        let declared = baseline.declared.clone().with_exact_equations();
        let (before, warnings) = checked_study(recording, declared, model, Vec::new(), tolerances_declared)?;
        same_steps(&before, &self)?;
        let linearised = Linearised::new(&before)?;
        another_machine(&before, &linearised.base.values)?;
        let tolerances = fitted_tolerances(&before, &linearised)?;
        let predicted = before.predict(&tolerances)?;
        let model_error: Vec<f64> =
            before.measured.iter().zip(&predicted.values).map(|(seen, predicted)| seen - predicted).collect();
        let shares = errors_of_change(&before, &linearised, &model_error);
        let declarations = measured_structure(&before)?;
        // Values missing in the reference recording cannot be compared.
        let partners = partners(&self, &before);
        let mut study = self.with_rows(&partners.iter().map(Option::is_some).collect::<Vec<_>>());
        let partners: Vec<usize> = partners.into_iter().flatten().collect();
        for (measured, row) in study.measured.iter_mut().zip(&partners) {
            *measured -= model_error[*row];
        }
        // Tolerances may have moved from their reference values by as much as declared, because sensors are remounted.
        for nuisance in &mut study.nuisances {
            let was =
                before.nuisances.iter().zip(&tolerances.nuisances).find(|(was, _)| was.kind == nuisance.kind);
            if let Some((was, sigmas)) = was.filter(|_| !nuisance.kind.is_start()) {
                nuisance.centre = was.value(*sigmas);
            }
        }
        let unchanged = study.predict(&study.nothing())?;
        let changed: Vec<f64> =
            study.measured.iter().zip(&unchanged.values).map(|(seen, predicted)| seen - predicted).collect();
        let elsewhere = elsewhere(&study, &changed);
        let noise = study.groups.iter().map(|group| {
            let rows = &partners[group.rows.clone()];
            let blocks = &study.steps[group.step].blocks;
            let since_jump_s: Vec<f64> =
                group.blocks.iter().map(|block| blocks[*block].since_jump_s).collect();
            let missed: Vec<f64> =
                group.rows.clone().map(|row| shares[group.output] * changed[row]).collect();
            let moved: Vec<f64> = rows.iter().map(|row| elsewhere[group.step] * model_error[*row]).collect();
            let mut noise = covariance_of_errors(&since_jump_s, [&missed, &moved]);
            let before_it =
                before.groups.iter().position(|other| rows.iter().all(|row| other.rows.contains(row)));
            if let Some(place) = before_it {
                let (covariance, first) = (linearised.covariance(place), before.groups[place].rows.start);
                noise += DMatrix::from_fn(rows.len(), rows.len(), |i, j| {
                    covariance[(rows[i] - first, rows[j] - first)]
                });
            }
            noise
        });
        study.other_noise = noise.collect();
        let baseline =
            Baseline { recording: name, lacking: by_channel(&before, &model_error, &shares, &declarations) };
        Ok(Changed { study, baseline, warnings })
    }
}

fn by_channel(
    study: &Study,
    model_error: &[f64],
    shares: &[f64],
    declarations: &[Declaration],
) -> BTreeMap<String, Lacking> {
    let of_output = |(output, channel): (usize, &Channel)| {
        let groups = study.groups.iter().filter(|group| group.output == output);
        let rows: Vec<usize> = groups.flat_map(|group| group.rows.clone()).collect();
        let squares: f64 = rows.iter().map(|row| model_error[*row].powi(2)).sum();
        let size = (squares / rows.len().max(1) as f64).sqrt();
        let of_channel = Lacking {
            size,
            unit: channel.unit().to_owned(),
            share: shares[output],
            declare: declarations[output],
        };
        (!rows.is_empty()).then(|| (channel.symbol().to_owned(), of_channel))
    };
    OUTPUTS.iter().enumerate().filter_map(of_output).collect()
}

/// For each row of a study, the row of the other study at the same time.
fn partners(study: &Study, other: &Study) -> Vec<Option<usize>> {
    let mut partners = vec![None; study.measured.len()];
    for group in &study.groups {
        let same = |candidate: &&Group| candidate.step == group.step && candidate.output == group.output;
        let Some(there) = other.groups.iter().find(same) else { continue };
        for (row, block) in group.rows.clone().zip(&group.blocks) {
            let block = &study.steps[group.step].blocks[*block];
            let close_s = block.spread_s.max(0.5 * study.table.interval_s);
            let found = there.rows.clone().zip(&there.blocks).find(|(_, candidate)| {
                let candidate = &other.steps[group.step].blocks[**candidate];
                (candidate.since_jump_s - block.since_jump_s).abs() < close_s
            });
            partners[row] = found.map(|(row, _)| row);
        }
    }
    partners
}

/// Baseline of a rig: its model error in fault-free condition.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Baseline {
    /// The reference recording.
    pub recording: String,
    /// Model error of each channel there after fitting tolerances; present in both recordings and therefore not diagnosed.
    pub lacking: BTreeMap<String, Lacking>,
}

/// Errors of the model's equations, as a campaign declares them.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Declaration {
    /// `offset` of the sensor, in the channel's unit: the mean error of the equations, if it is larger than the declared offset.
    pub offset: Option<f64>,
    /// `tolerances: structure`: standard deviation of the error, relative to that of the readings.
    pub structure_ratio: f64,
}

/// Model error of one channel.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Lacking {
    /// Root mean square, in the channel's unit.
    pub size: f64,
    pub unit: String,
    /// Relative model error of the channel's changes over the recording, 0..1; changes since then may be predicted equally badly.
    pub share: f64,
    /// What the campaign declares for a diagnosis of this rig without a reference.
    pub declare: Declaration,
}

/// Fits the tolerances of a fault-free rig; the misfit sets the noise level, so that model error pushes none outside its prior.
pub(crate) fn fitted_tolerances(study: &Study, linearised: &Linearised) -> Result<Hypothesis, PredictError> {
    let everywhere = Selection::all(study);
    let products = nuisance_products(study, linearised, &everywhere);
    let rows = everywhere.rows(study);
    let (mut best, mut residual) = (study.nothing(), linearised.residual(study, &linearised.base));
    let n = best.nuisances.len();
    for _ in 0..ROUNDS {
        let excess = (dot(&residual, &residual) / residual.len().max(1) as f64).max(1.0);
        let matrix = &products + DMatrix::identity(n, n) * excess;
        let right = DVector::from_fn(n, |i, _| {
            dot_over(&rows, &linearised.columns[i], &residual) - excess * best.nuisances[i]
        });
        let Some(step) = matrix.cholesky().map(|cholesky| cholesky.solve(&right)) else { break };
        let mut moved = best.clone();
        for (sigmas, by) in moved.nuisances.iter_mut().zip(step.iter()) {
            *sigmas = (*sigmas + by).clamp(-MAX_SIGMAS, MAX_SIGMAS);
        }
        let there = linearised.residual_of(study, &moved)?;
        let cost = |residual: &[f64], at: &Hypothesis| {
            dot(residual, residual) / excess + dot(&at.nuisances, &at.nuisances)
        };
        if cost(&there, &moved) >= cost(&residual, &best) {
            break;
        }
        (best, residual) = (moved, there);
    }
    Ok(best)
}

/// Rejects a reference with other steps. Times may differ by a slow logger's interval, T3 by its tolerance: that is variation of the stand.
pub(crate) fn same_steps(baseline: &Study, study: &Study) -> Result<(), Problem> {
    if baseline.steps.len() != study.steps.len() {
        return Err(Problem::OtherSteps { baseline: baseline.steps.len(), recorded: study.steps.len() });
    }
    let t3_k = |of: &Study, step: usize| {
        let marker = &of.steps[step].marker;
        let column = of.table.column(Channel::T3)?;
        mean_reading(&column[of.table.range(marker.start_s, marker.end_s)])
    };
    for (index, (theirs, ours)) in baseline.steps.iter().zip(&study.steps).enumerate() {
        let (theirs, ours) = (&theirs.marker, &ours.marker);
        let differs = |what: &'static str, baseline: f64, recorded: f64, unit: &'static str, within: f64| {
            let same =
                (baseline - recorded).abs() <= within || !baseline.is_finite() || !recorded.is_finite();
            let step = ours.index;
            if same {
                Ok(())
            } else {
                Err(Problem::OtherStep { step, what, baseline, recorded, unit, within })
            }
        };
        // Model error hardly changes between points that count as one.
        let (p3_kpa, opening) = (ours.p3_pa / PA_PER_KPA, ours.valve_opening_ratio);
        differs("commanded P3", theirs.p3_pa / PA_PER_KPA, p3_kpa, "kPa", jump_ratio(Channel::P3) * p3_kpa)?;
        differs(
            "opening of the valve",
            theirs.valve_opening_ratio,
            opening,
            "",
            jump_ratio(Channel::ValveCommand) * opening,
        )?;
        // The running time before the first jump is not compared.
        if index > 0 {
            differs(
                "length",
                theirs.end_s - theirs.start_s,
                ours.end_s - ours.start_s,
                "s",
                LONGEST_BRIDGE_S,
            )?;
        }
        if let (Some(before), Some(now)) = (t3_k(baseline, index), t3_k(study, index)) {
            differs("T3", before, now, "K", study.declared.tolerances.turbine_inlet_temperature_k)?;
        }
    }
    Ok(())
}

/// Relative model error of each output's variation over a recording; 0 if noise accounts for it. `model_error` is measured minus predicted.
pub(crate) fn errors_of_change(
    study: &Study,
    linearised: &Linearised,
    model_error: &[f64],
) -> [f64; OUTPUTS.len()] {
    let mut of_output = [const { Vec::new() }; OUTPUTS.len()];
    for (place, group) in study.groups.iter().enumerate() {
        let variances = linearised.covariance(place).diagonal();
        // Near surge.
        let most = UNINFORMATIVE * study.declared.noise_sigma(OUTPUTS[group.output]).powi(2);
        let kept = group.rows.clone().zip(variances.iter().copied()).filter(|(_, variance)| *variance < most);
        of_output[group.output].extend(kept);
    }
    of_output.map(|rows: Vec<(usize, f64)>| {
        let count = rows.len().max(1) as f64;
        let variance = |of: &[f64]| {
            let mean = rows.iter().map(|(row, _)| of[*row]).sum::<f64>() / count;
            rows.iter().map(|(row, _)| (of[*row] - mean).powi(2)).sum::<f64>() / count
        };
        let noise = rows.iter().map(|(_, variance)| variance).sum::<f64>() / count;
        let (missed, moved) = (variance(model_error) - noise, variance(&study.measured));
        if moved > 0.0 { (missed.max(0.0) / moved).sqrt().min(1.0) } else { 0.0 }
    })
}

/// Shift of each step's operating point, 1 sigma, over each output's span: the maximum over the outputs, the step and the one before.
pub(crate) fn elsewhere(study: &Study, changed: &[f64]) -> Vec<f64> {
    let spans: Vec<f64> = (0..OUTPUTS.len())
        .map(|output| {
            let groups = study.groups.iter().filter(|group| group.output == output);
            let values: Vec<f64> =
                groups.flat_map(|group| study.measured[group.rows.clone()].to_vec()).collect();
            let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
            let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
            (squares / values.len().max(1) as f64).sqrt()
        })
        .collect();
    let mut shares = vec![0.0f64; study.steps.len()];
    for group in study.groups.iter().filter(|group| spans[group.output] > 0.0) {
        let squares: f64 = changed[group.rows.clone()].iter().map(|by| by * by).sum();
        let by = (squares / group.rows.len().max(1) as f64).sqrt() / spans[group.output];
        shares[group.step] = shares[group.step].max(by);
    }
    (0..shares.len()).map(|step| shares[step].max(shares[step.saturating_sub(1)])).collect()
}

/// Errors of each output after fitting the tolerances, which undeclared would take up most of them: those of the nominal model are declared.
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

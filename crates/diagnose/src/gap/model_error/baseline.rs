//! Changes since a baseline: a recording of the same rig in fault-free condition.
//!
//! Every model of a rig has a structural error, larger than most faults and present in every recording. A reference recording measures it
//! block by block: readings `m_h` minus the model `f_h` with its fitted tolerances `u_h`. The diagnosis uses `m - (m_h - f_h(u_h))` with
//! noise `C + C_h`, unsmoothed because smoothing needs its time history. Each recording has its own inputs, so ambient changes do not count.

use crate::gap::findings::warning::GapWarning;
use crate::gap::model_error::baseline_assumptions::{Baseline, Declaration, Lacking};
use crate::gap::model_error::errors_of_change::{elsewhere, errors_of_change};
use crate::gap::model_error::fitted_tolerances::fitted_tolerances;
use crate::gap::model_error::measured_structure::measured_structure;
use crate::gap::model_error::same_steps::same_steps;
use crate::gap::model_error::structure::covariance_of_errors;
use crate::gap::preconditions::machine_mismatch::another_machine;
use crate::gap::preconditions::problem::GapError;
use crate::gap::preconditions::usable::checked_study;
use crate::gap::prepare::Zeroed;
use crate::gap::residuals::nuisance::OUTPUTS;
use crate::gap::residuals::study::{Group, Study};
use crate::gap::residuals::whiten::Linearised;
use mapper_core::Channel;
use mapper_observe::model_inputs::step_timing::with_command_times;
use mapper_physics::simulation::model::Model;
use nalgebra::DMatrix;
use std::collections::BTreeMap;

/// A study of the changes since the reference recording.
pub(crate) struct Changed {
    pub(crate) study: Study,
    pub(crate) baseline: Baseline,
    /// Warnings about the reference recording.
    pub(crate) warnings: Vec<GapWarning>,
}

impl Study {
    /// Turns this study into one of the changes since a reference recording.
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

/// Model error of each channel.
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

//! What a step would tell, to a joint identification of a whole campaign: for choosing among steps before anything is
//! measured.
//!
//! The mean variance of the points' efficiencies is a convex function of the information that the steps bring together
//! (A-optimality; Fedorov, Theory of Optimal Experiments, 1972, ch. 2). At a campaign that is planned it has a slope, and along
//! the slope each step counts for itself: that makes orders comparable step by step.

use crate::IdentifyConfig;
use crate::dynamic::Estimate;
use crate::joint::expected::{ExpectedStep, condensed, expected_problem};
use crate::joint::explained::Explained;
use crate::joint::model::Setting;
use crate::joint::parameters::{LN_DEVIATION, Prior, SHARED, SharedVector};
use crate::joint::parsimony::NO_EXTRA;
use crate::joint::rows::StepRows;
use crate::joint::solve::{Fisher, Problem};
use crate::joint::start;
use crate::joint::surface::SurfaceScale;
use mapper_numerics::statistics::mean;
use nalgebra::{DMatrix, DVector};

/// A planned campaign, and what more information would be worth to it.
#[derive(Debug)]
pub struct StepWorth {
    config: IdentifyConfig,
    setting: Setting,
    scale: SurfaceScale,
    mean_eta: f64,
    shared: SharedVector,
    priors: [Prior; SHARED],
    active: [bool; SHARED],
    surface_sigma: f64,
    law_sigma: f64,
    /// Covariance of what the steps share.
    covariance: DMatrix<f64>,
    /// By how much the sum of the points' variances falls with the information.
    slope: DMatrix<f64>,
}

impl StepWorth {
    /// About a campaign; `None` where its forecast cannot be identified.
    pub fn about(steps: &[ExpectedStep<'_>], config: &IdentifyConfig) -> Option<Self> {
        let rows: Vec<StepRows> = steps
            .iter()
            .enumerate()
            .filter_map(|(position, step)| condensed(position, step, config))
            .collect();
        let problem = expected_problem(steps, &rows, config)?;
        let fisher = problem.fisher()?;
        let mut total = fisher.information.clone();
        for (row, index) in fisher.unknown.iter().enumerate() {
            total[(row, row)] += problem.priors[*index].weight();
        }
        let covariance = total.cholesky()?.inverse();
        let mut answers = DMatrix::zeros(covariance.nrows(), covariance.nrows());
        for (_, answer) in &fisher.steps {
            answers += answer * answer.transpose();
        }
        let slope = &covariance * answers * &covariance;
        let places: Vec<(f64, f64)> = rows.iter().map(|step| step.end.place).collect();
        Some(StepWorth {
            scale: SurfaceScale::of(&places, config.reference)?,
            mean_eta: mean(steps.iter().map(|step| step.eta))?,
            law_sigma: problem.members.first()?.priors[LN_DEVIATION].sigma,
            config: config.clone(),
            setting: problem.setting,
            shared: problem.shared,
            priors: problem.priors,
            active: problem.active,
            surface_sigma: problem.surface_sigma,
            covariance,
            slope,
        })
    }

    /// What a step is worth, fraction^2: by how much it makes all points more certain, less the variance of its own point. The
    /// sum over the steps of a campaign differs from minus the sum of its variances by what the slope does not know.
    pub fn of(&self, step: &ExpectedStep<'_>) -> Option<f64> {
        let rows = condensed(0, step, &self.config)?;
        let fisher = self.fisher(&[rows], &step.estimate())?;
        let (own, answer) = fisher.steps.first()?;
        let worth = self.of_information(&fisher.information, *own, answer);
        worth.is_finite().then_some(worth)
    }

    /// The same of a step that brings this information; `own`: the variance of its efficiency if all that is shared were known,
    /// which answers to what is shared by `answer`.
    pub(crate) fn of_information(&self, information: &DMatrix<f64>, own: f64, answer: &DVector<f64>) -> f64 {
        let variance = own + answer.dot(&(&self.covariance * answer));
        self.slope.dot(information) - variance
    }

    /// What one step tells, where the campaign's shared numbers stand. `about`: where its own ones do.
    pub(crate) fn fisher(&self, rows: &[StepRows; 1], about: &Estimate) -> Option<Fisher> {
        self.alone(rows, about).fisher()
    }

    /// Where the surface lies.
    pub(crate) fn scale(&self) -> &SurfaceScale {
        &self.scale
    }

    /// The fit of one step by itself.
    pub(crate) fn alone<'a>(&self, rows: &'a [StepRows; 1], about: &Estimate) -> Problem<'a> {
        let mut member = start::member(&rows[0], Some(about), &self.scale, self.mean_eta, &self.config);
        if self.setting.with_law {
            member.priors[LN_DEVIATION].sigma = self.law_sigma;
        }
        let mut problem = Problem {
            setting: self.setting,
            members: vec![member],
            shared: self.shared,
            priors: self.priors,
            active: self.active,
            lowest: [f64::NEG_INFINITY; SHARED],
            surface_sigma: self.surface_sigma,
            explained: Explained::default(),
            probe_fitted: false,
            extra_variances: NO_EXTRA,
            inlet_sought: false,
            inlet: None,
        };
        start::weigh(&mut problem, rows, &self.config);
        problem
    }

    /// What is known beforehand of the numbers that [`StepWorth::fisher`] speaks of: one over the variance of each.
    pub(crate) fn known_beforehand(&self, unknown: &[usize]) -> Vec<f64> {
        unknown.iter().map(|index| self.priors[*index].weight()).collect()
    }
}

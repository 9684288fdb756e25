//! What no campaign of the same points can know better than, by what its steps tell.
//!
//! By the information of all steps together the variances of the points sum to `sum_k (o_k + a_k^T M^-1 a_k)`: `o_k` the variance of
//! point `k` if all that the steps share were known, `a_k` how its efficiency answers to what is shared, `M` what is known of that,
//! before any step and by each. `a^T M^-1 a` is convex in `a` and `M` together (Boyd and Vandenberghe, Convex Optimization, 2004,
//! example 3.4), so that no campaign lies below a tangent; and a tangent is a sum over steps, which an assignment bounds. Where
//! other campaigns may know much more, the tangent at one whose steps tell several times as much lies closer below them.

use crate::IdentifyConfig;
use crate::joint::expected::{ExpectedStep, condensed};
use crate::joint::solve::Fisher;
use crate::joint::worth::StepWorth;
use nalgebra::{DMatrix, DVector};

/// A tangent of the sum of the points' variances.
#[derive(Debug)]
pub struct VarianceTangent {
    worth: StepWorth,
    config: IdentifyConfig,
    /// For each step that measures a point: `C a`, with `C = M^-1`.
    carried: Vec<Option<DVector<f64>>>,
    /// `C sum(a a^T) C`.
    slope: DMatrix<f64>,
    /// Where no step counts for anything, fraction^2.
    start: f64,
}

impl VarianceTangent {
    /// At a campaign whose steps tell `times` as much as these; `measures`: whether each step measures a point, or is made for
    /// another purpose. `None` where its forecast cannot be identified.
    pub fn at(
        steps: &[ExpectedStep<'_>],
        measures: &[bool],
        times: f64,
        config: &IdentifyConfig,
    ) -> Option<Self> {
        let worth = StepWorth::about(steps, config)?;
        let told: Vec<Fisher> = steps.iter().map(|step| told(&worth, step, config)).collect::<Option<_>>()?;
        let before =
            DMatrix::from_diagonal(&DVector::from_vec(worth.known_beforehand(&told.first()?.unknown)));
        let known = told.iter().fold(before.clone(), |sum, one| sum + times * &one.information);
        let covariance = known.cholesky()?.inverse();
        let mut outer = DMatrix::zeros(covariance.nrows(), covariance.nrows());
        let mut carried = Vec::with_capacity(steps.len());
        for (one, measures) in told.iter().zip(measures) {
            let (_, answer) = one.steps.first()?;
            if *measures {
                outer += answer * answer.transpose();
            }
            carried.push(measures.then(|| &covariance * answer));
        }
        let slope = &covariance * outer * &covariance;
        let start = -slope.dot(&before);
        start.is_finite().then(|| VarianceTangent { config: config.clone(), worth, carried, slope, start })
    }

    /// Along the tangent: the sum of the variances of all efficiencies that a campaign measures is no less than this, less what its steps
    /// [count for](VarianceTangent::of), and is just that at the campaign of the tangent, fraction^2.
    pub fn start(&self) -> f64 {
        self.start
    }

    /// What a step in place of step `place` counts for, fraction^2; `None` where it tells nothing that can be identified.
    pub fn of(&self, step: &ExpectedStep<'_>, place: usize) -> Option<f64> {
        let told = told(&self.worth, step, &self.config)?;
        let (own, answer) = told.steps.first()?;
        let itself = self.carried.get(place)?.as_ref().map_or(0.0, |carried| own + 2.0 * carried.dot(answer));
        let counts = self.slope.dot(&told.information) - itself;
        counts.is_finite().then_some(counts)
    }
}

/// What one step tells.
fn told(worth: &StepWorth, step: &ExpectedStep<'_>, config: &IdentifyConfig) -> Option<Fisher> {
    worth.fisher(&[condensed(0, step, config)?], &step.estimate())
}

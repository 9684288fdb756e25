//! Causes that are added to others, and the calibration of their probabilities.

use crate::gap::best_fit::coordinate::Coordinate;
use crate::gap::best_fit::fit::{Column, Fit, Start};
use crate::gap::best_fit::normal::{Projector, Selection, Share};
use crate::gap::residuals::study::{Prediction, Study, members};
use crate::gap::residuals::whiten::{Linearised, rows_of_step};
use mapper_inference::posterior::{Rules, probability};
use mapper_numerics::least_squares::MAX_MOVE;
use mapper_numerics::parallel;
use mapper_physics::rig::effect::EffectParameter;
use nalgebra::DVector;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

#[derive(Debug)]
pub(crate) struct Addition {
    /// Index of the effect.
    pub effect: usize,
    /// Linear estimate of the cost reduction.
    pub gain: f64,
    /// Start of a fit.
    pub start: Start,
}

/// Minimum start offset from neutral, as a share of a step. Bound: some effects have zero slope at neutral; the fit moves away
/// from any start.
const OFF_NEUTRAL: f64 = 0.1;
/// Squared length of a change that counts as none. Bound: rounding of the projection.
const NO_CHANGE: f64 = 1e-9;
/// Places of the two starts in the range of a parameter, as shares. Bound: effort; thirds, the upper one slightly inside, because ranges end where
/// models fail.
const INNER_SHARES: [f64; 2] = [0.33, 0.6];

/// Every further effect added to a fit, in closed form from one run each (more if parameters interact); for `onsets` those with an onset.
pub(crate) fn additions(
    study: &Study,
    linearised: &Linearised,
    selection: &Selection,
    base: &Fit,
    onsets: bool,
) -> Vec<Addition> {
    let Some(projector) = Projector::new(study, linearised, selection, &base.effect_columns) else {
        return Vec::new();
    };
    // At the optimum the residual's pull on each nuisance equals its prior's: a strained tolerance supports the effect that releases it.
    let mut right_residual = projector.right(&base.residual);
    for (right, nuisance) in right_residual.iter_mut().zip(&base.hypothesis.nuisances) {
        *right -= nuisance;
    }
    let rows = selection.steps.iter().enumerate();
    let rows =
        rows.map(|(step, selected)| if *selected { rows_of_step(study, step) } else { 0..0 }).collect();
    let look = FitNeighbourhood {
        study,
        linearised,
        projector: &projector,
        base,
        columns: Column::of(base),
        prediction: Arc::new(base.prediction.clone()),
        right_residual,
        rows,
    };
    let used: Vec<usize> = members(&base.hypothesis).iter().map(|member| study.family(*member)).collect();
    let effects: Vec<usize> = (0..study.catalogue).filter(|effect| !used.contains(effect)).collect();
    let found = parallel::map(&effects, |effect| match study.effects[*effect].info().parameters.as_slice() {
        [parameter] if onsets => look.with_onsets(*effect, parameter),
        [parameter] => look.at_one(*effect, parameter).into_iter().collect(),
        _ if onsets => Vec::new(),
        several => corners(several).into_iter().filter_map(|corner| look.at(*effect, corner)).collect(),
    });
    found.into_iter().flatten().collect()
}

struct FitNeighbourhood<'a> {
    study: &'a Study,
    linearised: &'a Linearised,
    projector: &'a Projector<'a>,
    base: &'a Fit,
    columns: Vec<Column>,
    prediction: Arc<Prediction>,
    right_residual: DVector<f64>,
    rows: Vec<Range<usize>>,
}

impl FitNeighbourhood<'_> {
    fn with(&self, effect: usize, values: Vec<f64>) -> Start {
        let mut hypothesis = self.base.hypothesis.clone();
        hypothesis.effects.push((effect, values));
        Start { hypothesis, prediction: None, columns: Vec::new() }
    }

    /// The same with one value and its known change, by which the parameter's coordinate moves by `by`.
    fn with_change(&self, effect: usize, value: f64, change: &Arc<Vec<f64>>, by: f64) -> Start {
        let mut start = self.with(effect, vec![value]);
        if by != 0.0 && by.is_finite() {
            start.columns = self.columns.clone();
            let history = self.study.histories[effect];
            start.columns.push(Column { change: change.clone(), units: by, history });
        }
        start
    }

    fn change(&self, effect: usize, values: Vec<f64>) -> Option<Arc<Vec<f64>>> {
        self.linearised.change(self.study, effect, values)
    }

    /// Squared length of a change and its product with the residual, with nuisances free.
    fn products(&self, change: &[f64]) -> (f64, f64) {
        let right = self.projector.right(change);
        let own = self.projector.product(change, &right, change, &right);
        (own, self.projector.product(change, &right, &self.base.residual, &self.right_residual))
    }

    fn at(&self, effect: usize, values: Vec<f64>) -> Option<Addition> {
        let (own, seen) = self.products(self.change(effect, values.clone())?.as_slice());
        let gain = if own > NO_CHANGE && seen > 0.0 { seen * seen / own } else { 0.0 };
        Some(Addition { effect, gain, start: self.with(effect, values) })
    }

    fn at_one(&self, effect: usize, parameter: &EffectParameter) -> Option<Addition> {
        let (step, change, products) = self.line(effect, parameter)?;
        Some(self.along(effect, parameter, step, &change, products))
    }

    fn with_onsets(&self, effect: usize, parameter: &EffectParameter) -> Vec<Addition> {
        let Some((step, change, _)) = self.line(effect, parameter) else { return Vec::new() };
        // The products of a change that begins with a step are sums over its steps.
        let of_steps: Vec<Share> =
            self.rows.iter().map(|rows| self.projector.share(rows, &change, &self.base.residual)).collect();
        let from = |late: usize| {
            let history = self.study.histories[late];
            let mut right = DVector::zeros(self.right_residual.len());
            let (mut own, mut seen) = (0.0, 0.0);
            for (step, of_step) in of_steps.iter().enumerate() {
                let share = history.at(step as f64);
                right.axpy(share, &of_step.right, 1.0);
                own += share * share * of_step.own;
                seen += share * of_step.seen;
            }
            let own = self.projector.projected(own, &right, &right);
            let seen = self.projector.projected(seen, &right, &self.right_residual);
            (own > 1.0).then(|| self.along(late, parameter, step, &change, (own, seen)))
        };
        self.study.onsets_of(effect).filter_map(from).collect()
    }

    /// A step of the parameter to the side that the data suggest, with its change and products.
    fn line(&self, effect: usize, parameter: &EffectParameter) -> Option<Line> {
        let step_to =
            |by: f64| (parameter.neutral + by).clamp(parameter.low, parameter.high) - parameter.neutral;
        let step = step_to(parameter.typical_step);
        let change = self.change(effect, vec![parameter.neutral + step])?;
        let products = self.products(&change);
        let opposite = step_to(-step);
        if products.1 < -OFF_NEUTRAL * products.0
            && opposite != 0.0
            && let Some(other) = self.change(effect, vec![parameter.neutral + opposite])
        {
            let of_other = self.products(&other);
            if of_other.1 > 0.0 {
                return Some((opposite, other, of_other));
            }
        }
        Some((step, change, products))
    }

    /// The optimum along the line through a step.
    fn along(
        &self,
        effect: usize,
        parameter: &EffectParameter,
        step: f64,
        change: &Arc<Vec<f64>>,
        (own, seen): (f64, f64),
    ) -> Addition {
        let at = |share: f64| (parameter.neutral + share * step).clamp(parameter.low, parameter.high);
        let wanted = if own > NO_CHANGE { (seen / own).clamp(-MAX_MOVE, MAX_MOVE) } else { 0.0 };
        let share = (at(wanted) - parameter.neutral) / step;
        let gain = 2.0 * share * seen - share * share * own;
        let off = if wanted < 0.0 { wanted.min(-OFF_NEUTRAL) } else { wanted.max(OFF_NEUTRAL) };
        let off = if at(off) == parameter.neutral { OFF_NEUTRAL } else { off };
        let coordinate = Coordinate::new(parameter);
        let by = coordinate.of(parameter.neutral + step) - coordinate.of(parameter.neutral);
        // A weak effect starts at neutral, where the prediction is known.
        let weak = wanted.abs() <= 1.0 && !coordinate.is_logarithmic();
        let mut start = self.with_change(effect, if weak { parameter.neutral } else { at(off) }, change, by);
        start.prediction = weak.then(|| self.prediction.clone());
        Addition { effect, gain: if step == 0.0 { 0.0 } else { gain }, start }
    }
}

/// A step of a parameter, its whitened change, and the products of [`FitNeighbourhood::products`].
type Line = (f64, Arc<Vec<f64>>, (f64, f64));

/// Search starts for an effect of several parameters: the corners of the inner part of their ranges.
fn corners(parameters: &[EffectParameter]) -> Vec<Vec<f64>> {
    let places = |p: &EffectParameter| {
        let coordinate = Coordinate::new(p);
        let (low, high) = (coordinate.of(p.low), coordinate.of(p.high));
        INNER_SHARES.map(|share| coordinate.value(low + share * (high - low)))
    };
    let mut corners: Vec<Vec<f64>> = vec![Vec::new()];
    for parameter in parameters {
        corners = corners
            .into_iter()
            .flat_map(|corner| places(parameter).map(|value| [corner.clone(), vec![value]].concat()))
            .collect();
    }
    corners
}

/// Calibration constants.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Calibration {
    /// Command that produced the constants, with its seed.
    pub made_by: String,
    /// Minimum score above that of no cause for a cause to be named.
    pub threshold: f64,
    /// Divisor of score differences.
    pub temperature: f64,
    /// Prior of no cause.
    pub prior_none: f64,
    /// Prior of all singles together.
    pub prior_single: f64,
    /// Prior of all pairs together.
    pub prior_pair: f64,
    /// Prior of all triples together; each further effect multiplies the prior by this factor again.
    pub prior_triple: f64,
    /// Factor on the parameters' standard errors.
    pub interval_factor: f64,
    /// Share of recordings with causes of the effect library in which these are not among the candidates.
    pub unlisted: f64,
    /// Logistic model of an unmodelled cause: offset, and slopes of the features of a score.
    pub outside: [f64; 3],
    /// Where each number comes from, by its key; those of `outside` are `outside_0` to `outside_2`.
    pub origins: BTreeMap<String, Origin>,
}

/// Where a number of the calibration comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Origin {
    /// Fitted: the data determine it.
    Data,
    /// Fitted, but it ends at a bound that was set by hand.
    Bound,
    /// Fitted, but the data hardly narrow its prior.
    Prior,
    /// Not fitted.
    Copied,
}

const TEXT: &str = include_str!("../../../calibration.json");

impl Calibration {
    /// Returns the shipped calibration.
    pub fn shipped() -> Result<Calibration, serde_json::Error> {
        serde_json::from_str(TEXT)
    }

    /// Probability of an unmodelled cause, given smooth misfit and scatter of the best fit, in standard deviations.
    pub fn outside(&self, features: [f64; 2]) -> f64 {
        let [offset, slopes @ ..] = self.outside;
        let x = offset
            + slopes
                .iter()
                .zip(Calibration::logistic_features(features))
                .map(|(slope, x)| slope * x)
                .sum::<f64>();
        probability(x)
    }

    /// The rules by which the fits of a search become probabilities. Its sets are reduced to the members that the recording supports.
    pub fn rules(&self) -> Rules {
        let Calibration { threshold, temperature, unlisted, .. } = *self;
        Rules { threshold, temperature, unlisted, part_margin: 0.0 }
    }
}

/// Upper limit of half the squared misfit, above which all misfits count as equally large. Bound: its logistic model is certain
/// long before.
const MAX: f64 = 500.0;

impl Calibration {
    /// Transforms the features of an unmodelled cause for its logistic model: smooth misfit as half its square (negative log-probability of
    /// noise), scatter by order of magnitude, because linearised models follow any cause only to a few per cent.
    pub fn logistic_features([smooth_sigma, scatter_sigma]: [f64; 2]) -> [f64; 2] {
        let unlikely = 0.5 * smooth_sigma.max(0.0).powi(2);
        [unlikely.min(MAX), scatter_sigma.max(0.0).asinh()]
    }
}

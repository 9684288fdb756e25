//! What one more effect would do beside a fit, in closed form.

use crate::coordinate::Coordinate;
use crate::fit::Fit;
use crate::projector::Projector;
use crate::selection::Selection;
use crate::study::{Hypothesis, Study, members};
use crate::whiten::Linearised;

/// What one more effect would do beside a fit.
pub struct Addition {
    /// Which.
    pub effect: usize,
    /// What it would take off the cost, in a straight line.
    pub gain: f64,
    /// Where to start a fit.
    pub start: Hypothesis,
}

/// Every further effect beside a fit, in closed form from one run each.
pub fn additions(study: &Study, linearised: &Linearised, selection: &Selection, base: &Fit) -> Vec<Addition> {
    let Some(projector) = Projector::new(study, linearised, selection, &base.effect_columns) else {
        return Vec::new();
    };
    // At the fit's best what the residual asks of the nuisances is what their priors ask back: a tolerance that stands far
    // out pulls for the effect that would let it go.
    let mut right_residual = projector.right(&base.residual);
    for (right, nuisance) in right_residual.iter_mut().zip(&base.hypothesis.nuisances) {
        *right -= nuisance;
    }
    let used = members(&base.hypothesis);
    let mut starts: Vec<(usize, Hypothesis)> = Vec::new();
    for index in (0..study.catalogue).filter(|index| !used.contains(index)) {
        starts.extend(starts_of(study, &base.hypothesis, index).into_iter().map(|start| (index, start)));
    }
    let mut best: Vec<Addition> = Vec::new();
    for (index, start) in starts {
        // A whole typical step: some effects have no slope where they vanish.
        let parameters = &study.effects[index].info().parameters;
        let single = parameters.len() == 1;
        let mut near = start.clone();
        if let (true, Some((_, values))) = (single, near.effects.last_mut()) {
            let (neutral, step) = (parameters[0].neutral, values[0] - parameters[0].neutral);
            values[0] = (neutral + step).clamp(parameters[0].low, parameters[0].high);
        }
        let Ok(there) = study.predict(&near) else { continue };
        let mut change: Vec<f64> =
            there.values.iter().zip(&base.prediction.values).map(|(t, b)| t - b).collect();
        linearised.whiten(study, &mut change);
        let right = projector.right(&change);
        let own = projector.product(&change, &right, &change, &right);
        let seen = projector.product(&change, &right, &base.residual, &right_residual);
        let mut share = if own > 1e-9 { seen / own } else { 0.0 };
        let mut addition = Addition { effect: index, gain: 0.0, start };
        if single {
            let parameter = &parameters[0];
            let step = parameter.typical_step;
            // The straight estimate, kept within the range; not far beyond the step that was taken, for effects bend.
            let value =
                (parameter.neutral + share.clamp(-3.0, 3.0) * step).clamp(parameter.low, parameter.high);
            share = (value - parameter.neutral) / step;
            let value = if value == parameter.neutral { parameter.neutral + 0.1 * step } else { value };
            if let Some((_, values)) = addition.start.effects.last_mut() {
                values[0] = value.clamp(parameter.low, parameter.high);
            }
            addition.gain = 2.0 * share * seen - share * share * own;
        } else {
            addition.gain = if share > 0.0 { seen * seen / own } else { 0.0 };
        }
        match best.iter_mut().find(|other| other.effect == index) {
            Some(other) if other.gain >= addition.gain => {}
            Some(other) => *other = addition,
            None => best.push(addition),
        }
    }
    best
}

/// Where the search for an effect begins: a typical step from neutral, and where two parameters work together, several.
pub(crate) fn starts_of(study: &Study, base: &Hypothesis, index: usize) -> Vec<Hypothesis> {
    let parameters = &study.effects[index].info().parameters;
    let with = |values: Vec<f64>| {
        let mut start = base.clone();
        start.effects.push((index, values));
        start
    };
    if let [parameter] = parameters.as_slice() {
        let value = parameter.neutral + parameter.typical_step;
        return vec![with(vec![value.clamp(parameter.low, parameter.high)])];
    }
    // Corners of the inner part of each range.
    let places = |p: &mapper_physics::effect::EffectParameter| {
        let coordinate = Coordinate::new(p);
        let (low, high) = (coordinate.of(p.low), coordinate.of(p.high));
        [0.33, 0.6].map(|share| coordinate.value(low + share * (high - low)))
    };
    let mut corners: Vec<Vec<f64>> = vec![Vec::new()];
    for parameter in parameters {
        corners = corners
            .into_iter()
            .flat_map(|corner| places(parameter).map(|value| [corner.clone(), vec![value]].concat()))
            .collect();
    }
    corners.into_iter().map(with).collect()
}

//! All pairs of effects in closed form, so that none is overlooked because neither member does much alone.

use crate::fit::Fit;
use crate::projector::Projector;
use crate::selection::Selection;
use crate::study::{Hypothesis, Study};
use crate::whiten::Linearised;

/// A pair as a straight line sees it.
pub struct Screened {
    /// Both effects, by index, in order.
    pub names: Vec<usize>,
    /// Cost that is left.
    pub cost: f64,
    /// Where to start a fit.
    pub start: Hypothesis,
}

/// Strengths beyond so many times what each has alone are not believed.
const MOST_TIMES: f64 = 4.0;

/// All pairs of the fitted singles, lowest cost first: what each single changes at its own best, in any two amounts within
/// their ranges, nuisances free.
pub fn screen(
    study: &Study,
    linearised: &Linearised,
    selection: &Selection,
    singles: &[Fit],
) -> Vec<Screened> {
    let Some(projector) = Projector::new(study, linearised, selection, &[]) else { return Vec::new() };
    let residual = linearised.residual(study, &linearised.base);
    let right_residual = projector.right(&residual);
    let whole = projector.product(&residual, &right_residual, &residual, &right_residual);
    // What a single changes: its prediction minus the base. What its nuisances did is projected out with the others.
    let mut signatures = Vec::new();
    for fit in singles {
        let [(effect, values)] = fit.hypothesis.effects.as_slice() else { continue };
        let [parameter] = study.effects[*effect].info().parameters.as_slice() else { continue };
        let away = values[0] - parameter.neutral;
        if away == 0.0 {
            continue;
        }
        let mut change: Vec<f64> =
            fit.prediction.values.iter().zip(&linearised.base.values).map(|(t, b)| t - b).collect();
        linearised.whiten(study, &mut change);
        let right = projector.right(&change);
        let own = projector.product(&change, &right, &change, &right);
        let seen = projector.product(&change, &right, &residual, &right_residual);
        if own > 1.0 {
            let most = |end: f64| (end - parameter.neutral) / away;
            let (a, b) = (most(parameter.low), most(parameter.high));
            let range = (a.min(b).max(-MOST_TIMES), a.max(b).min(MOST_TIMES));
            signatures.push((*effect, parameter.neutral, away, range, change, right, own, seen));
        }
    }
    let mut found = Vec::new();
    for (place, (first, neutral_a, away_a, range_a, change_a, right_a, own_a, seen_a)) in
        signatures.iter().enumerate()
    {
        for (second, neutral_b, away_b, range_b, change_b, right_b, own_b, seen_b) in &signatures[..place] {
            let both = projector.product(change_a, right_a, change_b, right_b);
            let determinant = own_a * own_b - both * both;
            // Two that act alike are no pair.
            if determinant < 1e-4 * own_a * own_b {
                continue;
            }
            let within = |x: f64, range: &(f64, f64)| x.clamp(range.0, range.1);
            let mut a = within((seen_a * own_b - seen_b * both) / determinant, range_a);
            let b = within((seen_b - a * both) / own_b, range_b);
            a = within((seen_a - b * both) / own_a, range_a);
            let gain = 2.0 * (a * seen_a + b * seen_b) - (a * a * own_a + b * b * own_b + 2.0 * a * b * both);
            let mut start = study.nothing();
            start.effects =
                vec![(*first, vec![neutral_a + a * away_a]), (*second, vec![neutral_b + b * away_b])];
            let mut names = vec![*first, *second];
            names.sort_unstable();
            found.push(Screened { names, cost: whole - gain, start });
        }
    }
    found.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    found
}

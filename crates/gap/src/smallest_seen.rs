//! Smallest detectable size of an effect, from its signature length with nuisances projected out and the evidence required to name a cause.

use crate::calibration::Calibration;
use crate::coordinate::Coordinate;
use crate::in_words;
use crate::normal::PRIOR_STEPS;
use crate::projector::Projector;
use crate::report::SmallestSeen;
use crate::selection::Selection;
use crate::study::Study;
use crate::whiten::Linearised;
use mapper_numerics::parallel;

/// 95 % quantile of the standard normal distribution: at this margin above the threshold, an effect is named in 95 of 100 recordings.
const SURELY: f64 = 1.645;
/// Maximum number of runs to find a size, and the tolerance in the logarithm of the length.
const LOOKS: usize = 5;
const NEAR: f64 = 0.05;

/// Smallest size of each effect, on the side of its typical step, that would be named in 95 of 100 recordings like this one. Effects that
/// stay undetectable within their range have no size.
pub fn smallest_seen(study: &Study, linearised: &Linearised, calibration: &Calibration) -> Vec<SmallestSeen> {
    let everywhere = Selection::all(study);
    let Some(projector) = Projector::new(study, linearised, &everywhere, &[]) else { return Vec::new() };
    let count = study.catalogue.max(2) as f64;
    let against =
        calibration.threshold + calibration.prior_none.ln() - (calibration.prior_single / count).ln();
    let indices: Vec<usize> = (0..study.catalogue).collect();
    let found = parallel::map(&indices, |index| {
        let info = study.effects[*index].info();
        let (parameter, others) = info.parameters.split_last()?;
        let coordinate = Coordinate::new(parameter);
        // With several parameters, the others are a typical step from neutral.
        let at = |value: f64| {
            let mut there = study.nothing();
            let typical = others.iter().map(|p| (p.neutral + p.typical_step).clamp(p.low, p.high));
            there.effects = vec![(*index, typical.chain([value]).collect())];
            there
        };
        let length = |value: f64| -> Option<f64> {
            let there = study.predict(&at(value)).ok()?;
            let mut change: Vec<f64> =
                there.values.iter().zip(&linearised.base.values).map(|(t, b)| t - b).collect();
            linearised.whiten(study, &mut change);
            let right = projector.right(&change);
            Some(projector.product(&change, &right, &change, &right).max(0.0).sqrt())
        };
        // Distance from neutral; its inverse for a parameter that spans decades, because the effect is strong at small values.
        let away = |value: f64| {
            if coordinate.is_logarithmic() { 1.0 / value } else { value - parameter.neutral }
        };
        let value_at = |away: f64| {
            let value = if coordinate.is_logarithmic() { 1.0 / away } else { parameter.neutral + away };
            value.clamp(parameter.low, parameter.high)
        };
        let furthest = away(value_at(away(parameter.neutral + parameter.typical_step) * 1e9));
        let mut here = away(value_at(away(parameter.neutral + parameter.typical_step)));
        let mut seen = false;
        let mut before: Option<(f64, f64)> = None;
        for _ in 0..LOOKS {
            let sigma = length(value_at(here))?;
            if sigma <= 1e-6 || here == 0.0 {
                return None;
            }
            // Laplace evidence of one parameter with this curvature, compared with the threshold of a cause.
            let unit = coordinate.of(value_at(here)) - coordinate.of(parameter.neutral);
            let curvature = (sigma / unit.abs().max(1e-9)).powi(2);
            let needed =
                against + 0.5 * curvature.ln() - 0.5 * (2.0 * std::f64::consts::PI).ln() + PRIOR_STEPS.ln();
            let wanted = (2.0 * needed.max(0.0)).sqrt() + SURELY;
            seen = sigma > 0.9 * wanted;
            if (sigma / wanted).ln().abs() < NEAR {
                break;
            }
            // Interpolates logarithms with the power law of two runs, because effects are nonlinear.
            let power = before.map_or(1.0, |(there, length): (f64, f64)| {
                ((sigma / length).ln() / (here / there).ln()).clamp(0.6, 3.0)
            });
            before = Some((here, sigma));
            let moved = here * (wanted / sigma).powf(1.0 / if power.is_finite() { power } else { 1.0 });
            here = if moved.abs() > furthest.abs() { furthest } else { moved };
        }
        let value = value_at(here);
        Some(SmallestSeen {
            effect: info.id.to_string(),
            name: info.name.to_string(),
            parameter: parameter.name.to_string(),
            value: seen.then_some(value),
            unit: parameter.unit.to_string(),
            size: seen.then(|| in_words::size(parameter, value)),
        })
    });
    found.into_iter().flatten().collect()
}

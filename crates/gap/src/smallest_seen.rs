//! How small an effect would have been seen: from the length of its signature, nuisances projected out, and the evidence that a
//! cause needs to be named.

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

/// 95 % quantile of the standard normal distribution: so many sigmas above what is needed, an effect is seen in 95 of 100
/// recordings.
const SURELY: f64 = 1.645;
/// Runs in which a size is found, and how near in the logarithm of the length is near enough.
const LOOKS: usize = 5;
const NEAR: f64 = 0.05;

/// The smallest size of each effect, on the side of its typical step, that would have been named in 95 of 100 recordings like this
/// one; effects that would not have been within their range have no size.
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
        // Where several work together the others stand a typical step from neutral.
        let at = |value: f64| {
            let mut there = study.nothing();
            let beside = others.iter().map(|p| (p.neutral + p.typical_step).clamp(p.low, p.high));
            there.effects = vec![(*index, beside.chain([value]).collect())];
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
        // How far from neutral: of what spans decades its inverse tells, for the effect is there where it is small.
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
            // Laplace's evidence of one parameter of this curvature, held against what a cause needs.
            let unit = coordinate.of(value_at(here)) - coordinate.of(parameter.neutral);
            let curvature = (sigma / unit.abs().max(1e-9)).powi(2);
            let needed =
                against + 0.5 * curvature.ln() - 0.5 * (2.0 * std::f64::consts::PI).ln() + PRIOR_STEPS.ln();
            let wanted = (2.0 * needed.max(0.0)).sqrt() + SURELY;
            seen = sigma > 0.9 * wanted;
            if (sigma / wanted).ln().abs() < NEAR {
                break;
            }
            // In logarithms, by the power that two looks show: effects bend.
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

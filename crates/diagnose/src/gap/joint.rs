//! Joint analysis of several recordings of one rig: which causes persist, appear or disappear, and their sizes from all recordings.
//!
//! Offsets and tolerances belong to the rig and are the same in every recording; the metal's start is per recording. Each recording has a
//! mode `x_i` and a precision `P_i` with nuisance priors `D`, starts integrated out. The joint solution is `P = sum (P_i - D) + D`, `P x =
//! sum P_i x_i`, so shared information is counted once.

use crate::gap::best_fit::coordinate::{Coordinate, coordinates, infos, parameters, unknowns};
use crate::gap::best_fit::fit::{Effort, Fit, fit};
use crate::gap::best_fit::normal::Selection;
use crate::gap::causes::calibration::Calibration;
use crate::gap::diagnose::Diagnosed;
use crate::gap::findings::in_words;
use crate::gap::findings::report::Verdict;
use crate::gap::residuals::study::{EffectValues, Hypothesis, Study};
use mapper_core::confidence_interval_95;
use mapper_inference::hypotheses::MAX_MEMBERS;
use mapper_numerics::parallel;
use mapper_numerics::statistics::DOUBT_SIGMAS;
use nalgebra::{DMatrix, DVector};
use serde::Serialize;

/// Minimum share of a recording's variance by which it can differ from the joint one. Bound: rounding of their difference.
const MIN_VARIANCE_SHARE: f64 = 1e-4;

/// A value with its 95 % interval.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Value {
    /// Best value.
    pub value: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

/// Change of a cause over the recordings.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Persistence {
    /// In all recordings, with the same size.
    Persists,
    /// In all recordings, with different sizes.
    Changes,
    /// In the last recording but not in the first.
    Appeared,
    /// In the first recording but not in the last.
    Disappeared,
    /// In some recordings.
    ComesAndGoes,
}

/// One parameter of a cause over the recordings.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Over {
    /// Id of the effect.
    pub effect: String,
    /// Display name.
    pub name: String,
    /// The parameter.
    pub parameter: String,
    /// Unit.
    pub unit: String,
    /// Change of the cause.
    pub persistence: Persistence,
    /// Value of each recording alone, in order.
    pub each: Vec<Value>,
    /// Whether each recording has the cause.
    pub present: Vec<bool>,
    /// Joint value from all recordings with the cause.
    pub together: Value,
    /// The joint value as text.
    pub size: String,
}

impl Over {
    /// Jointly analyses several recordings of one rig. Empty if no recording has a named cause, or if their channels differ and so their
    /// nuisances do too.
    pub fn recordings(diagnosed: &[&Diagnosed], calibration: &Calibration) -> Vec<Over> {
        let Some(first) = diagnosed.first() else { return Vec::new() };
        let effects = named_anywhere(diagnosed);
        if effects.is_empty() || diagnosed.iter().any(|d| d.study.nuisances != first.study.nuisances) {
            return Vec::new();
        }
        let fitted: Vec<(Fit, Vec<bool>)> = diagnosed.iter().filter_map(|d| refitted(d, &effects)).collect();
        if fitted.len() != diagnosed.len() {
            return Vec::new();
        }
        let (fits, there): (Vec<Fit>, Vec<Vec<bool>>) = fitted.into_iter().unzip();
        let study = &first.study;
        let at = coordinates(&study.effects, &fits[0].hypothesis);
        let neutral = neutral_coordinates(study, &fits[0].hypothesis, &at);
        let factor = calibration.interval_factor;
        let places: Vec<Vec<f64>> = fits
            .iter()
            .map(|fit| parameters(&fit.hypothesis).iter().zip(&at).map(|(value, c)| c.of(*value)).collect())
            .collect();
        let sigma = |fit: &Fit, k: usize| factor * fit.covariance[(k, k)].max(0.0).sqrt();
        let named: Vec<(usize, usize)> = fits[0]
            .hypothesis
            .effects
            .iter()
            .flat_map(|(index, values)| (0..values.len()).map(move |p| (*index, p)))
            .collect();
        let mut over = Vec::new();
        for (k, (index, number)) in named.iter().enumerate() {
            let effect = fits[0].hypothesis.effects.iter().position(|(other, _)| other == index).unwrap_or(0);
            let present: Vec<bool> = there.iter().map(|there| there[effect]).collect();
            // An absent cause has the neutral size, with the uncertainty given by its curvature.
            let place = |i: usize| if present[i] { places[i][k] } else { neutral[k] };
            let having: Vec<&Fit> =
                fits.iter().zip(&present).filter(|(_, there)| **there).map(|(f, _)| f).collect();
            let Some((x, spread)) =
                together(study, if having.is_empty() { fits.iter().collect() } else { having }, &at, k)
            else {
                continue;
            };
            let spread = factor * spread;
            let apart = (0..fits.len()).filter(|i| present[*i]).any(|i| {
                let own = sigma(&fits[i], k);
                (places[i][k] - x).abs()
                    > DOUBT_SIGMAS * (own * own - spread * spread).max(MIN_VARIANCE_SHARE * own * own).sqrt()
            });
            let (begins, ends) = (present.first() == Some(&true), present.last() == Some(&true));
            let persistence = match (present.iter().all(|p| *p), begins, ends) {
                (true, ..) if apart => Persistence::Changes,
                (true, ..) => Persistence::Persists,
                (_, false, true) => Persistence::Appeared,
                (_, true, false) => Persistence::Disappeared,
                _ => Persistence::ComesAndGoes,
            };
            let value = |x: f64, sigma: f64| {
                let ends = <[f64; 2]>::from(confidence_interval_95(x, sigma)).map(|x| at[k].value(x));
                Value { value: at[k].value(x), low: ends[0].min(ends[1]), high: ends[0].max(ends[1]) }
            };
            let info = study.effects[*index].info();
            let parameter = &info.parameters[*number];
            let together = value(x, spread);
            over.push(Over {
                effect: info.id.to_string(),
                name: info.name.to_string(),
                parameter: parameter.name.to_string(),
                unit: parameter.unit.to_string(),
                persistence,
                each: (0..fits.len()).map(|i| value(place(i), sigma(&fits[i], k))).collect(),
                present,
                size: in_words::size(parameter, together.value),
                together,
            });
        }
        over
    }
}

/// Effects named in any recording, by library index, each with its values there.
fn named_anywhere(diagnosed: &[&Diagnosed]) -> EffectValues {
    let mut effects: EffectValues = Vec::new();
    for one in diagnosed {
        if !matches!(one.diagnosis.verdict, Verdict::Explained | Verdict::PartlyExplained) {
            continue;
        }
        let Some(best) = one.fits.first() else { continue };
        for (index, values) in &best.hypothesis.effects {
            let id = &one.study.effects[*index].info().id;
            let known = (0..one.study.catalogue).find(|i| one.study.effects[*i].info().id == *id);
            if let Some(known) = known.filter(|known| effects.iter().all(|(other, _)| other != known)) {
                effects.push((known, values.clone()));
            }
        }
    }
    effects.truncate(MAX_MEMBERS);
    effects
}

/// Refits one recording with all effects named in any of them. Also returns whether it has each effect: whether removing it worsens the fit
/// by [`DOUBT_SIGMAS`].
fn refitted(diagnosed: &Diagnosed, effects: &EffectValues) -> Option<(Fit, Vec<bool>)> {
    let study = &diagnosed.study;
    let everywhere = Selection::all(study);
    let nuisances = diagnosed.fits.first().unwrap_or(&diagnosed.null).hypothesis.nuisances.clone();
    let own = diagnosed.fits.first().map(|fit| &fit.hypothesis.effects);
    let start = effects
        .iter()
        .map(|(index, values)| {
            let here = own.and_then(|own| own.iter().find(|(other, _)| other == index));
            (*index, here.map_or(values, |(_, values)| values).clone())
        })
        .collect();
    let start = Hypothesis { nuisances, effects: start };
    let linearised = diagnosed.linearised.at(study, &start).ok()?;
    let whole = fit(study, &linearised, &start, &everywhere, Effort::default()).ok()?;
    let places: Vec<usize> = (0..effects.len()).collect();
    let there = parallel::map(&places, |place| {
        let mut without = whole.hypothesis.clone();
        without.effects.remove(*place);
        let without = fit(study, &linearised, &without, &everywhere, Effort::default());
        without.is_ok_and(|without| without.cost - whole.cost > DOUBT_SIGMAS * DOUBT_SIGMAS)
    });
    Some((whole, there))
}

fn neutral_coordinates(study: &Study, hypothesis: &Hypothesis, at: &[Coordinate]) -> Vec<f64> {
    let parameters = infos(&study.effects, hypothesis).flat_map(|info| &info.parameters);
    parameters.zip(at).map(|(parameter, coordinate)| coordinate.of(parameter.neutral)).collect()
}

/// Joint coordinate of one parameter over several recordings, and its standard error.
fn together(study: &Study, fits: Vec<&Fit>, at: &[Coordinate], wanted: usize) -> Option<(f64, f64)> {
    let starts: Vec<usize> =
        study.nuisances.iter().enumerate().filter(|(_, n)| n.kind.is_start()).map(|(i, _)| i).collect();
    let nuisances = study.nuisances.len();
    let kept: Vec<usize> = (0..nuisances + at.len()).filter(|i| !starts.contains(i)).collect();
    let shared = kept.iter().filter(|i| **i < nuisances).count();
    let n = kept.len();
    let (mut precision, mut right) = (DMatrix::zeros(n, n), DVector::zeros(n));
    for fit in fits {
        let mode = unknowns(&fit.hypothesis, at).select_rows(&kept);
        let part = |rows: &[usize], columns: &[usize]| {
            DMatrix::from_fn(rows.len(), columns.len(), |i, j| fit.precision[(rows[i], columns[j])])
        };
        let mut own = part(&kept, &kept);
        if !starts.is_empty() {
            let across = part(&kept, &starts);
            let inverse = part(&starts, &starts).try_inverse()?;
            own -= &across * inverse * across.transpose();
        }
        right += &own * mode;
        for i in 0..shared {
            own[(i, i)] -= 1.0;
        }
        precision += own;
    }
    for i in 0..shared {
        precision[(i, i)] += 1.0;
    }
    let cholesky = precision.cholesky()?;
    let x = cholesky.solve(&right);
    let place = shared + wanted;
    let mut unit = DVector::zeros(n);
    unit[place] = 1.0;
    let variance = cholesky.solve(&unit)[place];
    Some((x[place], variance.max(0.0).sqrt()))
}

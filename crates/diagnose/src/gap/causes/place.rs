//! Locates the gap in parts of the machine.
//!
//! Each explanation (a fitted cause, a closure term, a source term in one balance) has a score and parts. A part's share of an explanation is its
//! additional misfit reduction given the other parts. Its share of the gap is the probability-weighted mean over the explanations, so
//! shares add up to 1. A fault-free part has no share, because another part explains the gap better.

use crate::gap::best_fit::fit::Fit;
use crate::gap::causes::additions::Calibration;
use crate::gap::causes::probabilities::{prior, weight};
use crate::gap::report::Place;
use crate::gap::residuals::nuisance::OUTPUTS;
use crate::gap::residuals::prediction::PointState;
use crate::gap::residuals::study::{Study, members};
use crate::gap::residuals::whiten::{Linearised, NO_ENERGY};
use mapper_core::unit_factors::RPM_PER_KRPM;
use mapper_inference::posterior::shares;
use mapper_physics::rig::effect::Submodel;

/// Linearisation error as a share of the gain: explanations closer than this remain open, and a part with less of the gap is not listed.
/// Bound: derivatives from linear runs are within a per cent of those from runs of the model.
pub(crate) const LINEARISATION_ERROR_RATIO: f64 = 0.01;

/// Phases of a step: name and start after the jump, s. Bound: those of probe, gas and housings; only shown.
const PHASES: [(&str, f64); 3] = [("0-5 s", 0.0), ("5-30 s", 5.0), ("30-110 s", 30.0)];
/// Positions on the speed line from which a point is near surge, and in the middle. Bound: only shown.
const REGIONS: (f64, f64) = (0.97, 0.75);

#[derive(Debug)]
pub(crate) struct Gain<'a> {
    pub fit: &'a Fit,
    /// Null cost minus its own cost; scaled up proportionally for a fit to some of the steps.
    pub gain: f64,
}

pub(crate) struct Part<'a> {
    pub submodel: Submodel,
    /// Its additional misfit reduction given the other parts, squared sigmas.
    pub gain: f64,
    /// Its change of the recording, in the channels' units.
    pub signature: Box<dyn Fn() -> Option<Vec<f64>> + 'a>,
}

pub(crate) struct Explanation<'a> {
    /// Log evidence relative to no cause.
    pub score: f64,
    pub parts: Vec<Part<'a>>,
}

/// Converts fits to explanations. `fits` are effects and combinations, best first.
pub(crate) fn of_fits<'a>(
    study: &'a Study,
    fits: &'a [Gain<'_>],
    calibration: &Calibration,
) -> Vec<Explanation<'a>> {
    let explanation = |candidate: &'a Gain<'_>| {
        let all = members(&candidate.fit.hypothesis);
        let parts = all.iter().map(|effect| {
            let without: Vec<usize> = all.iter().copied().filter(|other| other != effect).collect();
            let others = fits.iter().find(|f| members(&f.fit.hypothesis) == without).map_or(0.0, |f| f.gain);
            let effect = *effect;
            Part {
                submodel: study.effects[effect].info().submodel,
                gain: (candidate.gain - others).max(0.0),
                signature: Box::new(move || signature(study, candidate.fit, effect)),
            }
        });
        // Scores of fits to some steps and to all steps are not comparable; gains are.
        let rarity = prior(calibration, study, &candidate.fit.hypothesis);
        let nothing = prior(calibration, study, &study.nothing());
        Explanation { score: 0.5 * candidate.gain + rarity - nothing, parts: parts.collect() }
    };
    fits.iter().map(explanation).collect()
}

/// Change of the recording due to one effect of a fit.
pub(crate) fn signature(study: &Study, fit: &Fit, effect: usize) -> Option<Vec<f64>> {
    let mut without = fit.hypothesis.clone();
    without.effects.retain(|(index, _)| *index != effect);
    let there = study.predict(&without).ok()?;
    Some(fit.prediction.values.iter().zip(&there.values).map(|(with, without)| with - without).collect())
}

/// Locations of the gap, largest first. `fits`: singles and pairs, best first; `named`: how many of them the data do not distinguish.
pub(crate) fn places(
    (study, calibration): (&Study, &Calibration),
    linearised: &Linearised,
    null: &Fit,
    fits: &[Gain<'_>],
    named: Option<usize>,
) -> Vec<Place> {
    let considered = named.map_or(fits, |causes| &fits[..fits.len().min(causes)]);
    // The other fits give each member's contribution.
    let mut explanations = of_fits(study, fits, calibration);
    explanations.truncate(considered.len());
    if named.is_some() {
        // Fits to the same steps: their evidence is comparable.
        for (explanation, Gain { fit, .. }) in explanations.iter_mut().zip(considered) {
            explanation.score = weight(calibration, study, fit);
        }
    }
    places_of(
        study,
        linearised,
        null,
        &explanations,
        if named.is_some() { 0.0 } else { LINEARISATION_ERROR_RATIO },
    )
}

/// Locations of the gap, largest first; explanations within the share `bend` of the best gain stay open (0 if the best leaves only noise).
pub(crate) fn places_of(
    study: &Study,
    linearised: &Linearised,
    null: &Fit,
    explanations: &[Explanation<'_>],
    bend: f64,
) -> Vec<Place> {
    let gain = |e: &Explanation<'_>| e.parts.iter().map(|part| part.gain).sum::<f64>();
    let most = explanations.iter().map(gain).fold(0.0, f64::max);
    let temperature = 1.0 + bend * 0.5 * most;
    let weights = shares(&explanations.iter().map(|e| e.score).collect::<Vec<_>>(), temperature);
    // Share, and the explanation in which the part contributes most.
    let mut parts: Vec<(Submodel, f64, f64, &Part<'_>)> = Vec::new();
    let mut whole = 0.0;
    for (explanation, weight) in explanations.iter().zip(&weights) {
        let of_all = gain(explanation);
        whole += weight * of_all;
        for part in explanation.parts.iter().filter(|_| of_all > 0.0) {
            let share = weight * part.gain / of_all;
            match parts.iter_mut().find(|(submodel, ..)| *submodel == part.submodel) {
                Some((_, sum, largest, shown)) => {
                    *sum += share;
                    if share > *largest {
                        (*largest, *shown) = (share, part);
                    }
                }
                None => parts.push((part.submodel, share, share, part)),
            }
        }
    }
    parts.sort_by(|a, b| b.1.total_cmp(&a.1));
    // A fitted cause is where its members are, however small; other parts may be due to the linearisation.
    let first = explanations.iter().zip(&weights).max_by(|a, b| a.1.total_cmp(b.1)).filter(|_| bend == 0.0);
    let of_first: Vec<Submodel> =
        first.iter().flat_map(|(explanation, _)| &explanation.parts).map(|part| part.submodel).collect();
    parts.retain(|(part, share, ..)| *share >= LINEARISATION_ERROR_RATIO || of_first.contains(part));
    let points = study.points(&null.hypothesis).unwrap_or_default();
    let shown = parts.into_iter().filter_map(|(submodel, share, _, part)| {
        Some((submodel, share, show(study, linearised, &(part.signature)()?, &points)?))
    });
    let shown: Vec<(Submodel, f64, Shown)> = shown.collect();
    let sum: f64 = shown.iter().map(|(_, share, _)| share).sum();
    shown
        .into_iter()
        .map(|(submodel, share, shown)| Place {
            submodel: submodel.name().to_owned(),
            channel: OUTPUTS[shown.output].symbol().to_owned(),
            phase: shown.phase.to_owned(),
            region: shown.region,
            share: share / sum,
            sigma: (share / sum * whole).max(0.0).sqrt(),
            size: shown.size,
            unit: OUTPUTS[shown.output].unit().to_owned(),
        })
        .collect()
}

struct Shown {
    output: usize,
    phase: &'static str,
    region: String,
    size: f64,
}

/// Location of the largest contribution of a signature; `None` if it is zero.
fn show(study: &Study, linearised: &Linearised, signature: &[f64], points: &[PointState]) -> Option<Shown> {
    let mut whitened = signature.to_vec();
    linearised.whiten(study, &mut whitened);
    if whitened.iter().map(|w| w * w).sum::<f64>() < NO_ENERGY {
        return None;
    }
    let energy = |keep: &dyn Fn(usize, usize, f64) -> bool| {
        let (mut whole, mut squares, mut count) = (0.0, 0.0, 0usize);
        for group in &study.groups {
            for (row, block) in group.rows.clone().zip(&group.blocks) {
                let since_s = study.steps[group.step].blocks[*block].since_jump_s;
                if keep(group.output, group.step, since_s) {
                    whole += whitened[row] * whitened[row];
                    squares += signature[row] * signature[row];
                    count += 1;
                }
            }
        }
        (whole, (squares / count.max(1) as f64).sqrt())
    };
    let largest = |candidates: usize, of: &dyn Fn(usize) -> f64| {
        (0..candidates).max_by(|a, b| of(*a).total_cmp(&of(*b)))
    };
    let output = largest(OUTPUTS.len(), &|o| energy(&|output, _, _| output == o).0)?;
    let in_phase = |phase: usize, since_s: f64| {
        let end_s = PHASES.get(phase + 1).map_or(f64::INFINITY, |(_, start_s)| *start_s);
        (PHASES[phase].1..end_s).contains(&since_s)
    };
    let phase = largest(PHASES.len(), &|p| energy(&|o, _, since_s| o == output && in_phase(p, since_s)).0)?;
    let step = largest(study.steps.len(), &|s| energy(&|o, step, _| o == output && step == s).0)?;
    let region = points.get(step).map_or_else(String::new, region);
    Some(Shown {
        output,
        phase: PHASES[phase].0,
        region,
        size: energy(&|o, _, since_s| o == output && in_phase(phase, since_s)).1,
    })
}

fn region(point: &PointState) -> String {
    let side = match point.surge_position_ratio {
        x if x > REGIONS.0 => "near surge",
        x if x > REGIONS.1 => "middle of the speed line",
        _ => "towards choke",
    };
    format!("{:.0} krpm, {side}", point.speed_rpm / RPM_PER_KRPM)
}

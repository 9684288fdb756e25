//! Where the gap lies: the parts of the model whose freedom accounts for most of it.
//!
//! A part's gain is by how much the best effect that sits in it reduces the misfit, nuisances refitted. Channel, phase and
//! region are those in which that effect shows most.

use crate::fit::Fit;
use crate::nuisance::OUTPUTS;
use crate::report::Place;
use crate::study::{PointState, Study, members};
use crate::whiten::Linearised;
use mapper_physics::effect::Submodel;

/// A part that reduces it by less, in squared sigmas, is not a place.
const LEAST_GAIN: f64 = 4.0;

/// Phases of a step: name and first second after the jump.
const PHASES: [(&str, f64); 3] = [("0-5 s", 0.0), ("5-30 s", 5.0), ("30-110 s", 30.0)];

/// A fit with its reduction of the misfit of all steps.
#[derive(Debug)]
pub struct Gain<'a> {
    /// The fit.
    pub fit: &'a Fit,
    /// Cost of the null minus its own; of a fit to some steps, in proportion.
    pub gain: f64,
}

/// One part with its gain, the fit in which it shows, and the effect that stands for it.
#[derive(Clone, Copy)]
struct Part<'a> {
    submodel: Submodel,
    gain: f64,
    fit: &'a Fit,
    effect: usize,
}

/// Places of the gap, largest first. `fits` are single effects and pairs, best first; where `named` is set, the first of
/// them is the cause, and its parts come first.
pub fn places(
    study: &Study,
    linearised: &Linearised,
    null: &Fit,
    fits: &[Gain<'_>],
    named: bool,
) -> Vec<Place> {
    // What no hypothesis gets below is noise.
    let excess = fits.iter().map(|f| f.gain).fold(1.0, f64::max);
    let submodel = |effect: usize| study.effects[effect].info().submodel;
    let mut first: Vec<Part<'_>> = Vec::new();
    if let (true, Some(best)) = (named, fits.first()) {
        let of_best = members(&best.fit.hypothesis);
        for effect in &of_best {
            // By how much this one reduces it beside the others.
            let without: Vec<usize> = of_best.iter().copied().filter(|other| other != effect).collect();
            let others = fits.iter().find(|f| members(&f.fit.hypothesis) == without).map_or(0.0, |f| f.gain);
            let gain = (best.gain - others).max(0.0);
            offer(&mut first, Part { submodel: submodel(*effect), gain, fit: best.fit, effect: *effect });
        }
    }
    let mut singles: Vec<Part<'_>> = Vec::new();
    for candidate in fits {
        if let [effect] = members(&candidate.fit.hypothesis)[..] {
            let part = submodel(effect);
            if first.iter().all(|other| other.submodel != part) {
                offer(
                    &mut singles,
                    Part { submodel: part, gain: candidate.gain, fit: candidate.fit, effect },
                );
            }
        }
    }
    first.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    singles.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    first.extend(singles);
    let points = study.points(&null.hypothesis).unwrap_or_default();
    first
        .into_iter()
        .filter(|part| part.gain > LEAST_GAIN)
        .filter_map(|part| {
            let Part { submodel, gain, fit, effect } = part;
            let shown = show(study, linearised, fit, effect, &points)?;
            Some(Place {
                submodel: submodel.name().to_owned(),
                channel: OUTPUTS[shown.output].symbol().to_owned(),
                phase: shown.phase.to_owned(),
                region: shown.region,
                share: (gain / excess).clamp(0.0, 1.0),
                sigma: gain.max(0.0).sqrt(),
                size: shown.size,
                unit: OUTPUTS[shown.output].unit().to_owned(),
            })
        })
        .collect()
}

/// Keeps the better of two for one part.
fn offer<'a>(parts: &mut Vec<Part<'a>>, part: Part<'a>) {
    match parts.iter_mut().find(|other| other.submodel == part.submodel) {
        Some(other) if other.gain >= part.gain => {}
        Some(other) => *other = part,
        None => parts.push(part),
    }
}

struct Shown {
    output: usize,
    phase: &'static str,
    region: String,
    size: f64,
}

/// Where one effect of a fit shows most: its signature against the same fit without it.
fn show(
    study: &Study,
    linearised: &Linearised,
    fit: &Fit,
    effect: usize,
    points: &[PointState],
) -> Option<Shown> {
    let mut without = fit.hypothesis.clone();
    without.effects.retain(|(index, _)| *index != effect);
    let there = study.predict(&without).ok()?;
    let signature: Vec<f64> =
        fit.prediction.values.iter().zip(&there.values).map(|(with, without)| with - without).collect();
    let mut whitened = signature.clone();
    linearised.whiten(study, &mut whitened);
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

/// A place on the map in words.
fn region(point: &PointState) -> String {
    let side = match point.surge_position_ratio {
        x if x > 0.97 => "near surge",
        x if x > 0.75 => "middle of the speed line",
        _ => "towards choke",
    };
    format!("{:.0} krpm, {side}", point.speed_rpm / 1000.0)
}

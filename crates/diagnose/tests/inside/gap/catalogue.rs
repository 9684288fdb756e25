//! Every library effect, planted with a typical step, is as visible as its signature predicts, and no other single effect explains the
//! recording better.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::gap::best_fit::fit::{Effort, fit, lengths};
use crate::gap::best_fit::normal::Selection;
use crate::gap::causes::additions::additions;
use crate::gap::residuals::study::{EffectValues, Hypothesis, Study};
use crate::gap::residuals::whiten::Linearised;
use crate::inside::gap::common;
use crate::inside::gap::common::{Visits, declared};
use mapper_numerics::parallel;
use mapper_observe::averages::Table;
use mapper_physics::rig::effect::{Effect, EffectParameter, Rig, add};
use mapper_physics::simulation::model::Model;

const VISITS: Visits = Visits { speeds_rpm: &[90e3, 140e3, 60e3, 120e3], dwell_s: 40.0 };

/// Values a number of typical steps from neutral, within the effect's range.
fn values(effect: &dyn Effect, steps: f64) -> Vec<f64> {
    let value = |p: &EffectParameter| (p.neutral + steps * p.typical_step).clamp(p.low, p.high);
    effect.info().parameters.iter().map(value).collect()
}

fn study(planted: Option<(&dyn Effect, &[f64])>, seed: u64) -> Study {
    let mut rig = Rig::new(Model::nominal());
    if let Some((effect, values)) = planted {
        add(&mut rig, effect, values).unwrap();
    }
    let recording = common::record_of(&rig, &VISITS, seed);
    let table = Table::new(&recording).unwrap();
    Study::new(&recording, table, declared(), Model::nominal(), mapper_effects::catalogue())
}

/// Minimum signature length of a planted effect, in sigmas: tolerances hide shorter ones.
const PLAIN: f64 = 8.0;
/// Misfit reduction by a superfluous effect due to chance: of 25, one exceeds this in three campaigns of a thousand (chi-square with one
/// degree of freedom).
const CHANCE: f64 = 15.0;
/// Number of the most promising rivals that are fitted.
const RIVALS: usize = 1;
/// Heat to the oil changes the metal over many minutes: in a campaign of three, its whole range stays within tolerances.
const TOO_SLOW: &str = "oil_scale";
/// Convection upstream of the wheel has no influence on the nominal machine, which has no area there, and the valve does not move in these visits.
const WITHOUT_PLACE: [&str; 2] = ["inlet_htc", "slow_valve"];

#[test]
fn every_effect_shows_as_its_signature_says_and_none_explains_it_better() {
    let clean = study(None, 1);
    let nominal = Linearised::new(&clean).unwrap();
    let catalogue = mapper_effects::catalogue();
    let indices: Vec<usize> = (0..catalogue.len()).collect();
    let complaints = parallel::map(&indices, |index| {
        let effect = catalogue[*index].as_ref();
        Some(format!("{}: {}", effect.info().id, complaint(&clean, &nominal, *index, effect)?))
    });
    let wrong: Vec<String> = complaints.into_iter().flatten().collect();
    assert!(wrong.is_empty(), "\n{}", wrong.join("\n"));
}

/// Error in the visibility of one effect; `None` if correct.
fn complaint(clean: &Study, nominal: &Linearised, index: usize, effect: &dyn Effect) -> Option<String> {
    let planted = [1.0, 3.0, 8.0].into_iter().find_map(|steps| {
        let values = values(effect, steps);
        let length = lengths(clean, nominal, &vec![(index, values.clone())]).ok()?[0];
        (length > PLAIN).then_some((values, length))
    });
    let Some((values, length)) = planted else {
        let id = &*effect.info().id;
        return (id != TOO_SLOW && !WITHOUT_PLACE.contains(&id))
            .then(|| "it does not show at any strength".to_owned());
    };
    let study = study(Some((effect, &values)), 2 + index as u64);
    // Its own derivatives: they are kept for later fits, and the studies run in parallel.
    let linearised = Linearised::new(&study).unwrap();
    let everywhere = Selection::all(&study);
    let effort = Effort { iterations: 5, enough: 0.5, ..Effort::default() };
    let fit_of = |effects: EffectValues| {
        fit(&study, &linearised, &Hypothesis { effects, ..study.nothing() }, &everywhere, effort).unwrap()
    };
    let (null, own) = (fit_of(Vec::new()), fit_of(vec![(index, values)]));
    // The misfit falls by the squared signature, whose root scatters by one. Allow four of them, plus the influence of input noise and
    // tolerances on a strong effect.
    let gained = (null.cost - own.cost).max(0.0).sqrt();
    if gained < 0.9 * length - 4.0 {
        return Some(format!("its signature is {length:.1} sigma long, {gained:.1} are found"));
    }
    // The residual is noise: chi-square within four standard deviations.
    let count = own.residual.len() as f64;
    if (own.cost - count).abs() > 4.0 * (2.0 * count).sqrt() {
        return Some(format!("it leaves a misfit of {:.0} in {count} values", own.cost));
    }
    let name = |effect: usize| study.effects[effect].info().id.to_string();
    let mut more = additions(&study, &linearised, &everywhere, &own, false);
    more.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    if more[0].gain > CHANCE {
        return Some(format!("{} reduces it by {:.1} in addition", name(more[0].effect), more[0].gain));
    }
    let mut rivals = additions(&study, &linearised, &everywhere, &null, false);
    rivals.retain(|rival| rival.effect != index);
    rivals.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    let better = rivals.into_iter().take(RIVALS).find_map(|rival| {
        let fitted = fit_of(rival.start.hypothesis.effects);
        (fitted.cost < own.cost - CHANCE).then(|| (name(rival.effect), own.cost - fitted.cost))
    });
    better.map(|(rival, by)| format!("{rival} explains it better by {by:.1}"))
}

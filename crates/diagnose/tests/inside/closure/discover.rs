//! Discovery on recordings of the adaptive simulator: planted laws are found, and nothing else is.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::closure::columns::Base;
use crate::closure::description::{ClosureDescription, script_of, sink};
use crate::closure::expression::{Expression, Span, Spans};
use crate::closure::library::library;
use crate::closure::residual_source::residual_sources;
use crate::closure::term::{Balance, ClosureEffect, Role, Term};
use crate::gap;
use crate::gap::residuals::study::{Hypothesis, Study};
use crate::gap::residuals::whiten::Linearised;
use crate::gap::{ClosureSearch, Diagnosed, GapRequest, Verdict};
use crate::inside::gap::common::{Visits, declared, effects, request};
use mapper_effects::ScriptEffect;
use mapper_inference::hypotheses::{Shape, TimeHistory};
use mapper_numerics::parallel;
use mapper_observe::averages::Table;
use mapper_physics::rig::effect::{Effect, Rig, add};
use mapper_physics::simulation::model::Model;
use std::path::Path;
use std::sync::Arc;

const VISITS: Visits =
    Visits { speeds_rpm: &[90e3, 140e3, 60e3, 120e3, 70e3, 130e3, 80e3, 110e3, 60e3], dwell_s: 60.0 };

fn ask(rig: &Rig, seed: u64, closure_search: ClosureSearch) -> Diagnosed {
    let recording = crate::inside::gap::common::record_of(rig, &VISITS, seed);
    // Candidates unrelated to the planted term.
    let candidates = effects(&["tip_diameter", "flowmeter_gain"]);
    let library = request(&recording, declared(), Model::nominal(), candidates);
    gap(GapRequest { closure_search, ..library }).unwrap()
}

fn study(visits: &Visits, effects: Vec<Arc<dyn Effect>>) -> Study {
    let recording = crate::inside::gap::common::record_of(&Rig::new(Model::nominal()), visits, 3);
    let table = Table::new(&recording).unwrap();
    Study::new(&recording, table, declared(), Model::nominal(), effects)
}

/// Level and slope of the heat to a housing, by role.
fn heat_to(balance: Balance) -> Vec<Term> {
    let terms = library().into_iter();
    terms.filter(|t| t.balance() == balance && matches!(t.role, Role::Level | Role::Slope)).collect()
}

/// A coolant passage of 1.5 W/K to water at 80 degC, outside the effect library. Part, conductance and temperature are found, and the
/// written file reproduces the law.
#[test]
fn a_coolant_passage_is_found_placed_and_written() {
    let terms = heat_to(Balance::CompressorHousing);
    let (slope, level) = sink(&terms.iter().collect::<Vec<_>>()).unwrap();
    let mut planted = [0.0; 2];
    (planted[slope], planted[level]) = (1.5, 1.5 * (353.15 - 323.15));
    let mut rig = Rig::new(Model::nominal());
    add(&mut rig, &ClosureEffect::new(terms), &planted).unwrap();
    let diagnosed = ask(&rig, 11, ClosureSearch::IfUnexplained);
    let found = &diagnosed.diagnosis;
    assert!(found.verdict != Verdict::WithinTolerance);
    let places = &found.locations;
    assert_eq!(places[0].submodel, "compressor_housing");
    let sum: f64 = places.iter().map(|place| place.share).sum();
    assert!((sum - 1.0).abs() < 1e-9, "shares add up to {sum}");
    let law = found.closure_terms.first().unwrap();
    assert_eq!(law.submodel, "compressor_housing");
    for (term, truth) in law.terms.iter().zip([1.5, 353.15]) {
        // 95 % intervals, twice as wide: four standard errors.
        let half = term.high - term.low;
        assert!((term.value - truth).abs() < half, "{}", law.sentence);
    }
    assert!(law.gap_reduction > 0.8, "{}", law.gap_reduction);
    // Steps used neither in the search nor in the fit: the housing improves, and no channel gets worse.
    let housing = &found.gap.channels["Tc"];
    assert!(law.held_out_steps > 0 && housing.after < 0.2 * housing.before, "{:?}", found.gap.channels);
    assert!(found.probable_closure_term().is_some());
    // The source term in each step, estimated without the law, agrees with the law.
    assert_eq!(found.closure_terms_by_balance[0].submodel, "compressor_housing");
    let script = ScriptEffect::new(law.script.as_ref().unwrap(), Path::new("law.rhai")).unwrap();
    assert_eq!(script.info().submodel.name(), "compressor_housing");
}

/// Fault-free recordings, searched although no diagnosis requires it: at most one of two has a law. The threshold is meant to pass one in
/// twenty.
#[test]
fn nothing_has_no_law() {
    let seeds = [21, 22];
    let found = parallel::map(&seeds, |seed| {
        ask(&Rig::new(Model::nominal()), *seed, ClosureSearch::Always).diagnosis.closure_terms
    });
    let sentences: Vec<&str> = found.iter().flatten().map(|law| law.sentence.as_str()).collect();
    assert!(sentences.len() <= 1, "{sentences:?}");
}

/// 60 W to the compressor housing in one step alone: the source term appears in that step only, and no other balance has as much evidence.
#[test]
fn a_force_comes_back_in_its_step() {
    let mut planted = study(&VISITS, Vec::new());
    let begin_s = planted.steps[4].marker.start_s;
    let history = TimeHistory { onset: begin_s, shape: Shape::Step };
    let course = Spans(vec![Span { history, end_s: begin_s + VISITS.dwell_s }]);
    let term = Term {
        acts_on: vec![(Balance::CompressorHousing, Expression::InTime(course))],
        unit: "W",
        step: 50.0,
        words: String::new(),
        role: Role::Other,
        positive: false,
    };
    planted.add(Arc::new(ClosureEffect::new(vec![term])));
    let nothing = planted.nothing();
    let with = planted.predict(&Hypothesis { effects: vec![(0, vec![60.0])], ..nothing.clone() }).unwrap();
    let without = planted.predict(&nothing).unwrap();
    for (row, value) in planted.measured.iter_mut().enumerate() {
        *value += with.values[row] - without.values[row];
    }
    let linearised = Linearised::new(&planted).unwrap();
    let base = Base::nothing(&planted, &linearised);
    let counts = vec![true; planted.steps.len()];
    let found = residual_sources(&base, &counts, &|_| true);
    assert_eq!(found[0].balance, Balance::CompressorHousing);
    for (step, (level, sigma)) in found[0].levels.iter().enumerate() {
        let truth = if step == 4 { 60.0 } else { 0.0 };
        // Nine steps: four standard errors are exceeded once in two thousand recordings.
        assert!((level - truth).abs() < 4.0 * sigma, "step {step}: {level} +/- {sigma} W for {truth} W");
    }
}

/// The script of every term gives the same readings as the term itself.
#[test]
fn every_term_can_be_written_and_its_script_does_the_same() {
    let short = Visits { speeds_rpm: &[90e3, 130e3, 60e3], dwell_s: 20.0 };
    let study = study(&short, Vec::new());
    let nothing = study.predict(&study.nothing()).unwrap();
    let description = ClosureDescription { sentence: "a term".to_owned(), terms: Vec::new(), sink_k: None };
    let terms = library();
    let complaints = parallel::map(&terms, |term| {
        let text = script_of(&[term], &description).unwrap();
        let script = match ScriptEffect::new(&text, Path::new("term.rhai")) {
            Ok(script) => script,
            Err(error) => return Some(format!("{error}\n{text}")),
        };
        let of = |effect: Arc<dyn Effect>| {
            let mut own = study.clone();
            own.add(effect);
            let values = vec![0.5 * term.step];
            own.predict(&Hypothesis { effects: vec![(0, values)], ..own.nothing() }).unwrap().values
        };
        let (native, scripted) = (of(Arc::new(ClosureEffect::new(vec![term.clone()]))), of(Arc::new(script)));
        let change = native.iter().zip(&nothing.values).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        let apart = native.iter().zip(&scripted).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        // Rounding errors, propagated by the integration.
        (apart > 1e-6 * change.max(1e-3)).then(|| format!("{apart} of {change}\n{text}"))
    });
    let wrong: Vec<String> = complaints.into_iter().flatten().collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

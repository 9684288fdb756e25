//! Diagnoses that were written to a file and read again.

use crate::closure::library::library;
use crate::closure::term::{Balance, ClosureEffect, Role, Term};
use crate::drift::{Alternative, Cause, DriftReport, FoundDrift, RateOrStep};
use crate::gap;
use crate::gap::best_fit::fitted_causes::Changes;
use crate::gap::residuals::study::Hypothesis;
use crate::gap::{ClosureSearch, Diagnosed, Diagnosis, GapRequest, RestoreError, StoredFits};
use crate::inside::gap::common::{Visits, declared, effects, record_of, request};
use mapper_core::Recording;
use mapper_physics::rig::effect::{Effect, Rig, add};
use mapper_physics::simulation::model::Model;
use serde_json::json;
use std::sync::Arc;

const VISITS: Visits = Visits { speeds_rpm: &[90e3, 140e3, 60e3, 120e3, 70e3, 130e3], dwell_s: 60.0 };

fn candidates() -> Vec<Arc<dyn Effect>> {
    effects(&["stem_conduction", "recirculation", "inner_node", "flowmeter_gain"])
}

fn ask(recording: &Recording) -> Diagnosed {
    let asked = request(recording, declared(), Model::nominal(), candidates());
    gap(GapRequest { closure_search: ClosureSearch::IfUnexplained, ..asked }).unwrap()
}

fn again(
    written: &Diagnosed,
    recording: &Recording,
    of: Vec<Arc<dyn Effect>>,
) -> Result<Diagnosed, RestoreError> {
    let text = serde_json::to_string(&(&written.diagnosis, &written.found, written.stored())).unwrap();
    let (diagnosis, found, fits): (Diagnosis, _, StoredFits) = serde_json::from_str(&text).unwrap();
    let rig = request(recording, declared(), Model::nominal(), Vec::new()).recording;
    Diagnosed::restored((diagnosis, None, found), fits, &rig, of)
}

/// Of both: what each cause adds to the readings, and the differences of the figures.
fn assert_same(one: &Diagnosed, other: &Diagnosed) {
    assert_eq!(one.diagnosis.candidates.len(), other.diagnosis.candidates.len());
    assert_eq!(one.diagnosis.verdict, other.diagnosis.verdict);
    assert_eq!(one.fits.closure.is_some(), other.fits.closure.is_some());
    let of = |diagnosed: &Diagnosed, hypothesis: &Hypothesis| {
        let changes = Changes::of(&diagnosed.study, hypothesis).unwrap();
        changes.subtracted_from(Recording { series: one_second(), ..Recording::default() })
    };
    let hypotheses = |diagnosed: &Diagnosed| -> Vec<Hypothesis> {
        diagnosed
            .fits
            .causes
            .iter()
            .chain(&diagnosed.fits.closure)
            .map(|fit| fit.hypothesis.clone())
            .collect()
    };
    for (a, b) in hypotheses(one).iter().zip(&hypotheses(other)) {
        let (a, b) = (of(one, a), of(other, b));
        for (channel, series) in &a.series {
            for (a, b) in series.values.iter().zip(&b.series[channel].values) {
                // Numbers of a file lose the last digit at most, which the lengths of repeated time steps amplify.
                assert!((a - b).abs() < 1e-5 * a.abs().max(1.0), "{channel}: {a} and {b}");
            }
        }
    }
    let (a, b) = (one.evidence().unwrap(), other.evidence().unwrap());
    let (a, b) = (a.with_cause.unwrap().2, b.with_cause.unwrap().2);
    assert!(a.len() == b.len() && a.iter().zip(&b).all(|(a, b)| (a - b).abs() < 1e-6));
}

/// Readings of zero at each second.
fn one_second() -> std::collections::BTreeMap<mapper_core::Channel, mapper_core::Series> {
    let t_s: Vec<f64> = (0..360).map(f64::from).collect();
    let zero = mapper_core::Series { values: vec![0.0; t_s.len()], t_s };
    crate::inside::gap::common::channels().into_iter().map(|channel| (channel, zero.clone())).collect()
}

#[test]
fn a_diagnosis_from_a_file_subtracts_and_shows_the_same() {
    let mut rig = Rig::new(Model::nominal());
    add(&mut rig, mapper_effects::find("stem_conduction").unwrap().as_ref(), &[0.1]).unwrap();
    let recording = record_of(&rig, &VISITS, 31);
    let written = ask(&recording);
    assert_eq!(written.diagnosis.candidates[0].effects, ["stem_conduction"]);
    let read = again(&written, &recording, candidates()).unwrap();
    assert_same(&written, &read);
    // What is written once more is the same file.
    assert_eq!(read.stored(), again(&read, &recording, candidates()).unwrap().stored());
    let lacking = again(&written, &recording, effects(&["recirculation"])).unwrap_err();
    assert!(matches!(&lacking, RestoreError::Effect(id) if id != "recirculation"), "{lacking}");
}

/// A coolant passage, which only a closure term describes.
#[test]
fn a_closure_term_from_a_file_subtracts_the_same() {
    let is_heat = |term: &Term| {
        term.balance() == Balance::CompressorHousing && matches!(term.role, Role::Level | Role::Slope)
    };
    let terms: Vec<Term> = library().into_iter().filter(is_heat).collect();
    let sizes: Vec<f64> = terms.iter().map(|t| if t.role == Role::Slope { 1.5 } else { 45.0 }).collect();
    let mut rig = Rig::new(Model::nominal());
    add(&mut rig, &ClosureEffect::new(terms), &sizes).unwrap();
    let recording = record_of(&rig, &VISITS, 11);
    let written = ask(&recording);
    assert!(written.fits.closure.is_some(), "{:?}", written.diagnosis.closure_terms);
    assert_same(&written, &again(&written, &recording, candidates()).unwrap());
}

/// Every cause of drift, as a rate and as a step.
#[test]
fn a_drift_from_a_file_is_that_of_the_diagnosis() {
    let sizes = [RateOrStep::RatePerH(1.5), RateOrStep::Step(-0.25)];
    for (cause, size) in Cause::all().into_iter().flat_map(|cause| sizes.map(|size| (cause, size))) {
        let drift = FoundDrift {
            cause,
            probability: 0.875,
            alternatives: vec![Alternative { cause: None, probability: 0.125 }],
            onset_s: 60.0,
            onset_low_s: 45.5,
            onset_high_s: 75.0,
            size,
            low: -1.0,
            high: 2.0,
            unit: cause.unit().into(),
        };
        let report = DriftReport { drifts: vec![drift], ..DriftReport::without_verdict("why".to_owned()) };
        let file = json!({"verdict": report.verdict, "drifts": report.drifts, "reason": report.reason});
        assert_eq!(serde_json::from_str::<DriftReport>(&file.to_string()).unwrap(), report);
    }
}

//! Campaigns whose steps end when enough is known: what the plan says of them, and what a run makes of it.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

#[path = "common/shipped.rs"]
mod shipped;

use mapper_backends::virtual_lab;
use mapper_campaign::Campaign;
use mapper_core::{DwellEnd, EventKind, Plan, StepKind, Timing};
use mapper_formats::FORMATS;
use mapper_planner::make_plan;
use mapper_record::{ChannelMap, ReadOptions, read_recording};
use mapper_session::{Registry, RunRequest, Session, SessionError, nominal_model, plan, with_plan_request};
use shipped::campaign;

/// Eight points with a repeated jump.
fn small() -> Campaign {
    campaign(&[
        (
            "speeds: [50 krpm, 65 krpm, 80 krpm, 95 krpm, 110 krpm, 125 krpm, 140 krpm, 155 krpm]",
            "speeds: [50 krpm, 80 krpm, 110 krpm, 140 krpm]",
        ),
        ("openings: [0.5, 0.7, 1.0, 1.4, 2.0, 2.5]", "openings: [0.5, 1.0]"),
        // Eight points know the shared numbers badly: 120 s at each reach 4 points.
        ("required_sigma_eta: 0.5 %", "required_sigma_eta: 5 %"),
        ("  dwell: 120 s ", "  ends: when_certain\n  dwell: 120 s "),
    ])
}

fn planned(campaign: &Campaign) -> Plan {
    plan(campaign, &nominal_model(campaign).unwrap()).unwrap()
}

/// The same error in less time than with one dwell for all: one dwell for all is a choice that prices have too.
#[test]
fn priced_dwells_reach_the_required_error_in_no_more_time() {
    let certain = small();
    let timing = Timing { ends: DwellEnd::Planned, ..certain.timing };
    let model = nominal_model(&certain).unwrap();
    // As the planner makes it, before the session prices its seconds.
    let even =
        with_plan_request(&certain, &model, |request| Ok::<_, SessionError>(make_plan(request)?)).unwrap();
    let (priced, as_planned) = (planned(&certain), planned(&Campaign { timing, ..certain.clone() }));
    let dwells_s = |plan: &Plan| plan.steps.iter().map(|step| step.dwell_s).collect::<Vec<_>>();
    assert_eq!(dwells_s(&priced), dwells_s(&as_planned), "one forecast, whoever ends the steps");
    let required = certain.required_sigma_eta.unwrap();
    for plan in [&priced, &even] {
        // Both stop searching within 2 % of it; dwells are whole seconds.
        assert!(plan.figures.open_rms_error_eta.unwrap() <= 1.04 * required, "{:?}", plan.figures);
    }
    assert!(priced.figures.minutes <= even.figures.minutes, "{:?} {:?}", priced.figures, even.figures);
    assert!(priced.remarks.iter().any(|remark| remark.contains("between")), "{:?}", priced.remarks);
}

#[test]
fn a_run_keeps_its_bounds_says_why_each_step_ended_and_is_the_same_again() {
    let campaign = small();
    let registry = Registry { backends: vec![virtual_lab::PLUGIN], formats: FORMATS, ..Registry::default() };
    let session = Session::new(&registry);
    let run = || {
        let folder = tempfile::tempdir().unwrap();
        let outcome = session.run(RunRequest::new(&campaign, "", folder.path())).unwrap();
        let bytes = std::fs::read(&outcome.recording).unwrap();
        let read =
            read_recording(&outcome.recording, &ChannelMap::native(), &ReadOptions::default()).unwrap();
        let executed = std::fs::read(outcome.directory.join("executed_plan.json")).unwrap();
        (bytes, read.recording, serde_json::from_slice::<Plan>(&executed).unwrap())
    };
    let (bytes, recording, executed) = run();
    let planned = planned(&campaign);
    assert_eq!(executed.steps.len(), planned.steps.len());
    let mut ended = 0;
    for (step, planned) in executed.steps.iter().zip(&planned.steps) {
        assert_eq!((step.to, step.kind), (planned.to, planned.kind));
        if step.kind == StepKind::Repeat {
            assert!((step.dwell_s - planned.dwell_s).abs() < 1e-6, "repeats last equally long: {step:?}");
        } else {
            assert!((20.0 - 1e-6..=120.0 + 1e-6).contains(&step.dwell_s), "{step:?}");
            ended += usize::from(step.dwell_s < 119.0);
        }
    }
    let told = |event: &&mapper_core::Event| {
        event.kind == EventKind::Note
            && event.message.contains("is left after")
            && event.message.contains("points")
    };
    assert_eq!(recording.events.iter().filter(told).count(), ended);
    assert!(ended > 0, "no step ended before its longest time");
    assert!(run().0 == bytes, "same seed, same bytes");
}

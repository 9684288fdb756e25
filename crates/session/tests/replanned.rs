//! Campaigns that are planned again while they run: what changes, why, and that it follows from the recording alone.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

#[path = "common/shipped.rs"]
mod shipped;

use mapper_backends::virtual_lab;
use mapper_campaign::Campaign;
use mapper_core::{EventKind, Plan, PlanStep, Recording, StepKind};
use mapper_formats::FORMATS;
use mapper_record::{ChannelMap, ReadOptions, read_recording};
use mapper_session::{
    BrokenOff, Ended, Registry, RunOutcome, RunRequest, Session, SessionEvent, nominal_model, order_again,
    plan,
};
use shipped::campaign;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

/// Eight points along speed lines, which nobody would take who may choose.
fn small(more: &[(&str, &str)]) -> Campaign {
    let replaced = [
        (
            "speeds: [50 krpm, 65 krpm, 80 krpm, 95 krpm, 110 krpm, 125 krpm, 140 krpm, 155 krpm]",
            "speeds: [50 krpm, 80 krpm, 110 krpm, 140 krpm]",
        ),
        ("openings: [0.5, 0.7, 1.0, 1.4, 2.0, 2.5]", "openings: [0.5, 1.0]"),
        ("required_sigma_eta: 0.5 %", "required_sigma_eta: 5 %"),
        ("order: information ", "replan: after_each_step\norder: speed_lines "),
    ];
    campaign(&[&replaced[..], more].concat())
}

fn registry() -> Registry {
    Registry { backends: vec![virtual_lab::PLUGIN], formats: FORMATS, ..Registry::default() }
}

fn recorded(recording: &Path) -> Recording {
    read_recording(recording, &ChannelMap::native(), &ReadOptions::default()).unwrap().recording
}

fn executed(outcome: &RunOutcome) -> Plan {
    serde_json::from_slice(&std::fs::read(outcome.directory.join("executed_plan.json")).unwrap()).unwrap()
}

fn visits(steps: &[PlanStep], kind: StepKind) -> Vec<String> {
    let mut visits: Vec<String> =
        steps.iter().filter(|step| step.kind == kind).map(|step| step.to.to_string()).collect();
    visits.sort();
    visits
}

#[test]
fn a_bad_order_is_mended_on_the_way_with_its_reason_and_follows_from_the_recording() {
    let campaign = small(&[]);
    let (registry, model) = (registry(), nominal_model(&campaign).unwrap());
    let planned = plan(&campaign, &model).unwrap();
    let run = || {
        let folder = tempfile::tempdir().unwrap();
        let outcome = Session::new(&registry).run(RunRequest::new(&campaign, "", folder.path())).unwrap();
        assert!(matches!(outcome.end, Ended::Completed), "{}", outcome.sentence());
        (std::fs::read(&outcome.recording).unwrap(), recorded(&outcome.recording), executed(&outcome))
    };
    let (bytes, recording, made) = run();
    for kind in [StepKind::Point, StepKind::Repeat, StepKind::Return] {
        assert_eq!(visits(&made.steps, kind), visits(&planned.steps, kind), "the same steps");
    }
    let order = |plan: &Plan| plan.steps.iter().map(|step| (step.to, step.kind)).collect::<Vec<_>>();
    assert_ne!(order(&made), order(&planned));
    // Repeats stay the same jump, in the same place.
    for (step, planned) in made.steps.iter().zip(&planned.steps).skip(1) {
        if planned.kind == StepKind::Repeat {
            assert_eq!((step.kind, step.to, step.from), (planned.kind, planned.to, planned.from));
        }
    }
    let said = |event: &&mapper_core::Event| {
        event.kind == EventKind::Note && event.message.starts_with("planned again after step")
    };
    let notes: Vec<&str> = recording.events.iter().filter(said).map(|event| event.message.as_str()).collect();
    assert!(!notes.is_empty());
    for note in notes {
        assert!(note.contains(" min for ") && note.contains("as it stood"), "{note}");
        assert!(made.remarks.iter().any(|remark| remark == note), "{note}");
    }
    assert!(made.figures.minutes < planned.figures.minutes, "{:?} {:?}", made.figures, planned.figures);
    let again = order_again(&campaign, &model, &planned, &recording).unwrap();
    assert_eq!(order(&again), order(&made), "the order follows from the recording");
    assert!(run().0 == bytes, "same seed, same bytes");
}

/// T2 is above the guard's limit at one point alone, the hottest: it is left out, and tried again later.
#[test]
fn what_a_guard_leaves_out_is_tried_again() {
    let planned = |campaign: &Campaign| plan(campaign, &nominal_model(campaign).unwrap()).unwrap();
    let mut hot: Vec<(f64, String)> = planned(&small(&[]))
        .steps
        .iter()
        .filter(|step| step.kind == StepKind::Point)
        .map(|step| (step.predicted.t2_k, step.to.to_string()))
        .collect();
    hot.sort_by(|a, b| b.0.total_cmp(&a.0));
    let above_degc = 0.5 * (hot[0].0 + hot[1].0) - 273.15;
    let guards = format!(
        "guards: {{compressor_outlet_temperature: {{above: {above_degc:.1} degC, reaction: skip_step}}}}\nlimits:"
    );
    let campaign =
        small(&[("limits:", guards.as_str()), ("order: speed_lines", "repeats: off\norder: speed_lines")]);
    let registry = registry();
    let folder = tempfile::tempdir().unwrap();
    let outcome = Session::new(&registry).run(RunRequest::new(&campaign, "", folder.path())).unwrap();
    assert!(matches!(outcome.end, Ended::Completed), "{}", outcome.sentence());
    let made = executed(&outcome);
    let again = |remark: &String| remark.starts_with(&hot[0].1) && remark.contains("it is tried again");
    assert!(made.remarks.iter().any(again), "{:#?}", made.remarks);
    let points = visits(&made.steps, StepKind::Point);
    let whole = visits(&planned(&campaign).steps, StepKind::Point);
    // Whether the guard lets it pass from elsewhere is the machine's affair; the others are all made.
    assert!(whole.iter().all(|point| points.contains(point) || *point == hot[0].1), "{points:?}");
    let last = made.steps.last().unwrap();
    assert_eq!(last.kind, StepKind::Return, "the first point still comes last");
    let left_out = recorded(&outcome.recording);
    let model = nominal_model(&campaign).unwrap();
    let again = order_again(&campaign, &model, &planned(&campaign), &left_out).unwrap();
    let order = |plan: &Plan| plan.steps.iter().map(|step| (step.to, step.kind)).collect::<Vec<_>>();
    assert_eq!(order(&again), order(&made), "what was left out is known from the recording too");
}

#[test]
fn a_run_that_was_broken_off_goes_on_by_the_plan_as_it_stood() {
    let campaign = small(&[]);
    let registry = registry();
    let (folder, stop) = (tempfile::tempdir().unwrap(), AtomicBool::new(false));
    let stops = |event: &SessionEvent| {
        if matches!(event, SessionEvent::StepStarted(marker) if marker.index == 5) {
            stop.store(true, Ordering::Relaxed);
        }
    };
    let session = Session { on_event: &stops, stop: &stop, ..Session::new(&registry) };
    let broken = session.run(RunRequest::new(&campaign, "", folder.path())).unwrap();
    assert!(matches!(broken.end, Ended::Interrupted { .. }), "{}", broken.sentence());
    let resume = Some(BrokenOff::read(&broken.directory).unwrap());
    let request = RunRequest { resume, ..RunRequest::new(&campaign, "", folder.path()) };
    let whole = Session::new(&registry).run(request).unwrap();
    assert!(matches!(whole.end, Ended::Completed), "{}", whole.sentence());
    let points = &whole.results.as_ref().unwrap().points;
    let mut found: Vec<String> = points
        .iter()
        .filter(|scored| scored.point.kind == StepKind::Point)
        .map(|scored| scored.point.target.unwrap().to_string())
        .collect();
    found.sort();
    let planned = plan(&campaign, &nominal_model(&campaign).unwrap()).unwrap();
    assert_eq!(found, visits(&planned.steps, StepKind::Point), "each point once");
    let notes = recorded(&whole.recording).events;
    assert!(notes.iter().any(|event| event.message.contains("by the plan as it stood before the run")));
}

//! The drift watch: a differing jump is repeated, and only a confirmed difference has consequences.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use mapper_core::{
    Channel, ChannelColumn, DeclaredUncertainty, OnDrift, OperatingPoint, PlanStep, Predicted, SampleBatch,
    StepKind, StepMarker,
};
use mapper_runner::{DriftWatch, StepSource, StepSourceError};
use std::collections::BTreeMap;

/// Three sweeps from slow to fast, with a point between.
struct Steps(usize);

const SPEEDS: [f64; 8] = [70e3, 130e3, 90e3, 70e3, 130e3, 90e3, 70e3, 130e3];

fn step(index: usize) -> PlanStep {
    let to = |index: usize| OperatingPoint { speed_rpm: SPEEDS[index], valve_opening_ratio: 0.7 };
    PlanStep {
        index,
        kind: StepKind::Point,
        from: index.checked_sub(1).map(to),
        to: to(index),
        p3_pa: 2e5,
        t3_k: 773.15,
        oil_temperature_k: 323.15,
        dwell_s: 100.0,
        start_s: 100.0 * index as f64,
        transition: None,
        predicted: Predicted::settled(0.05, 1.5, 350.0, 120.0),
    }
}

impl StepSource for Steps {
    fn warm_up_s(&self) -> f64 {
        0.0
    }
    fn cool_down_s(&self) -> f64 {
        0.0
    }
    fn next_step(&mut self) -> Result<Option<PlanStep>, StepSourceError> {
        let next = (self.0 < SPEEDS.len()).then(|| step(self.0));
        self.0 += 1;
        Ok(next)
    }
}

/// Runs all steps with T2 = 350 K + `drift(t)`; returns the executed speeds and the notes.
fn run(on_drift: OnDrift, drift: impl Fn(f64) -> f64) -> (Vec<f64>, Vec<String>) {
    let declared = BTreeMap::from([(
        Channel::T2,
        DeclaredUncertainty { noise_sigma: 0.1, offset_sigma: 0.25, gain_sigma_ratio: 0.0 },
    )]);
    let mut inner = Steps(0);
    let mut watch = DriftWatch::new(&mut inner, on_drift, declared);
    let (mut speeds, mut notes, mut t_s) = (Vec::new(), Vec::new(), 0.0);
    while let Some(step) = watch.next_step().unwrap() {
        assert_eq!(step.index, speeds.len(), "indices count up");
        assert_eq!(step.start_s, t_s, "inserted steps delay later ones");
        assert_eq!(step.from.map(|from| from.speed_rpm), speeds.last().copied());
        let times: Vec<f64> = (1..=100).map(|second| t_s + f64::from(second)).collect();
        let column = |channel, values| ChannelColumn { channel, values };
        watch.on_batch(&SampleBatch {
            t_s: times.clone(),
            columns: vec![
                // A warming inlet is not drift.
                column(Channel::T1, times.iter().map(|t_s| 298.0 + 0.01 * t_s).collect()),
                column(Channel::T2, times.iter().map(|t_s| 350.0 + 0.01 * t_s + drift(*t_s)).collect()),
            ],
            ..SampleBatch::default()
        });
        watch
            .after_step(&StepMarker {
                index: step.index,
                kind: step.kind,
                start_s: t_s,
                end_s: t_s + step.dwell_s,
                from: step.from,
                to: Some(step.to),
                p3_pa: step.p3_pa,
                valve_opening_ratio: 0.7,
            })
            .unwrap();
        notes.extend(watch.take_notes());
        speeds.push(step.to.speed_rpm);
        t_s += step.dwell_s;
    }
    (speeds, notes)
}

#[test]
fn without_drift_no_step_is_inserted() {
    let (speeds, notes) = run(OnDrift::Hold, |_| 0.0);
    assert_eq!(speeds, SPEEDS);
    assert!(notes.is_empty(), "{notes:?}");
}

#[test]
fn drift_is_confirmed_and_then_the_run_is_held() {
    // 1 K from 350 s on: detected at the second visit, beyond 1.96 times the declared 0.25 K.
    let (speeds, notes) = run(OnDrift::Hold, |t_s| if t_s > 350.0 { 1.0 } else { 0.0 });
    assert_eq!(
        speeds,
        [70e3, 130e3, 90e3, 70e3, 130e3, 70e3, 130e3],
        "the jump is repeated, then the run ends"
    );
    assert!(notes.len() == 2 && notes[0].contains("T2 by +1.0000 K"), "{notes:?}");
}

#[test]
fn a_run_that_continues_reports_drift_once() {
    let (speeds, notes) = run(OnDrift::Continue, |t_s| if t_s > 350.0 { 1.0 } else { 0.0 });
    assert_eq!(speeds.len(), SPEEDS.len() + 2);
    assert_eq!(speeds[7..], [90e3, 70e3, 130e3], "then the plan continues");
    assert_eq!(notes.len(), 2, "{notes:?}");
}

#[test]
fn unconfirmed_drift_does_not_stop_the_run() {
    let (speeds, notes) = run(OnDrift::Zero, |t_s| if (401.0..=500.0).contains(&t_s) { 1.0 } else { 0.0 });
    assert_eq!(speeds.len(), SPEEDS.len() + 2);
    assert_eq!(notes.len(), 2, "suspected, then not confirmed: {notes:?}");
}

#[test]
fn confirmed_drift_ends_the_run_for_a_zero() {
    let (_, notes) = run(OnDrift::Zero, |t_s| 0.005 * t_s);
    assert!(notes.last().unwrap().contains("zero the sensors"), "{notes:?}");
}

//! The decision on simulated campaigns: no drift, drifts at three times the printed limit, and what cannot be judged.
//! Error rates over many campaigns are the business of `examples/drift_study`, with their figures in docs/how-to/drift.md.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::drift::common;

use common::{Planted, Unmodelled, campaign, campaign_on, drift_reading, judge, judge_all, judge_on};
use mapper_core::{ActuatorMotion, Channel, RigActuators};
use mapper_diagnose::drift::{
    Alternative, Cause, DriftReport, DriftVerdict, FoundDrift, RATE_PER_H, RateOrStep, RecordedRun,
};
use mapper_inference::hypotheses::{Shape, TimeHistory};

fn limit(report: &DriftReport, cause: Cause) -> f64 {
    report.detection_limits.iter().find(|limit| limit.cause == cause).unwrap().change
}

fn sums_to_one(report: &DriftReport) {
    let sum = |all: &[Alternative]| all.iter().map(|other| other.probability).sum::<f64>();
    assert!((sum(&report.alone) - 1.0).abs() < 1e-9);
    for drift in &report.drifts {
        assert!((drift.probability + sum(&drift.alternatives) - 1.0).abs() < 1e-9);
    }
}

/// The only drift of a report.
fn only(report: &DriftReport) -> &FoundDrift {
    assert_eq!(report.drifts.len(), 1, "{}", report.reason);
    &report.drifts[0]
}

#[test]
fn a_drift_free_campaign_is_not_flagged_and_prints_its_limits() {
    let report = judge(&campaign(11, None).recording);
    assert_eq!((report.verdict, report.drifts.len()), (DriftVerdict::None, 0), "{}", report.reason);
    sums_to_one(&report);
    // What a campaign of 53 minutes with four visits has to see.
    assert!(limit(&report, Cause::Sensors(&[Channel::T2])) <= 0.1);
    assert!(limit(&report, Cause::Sensors(&[Channel::P2])) <= 60.0);
    assert!(limit(&report, Cause::Sensors(&[Channel::CompressorFlow])) <= 0.003);
    assert!(limit(&report, Cause::Sensors(&[Channel::TurbineFlow])) <= 0.003);
    assert_eq!(report.groups[0].visits.len(), 4);
}

/// Play leaves the valve above or below its command, from where it came: repeats of one point differ in flow and P2, and nothing drifts. That holds
/// where it is declared, and where the repeats alone show it.
#[test]
fn play_of_the_valve_is_no_drift() {
    let at_once = ActuatorMotion { lag_s: 0.0, rate_per_s: f64::INFINITY, dead_time_s: 0.0 };
    let declared = RigActuators { valve: at_once, valve_play_ratio: 0.02, ..RigActuators::FAST_VALVE };
    for (play_ratio, actuators) in [(0.02, Some(declared)), (0.02, None), (0.06, None)] {
        let unmodelled = Unmodelled { play_ratio, ..Unmodelled::default() };
        let report = judge_on(&campaign_on(11, None, unmodelled).recording, actuators);
        assert_eq!((report.verdict, report.drifts.len()), (DriftVerdict::None, 0), "{}", report.reason);
    }
}

/// A share of the housing before the wheel, which the model does not have, moves each operating point by its own amount, but all visits of one alike.
#[test]
fn a_cause_that_acts_all_the_time_is_no_drift() {
    for alpha_area_ratio in [0.05, 0.15] {
        let unmodelled = Unmodelled { alpha_area_ratio, ..Unmodelled::default() };
        let report = judge(&campaign_on(11, None, unmodelled).recording);
        assert_eq!((report.verdict, report.drifts.len()), (DriftVerdict::None, 0), "{}", report.reason);
    }
}

#[test]
fn a_sensor_that_drifts_is_named_and_its_points_are_put_right() {
    // Three times the limit of 0.08 K over the campaign, from 600 s on.
    let course = TimeHistory { onset: 600.0, shape: RATE_PER_H };
    let planted = Planted { cause: Cause::Sensors(&[Channel::T2]), course, size: 0.34 };
    let campaign = campaign(12, Some(planted));
    let report = judge(&campaign.recording);
    assert_eq!(only(&report).cause, planted.cause, "{}", report.reason);
    assert_eq!(report.verdict, DriftVerdict::Sensor);
    sums_to_one(&report);
    let RateOrStep::RatePerH(rate) = only(&report).size else { panic!("{}", report.reason) };
    assert!(only(&report).low <= 0.34 && 0.34 <= only(&report).high, "{rate}");
    // Two repeats: twice 16 minutes.
    assert!((only(&report).onset_s - 600.0).abs() < 1920.0);
    assert!(
        report.reason.contains("subtracted from the reading of T2"),
        "never in silence: {}",
        report.reason
    );

    // Against the truth, constant bias removed: at most a third of the error without correction.
    let (mut corrected, mut uncorrected) = (Vec::new(), Vec::new());
    for (eta, point) in campaign.eta_true.iter().zip(&report.corrected_points) {
        if let Some(before) = point.eta_uncorrected {
            corrected.push(point.eta - eta);
            uncorrected.push(before - eta);
        }
    }
    let rms = |values: &[f64]| {
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        (values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / values.len() as f64).sqrt()
    };
    assert!(rms(&corrected) * 3.0 <= rms(&uncorrected), "{} of {}", rms(&corrected), rms(&uncorrected));
}

/// Each as large as in the test before: both are named, sized and dated together, and both are removed.
#[test]
fn two_drifts_at_once_are_both_named() {
    let ramp = TimeHistory { onset: 600.0, shape: RATE_PER_H };
    let step = TimeHistory { onset: 1800.0, shape: Shape::Step };
    let planted = Planted { cause: Cause::Sensors(&[Channel::T2]), course: ramp, size: 0.34 };
    let mut recording = campaign(18, Some(planted)).recording;
    drift_reading(&mut recording, Channel::CompressorFlow, step, 0.01);
    let report = judge(&recording);
    assert_eq!(report.verdict, DriftVerdict::Sensor, "{}", report.reason);
    sums_to_one(&report);
    let of = |channels: &'static [Channel]| {
        report.drifts.iter().find(|drift| drift.cause == Cause::Sensors(channels)).expect("it is found")
    };
    assert_eq!(report.drifts.len(), 2, "{}", report.reason);
    let (t2, flow) = (of(&[Channel::T2]), of(&[Channel::CompressorFlow]));
    assert!((t2.low..=t2.high).contains(&0.34) && matches!(t2.size, RateOrStep::RatePerH(_)));
    assert!((flow.low..=flow.high).contains(&0.01) && matches!(flow.size, RateOrStep::Step(_)));
    assert!((flow.onset_s - 1800.0).abs() < 1920.0);
    assert!(report.corrected_points.iter().all(|point| point.corrections.len() == 2));
}

/// Ten times the limit, between two onsets of the grid, and a machine that changes at once by thirty times its limit: the residual of
/// one drift dated or sized roughly is not taken for another drift.
#[test]
fn a_large_step_is_one_drift() {
    let at = |onset: f64| TimeHistory { onset, shape: Shape::Step };
    for (seed, planted) in [
        (20, Planted { cause: Cause::Sensors(&[Channel::P2]), course: at(1708.0), size: 600.0 }),
        (21, Planted { cause: Cause::BearingFriction, course: at(1695.5), size: 8.65e-7 }),
    ] {
        let report = judge(&campaign(seed, Some(planted)).recording);
        let drift = only(&report);
        assert_eq!(drift.cause, planted.cause, "{}", report.reason);
        assert!((drift.onset_s - planted.course.onset).abs() < 120.0, "{}", drift.onset_s);
    }
}

/// A barometer that drifts moves both absolute pressures, and neither by itself explains that.
#[test]
fn a_common_reference_that_drifts_is_named_as_one_cause() {
    let course = TimeHistory { onset: 0.0, shape: RATE_PER_H };
    let mut recording = campaign(19, None).recording;
    for channel in [Channel::P1, Channel::P2] {
        drift_reading(&mut recording, channel, course, 400.0);
    }
    let report = judge(&recording);
    assert_eq!(only(&report).cause, Cause::Sensors(&[Channel::P1, Channel::P2]), "{}", report.reason);
    assert!((only(&report).low..=only(&report).high).contains(&400.0));
}

#[test]
fn a_machine_that_fouls_is_reported_from_its_sensors() {
    let course = TimeHistory { onset: 0.0, shape: RATE_PER_H };
    let planted = Planted { cause: Cause::Fouling, course, size: -0.01 };
    let report = judge(&campaign(13, Some(planted)).recording);
    assert_eq!(
        (report.verdict, only(&report).cause),
        (DriftVerdict::Machine, Cause::Fouling),
        "{}",
        report.reason
    );
    assert!(only(&report).low <= -0.01 && -0.01 <= only(&report).high);
}

#[test]
fn a_machine_that_changes_much_is_sized_as_it_changed() {
    let course = TimeHistory { onset: 0.0, shape: RATE_PER_H };
    let planted = Planted { cause: Cause::Fouling, course, size: -0.03 };
    let report = judge(&campaign(16, Some(planted)).recording);
    assert_eq!(only(&report).cause, planted.cause, "{}", report.reason);
    let RateOrStep::RatePerH(rate) = only(&report).size else { panic!("{}", report.reason) };
    // Thirty times the limit: noise leaves 1 to 2 %, tolerances of the machine as much.
    assert!((rate / planted.size - 1.0).abs() < 0.05, "{rate} of {}", planted.size);
}

#[test]
fn a_step_over_two_nights_is_dated_within_two_repeats() {
    // The second night follows the first on the campaign's axis of time; the gain of the flow meter steps at its begin.
    let course = TimeHistory { onset: 0.0, shape: Shape::Step };
    let planted = Planted { cause: Cause::Sensors(&[Channel::CompressorFlow]), course, size: 0.01 };
    let (first, second) = (campaign(14, None), campaign(14, Some(planted)));
    let runs =
        [&first, &second].map(|night| RecordedRun { recording: &night.recording, fingerprint: Some("a") });
    let report = judge_all(&runs);
    assert_eq!(only(&report).cause, planted.cause, "{}", report.reason);
    assert!((only(&report).onset_s - 3150.0).abs() < 1920.0, "{}", only(&report).onset_s);
    assert_eq!(report.groups[0].visits.len(), 8);

    // The same two, but the second by another machine.
    let runs = [
        RecordedRun { fingerprint: Some("a"), ..runs[0] },
        RecordedRun { fingerprint: Some("b"), ..runs[1] },
    ];
    refused(&judge_all(&runs));
}

fn refused(report: &DriftReport) {
    assert_eq!((report.verdict, report.drifts.len()), (DriftVerdict::Unclear, 0), "{}", report.reason);
    assert!(!report.reason.is_empty());
}

#[test]
fn what_cannot_be_judged_gets_a_clear_word() {
    let whole = campaign(15, None).recording;
    // Between the first two reference jumps: nothing is made twice.
    let mut none = whole.clone();
    none.steps.retain(|step| (2..8).contains(&step.index));
    refused(&judge(&none));

    let mut one = whole.clone();
    one.steps.retain(|step| step.index < 10);
    refused(&judge(&one));

    // The reference point is visited again, but from other points each time.
    let mut other_jumps = whole.clone();
    other_jumps.steps.retain(|step| (9..16).contains(&step.index));
    refused(&judge(&other_jumps));

    let mut gap = whole.clone();
    for series in gap.series.values_mut().filter(|series| series.t_s.len() > 100) {
        let kept = |t_s: &f64| !(1000.0..1040.0).contains(t_s);
        series.values =
            series.values.iter().zip(&series.t_s).filter(|(_, t)| kept(t)).map(|(v, _)| *v).collect();
        series.t_s.retain(kept);
    }
    refused(&judge(&gap));

    let empty = mapper_core::Recording::default();
    refused(&judge(&empty));
}

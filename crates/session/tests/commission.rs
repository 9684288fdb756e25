//! Commissionings of virtual stands: the intervals contain what was planted, and no limit is left.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::common::shipped::campaign;
use mapper_core::{Channel, Event, EventKind, Recording, RunEnding, SampleBatch, Series, StepMarker};
use mapper_observe::MeasuredValue;
use mapper_runner::{ObserverError, PlanSteps, RunObserver};
use mapper_session::{Commissioning, Registry, drive, nominal_model};
use std::sync::atomic::AtomicBool;

/// Keeps everything in memory.
#[derive(Default)]
struct Memory {
    recording: Recording,
    events: Vec<Event>,
}

impl RunObserver for Memory {
    fn on_batch(&mut self, batch: &SampleBatch) -> Result<(), ObserverError> {
        for column in &batch.columns {
            let none = || Series { t_s: Vec::new(), values: Vec::new() };
            let series = self.recording.series.entry(column.channel).or_insert_with(none);
            series.t_s.extend(&batch.t_s);
            series.values.extend(&column.values);
        }
        self.events.extend(batch.events.iter().cloned());
        Ok(())
    }

    fn on_event(&mut self, event: &Event) -> Result<(), ObserverError> {
        self.events.push(event.clone());
        Ok(())
    }

    fn on_step_end(&mut self, marker: &StepMarker) -> Result<(), ObserverError> {
        self.recording.steps.push(*marker);
        Ok(())
    }
}

/// Commissions the lab with these settings of its actuators; the campaign declares this.
fn commission(lab: &str, declared: &str, seed: u64) -> Vec<MeasuredValue> {
    let campaign = campaign(&[
        ("virtual_lab: {}", &format!("virtual_lab: {{actuators: {lab}}}")),
        ("seed: 1  ", &format!("{declared}seed: {seed}  ")),
    ]);
    let model = nominal_model(&campaign).unwrap();
    let registry = Registry {
        backends: vec![mapper_backends::virtual_lab::PLUGIN],
        effects: mapper_effects::catalogue(),
        ..Registry::empty()
    };
    let commissioning = Commissioning::new(&campaign, &model).unwrap();
    let mut backend = registry.make_backend(&campaign, &model).unwrap();
    let mut steps = PlanSteps::new(&commissioning.plan);
    let mut memory = Memory::default();
    let under = &commissioning.campaign;
    let end =
        drive(under, &model, &mut steps, backend.as_mut(), &mut memory, &AtomicBool::new(false)).unwrap();
    assert_eq!(end, RunEnding::Completed, "{lab}");
    let left = |event: &Event| matches!(event.kind, EventKind::SurgeEntered | EventKind::OverspeedEntered);
    assert!(!memory.events.iter().any(left), "{lab}: {:?}", memory.events);
    let speeds = &memory.recording.series[&Channel::ShaftSpeed].values;
    let highest_rpm = speeds.iter().copied().fold(0.0, f64::max);
    // Small: three quarters of the limit, which the opening valve and the noise do not use up.
    assert!(highest_rpm < 0.75 * campaign.limits.speed_max_rpm, "{lab}: {highest_rpm}");
    commissioning.measure(&memory.recording)
}

/// The whole of a number's digits after the point: numbers that fill the range from 0 to 1 evenly for i = 0, 1, 2 ...
fn spread(i: u64, irrational: f64) -> f64 {
    (0.5 + i as f64 * irrational).fract()
}

#[test]
fn intervals_contain_what_was_planted() {
    let (mut contained, mut total, mut missed) = (0, 0, Vec::new());
    for i in 0..12u64 {
        let lag_s = 0.3 * (8.0f64 / 0.3).powf(spread(i, 2f64.sqrt()));
        let rate_kpa_s = 5.0 * 40f64.powf(spread(i, 3f64.sqrt()));
        let (valve_lag_s, play) = (2.0 * spread(i, 5f64.sqrt()), 5.0 * spread(i, 7f64.sqrt()));
        let lab = format!(
            "{{turbine_inlet_pressure: {{lag: {lag_s:.3} s, slew: {rate_kpa_s:.2} kPa/s}}, valve: {{lag: {valve_lag_s:.3} s}}, \
             valve_play: {play:.2} %}}"
        );
        let values = commission(&lab, "", i + 1);
        let planted = [
            ("turbine_inlet_pressure", "lag", lag_s),
            ("turbine_inlet_pressure", "rate", rate_kpa_s),
            ("turbine_inlet_pressure", "dead_time", 0.0),
            ("valve", "lag", valve_lag_s),
            ("valve", "rate", 1.0),
            ("valve", "play", play),
            ("valve", "dead_band", 0.0),
            ("turbine_inlet_temperature", "lag", 20.0),
            ("turbine_inlet_temperature", "rate", 10.0),
        ];
        assert_eq!(values.len(), planted.len());
        for (actuator, key, planted) in planted {
            let value = values.iter().find(|value| (value.actuator, value.key) == (actuator, key)).unwrap();
            let measured = value.measured;
            total += 1;
            match measured.contains(planted) {
                true => contained += 1,
                false => missed.push(format!("{lab} {actuator} {key}: {planted} in {measured:?}")),
            }
            // An interval that is as wide as the range of its value would say nothing.
            if measured.high.is_finite() && planted > 1.0 {
                assert!(measured.high - measured.low < planted, "{lab} {value:?}");
            }
        }
    }
    assert!(10 * contained >= 9 * total, "{contained} of {total}: {missed:#?}");
}

/// A declaration of the stand as it is agrees, and that of another stand does not.
#[test]
fn a_wrong_declaration_is_found() {
    let lab = "{turbine_inlet_pressure: {lag: 2.9 s, slew: 30 kPa/s}, valve_play: 2 %}";
    let declared = |lag: &str| {
        let text =
            format!("rig: {{actuators: {{turbine_inlet_pressure: {{lag: {lag}, rate: 30 kPa/s}}}}}}\n");
        let values = commission(lab, &text, 1);
        values.into_iter().find(|value| value.key == "lag").unwrap()
    };
    assert!(declared("2.9 s").agrees());
    let wrong = declared("1 s");
    assert!(!wrong.agrees());
    assert!((wrong.to_declare() - 2.9).abs() < 0.3, "{wrong:?}");
}

//! Steps that end when somebody says so: within their bounds, from their own jump on, and never a step that is none of theirs.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use mapper_core::{
    Channel, ChannelColumn, OperatingPoint, PlanStep, Predicted, Recording, SampleBatch, StepKind, StepMarker,
};
use mapper_runner::{Certainty, DwellBounds, StepSource, StepSourceError, UntilCertain};

const TO: OperatingPoint = OperatingPoint { speed_rpm: 80e3, valve_opening_ratio: 0.7 };

/// Two steps of 50 s.
struct Steps(usize);

impl StepSource for Steps {
    fn warm_up_s(&self) -> f64 {
        0.0
    }
    fn cool_down_s(&self) -> f64 {
        0.0
    }
    fn next_step(&mut self) -> Result<Option<PlanStep>, StepSourceError> {
        self.0 += 1;
        Ok((self.0 <= 2).then(|| PlanStep {
            index: self.0 - 1,
            kind: StepKind::Point,
            from: None,
            to: TO,
            p3_pa: 2e5,
            t3_k: 773.15,
            oil_temperature_k: 323.15,
            dwell_s: 50.0,
            start_s: 0.0,
            predicted: Predicted::settled(0.05, 1.5, 350.0, 50.0),
        }))
    }
}

/// Lets a step end once it has `enough` samples; keeps the times of its looks after the jump.
struct Counts {
    enough: usize,
    bounds: Option<DwellBounds>,
    looks_s: Vec<f64>,
    ended: Vec<usize>,
    left_out: usize,
}

fn samples(readings: &Recording) -> usize {
    readings.series.get(&Channel::T2).map_or(0, |series| series.t_s.len())
}

impl Certainty for Counts {
    fn bounds(&mut self, _: &PlanStep) -> Option<DwellBounds> {
        self.bounds
    }
    fn look(&mut self, readings: &Recording, marker: &StepMarker) -> Option<String> {
        assert_eq!(readings.steps, [*marker]);
        self.looks_s.push(marker.end_s - marker.start_s);
        (samples(readings) >= self.enough).then(|| "enough".to_owned())
    }
    fn ended(&mut self, readings: &Recording, _: &StepMarker) {
        self.ended.push(samples(readings));
    }
    fn left_out(&mut self) {
        self.left_out += 1;
    }
}

fn counts(enough: usize) -> Counts {
    let bounds = Some(DwellBounds { first_look_s: 20.0, apart_s: 3.0, longest_s: 90.0 });
    Counts { enough, bounds, looks_s: Vec::new(), ended: Vec::new(), left_out: 0 }
}

fn marker(start_s: f64, end_s: f64) -> StepMarker {
    StepMarker {
        index: 0,
        kind: StepKind::Point,
        start_s,
        end_s,
        from: None,
        to: Some(TO),
        p3_pa: 2e5,
        valve_opening_ratio: 0.7,
    }
}

/// One sample a second; the time at which the source ends the step, or `until_s`.
fn goes_on(source: &mut UntilCertain<'_>, from_s: f64, until_s: f64) -> f64 {
    let mut now_s = from_s;
    while now_s < until_s {
        now_s += 1.0;
        let columns = vec![ChannelColumn { channel: Channel::T2, values: vec![350.0] }];
        if source.on_batch(&SampleBatch { t_s: vec![now_s], columns, ..SampleBatch::default() }) {
            break;
        }
    }
    now_s
}

#[test]
fn a_step_ends_at_a_look_and_says_why() {
    let (mut steps, mut counts) = (Steps(0), counts(24));
    let mut source = UntilCertain::new(&mut steps, &mut counts);
    let step = source.next_step().unwrap().unwrap();
    assert_eq!(step.dwell_s, 90.0, "the longest that it may last");
    // The warm-up is none of the step.
    assert_eq!(goes_on(&mut source, 0.0, 100.0), 100.0);
    source.begins(&marker(100.0, 190.0));
    let end_s = goes_on(&mut source, 100.0, 190.0);
    // Looks at 20, 23 and 26 s.
    assert_eq!(end_s, 126.0);
    // A guard may hold the step: it is still to be ended.
    assert_eq!(goes_on(&mut source, 126.0, 190.0), 127.0);
    source.after_step(&marker(100.0, 127.0)).unwrap();
    assert_eq!(source.take_notes(), ["enough"]);
    // Another's step, put in between, is not looked at.
    source.begins(&marker(127.0, 200.0));
    assert_eq!(goes_on(&mut source, 127.0, 200.0), 200.0);
    source.after_step(&marker(127.0, 200.0)).unwrap();
    assert_eq!((counts.looks_s, counts.ended), (vec![20.0, 23.0, 26.0], vec![27]));
}

#[test]
fn a_step_that_is_never_certain_lasts_as_long_as_it_may_and_says_nothing() {
    let (mut steps, mut counts) = (Steps(0), counts(usize::MAX));
    let mut source = UntilCertain::new(&mut steps, &mut counts);
    source.next_step().unwrap();
    source.begins(&marker(0.0, 90.0));
    assert_eq!(goes_on(&mut source, 0.0, 90.0), 90.0);
    source.after_step(&marker(0.0, 90.0)).unwrap();
    assert!(source.take_notes().is_empty());
    assert_eq!(counts.looks_s.len(), 24, "at bounded intervals: {:?}", counts.looks_s);
}

#[test]
fn a_step_that_is_made_again_is_read_from_its_second_jump_on_and_one_that_is_left_out_is_told() {
    let (mut steps, mut counts) = (Steps(0), counts(24));
    let mut source = UntilCertain::new(&mut steps, &mut counts);
    source.next_step().unwrap();
    source.begins(&marker(0.0, 90.0));
    goes_on(&mut source, 0.0, 22.0);
    source.begins(&marker(30.0, 120.0));
    assert_eq!(goes_on(&mut source, 30.0, 120.0), 56.0);
    source.skipped(&marker(30.0, 56.0)).unwrap();
    assert!(source.take_notes().is_empty());
    assert_eq!((counts.left_out, counts.ended.len()), (1, 0));
}

#[test]
fn a_step_without_bounds_lasts_as_planned_and_is_read_all_the_same() {
    let (mut steps, mut counts) = (Steps(0), Counts { bounds: None, ..counts(1) });
    let mut source = UntilCertain::new(&mut steps, &mut counts);
    assert_eq!(source.next_step().unwrap().unwrap().dwell_s, 50.0);
    source.begins(&marker(0.0, 50.0));
    assert_eq!(goes_on(&mut source, 0.0, 50.0), 50.0);
    source.after_step(&marker(0.0, 50.0)).unwrap();
    assert_eq!((counts.looks_s.len(), counts.ended), (0, vec![50]));
}

//! The rules of the seam `Backend`, one function each.

use crate::candidate::{Candidate, bits, out_of_order};
use mapper_core::{BackendError, RigMode, Setpoints};
use std::collections::BTreeSet;

/// A rule, and how it is checked.
type Rule = (&'static str, fn(&Candidate));

/// All of them.
#[rustfmt::skip]
pub const ALL: &[Rule] = &[
    ("it describes itself before it is armed, and the same afterwards", describes_itself),
    ("calls before arming and after disarming are refused", keeps_the_life_cycle),
    ("a batch is whole: columns of one length, of described channels alone, each once", batches_are_whole),
    ("time and sequence go on without gap or step back, whatever it is polled for", time_goes_forward),
    ("nothing is delivered from beyond the time asked for, and all that is due", polls_to_the_time_asked_for),
    ("how often it is polled changes nothing but the cut", polling_changes_nothing),
    ("equal seeds, equal calls: equal samples to the bit", repeats_itself),
    ("a setpoint that means nothing is refused by a typed error, and changes nothing", refuses_wild_setpoints),
    ("it may be made safe at any time after arming, and twice", is_made_safe),
    ("a disarmed rig can be armed again, and starts at time 0", starts_anew),
    ("the end of what it has is the loss of the rig, after which it can be made safe", ends_with_its_loss),
];

fn describes_itself(candidate: &Candidate) {
    let mut rig = (candidate.make)();
    let description = rig.describe();
    assert_eq!(description.backend, candidate.name);
    assert!(!description.version.is_empty() && !description.channels.is_empty());
    assert!(description.sample_rate_hz > 0.0 && description.sample_rate_hz.is_finite());
    let different: BTreeSet<_> = description.channels.iter().collect();
    assert_eq!(different.len(), description.channels.len(), "a channel is described twice");
    rig.arm().unwrap();
    rig.set(&candidate.setpoints).unwrap();
    rig.poll(1.0).unwrap();
    assert_eq!(rig.describe(), description);
}

fn keeps_the_life_cycle(candidate: &Candidate) {
    let mut rig = (candidate.make)();
    for disarmed in [false, true] {
        if disarmed {
            rig.arm().unwrap();
            out_of_order(rig.arm());
            rig.set(&candidate.setpoints).unwrap();
            rig.poll(1.0).unwrap();
            rig.disarm().unwrap();
        }
        // No samples after disarming, in particular.
        out_of_order(rig.poll(2.0));
        out_of_order(rig.set(&candidate.setpoints));
        out_of_order(rig.make_safe());
        out_of_order(rig.disarm());
    }
}

fn batches_are_whole(candidate: &Candidate) {
    let mut rig = candidate.running();
    let described: BTreeSet<_> = rig.describe().channels.into_iter().collect();
    for until_s in [0.0, 0.55, 0.55, 3.0, 3.01] {
        let batch = rig.poll(until_s).unwrap();
        let delivered: BTreeSet<_> = batch.columns.iter().map(|column| column.channel).collect();
        assert_eq!(delivered, described, "at {until_s} s");
        assert_eq!(batch.columns.len(), described.len(), "a channel has two columns");
        for column in &batch.columns {
            assert_eq!(column.values.len(), batch.t_s.len(), "{}", column.channel);
        }
        for column in &batch.truth {
            assert_eq!(column.values.len(), batch.t_s.len(), "{} (truth)", column.name);
        }
    }
}

fn time_goes_forward(candidate: &Candidate) {
    let mut rig = candidate.running();
    let (mut last_s, mut next) = (f64::NEG_INFINITY, 0);
    // Also to times that have passed, and that were never.
    for until_s in [-1.0, 0.0, 2.0, 1.0, -1.0, 2.0, f64::NAN, 2.05, 6.0] {
        let batch = rig.poll(until_s).unwrap();
        assert_eq!(batch.first_sequence, next, "at {until_s} s");
        for t_s in &batch.t_s {
            assert!(*t_s > last_s && *t_s >= 0.0, "{t_s} s after {last_s} s");
            last_s = *t_s;
        }
        next += batch.t_s.len() as u64;
    }
    assert!(last_s > 5.5);
}

fn polls_to_the_time_asked_for(candidate: &Candidate) {
    let mut rig = candidate.running();
    let sample_s = 1.0 / rig.describe().sample_rate_hz;
    for until_s in [1.0, 1.04, 2.37, 7.0] {
        let batch = rig.poll(until_s).unwrap();
        let Some(last_s) = batch.t_s.last() else { continue };
        assert!(*last_s <= until_s, "{last_s} s, asked for {until_s} s");
        // The sample after it would lie beyond.
        assert!(until_s - last_s < 1.001 * sample_s, "{last_s} s, asked for {until_s} s");
        assert!(batch.events.iter().all(|event| event.t_s <= until_s), "{:?}", batch.events);
    }
}

fn polling_changes_nothing(candidate: &Candidate) {
    let whole = candidate.running().poll(6.0).unwrap();
    let mut rig = candidate.running();
    let pieces = [0.3, 0.3, 1.0, 5.95, 6.0].map(|until_s| rig.poll(until_s).unwrap());
    let times: Vec<f64> = pieces.iter().flat_map(|batch| batch.t_s.clone()).collect();
    assert_eq!(times, whole.t_s);
    for (index, column) in whole.columns.iter().enumerate() {
        let cut = pieces.iter().flat_map(|batch| batch.columns[index].values.clone());
        let scale = column.values.iter().map(|value| value.abs()).fold(0.0, f64::max);
        for ((t_s, cut), whole) in times.iter().zip(cut).zip(&column.values) {
            // A solver ends its step where a poll ends: a hundred times its relative tolerance of 1e-6.
            let agrees = (cut - whole).abs() <= 1e-4 * scale || (cut.is_nan() && whole.is_nan());
            assert!(agrees, "{} at {t_s} s: {cut} in pieces, {whole} in one", column.channel);
        }
    }
}

fn repeats_itself(candidate: &Candidate) {
    let (mut first, mut second) = (candidate.running(), candidate.running());
    for until_s in [0.5, 2.0, 2.01, 8.0] {
        assert_eq!(bits(&first.poll(until_s).unwrap()), bits(&second.poll(until_s).unwrap()));
    }
}

fn refuses_wild_setpoints(candidate: &Candidate) {
    let good = candidate.setpoints;
    let wild = [
        Setpoints { p3_pa: f64::NAN, ..good },
        Setpoints { p3_pa: 1e9, ..good },
        Setpoints { p3_pa: -1e5, ..good },
        Setpoints { t3_k: f64::INFINITY, ..good },
        Setpoints { valve_opening_ratio: -0.1, ..good },
        Setpoints { valve_opening_ratio: 25.0, ..good },
        Setpoints { oil_temperature_k: 0.0, ..good },
    ];
    let (mut rig, mut untouched) = (candidate.running(), candidate.running());
    for setpoints in wild {
        let refused = rig.set(&setpoints);
        let Err(BackendError::SetpointOutOfRange { value, low, high, .. }) = refused else {
            panic!("{setpoints:?}: {refused:?}")
        };
        assert!(!(low..=high).contains(&value) && low < high, "{value} in {low} to {high}");
    }
    assert_eq!(bits(&rig.poll(2.0).unwrap()), bits(&untouched.poll(2.0).unwrap()));
}

fn is_made_safe(candidate: &Candidate) {
    // Before it has any setpoints, and after.
    for running in [false, true] {
        let mut rig = (candidate.make)();
        rig.arm().unwrap();
        if running {
            rig.set(&candidate.setpoints).unwrap();
            rig.poll(1.0).unwrap();
        }
        rig.make_safe().unwrap();
        rig.make_safe().unwrap();
        let batch = rig.poll(2.0).unwrap();
        assert!(!batch.t_s.is_empty(), "a safe rig still measures");
        rig.make_safe().unwrap();
        rig.disarm().unwrap();
    }
}

fn starts_anew(candidate: &Candidate) {
    let mut rig = candidate.running();
    let first = rig.poll(2.0).unwrap();
    rig.disarm().unwrap();
    rig.arm().unwrap();
    rig.set(&candidate.setpoints).unwrap();
    assert_eq!(bits(&rig.poll(2.0).unwrap()), bits(&first));
}

fn ends_with_its_loss(candidate: &Candidate) {
    let Some(lasts_s) = candidate.lasts_s else { return };
    let mut rig = candidate.running();
    // What there is comes whole, then the loss is told, each time.
    let batch = rig.poll(lasts_s + 1.0).unwrap();
    assert_eq!(batch.t_s.last(), Some(&lasts_s));
    for _ in 0..2 {
        let lost = rig.poll(lasts_s + 2.0);
        assert!(matches!(lost, Err(BackendError::Lost { t_s, .. }) if t_s == lasts_s), "{lost:?}");
    }
    rig.set(&Setpoints { mode: RigMode::Standstill, ..candidate.setpoints }).unwrap();
    rig.make_safe().unwrap();
    rig.disarm().unwrap();
}

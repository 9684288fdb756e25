//! The dynamic method with a lagging probe: as good as without one if the probe is declared, biased if not.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::lab::{self, Campaign, Machine, campaign, eighteen, measured};
use mapper_core::{IdentifiedPoint, Method, Recording};
use mapper_identify::{Identified, IdentifyConfig, identify_recording};
use rand::SeedableRng;
use rand_pcg::Pcg64;

/// Errors of eta (fraction) and h (ratio) of every point with both.
fn errors(campaign: &Campaign, recording: &Recording, config: &IdentifyConfig) -> Vec<(f64, f64)> {
    let Identified { points, .. } = identify_recording(recording, config, None).unwrap();
    let off = |(point, truth): (&IdentifiedPoint, &lab::Truth)| {
        Some((point.eta? - truth.eta, point.h_w_m2k? / truth.h_w_m2k - 1.0))
    };
    let points: Vec<_> = points.into_iter().map(Result::unwrap).collect();
    points.iter().zip(&campaign.truth).filter_map(off).collect()
}

fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let squares: Vec<f64> = values.map(|value| value * value).collect();
    (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let values: Vec<f64> = values.collect();
    values.iter().sum::<f64>() / values.len() as f64
}

const PROBE_M: f64 = 3e-3;

/// Draws of the noise: 17 points each.
const SEEDS: std::ops::RangeInclusive<u64> = 1..=6;

fn config(method: Method, probe_diameter_m: f64) -> IdentifyConfig {
    IdentifyConfig { method, probe_diameter_m, ..IdentifyConfig::default() }
}

fn with_probe(probe_m: f64) -> Campaign {
    campaign(&eighteen(), 120.0, Machine { probe_m, ..Machine::default() })
}

/// Without noise the error is that of a constant h, probe or not; an undeclared 3 mm probe gives an error of h of a third.
#[test]
fn without_noise_a_declared_probe_costs_nothing() {
    let (fast, slow) = (with_probe(0.0), with_probe(PROBE_M));
    let of = |campaign: &Campaign, declared_m| {
        errors(campaign, &campaign.recording, &config(Method::Dynamic, declared_m))
    };
    let (ideal, declared, silent) = (of(&fast, 0.0), of(&slow, PROBE_M), of(&slow, 0.0));
    assert_eq!(ideal.len(), declared.len());
    for (ideal, declared) in ideal.iter().zip(&declared) {
        // The probe changes the weights of the seconds in a window slightly, and with them the model error of eta and h.
        assert!(
            (ideal.0 - declared.0).abs() < 0.003 && (ideal.1 - declared.1).abs() < 0.02,
            "{ideal:?} {declared:?}"
        );
    }
    assert!(mean(silent.iter().map(|error| error.1)) > 0.2, "{silent:?}");
}

/// With the noise of a rig, the same draws for all: no worse than without a probe, and no bias of h.
#[test]
fn with_noise_a_declared_probe_is_no_worse_than_none() {
    let (fast, slow) = (with_probe(0.0), with_probe(PROBE_M));
    let pooled = |campaign: &Campaign, declared_m: f64| -> Vec<(f64, f64)> {
        let of = |seed| {
            let (recording, declared) =
                measured(&campaign.recording, 1.0, 0.0, &mut Pcg64::seed_from_u64(seed));
            let config = IdentifyConfig { declared, ..config(Method::Dynamic, declared_m) };
            errors(campaign, &recording, &config)
        };
        SEEDS.flat_map(of).collect()
    };
    let (ideal, declared, silent) = (pooled(&fast, 0.0), pooled(&slow, PROBE_M), pooled(&slow, 0.0));
    let eta = |errors: &[(f64, f64)]| rms(errors.iter().map(|error| error.0));
    let h = |errors: &[(f64, f64)]| rms(errors.iter().map(|error| error.1));
    // The standard error of the ratio of two such figures of 102 points, were they independent, is 10 %.
    assert!(eta(&declared) < 1.1 * eta(&ideal), "{} and {}", eta(&declared), eta(&ideal));
    assert!(h(&declared) < 1.1 * h(&ideal), "{} and {}", h(&declared), h(&ideal));
    // The mean of 102 errors with a spread of 4 % is known to 0.4 %; allow twice that for the model error.
    let bias = |errors: &[(f64, f64)]| mean(errors.iter().map(|error| error.1));
    assert!((bias(&declared) - bias(&ideal)).abs() < 0.01, "{} and {}", bias(&declared), bias(&ideal));
    assert!(bias(&silent) > 0.2 && eta(&silent) > 1.5 * eta(&ideal), "{} {}", bias(&silent), eta(&silent));
}

/// The end of a drifting step: most of the probe's lag is corrected, and the interval covers the remainder.
#[test]
fn the_steady_method_reads_ahead_of_a_declared_probe() {
    let (fast, slow) = (with_probe(0.0), with_probe(PROBE_M));
    let of = |campaign: &Campaign, declared_m| -> Vec<IdentifiedPoint> {
        let config = config(Method::Steady, declared_m);
        let Identified { points, .. } = identify_recording(&campaign.recording, &config, None).unwrap();
        points.into_iter().map(Result::unwrap).collect()
    };
    let (ideal, declared, silent) = (of(&fast, 0.0), of(&slow, PROBE_M), of(&slow, 0.0));
    let off = |found: &[IdentifiedPoint]| {
        rms(found.iter().zip(&ideal).map(|(found, ideal)| found.eta.unwrap() - ideal.eta.unwrap()))
    };
    // The drift is that of a minute in which it decreases: the correction is too large by that decrease.
    assert!(off(&declared) < 0.6 * off(&silent), "{} and {}", off(&declared), off(&silent));
    for (found, ideal) in declared.iter().zip(&ideal) {
        // The settled first step needs no correction beyond the simulator's own tolerance.
        let (low, high) =
            found.eta_low.zip(found.eta_high).map(|(low, high)| (low - 1e-6, high + 1e-6)).unwrap();
        assert!((low..=high).contains(&ideal.eta.unwrap()), "{} in {low} to {high}", ideal.eta.unwrap());
    }
}

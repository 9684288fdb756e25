//! Housings and thermocouples that the campaign does not describe: the machine's own efficiencies are the truth.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::common::shipped::campaign;
use mapper_backends::{other_lab, virtual_lab};
use mapper_core::{ThermalModel, Verdict};
use mapper_formats::FORMATS;
use mapper_recording::score::ScoredPoint;
use mapper_session::{Registry, RunRequest, Session};

/// Good points, those of them whose interval holds the truth, all points, and the thermal model of the shipped campaign with these changes.
fn identified(changes: &[(&str, &str)]) -> (usize, usize, usize, ThermalModel) {
    let campaign = campaign(changes);
    let backends = vec![virtual_lab::PLUGIN, other_lab::PLUGIN];
    let registry = Registry { backends, formats: FORMATS, ..Registry::empty() };
    let folder = tempfile::tempdir().unwrap();
    let run = Session::new(&registry).run(RunRequest::new(&campaign, "", folder.path())).unwrap();
    let identified = run.results.unwrap().identified;
    let is_good = |scored: &&_| {
        let scored: &ScoredPoint = scored;
        scored.point.verdict == Verdict::Good
    };
    let good: Vec<_> = identified.points.iter().filter(is_good).collect();
    let holds = |scored: &&&ScoredPoint| {
        let eta = scored.truth.as_ref().unwrap().eta;
        scored.point.eta_low.unwrap() <= eta && eta <= scored.point.eta_high.unwrap()
    };
    let held = good.iter().filter(holds).count();
    (good.len(), held, identified.points.len(), identified.thermal.unwrap())
}

/// Four nodes behind 5 W/K, the gas touches all of them, and Tc is one of them: most points are good, and most of these hold.
#[test]
fn a_housing_of_four_nodes_has_good_points_that_hold() {
    let (good, held, all, thermal) = identified(&[("virtual_lab: {}", "other_lab: {}")]);
    assert!(2 * held >= all && 4 * held >= 3 * good, "{held} of {good} of {all}");
    assert!(thermal.housing.unwrap().outer_area_ratio.is_some());
}

/// A thermocouple that lags by 5 s is a lag and no mass of the housing: it is found within its stated error and half a second.
#[test]
fn a_slow_thermocouple_is_found_and_the_points_hold() {
    let (good, held, all, thermal) = identified(&[
        ("mounting: embedded}", "mounting: embedded, count: 2}"),
        (
            "virtual_lab: {}",
            "virtual_lab: {faults: [{channel: Tc, element: 1, lag: 5 s}, {channel: Tc, element: 2, lag: 5 s}]}",
        ),
    ]);
    assert!(2 * good >= all && 10 * held >= 9 * good, "{held} of {good} of {all}");
    let housing = thermal.housing.unwrap();
    let lag_s = housing.tc_lag_s.value.unwrap();
    let error_s = housing.tc_lag_s.uncertainty.combined_standard_error();
    assert!((lag_s - 5.0).abs() < 0.5 + 2.0 * error_s, "{lag_s} +/- {error_s} s");
    assert!(housing.inner_capacity_ratio.is_none());
}

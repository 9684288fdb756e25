//! The fitted efficiency: exact at the points, near the truth between them, absent outside.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::support;
use mapper_core::{CompressorMap, Verdict};
use mapper_formats::efficiency_surface;
use proptest::prelude::*;

/// The closed form sampled without errors, all points good.
fn exact(xs: &[f64]) -> CompressorMap {
    let mut map = support::turbo_a();
    for line in &mut map.lines {
        let template = line.points[1].clone();
        line.points = xs
            .iter()
            .map(|x| {
                let (flow, ratio, eta) = support::closed_form(line.speed_corrected_rpm, *x);
                let mut point = template.clone();
                (point.flow_corrected_kg_s, point.pressure_ratio, point.eta) = (flow, ratio, Some(eta));
                point
            })
            .collect();
    }
    map
}

fn nodes(map: &CompressorMap) -> Vec<[f64; 3]> {
    let grid = efficiency_surface(map).unwrap();
    (0..grid.rows())
        .flat_map(|r| (0..grid.columns()).map(move |c| (r, c)))
        .filter_map(|(r, c)| grid.node(r, c))
        .collect()
}

/// Efficiency of the closed form at a flow and pressure ratio: speed and x by bisection on speed.
fn truth(flow_kg_s: f64, pressure_ratio: f64) -> Option<f64> {
    // On a line of constant pressure ratio, flow rises with speed.
    let x_at = |speed: f64| {
        let (_, surge, _) = support::closed_form(speed, 1.0);
        let (_, choke, _) = support::closed_form(speed, 0.0);
        (pressure_ratio - choke) / (surge - choke)
    };
    let (mut low, mut high) = (40e3, 200e3);
    for _ in 0..60 {
        let speed = 0.5 * (low + high);
        let x = x_at(speed);
        if x > 1.0 || support::closed_form(speed, x).0 < flow_kg_s { low = speed } else { high = speed }
    }
    let x = x_at(high);
    (0.02..0.99).contains(&x).then(|| support::closed_form(high, x).2)
}

#[test]
fn between_exact_points_it_is_near_the_truth() {
    let map = exact(&[0.985, 0.93, 0.82, 0.66, 0.42, 0.12]);
    let mut errors: Vec<f64> = nodes(&map)
        .iter()
        .filter_map(|[flow, ratio, eta]| truth(*flow, *ratio).map(|truth| (eta - truth).abs()))
        .collect();
    errors.sort_by(f64::total_cmp);
    assert!(errors.len() > 1000);
    // A monotone cubic flattens a peak between two points by about an eighth of its second difference: with
    // efficiency falling by 5 to 10 points from one point to the next, that is one point or a little more.
    assert!(errors[errors.len() / 2] < 0.003, "median {}", errors[errors.len() / 2]);
    assert!(errors[errors.len() - 1] < 0.02, "worst {}", errors[errors.len() - 1]);
}

#[test]
fn ends_of_a_line_without_efficiency_are_not_supported_and_a_hole_inside_is_bridged() {
    let mut map = exact(&[0.98, 0.8, 0.6, 0.4, 0.2]);
    map.lines[3].points[0].eta = None;
    map.lines[5].points[2].eta = None;
    map.lines[5].points[2].identified.verdict = Verdict::Unusable;
    let grid = efficiency_surface(&map).unwrap();
    let per_line = (grid.rows() - 1) / (map.lines.len() - 1);
    let known =
        |line: usize| (0..grid.columns()).filter(|c| grid.node(line * per_line, *c).is_some()).count();
    assert_eq!(known(1), grid.columns());
    assert!(known(3) < grid.columns() && grid.node(3 * per_line, 0).is_none());
    assert!(grid.node(3 * per_line + 1, 0).is_none() && grid.node(3 * per_line - 1, 0).is_none());
    assert!(grid.node(3 * per_line, grid.columns() - 1).is_some());
    assert_eq!(known(5), grid.columns());
}

/// A slow line is a small part of the map: its points near choke are close together, but not repeats.
#[test]
fn a_slow_line_keeps_its_ends() {
    let map = exact(&[1.0, 0.9, 0.7, 0.4, 0.12, 0.06, 0.0]);
    let grid = efficiency_surface(&map).unwrap();
    let points = &map.lines[0].points;
    for (column, point) in [(0, &points[0]), (grid.columns() - 1, &points[6])] {
        let expected = [point.flow_corrected_kg_s, point.pressure_ratio, point.eta.unwrap()];
        let node = grid.node(0, column).unwrap();
        assert!(node.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-9), "{node:?} {expected:?}");
    }
}

#[test]
fn too_little_gives_no_surface() {
    let mut map = exact(&[0.9, 0.5]);
    map.lines.truncate(1);
    assert!(efficiency_surface(&map).is_none());
    let mut points = exact(&[0.5]);
    points.lines.truncate(3);
    assert!(efficiency_surface(&points).is_none());
}

proptest! {
    #[test]
    fn it_never_leaves_what_was_measured(etas in proptest::collection::vec(proptest::option::weighted(0.85, 0.2..0.8f64), 48)) {
        let mut map = support::turbo_a();
        for (point, eta) in map.lines.iter_mut().flat_map(|l| &mut l.points).zip(&etas) { point.eta = *eta; }
        let known = || etas.iter().flatten().copied();
        let (low, high) = (known().fold(1.0, f64::min), known().fold(0.0, f64::max));
        for [flow, ratio, eta] in nodes(&map) {
            // Rounding of a cubic's four terms.
            prop_assert!(eta >= low - 1e-9 && eta <= high + 1e-9);
            prop_assert!(flow > 0.0 && ratio > 1.0);
        }
    }
}

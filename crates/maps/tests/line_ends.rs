//! Where surge and choke were reached on the lines of a map.

use crate::support::map_of;
use mapper_core::{EndEvidence, LineEnd};
use mapper_maps::{LineEnds, mark_line_ends};

/// Speed, flow, pressure ratio, efficiency of a line: an ellipse from its top at 0.05 kg/s to choke at 0.10 kg/s.
fn line(from: f64, to: f64, points: usize, eta: f64) -> Vec<[f64; 4]> {
    let at = |index: usize| {
        let x = from + (to - from) * index as f64 / (points - 1) as f64;
        [100e3, 0.05 + 0.05 * x.sin(), 1.0 + x.cos(), eta - 0.3 * (x - 0.6).powi(2)]
    };
    (0..points).map(at).collect()
}

fn ends(rows: &[[f64; 4]]) -> LineEnds {
    mark_line_ends(&mut map_of(rows), |_| None)[0]
}

#[test]
fn the_slope_shows_both_ends() {
    // From left of the top, where the pressure ratio falls again, to 87 degrees, where the line is vertical.
    let whole = ends(&line(-0.3, 1.52, 14, 0.55));
    assert_eq!((whole.surge.by, whole.choke.by), (EndEvidence::ZeroSlope, EndEvidence::Vertical));
    assert!(whole.choke.flow_corrected_kg_s > 0.097, "{whole:?}");
    // The middle of the line has neither.
    let middle = ends(&line(0.3, 1.0, 8, 0.55));
    assert_eq!((middle.surge.by, middle.choke.by), (EndEvidence::NotReached, EndEvidence::NotReached));
    // Many points or few, the end is the same within a step.
    let dense = ends(&line(-0.3, 1.52, 200, 0.55));
    assert!((dense.choke.flow_corrected_kg_s / whole.choke.flow_corrected_kg_s - 1.0).abs() < 0.02);
}

#[test]
fn an_efficiency_below_58_percent_is_choke_behind_the_best_point_only() {
    let found = ends(&line(-0.3, 1.3, 9, 0.7));
    assert_eq!(found.choke.by, EndEvidence::Efficiency);
    assert!(found.choke.flow_corrected_kg_s > 0.09);
}

/// A point that was measured six times scatters; neither end is there.
#[test]
fn repeated_points_show_no_end() {
    let repeated = |index: usize| {
        let scatter = 1e-3 * ((index * 7 % 5) as f64 - 2.0);
        [100e3, 0.07 * (1.0 + scatter), 1.8 * (1.0 - 0.5 * scatter), 0.7]
    };
    let mut rows: Vec<[f64; 4]> = (0..6).map(repeated).chain([[100e3, 0.08, 1.7, 0.69]]).collect();
    rows.sort_by(|a, b| a[1].total_cmp(&b[1]));
    let found = ends(&rows);
    assert_eq!((found.surge.by, found.choke.by), (EndEvidence::NotReached, EndEvidence::NotReached));
}

#[test]
fn a_row_that_names_an_end_has_it() {
    let mut map = map_of(&line(0.3, 1.0, 8, 0.7));
    map.lines[0].points.iter_mut().enumerate().for_each(|(step, point)| point.identified.step = step);
    let named =
        |step: usize| [(0, LineEnd::Surge), (7, LineEnd::Choke)].into_iter().find(|(at, _)| *at == step);
    let found = mark_line_ends(&mut map, |step| Some(named(step)?.1));
    assert_eq!((found[0].surge.by, found[0].choke.by), (EndEvidence::Named, EndEvidence::Named));
    let codes: Vec<&str> = map.lines[0]
        .points
        .iter()
        .flat_map(|point| &point.identified.warnings)
        .map(|warning| warning.code())
        .collect();
    assert_eq!(codes, ["surge_end", "choke_end"]);
}

//! Contour lines against what a contour is.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use mapper_chart::{StructuredGrid, contour_lines};
use proptest::prelude::*;

const ROWS: usize = 6;
const COLUMNS: usize = 7;

/// Unit squares, x = column, y = row.
fn unit_grid(z: &[f64]) -> StructuredGrid {
    let x = (0..ROWS * COLUMNS).map(|i| (i % COLUMNS) as f64).collect();
    let y = (0..ROWS * COLUMNS).map(|i| (i / COLUMNS) as f64).collect();
    StructuredGrid::new(ROWS, COLUMNS, x, y, z.to_vec()).unwrap()
}

/// The field at a point of a cell edge, by linear interpolation between the edge's ends.
fn field_on_edge(z: &[f64], (x, y): (f64, f64)) -> f64 {
    let (c, r) = (x.floor().min(COLUMNS as f64 - 2.0), y.floor().min(ROWS as f64 - 2.0));
    let (u, v) = (x - c, y - r);
    assert!([u, u - 1.0, v, v - 1.0].iter().any(|d| d.abs() < 1e-12), "({x}, {y}) is on no cell edge");
    let at = |dr: usize, dc: usize| z[(r as usize + dr) * COLUMNS + c as usize + dc];
    // Weights of corners off the edge are 0 up to rounding; 0 * NaN must not count.
    [
        (at(0, 0), (1.0 - u) * (1.0 - v)),
        (at(0, 1), u * (1.0 - v)),
        (at(1, 0), (1.0 - u) * v),
        (at(1, 1), u * v),
    ]
    .into_iter()
    .filter(|(_, w)| *w > 1e-11)
    .map(|(z, w)| z * w)
    .sum()
}

fn known(z: &[f64], r: usize, c: usize) -> bool {
    [(0, 0), (0, 1), (1, 0), (1, 1)].iter().all(|(dr, dc)| z[(r + dr) * COLUMNS + c + dc].is_finite())
}

fn field() -> impl Strategy<Value = Vec<f64>> {
    let value = prop_oneof![9 => -1.0..1.0f64, 1 => Just(f64::NAN), 1 => Just(0.25)];
    proptest::collection::vec(value, ROWS * COLUMNS)
}

proptest! {
    #[test]
    fn every_point_of_a_contour_has_the_level(z in field(), level in prop_oneof![-0.9..0.9f64, Just(0.25)]) {
        for point in contour_lines(&unit_grid(&z), level).into_iter().flatten() {
            // Interpolation and its inverse, each a few ulp of numbers around 1; steep edges do not amplify z.
            prop_assert!((field_on_edge(&z, point) - level).abs() < 1e-9);
        }
    }

    #[test]
    fn segments_are_in_known_cells_alone_and_none_is_lost(z in field(), level in -0.9..0.9f64) {
        let mut found = 0;
        for line in contour_lines(&unit_grid(&z), level) {
            for pair in line.windows(2) {
                // A segment crosses one cell; its middle is inside it unless both ends are on one edge.
                let (x, y) = (0.5 * (pair[0].0 + pair[1].0), 0.5 * (pair[0].1 + pair[1].1));
                prop_assert!(known(&z, y.floor() as usize, x.floor() as usize), "segment at ({x}, {y})");
                found += 1;
            }
        }
        // Brute force: a cell has half as many segments as it has edges whose ends lie on different sides.
        let side = |r: usize, c: usize| z[r * COLUMNS + c] >= level;
        let mut expected = 0;
        for r in 0..ROWS - 1 {
            for c in (0..COLUMNS - 1).filter(|c| known(&z, r, *c)) {
                let ring = [side(r, c), side(r, c + 1), side(r + 1, c + 1), side(r + 1, c)];
                expected += (0..4).filter(|i| ring[*i] != ring[(i + 1) % 4]).count() / 2;
            }
        }
        prop_assert_eq!(found, expected);
    }

    #[test]
    fn contours_of_a_plane_are_straight_on_any_grid(
        shifts in proptest::collection::vec((-0.3..0.3f64, -0.3..0.3f64), ROWS * COLUMNS),
        angle in 0.0..std::f64::consts::TAU, level in 0.5..2.5f64,
    ) {
        let (a, b) = (angle.cos(), angle.sin());
        let x: Vec<f64> = (0..ROWS * COLUMNS).map(|i| (i % COLUMNS) as f64 + shifts[i].0).collect();
        let y: Vec<f64> = (0..ROWS * COLUMNS).map(|i| (i / COLUMNS) as f64 + shifts[i].1).collect();
        let z = x.iter().zip(&y).map(|(x, y)| a * (x - 3.0) + b * (y - 2.5)).collect();
        let grid = StructuredGrid::new(ROWS, COLUMNS, x, y, z).unwrap();
        for (x, y) in contour_lines(&grid, level - 1.5).into_iter().flatten() {
            prop_assert!((a * (x - 3.0) + b * (y - 2.5) - (level - 1.5)).abs() < 1e-9);
        }
    }

    #[test]
    fn no_field_makes_it_fail(z in proptest::collection::vec(proptest::num::f64::ANY, ROWS * COLUMNS), level in proptest::num::f64::ANY) {
        let lines = contour_lines(&unit_grid(&z), level);
        prop_assert!(lines.iter().flatten().all(|p| p.0.is_finite() && p.1.is_finite()));
    }
}

#[test]
fn a_circle_is_one_closed_line_of_the_right_length() {
    let axis: Vec<f64> = (0..=80).map(|i| -1.0 + 0.025 * f64::from(i)).collect();
    let nodes = || axis.iter().flat_map(|y| axis.iter().map(move |x| (*x, *y)));
    let (x, y) = nodes().unzip();
    let radius = nodes().map(|(x, y)| x.hypot(y)).collect();
    let grid = StructuredGrid::new(axis.len(), axis.len(), x, y, radius).unwrap();
    let lines = contour_lines(&grid, 0.6);
    assert_eq!(lines.len(), 1);
    assert_eq!(lines[0].first(), lines[0].last());
    let length: f64 = lines[0].windows(2).map(|w| (w[1].0 - w[0].0).hypot(w[1].1 - w[0].1)).sum();
    // Chords of about 0.02 on a radius of 0.6 fall short of the arc by (0.02/0.6)^2/24, interpolation adds as much.
    assert!((length / (std::f64::consts::TAU * 0.6) - 1.0).abs() < 1e-3);
}

#[test]
fn small_and_wrong_grids_are_harmless() {
    let empty = StructuredGrid::new(0, 0, vec![], vec![], vec![]).unwrap();
    assert!(contour_lines(&empty, 0.0).is_empty() && empty.value_range().is_none());
    let line = StructuredGrid::new(1, 3, vec![0.0; 3], vec![0.0; 3], vec![0.0, 1.0, 2.0]).unwrap();
    assert!(contour_lines(&line, 0.5).is_empty());
    assert!(StructuredGrid::new(2, 2, vec![0.0; 4], vec![0.0; 3], vec![0.0; 4]).is_none());
    assert!(StructuredGrid::new(usize::MAX, 2, vec![], vec![], vec![]).is_none());
}

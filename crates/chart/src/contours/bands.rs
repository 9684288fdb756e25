//! Areas between two contour levels, cell by cell.

use crate::StructuredGrid;
use crate::contours::grid::Node;
use crate::contours::marching::crossing;

/// Polygons (x, y) that together cover the area with `low <= z < high`; neighbouring cells inside it form one polygon.
///
/// Their edges are those of [`crate::contour_lines`], except within saddle cells.
pub(crate) fn band(grid: &StructuredGrid, low: f64, high: f64) -> Vec<Vec<(f64, f64)>> {
    let mut polygons = Vec::new();
    for row in 0..grid.rows().saturating_sub(1) {
        // Lower and upper corners of the current run of whole cells.
        let mut run: Vec<[Node; 2]> = Vec::new();
        for column in 0..grid.columns().saturating_sub(1) {
            let cell = grid.cell(row, column);
            match cell {
                Some([sw, se, ne, nw]) if [sw, se, ne, nw].iter().all(|n| n[2] >= low && n[2] < high) => {
                    if run.is_empty() {
                        run.push([sw, nw]);
                    }
                    run.push([se, ne]);
                }
                other => {
                    close_run(&mut run, &mut polygons);
                    if let Some(cell) = other {
                        for piece in pieces(&cell) {
                            let inside = cut(&cut(&piece, high, |z| z < high), low, |z| z >= low);
                            if inside.len() > 2 {
                                polygons.push(inside.iter().map(|n| (n[0], n[1])).collect());
                            }
                        }
                    }
                }
            }
        }
        close_run(&mut run, &mut polygons);
    }
    polygons
}

/// The cell itself, or four triangles around its middle if it is a saddle: otherwise the bands of a
/// saddle would overlap. The middle has the mean of the corners, as for contour lines.
fn pieces(cell: &[Node; 4]) -> Vec<Vec<Node>> {
    let [a, b, c, d] = cell.map(|node| node[2]);
    let saddle = a.min(c) > b.max(d) || b.min(d) > a.max(c);
    if !saddle {
        return vec![cell.to_vec()];
    }
    let middle = [0, 1, 2].map(|i| cell.iter().map(|node| 0.25 * node[i]).sum::<f64>());
    (0..4).map(|i| vec![cell[i], cell[(i + 1) % 4], middle]).collect()
}

fn close_run(run: &mut Vec<[Node; 2]>, polygons: &mut Vec<Vec<(f64, f64)>>) {
    if !run.is_empty() {
        let xy = |n: &Node| (n[0], n[1]);
        polygons.push(run.iter().map(|p| xy(&p[0])).chain(run.iter().rev().map(|p| xy(&p[1]))).collect());
        run.clear();
    }
}

/// Keeps the part of a polygon on one side of a level of z (Sutherland-Hodgman); infinite levels keep all or nothing.
fn cut(polygon: &[Node], level: f64, keep: impl Fn(f64) -> bool) -> Vec<Node> {
    let mut out = Vec::with_capacity(polygon.len() + 2);
    for (i, node) in polygon.iter().enumerate() {
        let previous = &polygon[(i + polygon.len() - 1) % polygon.len()];
        if keep(node[2]) != keep(previous[2]) {
            let (x, y) = crossing(previous, node, level);
            out.push([x, y, level]);
        }
        if keep(node[2]) {
            out.push(*node);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn area(polygon: &[(f64, f64)]) -> f64 {
        let n = polygon.len();
        (0..n)
            .map(|i| polygon[i].0 * polygon[(i + 1) % n].1 - polygon[(i + 1) % n].0 * polygon[i].1)
            .sum::<f64>()
            / 2.0
    }

    proptest! {
        #[test]
        fn bands_between_all_levels_cover_the_known_area_once(
            z in proptest::collection::vec(prop_oneof![9 => -1.0..1.0f64, 1 => Just(f64::NAN)], 30),
            mut levels in proptest::collection::vec(-0.9..0.9f64, 1..5),
        ) {
            levels.sort_by(f64::total_cmp);
            let x: Vec<f64> = (0..30).map(|i| f64::from(i % 6)).collect();
            let y: Vec<f64> = (0..30).map(|i| f64::from(i / 6)).collect();
            let grid = StructuredGrid::new(5, 6, x, y, z).unwrap();
            let known = (0..4).flat_map(|r| (0..5).map(move |c| (r, c))).filter(|(r, c)| grid.cell(*r, *c).is_some()).count();
            let mut edges = vec![f64::NEG_INFINITY];
            edges.extend(&levels);
            edges.push(f64::INFINITY);
            let covered: f64 = edges.windows(2).flat_map(|w| band(&grid, w[0], w[1])).map(|p| area(&p)).sum();
            // Rounding of at most some hundred sums of coordinates below 10.
            prop_assert!((covered - known as f64).abs() < 1e-9, "{covered} of {known}");
        }
    }
}

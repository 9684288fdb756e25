//! Contour lines by marching squares with support for missing values.
//!
//! Source: W. E. Lorensen, H. E. Cline, "Marching cubes", SIGGRAPH 1987, in two dimensions; the two interpretations of a
//! saddle are distinguished by the mean of the four corners. A crossing is found on each cell edge by linear
//! interpolation, so the contours of a plane field are straight on any grid.

use crate::StructuredGrid;
use crate::contours::grid::Node;
use std::collections::BTreeMap;

/// The lines on which the field equals `level` (unit of z), as chains of (x, y) in the axes' units.
///
/// Cells with an unknown corner have no part of a line. A closed line repeats its first point at the end. A field
/// equal to `level` over an area has a line only at the lower edge of the area. Empty for a `level` that is not finite.
pub fn contour_lines(grid: &StructuredGrid, level: f64) -> Vec<Vec<(f64, f64)>> {
    if !level.is_finite() {
        return Vec::new();
    }
    let mut crossings = BTreeMap::new();
    let mut segments = Vec::new();
    for row in 0..grid.rows().saturating_sub(1) {
        for column in 0..grid.columns().saturating_sub(1) {
            if let Some(cell) = grid.cell(row, column) {
                cell_segments(grid, (row, column), &cell, level, &mut crossings, &mut segments);
            }
        }
    }
    chain(&segments)
        .into_iter()
        .map(|edges| {
            let mut line: Vec<(f64, f64)> =
                edges.iter().filter_map(|edge| crossings.get(edge).copied()).collect();
            line.dedup();
            line
        })
        .filter(|line| line.len() > 1)
        .collect()
}

/// Index of a grid edge: from node (row, column) to the right (0) or up (1).
fn edge_id(grid: &StructuredGrid, row: usize, column: usize, up: usize) -> usize {
    2 * (row * grid.columns() + column) + up
}

fn cell_segments(
    grid: &StructuredGrid,
    (row, column): (usize, usize),
    cell: &[Node; 4],
    level: f64,
    crossings: &mut BTreeMap<usize, (f64, f64)>,
    segments: &mut Vec<[usize; 2]>,
) {
    let above = cell.map(|node| node[2] >= level);
    // Edges in order around the cell, each with its corners in the order of the grid, so that two cells have the same
    // point on a common edge.
    let edges = [
        (edge_id(grid, row, column, 0), 0, 1),
        (edge_id(grid, row, column + 1, 1), 1, 2),
        (edge_id(grid, row + 1, column, 0), 3, 2),
        (edge_id(grid, row, column, 1), 0, 3),
    ];
    let mut crossed = [None; 4];
    for (slot, (id, from, to)) in crossed.iter_mut().zip(edges) {
        if above[from] != above[to] {
            crossings.entry(id).or_insert_with(|| crossing(&cell[from], &cell[to], level));
            *slot = Some(id);
        }
    }
    match crossed {
        [Some(south), Some(east), Some(north), Some(west)] => {
            let centre_above = cell.iter().map(|node| 0.25 * node[2]).sum::<f64>() >= level;
            if centre_above == above[0] {
                segments.extend([[south, east], [north, west]]);
            } else {
                segments.extend([[west, south], [east, north]]);
            }
        }
        _ => {
            let mut found = crossed.into_iter().flatten();
            if let (Some(a), Some(b)) = (found.next(), found.next()) {
                segments.push([a, b]);
            }
        }
    }
}

/// The point at which z reaches `level` between two nodes, by linear interpolation: (x, y).
pub(crate) fn crossing(from: &Node, to: &Node, level: f64) -> (f64, f64) {
    let share = (level - from[2]) / (to[2] - from[2]);
    let share = if share.is_finite() { share.clamp(0.0, 1.0) } else { 0.5 };
    (from[0] + share * (to[0] - from[0]), from[1] + share * (to[1] - from[1]))
}

/// Joins segments that share an edge into chains: open ones first, then closed ones, in order of edge number.
fn chain(segments: &[[usize; 2]]) -> Vec<Vec<usize>> {
    let mut at_edge: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for (index, ends) in segments.iter().enumerate() {
        for end in ends {
            at_edge.entry(*end).or_default().push(index);
        }
    }
    let mut used = vec![false; segments.len()];
    let mut chains = Vec::new();
    let open_first = at_edge
        .iter()
        .filter(|(_, list)| list.len() == 1)
        .chain(at_edge.iter().filter(|(_, list)| list.len() > 1));
    for (start, _) in open_first {
        let mut line = vec![*start];
        let mut end = *start;
        while let Some(next) = at_edge.get(&end).and_then(|list| list.iter().find(|segment| !used[**segment]))
        {
            used[*next] = true;
            let [a, b] = segments[*next];
            end = if a == end { b } else { a };
            line.push(end);
        }
        if line.len() > 1 {
            chains.push(line);
        }
    }
    chains
}

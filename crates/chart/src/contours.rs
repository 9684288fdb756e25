//! Contours of a field, clipped to its region.
//!
//! Lines are found by marching squares with support for missing values. Source: W. E. Lorensen, H. E. Cline, "Marching cubes", SIGGRAPH 1987,
//! in two dimensions; the two interpretations of a saddle are distinguished by the mean of the four corners. A crossing is found on each cell
//! edge by linear interpolation, so the contours of a plane field are straight on any grid.

use std::collections::BTreeMap;

/// `rows * columns` nodes with coordinates and a value each, row after row; node (r, c) is at `r * columns + c`.
///
/// Neighbours in (r, c) are corners of a cell; the coordinates are free, so speed lines of a map make rows.
/// A node with a NaN or infinite value or coordinate is unknown, and so are its cells.
#[derive(Debug, Clone, PartialEq)]
pub struct StructuredGrid {
    rows: usize,
    columns: usize,
    x: Vec<f64>,
    y: Vec<f64>,
    z: Vec<f64>,
}

/// A node: x, y in the axes' units, z in the field's.
pub(crate) type Node = [f64; 3];

impl StructuredGrid {
    /// Makes a grid of node coordinates `x`, `y` (units of the axes) and values `z`; `None` if one of them is not `rows * columns` long.
    pub fn new(rows: usize, columns: usize, x: Vec<f64>, y: Vec<f64>, z: Vec<f64>) -> Option<Self> {
        let nodes = rows.checked_mul(columns)?;
        [x.len(), y.len(), z.len()].iter().all(|count| *count == nodes).then_some(StructuredGrid {
            rows,
            columns,
            x,
            y,
            z,
        })
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Number of columns.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// Coordinates and value of a node; `None` if it is unknown or outside the grid.
    pub fn node(&self, row: usize, column: usize) -> Option<[f64; 3]> {
        if row >= self.rows || column >= self.columns {
            return None;
        }
        let at = row * self.columns + column;
        let node = [self.x[at], self.y[at], self.z[at]];
        node.iter().all(|v| v.is_finite()).then_some(node)
    }

    /// Smallest and largest known value.
    pub fn value_range(&self) -> Option<(f64, f64)> {
        self.known_nodes().fold(None, |range, node| match range {
            None => Some((node[2], node[2])),
            Some((low, high)) => Some((f64::min(low, node[2]), f64::max(high, node[2]))),
        })
    }

    pub(crate) fn known_nodes(&self) -> impl Iterator<Item = Node> + '_ {
        (0..self.rows).flat_map(move |r| (0..self.columns).filter_map(move |c| self.node(r, c)))
    }

    /// The corners (r, c), (r, c+1), (r+1, c+1), (r+1, c) of a cell, if all are known.
    pub(crate) fn cell(&self, row: usize, column: usize) -> Option<[Node; 4]> {
        Some([
            self.node(row, column)?,
            self.node(row, column + 1)?,
            self.node(row + 1, column + 1)?,
            self.node(row + 1, column)?,
        ])
    }
}

/// Labelled contour lines of a field, shaded between them: from white below the first level to light blue above the last.
#[derive(Debug, Clone, PartialEq)]
pub struct Contours {
    /// The field.
    pub grid: StructuredGrid,
    /// Levels in rising order, unit of the field, with the labels of their lines; at most 100 are drawn.
    pub levels: Vec<(f64, String)>,
}

impl Contours {
    /// Contours at `levels` (unit of the field, any order; values that are not finite are skipped), labelled by `text`.
    pub fn new(grid: StructuredGrid, levels: &[f64], text: impl Fn(f64) -> String) -> Self {
        let mut values: Vec<f64> = levels.iter().copied().filter(|v| v.is_finite()).collect();
        values.sort_by(f64::total_cmp);
        values.dedup();
        Contours { grid, levels: values.into_iter().map(|value| (value, text(value))).collect() }
    }
}

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
    // Edges around the cell, corners in the order of the grid, so that two cells have the same point on a common edge.
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
fn crossing(from: &Node, to: &Node, level: f64) -> (f64, f64) {
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

/// The cell itself, or four triangles around the mean of its corners if it is a saddle, whose bands would overlap.
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

#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct LabelPlace {
    /// Middle of the text, px.
    pub centre: (f64, f64),
    /// Counter-clockwise turn, degrees, -90..90: never upside down.
    pub turn_deg: f64,
    /// The part of the line that the text covers, from the start of the line, px.
    pub gap: (f64, f64),
}

/// Finds the straightest part of a line for a text `width_px` wide, away from `obstacles` and placed texts; `None` if it is too short.
pub(crate) fn place(line: &[(f64, f64)], width_px: f64, obstacles: &[(f64, f64)]) -> Option<LabelPlace> {
    let lengths = cumulative_lengths(line);
    let total = *lengths.last()?;
    let half = 0.5 * width_px + 2.0;
    if !total.is_finite() || total < 2.0 * half + 16.0 {
        return None;
    }
    // From the middle outwards, so that the middle wins a tie.
    const SHARES: [f64; 13] = [0.5, 0.44, 0.56, 0.38, 0.62, 0.32, 0.68, 0.26, 0.74, 0.2, 0.8, 0.14, 0.86];
    let mut best: Option<(f64, LabelPlace)> = None;
    for (rank, share) in SHARES.into_iter().enumerate() {
        let middle = share * total;
        if middle < half + 4.0 || middle > total - half - 4.0 {
            continue;
        }
        let (from, centre, to) = (
            at(line, &lengths, middle - half),
            at(line, &lengths, middle),
            at(line, &lengths, middle + half),
        );
        let chord = (to.0 - from.0).hypot(to.1 - from.1);
        let nearest =
            obstacles.iter().map(|o| (o.0 - centre.0).hypot(o.1 - centre.1)).fold(f64::INFINITY, f64::min);
        let bend = 1.0 - chord / (2.0 * half);
        let crowding = ((half + 8.0 - nearest) / (half + 8.0)).max(0.0);
        let cost = 4.0 * bend + 2.0 * crowding + 0.01 * rank as f64;
        // The y axis of the drawing points down.
        let mut turn_deg = -(to.1 - from.1).atan2(to.0 - from.0).to_degrees();
        if turn_deg > 90.0 {
            turn_deg -= 180.0;
        } else if turn_deg <= -90.0 {
            turn_deg += 180.0;
        }
        if best.is_none_or(|b| cost < b.0) {
            best = Some((cost, LabelPlace { centre, turn_deg, gap: (middle - half, middle + half) }));
        }
    }
    best.map(|b| b.1)
}

pub(crate) fn without_gap(line: &[(f64, f64)], gap: (f64, f64)) -> [Vec<(f64, f64)>; 2] {
    let lengths = cumulative_lengths(line);
    let mut before: Vec<(f64, f64)> =
        line.iter().zip(&lengths).filter(|(_, s)| **s < gap.0).map(|(p, _)| *p).collect();
    before.push(at(line, &lengths, gap.0));
    let mut after = vec![at(line, &lengths, gap.1)];
    after.extend(line.iter().zip(&lengths).filter(|(_, s)| **s > gap.1).map(|(p, _)| *p));
    [before, after]
}

fn cumulative_lengths(line: &[(f64, f64)]) -> Vec<f64> {
    let mut sum = 0.0;
    let mut out = Vec::with_capacity(line.len());
    for (i, p) in line.iter().enumerate() {
        if i > 0 {
            sum += (p.0 - line[i - 1].0).hypot(p.1 - line[i - 1].1);
        }
        out.push(sum);
    }
    out
}

/// The point at a length along the line, limited to its ends. The line is not empty.
fn at(line: &[(f64, f64)], lengths: &[f64], length: f64) -> (f64, f64) {
    let next = lengths.partition_point(|s| *s < length);
    if next == 0 {
        return line[0];
    }
    if next >= line.len() {
        return line[line.len() - 1];
    }
    let (a, b) = (line[next - 1], line[next]);
    let share = (length - lengths[next - 1]) / (lengths[next] - lengths[next - 1]);
    (a.0 + share * (b.0 - a.0), a.1 + share * (b.1 - a.1))
}

/// An axis-parallel rectangle, px: left, top, right, bottom.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Rect {
    pub left: f64,
    pub top: f64,
    pub right: f64,
    pub bottom: f64,
}

impl Rect {
    pub(crate) fn contains(&self, (x, y): (f64, f64)) -> bool {
        // Rounding to hundredths of a pixel.
        let slack = 0.005;
        x >= self.left - slack && x <= self.right + slack && y >= self.top - slack && y <= self.bottom + slack
    }

    pub(crate) fn overlaps(&self, other: &Rect) -> bool {
        self.left < other.right
            && other.left < self.right
            && self.top < other.bottom
            && other.top < self.bottom
    }

    pub(crate) fn width(&self) -> f64 {
        self.right - self.left
    }

    pub(crate) fn height(&self) -> f64 {
        self.bottom - self.top
    }
}

pub(crate) fn touches(a: (f64, f64), b: (f64, f64), rect: &Rect) -> bool {
    segment(a, b, rect).is_some()
}

/// The part of a segment inside the rectangle (Liang-Barsky).
fn segment(a: (f64, f64), b: (f64, f64), rect: &Rect) -> Option<((f64, f64), (f64, f64))> {
    let (dx, dy) = (b.0 - a.0, b.1 - a.1);
    let (mut enter, mut leave) = (0.0f64, 1.0f64);
    for (p, q) in
        [(-dx, a.0 - rect.left), (dx, rect.right - a.0), (-dy, a.1 - rect.top), (dy, rect.bottom - a.1)]
    {
        if p == 0.0 {
            if q < 0.0 {
                return None;
            }
        } else if p < 0.0 {
            enter = enter.max(q / p);
        } else {
            leave = leave.min(q / p);
        }
    }
    let at = |t: f64| (a.0 + t * dx, a.1 + t * dy);
    (enter <= leave)
        .then(|| (if enter > 0.0 { at(enter) } else { a }, if leave < 1.0 { at(leave) } else { b }))
}

pub(crate) fn polyline(points: &[(f64, f64)], rect: &Rect) -> Vec<Vec<(f64, f64)>> {
    let mut pieces: Vec<Vec<(f64, f64)>> = Vec::new();
    let mut joined = false;
    for pair in points.windows(2) {
        let finite = pair.iter().all(|p| p.0.is_finite() && p.1.is_finite());
        match finite.then(|| segment(pair[0], pair[1], rect)).flatten() {
            Some((from, to)) => {
                match pieces.last_mut() {
                    Some(piece) if joined && from == pair[0] => piece.push(to),
                    _ => pieces.push(vec![from, to]),
                }
                joined = to == pair[1];
            }
            None => joined = false,
        }
    }
    pieces
}

/// The part of a polygon inside the rectangle (Sutherland-Hodgman); points that are not finite are skipped.
pub(crate) fn polygon(points: &[(f64, f64)], rect: &Rect) -> Vec<(f64, f64)> {
    let mut shape: Vec<(f64, f64)> =
        points.iter().copied().filter(|p| p.0.is_finite() && p.1.is_finite()).collect();
    // Signed distance to each side, positive inside.
    let sides: [&dyn Fn((f64, f64)) -> f64; 4] =
        [&|p| p.0 - rect.left, &|p| rect.right - p.0, &|p| p.1 - rect.top, &|p| rect.bottom - p.1];
    for distance in sides {
        let mut out = Vec::with_capacity(shape.len() + 2);
        for (i, p) in shape.iter().enumerate() {
            let previous = shape[(i + shape.len() - 1) % shape.len()];
            let (here, before) = (distance(*p), distance(previous));
            if (here >= 0.0) != (before >= 0.0) {
                let t = before / (before - here);
                out.push((previous.0 + t * (p.0 - previous.0), previous.1 + t * (p.1 - previous.1)));
            }
            if here >= 0.0 {
                out.push(*p);
            }
        }
        shape = out;
    }
    shape
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

    #[test]
    fn a_text_is_on_its_line_and_upright() {
        for step in [(3.0, 1.0), (-3.0, 1.0), (0.0, -3.0), (-2.0, -2.0)] {
            let line: Vec<_> = (0..60).map(|i| (f64::from(i) * step.0, f64::from(i) * step.1)).collect();
            let place = place(&line, 30.0, &[]).unwrap();
            assert!(place.turn_deg.abs() <= 90.0);
            let off = place.centre.0 * step.1 - place.centre.1 * step.0;
            assert!(off.abs() < 1e-9);
            let [before, after] = without_gap(&line, place.gap);
            let (a, b) = (before[before.len() - 1], after[0]);
            // The gap is the text and 2 px on each side.
            assert!(((a.0 - b.0).hypot(a.1 - b.1) - 34.0).abs() < 1e-9);
        }
        assert_eq!(place(&[(0.0, 0.0), (20.0, 0.0)], 30.0, &[]), None);
        assert_eq!(place(&[], 30.0, &[]), None);
    }
}

#[cfg(test)]
mod clip_tests {
    use super::*;
    use proptest::prelude::*;

    const RECT: Rect = Rect { left: 0.0, top: 0.0, right: 10.0, bottom: 5.0 };

    #[test]
    fn a_line_that_leaves_and_returns_is_two_pieces() {
        let pieces = polyline(&[(1.0, 1.0), (1.0, 9.0), (9.0, 9.0), (9.0, 1.0)], &RECT);
        assert_eq!(pieces, [vec![(1.0, 1.0), (1.0, 5.0)], vec![(9.0, 5.0), (9.0, 1.0)]]);
        let broken = polyline(&[(1.0, 1.0), (2.0, 1.0), (f64::NAN, 1.0), (3.0, 1.0), (4.0, 1.0)], &RECT);
        assert_eq!(broken.len(), 2);
    }

    proptest! {
        #[test]
        fn what_is_left_is_inside(points in proptest::collection::vec((-30.0..30.0f64, -30.0..30.0f64), 0..12)) {
            for p in polyline(&points, &RECT).into_iter().flatten().chain(polygon(&points, &RECT)) {
                prop_assert!(RECT.contains(p), "{p:?}");
            }
        }
    }
}

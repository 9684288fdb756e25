//! Efficiency between the points of a map, only inside the measured region, as a mesh over flow and pressure ratio: for the picture of a map and
//! for the page, so that both show the same contours, and for the table of a machine's own map.
//!
//! Each speed line is a row of a structured grid. Along a line the position runs from 0 at its surge-side point to 1
//! at its choke-side point, by length on the map with both axes scaled to the map's spans; flow, pressure ratio and
//! efficiency are monotone cubics of it. Between lines, at equal position, the same three quantities are monotone
//! cubics of corrected speed. A monotone cubic stays within the range of the values that it joins, so the picture shows no
//! efficiency outside the measured range.
//!
//! The efficiency is NaN before the first and after the last point of a line with an efficiency, and between two lines at positions where
//! one of them is NaN. Points without an efficiency between others are bridged. Lines with fewer than two distinct points are not used.
//! Points closer than 1 % of the diagonal of their line (repeats) are replaced by their mean.

use crate::StructuredGrid;
use crate::frame::nice_ticks;
use mapper_core::{CompressorMap, FittedMap, FittedNode, MapPoint, SpeedLine};

/// Nodes along a line.
const COLUMNS: usize = 49;
/// Rows of the mesh from one line to the next.
pub const SUBDIVISIONS: usize = 8;
/// Distance below which points are merged, as a fraction of the line's diagonal: a slow line is a small part of the map.
const MERGE_DISTANCE: f64 = 0.01;

/// A speed line on the interpolating surface.
#[derive(Debug, Clone, PartialEq)]
pub struct InterpolatedLine {
    /// Corrected speed, rpm.
    pub speed_corrected_rpm: f64,
    /// Corrected flow (kg/s), pressure ratio and efficiency (fraction; NaN where it is not measured) from surge to choke side.
    pub nodes: Vec<[f64; 3]>,
}

/// The measured lines, with [`SUBDIVISIONS`] - 1 lines between two of them, by the source of this module. `None` for fewer than two.
pub fn interpolated_lines(map: &CompressorMap) -> Option<Vec<InterpolatedLine>> {
    let spans = spans(&map.lines)?;
    let mut rows: Vec<InterpolatedLine> = map.lines.iter().filter_map(|line| row(line, spans)).collect();
    // Speeds must rise strictly; the first of two lines with equal speed is used.
    rows.dedup_by(|b, a| b.speed_corrected_rpm <= a.speed_corrected_rpm);
    if rows.len() < 2 {
        return None;
    }
    let speeds: Vec<f64> = rows.iter().map(|row| row.speed_corrected_rpm).collect();
    let mut lines: Vec<InterpolatedLine> = (interpolate_between_lines(&speeds, &speeds).into_iter())
        .map(|speed_corrected_rpm| InterpolatedLine {
            speed_corrected_rpm,
            nodes: vec![[f64::NAN; 3]; COLUMNS],
        })
        .collect();
    for column in 0..COLUMNS {
        for field in 0..3 {
            let values: Vec<f64> = rows.iter().map(|row| row.nodes[column][field]).collect();
            for (line, value) in lines.iter_mut().zip(interpolate_between_lines(&speeds, &values)) {
                line.nodes[column][field] = value;
            }
        }
    }
    Some(lines)
}

/// Efficiency (fraction) over corrected flow (x, kg/s) and pressure ratio (y) inside the measured region: [`interpolated_lines`] as a grid.
pub fn efficiency_surface(map: &CompressorMap) -> Option<StructuredGrid> {
    let lines = interpolated_lines(map)?;
    let field = |field: usize| lines.iter().flat_map(|line| &line.nodes).map(|node| node[field]).collect();
    StructuredGrid::new(lines.len(), COLUMNS, field(0), field(1), field(2))
}

/// Spans of flow (kg/s) and pressure ratio over the lines, above 0.
fn spans(lines: &[SpeedLine]) -> Option<(f64, f64)> {
    let span = |value: fn(&MapPoint) -> f64| {
        let all = lines.iter().flat_map(|line| &line.points).map(value).filter(|v| v.is_finite());
        let (low, high) = all.fold((f64::INFINITY, f64::NEG_INFINITY), |r, v| (r.0.min(v), r.1.max(v)));
        (high > low).then_some(high - low)
    };
    Some((span(|p| p.flow_corrected_kg_s)?, span(|p| p.pressure_ratio)?))
}

/// Sorts a line from surge to choke by flow minus pressure ratio: noise changes no order on the steep part or the flat one.
fn surge_to_choke(line: &SpeedLine, (flow_span, ratio_span): (f64, f64)) -> Vec<&MapPoint> {
    let mut points: Vec<&MapPoint> = line.points.iter().collect();
    let key = |p: &MapPoint| p.flow_corrected_kg_s / flow_span - p.pressure_ratio / ratio_span;
    points.sort_by(|a, b| key(a).total_cmp(&key(b)));
    points
}

/// The points of a line from surge to choke.
pub fn points_surge_to_choke<'a>(map: &CompressorMap, line: &'a SpeedLine) -> Vec<&'a MapPoint> {
    surge_to_choke(line, spans(&map.lines).unwrap_or((1.0, 1.0)))
}

/// The curve of a speed line for drawing: (corrected flow, kg/s; pressure ratio) from surge to choke side, on the surface.
///
/// If the surface does not use the line, the curve consists of the measured points.
pub fn speed_curve(map: &CompressorMap, line: &SpeedLine) -> Vec<(f64, f64)> {
    match spans(&map.lines).and_then(|spans| row(line, spans)) {
        Some(row) => row.nodes.iter().map(|node| (node[0], node[1])).collect(),
        None => points_surge_to_choke(map, line)
            .iter()
            .map(|p| (p.flow_corrected_kg_s, p.pressure_ratio))
            .collect(),
    }
}

/// Mean of merged points.
struct Place {
    flow: f64,
    ratio: f64,
    eta: Option<f64>,
}

fn row(line: &SpeedLine, spans: (f64, f64)) -> Option<InterpolatedLine> {
    let places = places(line, spans);
    let mut position = vec![0.0];
    for pair in places.windows(2) {
        let step = ((pair[1].flow - pair[0].flow) / spans.0).hypot((pair[1].ratio - pair[0].ratio) / spans.1);
        position.push(position.last()? + step);
    }
    let total = *position.last()?;
    position.iter_mut().for_each(|p| *p /= total);
    let flows: Vec<f64> = places.iter().map(|p| p.flow).collect();
    let ratios: Vec<f64> = places.iter().map(|p| p.ratio).collect();
    let (eta_positions, etas): (Vec<f64>, Vec<f64>) =
        places.iter().zip(&position).filter_map(|(p, s)| p.eta.map(|eta| (*s, eta))).unzip();
    // Fewer than two places have no interpolant; the line is then not used.
    let (flow, ratio) = (Monotone::new(&position, &flows)?, Monotone::new(&position, &ratios)?);
    let eta = Monotone::new(&eta_positions, &etas);
    let nodes = (0..COLUMNS)
        .map(|i| {
            let s = i as f64 / (COLUMNS - 1) as f64;
            [flow.at(s), ratio.at(s), eta.as_ref().and_then(|eta| eta.at(s))].map(|v| v.unwrap_or(f64::NAN))
        })
        .collect();
    Some(InterpolatedLine { speed_corrected_rpm: line.speed_corrected_rpm, nodes })
}

fn places(line: &SpeedLine, spans: (f64, f64)) -> Vec<Place> {
    let points = surge_to_choke(line, spans);
    let finite =
        points.into_iter().filter(|p| p.flow_corrected_kg_s.is_finite() && p.pressure_ratio.is_finite());
    let own = self::spans(std::slice::from_ref(line)).unwrap_or(spans);
    let mut clusters: Vec<Vec<&MapPoint>> = Vec::new();
    for point in finite {
        let near = |other: &&MapPoint| {
            let flow = (point.flow_corrected_kg_s - other.flow_corrected_kg_s) / own.0;
            let ratio = (point.pressure_ratio - other.pressure_ratio) / own.1;
            flow.hypot(ratio) < MERGE_DISTANCE * std::f64::consts::SQRT_2
        };
        match clusters.last_mut() {
            Some(cluster) if cluster.first().is_some_and(near) => cluster.push(point),
            _ => clusters.push(vec![point]),
        }
    }
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    clusters
        .iter()
        .map(|cluster| {
            let all =
                |value: fn(&MapPoint) -> f64| mean(&cluster.iter().map(|p| value(p)).collect::<Vec<_>>());
            let etas: Vec<f64> = cluster.iter().filter_map(|p| p.eta).collect();
            Place {
                flow: all(|p| p.flow_corrected_kg_s),
                ratio: all(|p| p.pressure_ratio),
                eta: (!etas.is_empty()).then(|| mean(&etas)),
            }
        })
        .collect()
}

/// Interpolates between lines, with `SUBDIVISIONS` values per gap; NaN in gaps with an unknown end.
pub fn interpolate_between_lines(speeds: &[f64], values: &[f64]) -> Vec<f64> {
    let mut out = vec![f64::NAN; (speeds.len() - 1) * SUBDIVISIONS + 1];
    let mut start = 0;
    while start < values.len() {
        let known = values[start..].iter().take_while(|v| v.is_finite()).count();
        if known > 0 {
            out[start * SUBDIVISIONS] = values[start];
        }
        let end = start + known;
        if let Some(curve) = Monotone::new(&speeds[start..end], &values[start..end]) {
            for i in start..end - 1 {
                for k in 0..=SUBDIVISIONS {
                    let share = k as f64 / SUBDIVISIONS as f64;
                    let speed = (speeds[i] + share * (speeds[i + 1] - speeds[i])).min(speeds[end - 1]);
                    out[i * SUBDIVISIONS + k] = curve.at(speed).unwrap_or(f64::NAN);
                }
            }
        }
        start = end + 1;
    }
    out
}

/// A monotone cubic through points with strictly rising abscissae: it stays between neighbouring values.
///
/// Source: F. N. Fritsch, J. Butland, "A method for constructing local monotone piecewise cubic interpolants",
/// SIAM J. Sci. Stat. Comput. 5 (1984) 300-304; the harmonic mean of neighbouring slopes, one-sided ends.
pub(crate) struct Monotone<'a> {
    x: &'a [f64],
    y: &'a [f64],
    slopes: Vec<f64>,
}

impl<'a> Monotone<'a> {
    /// `None` for fewer than two points, or if `x` does not rise strictly or is not as long as `y`.
    pub(crate) fn new(x: &'a [f64], y: &'a [f64]) -> Option<Self> {
        if x.len() < 2 || x.len() != y.len() || !x.windows(2).all(|w| w[1] > w[0]) {
            return None;
        }
        let secants: Vec<f64> = (1..x.len()).map(|i| (y[i] - y[i - 1]) / (x[i] - x[i - 1])).collect();
        let n = x.len();
        let slopes = (0..n)
            .map(|i| match i {
                0 => end_slope(x, &secants, 0, 1),
                i if i == n - 1 => end_slope(x, &secants, n - 2, n.saturating_sub(3)),
                _ => inner_slope(x[i] - x[i - 1], x[i + 1] - x[i], secants[i - 1], secants[i]),
            })
            .collect();
        Some(Monotone { x, y, slopes })
    }

    pub(crate) fn at(&self, at: f64) -> Option<f64> {
        let last = self.x.len() - 1;
        if !(at >= self.x[0] && at <= self.x[last]) {
            return None;
        }
        let i = self.x.partition_point(|x| *x <= at).clamp(1, last) - 1;
        let width = self.x[i + 1] - self.x[i];
        let t = (at - self.x[i]) / width;
        let (a, b) = (self.y[i], self.y[i + 1]);
        let (da, db) = (self.slopes[i] * width, self.slopes[i + 1] * width);
        let (t2, t3) = (t * t, t * t * t);
        Some(
            (2.0 * t3 - 3.0 * t2 + 1.0) * a
                + (t3 - 2.0 * t2 + t) * da
                + (3.0 * t2 - 2.0 * t3) * b
                + (t3 - t2) * db,
        )
    }
}

fn inner_slope(before: f64, after: f64, left: f64, right: f64) -> f64 {
    if left * right <= 0.0 {
        return 0.0;
    }
    let (w1, w2) = (2.0 * after + before, after + 2.0 * before);
    (w1 + w2) / (w1 / left + w2 / right)
}

/// Three-point slope at an end, limited so that the end stays monotone.
fn end_slope(x: &[f64], secants: &[f64], near: usize, far: usize) -> f64 {
    if secants.len() < 2 {
        return secants[near];
    }
    let width = |i: usize| x[i + 1] - x[i];
    let (h0, h1, d0, d1) = (width(near), width(far), secants[near], secants[far]);
    let slope = ((2.0 * h0 + h1) * d0 - h0 * d1) / (h0 + h1);
    if slope * d0 <= 0.0 {
        0.0
    } else if d0 * d1 <= 0.0 && slope.abs() > 3.0 * d0.abs() {
        3.0 * d0
    } else {
        slope
    }
}

/// Efficiency (fraction) over corrected flow (x, kg/s) and pressure ratio (y) on the supported part of a fitted map, finer in
/// speed than its lines; NaN in extrapolated parts. `None` for fewer than two lines.
pub fn fitted_surface(fitted: &FittedMap) -> Option<StructuredGrid> {
    let speeds: Vec<f64> = fitted.lines.iter().map(|line| line.speed_corrected_rpm).collect();
    let columns = fitted.beta_ratio.len();
    if speeds.len() < 2 || !speeds.windows(2).all(|w| w[1] > w[0]) {
        return None;
    }
    let mut fields: [Vec<Vec<f64>>; 3] = Default::default();
    for column in 0..columns {
        let values: [fn(&FittedNode) -> f64; 3] = [
            |n| n.flow_corrected_kg_s,
            |n| n.pressure_ratio,
            |n| if n.extrapolated { f64::NAN } else { n.eta },
        ];
        for (field, value) in fields.iter_mut().zip(values) {
            let over_speed: Vec<f64> =
                fitted.lines.iter().map(|line| line.nodes.get(column).map_or(f64::NAN, value)).collect();
            field.push(interpolate_between_lines(&speeds, &over_speed));
        }
    }
    let rows = fields[0].first()?.len();
    // The values are computed by columns, but the grid is stored by rows.
    let flat =
        |field: &Vec<Vec<f64>>| (0..rows).flat_map(|r| field.iter().map(move |c| c[r])).collect::<Vec<f64>>();
    StructuredGrid::new(rows, columns, flat(&fields[0]), flat(&fields[1]), flat(&fields[2]))
}

/// Round levels (fractions), finer near the best efficiency, where the map is flat.
pub fn contour_levels(range: Option<(f64, f64)>) -> Vec<f64> {
    let Some((low, high)) = range else { return Vec::new() };
    let (low, high) = (low.max(0.0), high.min(1.5));
    if low >= high {
        return Vec::new();
    }
    if high - low < 0.08 {
        return nice_ticks(low, high, 6);
    }
    let coarse_end = high - 0.06;
    // Whole percents as integers, to avoid accumulated rounding errors.
    let every = |step: i32| (1..=150 / step).map(move |i| f64::from(i * step) / 100.0);
    let mut levels: Vec<f64> = every(5).filter(|v| *v > low && *v < coarse_end).collect();
    levels.extend(every(2).filter(|v| *v >= coarse_end && *v < high));
    levels
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_straight_line_is_met_exactly() {
        let (x, y) = ([0.0, 1.0, 4.0, 5.0], [1.0, 3.0, 9.0, 11.0]);
        let curve = Monotone::new(&x, &y).unwrap();
        for at in [0.0, 0.3, 2.0, 4.9, 5.0] {
            assert!((curve.at(at).unwrap() - (1.0 + 2.0 * at)).abs() < 1e-12);
        }
        assert_eq!(curve.at(5.1), None);
        assert_eq!(curve.at(f64::NAN), None);
        assert!(Monotone::new(&[0.0, 0.0], &[1.0, 2.0]).is_none());
    }

    proptest! {
        #[test]
        fn it_meets_the_points_and_stays_between_neighbours(steps in proptest::collection::vec((0.01..2.0f64, -1.0..1.0f64), 2..9), t in 0.0..1.0f64) {
            let mut at = 0.0;
            let (x, y): (Vec<f64>, Vec<f64>) = steps.iter().map(|(dx, y)| { at += dx; (at, *y) }).unzip();
            let curve = Monotone::new(&x, &y).unwrap();
            for i in 0..x.len() {
                prop_assert!((curve.at(x[i]).unwrap() - y[i]).abs() < 1e-12);
            }
            for i in 1..x.len() {
                let value = curve.at((x[i - 1] + t * (x[i] - x[i - 1])).min(x[i])).unwrap();
                let (low, high) = (y[i - 1].min(y[i]), y[i - 1].max(y[i]));
                prop_assert!(value >= low - 1e-9 && value <= high + 1e-9);
            }
        }
    }
}

//! Counts crossing speed lines.

use mapper_core::FittedLine;

/// Number of pairs of neighbouring lines with intersecting segments.
pub(crate) fn count_crossings(lines: &[FittedLine]) -> usize {
    lines.windows(2).filter(|pair| lines_cross(&pair[0], &pair[1])).count()
}

fn lines_cross(a: &FittedLine, b: &FittedLine) -> bool {
    let points = |line: &FittedLine| -> Vec<(f64, f64)> {
        line.nodes.iter().map(|n| (n.flow_corrected_kg_s, n.pressure_ratio)).collect()
    };
    let (a, b) = (points(a), points(b));
    a.windows(2).any(|s| b.windows(2).any(|t| segments_meet(s[0], s[1], t[0], t[1])))
}

fn segments_meet(a: (f64, f64), b: (f64, f64), c: (f64, f64), d: (f64, f64)) -> bool {
    let side =
        |p: (f64, f64), q: (f64, f64), r: (f64, f64)| (q.0 - p.0) * (r.1 - p.1) - (q.1 - p.1) * (r.0 - p.0);
    side(a, b, c) * side(a, b, d) < 0.0 && side(c, d, a) * side(c, d, b) < 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cross_is_a_cross_and_neighbours_are_none() {
        assert!(segments_meet((0.0, 0.0), (1.0, 1.0), (0.0, 1.0), (1.0, 0.0)));
        assert!(!segments_meet((0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)));
        assert!(!segments_meet((0.0, 0.0), (1.0, 1.0), (2.0, 0.0), (3.0, 3.5)));
    }
}

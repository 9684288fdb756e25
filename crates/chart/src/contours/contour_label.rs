//! Position of the text on a contour line.

/// Position and angle of a text on a line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct LabelPlace {
    /// Middle of the text, px.
    pub centre: (f64, f64),
    /// Counter-clockwise turn, degrees, -90..90: never upside down.
    pub turn_deg: f64,
    /// The part of the line that the text covers, from the start of the line, px.
    pub gap: (f64, f64),
}

/// Finds the straightest part of a line for a text `width_px` wide, away from `obstacles`; `None` if the line is
/// too short. Placed texts are obstacles too.
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

/// The line without the part `gap`.
pub(crate) fn without_gap(line: &[(f64, f64)], gap: (f64, f64)) -> [Vec<(f64, f64)>; 2] {
    let lengths = cumulative_lengths(line);
    let mut before: Vec<(f64, f64)> =
        line.iter().zip(&lengths).filter(|(_, s)| **s < gap.0).map(|(p, _)| *p).collect();
    before.push(at(line, &lengths, gap.0));
    let mut after = vec![at(line, &lengths, gap.1)];
    after.extend(line.iter().zip(&lengths).filter(|(_, s)| **s > gap.1).map(|(p, _)| *p));
    [before, after]
}

/// Length of the line up to each of its points.
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

#[cfg(test)]
mod tests {
    use super::*;

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

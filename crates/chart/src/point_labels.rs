//! Positions of short texts around their points.

use crate::Item;
use crate::clip::{Rect, touches};
use crate::frame::Frame;
use crate::text::width_px;

type Px = (f64, f64);

/// Candidate gaps between point and text, px.
const GAPS_PX: [f64; 9] = [3.0, 6.0, 10.0, 15.0, 21.0, 28.0, 36.0, 48.0, 64.0];
/// Directions that are tried at each gap.
const DIRECTIONS: usize = 24;
/// Minimum gap at which a leader line connects a text with its point.
const LEADER_FROM_PX: f64 = 8.0;
/// Cost of a line through the text, as px of gap: a line behind a short text hides little of it.
const CROSSED_PX: f64 = 1.5;
/// Cost of a leader line through a marker, a text or another leader line, as px of gap.
const LEADER_CROSSED_PX: f64 = 40.0;
/// Room around a text, px.
const ROOM_PX: f64 = 2.0;
/// Factor on estimated widths for bold digits, which are wider than letters.
const BOLD_RATIO: f64 = 1.12;

/// A place for a text.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PlacedLabel {
    /// Middle, px.
    pub centre: Px,
    /// From the point to the text.
    pub leader: Option<(Px, Px)>,
}

/// Obstacles for texts.
pub(crate) struct Surroundings {
    inside: Rect,
    /// Markers and texts, which no text may cover.
    boxes: Vec<Rect>,
    lines: Vec<(Px, Px)>,
    leaders: Vec<(Px, Px)>,
}

impl Surroundings {
    /// The obstacles of a panel, placed texts included.
    pub(crate) fn of(frame: &Frame, items: &[Item], mut boxes: Vec<Rect>) -> Self {
        let mut lines = Vec::new();
        for item in items {
            match item {
                Item::Scatter(scatter) => boxes.extend(scatter.points.iter().map(|point| {
                    let ((x, y), half) = (frame.px((point.x, point.y)), 0.5 * scatter.size_px);
                    Rect { left: x - half, top: y - half, right: x + half, bottom: y + half }
                })),
                Item::Line(line) => {
                    lines.extend(line.points.windows(2).map(|pair| (frame.px(pair[0]), frame.px(pair[1]))))
                }
                _ => {}
            }
        }
        Surroundings { inside: frame.rect, boxes, lines, leaders: Vec::new() }
    }

    /// Finds the cheapest place around a point, and occupies it; `None` if no place is free.
    pub(crate) fn place(&mut self, point: Px, text: &str, size_px: f64) -> Option<PlacedLabel> {
        let half = (0.5 * BOLD_RATIO * width_px(text, size_px) + ROOM_PX, 0.5 * size_px + ROOM_PX);
        let mut best: Option<(f64, PlacedLabel, Rect)> = None;
        for gap_px in GAPS_PX {
            if best.is_some_and(|(cost, ..)| cost <= gap_px) {
                break;
            }
            for direction in 0..DIRECTIONS {
                let turn = (direction as f64 / DIRECTIONS as f64 - 0.125) * std::f64::consts::TAU;
                let (ux, uy) = (turn.cos(), turn.sin());
                // The middle of a box at this gap from the point.
                let reach = (half.0 / ux.abs().max(1e-9)).min(half.1 / uy.abs().max(1e-9)) + gap_px;
                let (x, y) = (point.0 + reach * ux, point.1 + reach * uy);
                let around =
                    Rect { left: x - half.0, top: y - half.1, right: x + half.0, bottom: y + half.1 };
                let inside = self.inside.contains((around.left, around.top))
                    && self.inside.contains((around.right, around.bottom));
                if !inside || self.boxes.iter().any(|taken| taken.overlaps(&around)) {
                    continue;
                }
                let edge = (point.0 + (gap_px + ROOM_PX) * ux, point.1 + (gap_px + ROOM_PX) * uy);
                let leader = (gap_px >= LEADER_FROM_PX).then_some((point, edge));
                let cost = gap_px + self.crossed_px(&around, point, leader);
                if best.is_none_or(|(before, ..)| cost < before) {
                    best = Some((cost, PlacedLabel { centre: (x, y), leader }, around));
                }
            }
        }
        let (_, label, around) = best?;
        self.boxes.push(around);
        self.leaders.extend(label.leader);
        Some(label)
    }

    /// Cost of lines that cross a text, and of obstacles that its leader line crosses.
    fn crossed_px(&self, around: &Rect, point: Px, leader: Option<(Px, Px)>) -> f64 {
        let through =
            |lines: &[(Px, Px)]| lines.iter().filter(|line| touches(line.0, line.1, around)).count();
        let mut cost_px =
            CROSSED_PX * through(&self.lines) as f64 + LEADER_CROSSED_PX * through(&self.leaders) as f64;
        if let Some((from, to)) = leader {
            // The leader line begins in its own marker.
            let foreign =
                self.boxes.iter().filter(|taken| !taken.contains(point) && touches(from, to, taken));
            cost_px += LEADER_CROSSED_PX * foreign.count() as f64;
        }
        cost_px
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn crowd(count: usize) -> (Surroundings, Vec<Px>) {
        let points: Vec<Px> = (0..count)
            .map(|i| (60.0 + 17.0 * (i % 20) as f64, 60.0 + 23.0 * (i / 20) as f64 + 0.4 * (i % 20) as f64))
            .collect();
        let marker = |p: &Px| Rect { left: p.0 - 2.5, top: p.1 - 2.5, right: p.0 + 2.5, bottom: p.1 + 2.5 };
        let surroundings = Surroundings {
            inside: Rect { left: 0.0, top: 0.0, right: 600.0, bottom: 500.0 },
            boxes: points.iter().map(marker).collect(),
            lines: points.windows(2).map(|pair| (pair[0], pair[1])).collect(),
            leaders: Vec::new(),
        };
        (surroundings, points)
    }

    #[test]
    fn no_text_covers_a_marker_or_another_text() {
        // All labels of a usual number of points find a place; of more points, most do.
        for (count, most) in [(1, 1.0), (20, 1.0), (60, 1.0), (200, 0.8)] {
            let (mut surroundings, points) = crowd(count);
            let placed = points
                .iter()
                .enumerate()
                .filter_map(|(i, point)| surroundings.place(*point, &(i + 1).to_string(), 10.0))
                .count();
            assert!(placed as f64 >= most * count as f64, "{placed} of {count}");
            let boxes = &surroundings.boxes;
            assert_eq!(boxes.len(), count + placed);
            for (i, text) in boxes.iter().enumerate().skip(count) {
                assert!(!boxes[..i].iter().any(|other| other.overlaps(text)), "{text:?}");
            }
        }
    }

    #[test]
    fn a_text_with_room_is_at_its_point_and_one_without_has_no_place() {
        let (mut surroundings, points) = crowd(1);
        let label = surroundings.place(points[0], "7", 10.0).unwrap();
        assert_eq!(label.leader, None);
        assert!((label.centre.0 - points[0].0).hypot(label.centre.1 - points[0].1) < 15.0);
        surroundings.boxes.push(surroundings.inside);
        assert_eq!(surroundings.place(points[0], "8", 10.0), None);
        assert_eq!(surroundings.place((f64::NAN, 0.0), "9", 10.0), None);
    }
}

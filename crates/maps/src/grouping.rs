//! Which points belong to one speed line.

use mapper_core::IdentifiedPoint;

/// How points without a target are distinguished.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Grouping {
    /// Two points belong to different lines where, in order of corrected speed, the step from one to the next is
    /// larger than this share of the slower; above 0, below 1.
    ///
    /// Speed lines of maps are 8 % or more apart; a closed-loop speed holds 1 %, and in an open-loop campaign speed
    /// drifts by some 2 % over a line. 4 % lies between.
    pub speed_gap_ratio: f64,
}

impl Default for Grouping {
    fn default() -> Self {
        Grouping { speed_gap_ratio: 0.04 }
    }
}

/// Points of one line, as they came, with the target they share.
pub(crate) struct Group<'a> {
    pub target_speed_rpm: Option<f64>,
    pub points: Vec<&'a IdentifiedPoint>,
}

/// Points with a target go by its speed, all others by gaps in corrected speed. Every point lands in one group.
pub(crate) fn group<'a>(points: &'a [IdentifiedPoint], grouping: &Grouping) -> Vec<Group<'a>> {
    let (mut aimed, mut free): (Vec<_>, Vec<_>) =
        points.iter().partition(|point| target_speed_rpm(point).is_some());
    // Stable sorts: points that compare equal stay in the order they were measured.
    aimed.sort_by(|a, b| {
        let key = |p: &IdentifiedPoint| target_speed_rpm(p).unwrap_or_default();
        key(a).total_cmp(&key(b))
    });
    free.sort_by(|a, b| a.speed_corrected_rpm.total_cmp(&b.speed_corrected_rpm));
    let mut groups = split(aimed, |a, b| {
        let (a, b) = (target_speed_rpm(a).unwrap_or_default(), target_speed_rpm(b).unwrap_or_default());
        // Targets are set, not measured: only rounding may differ.
        b - a > 1e-6 * a.abs()
    });
    for group in &mut groups {
        group.target_speed_rpm = group.points.first().and_then(|point| target_speed_rpm(point));
    }
    groups.extend(split(free, |a, b| {
        b.speed_corrected_rpm - a.speed_corrected_rpm > grouping.speed_gap_ratio * a.speed_corrected_rpm.abs()
    }));
    groups
}

fn target_speed_rpm(point: &IdentifiedPoint) -> Option<f64> {
    point.target.map(|target| target.speed_rpm).filter(|speed_rpm| speed_rpm.is_finite())
}

/// Splits a sorted list where `apart(previous, next)`.
fn split<'a>(
    points: Vec<&'a IdentifiedPoint>,
    apart: impl Fn(&IdentifiedPoint, &IdentifiedPoint) -> bool,
) -> Vec<Group<'a>> {
    let mut groups: Vec<Group<'a>> = Vec::new();
    for point in points {
        match groups.last_mut() {
            Some(group) if !group.points.last().is_some_and(|last| apart(last, point)) => {
                group.points.push(point)
            }
            _ => groups.push(Group { target_speed_rpm: None, points: vec![point] }),
        }
    }
    groups
}

//! Groups points into speed lines.

use mapper_core::IdentifiedPoint;

/// Relative difference of equal target speeds. Bound: targets are setpoints, which differ by rounding only.
const TARGET_ROUNDING_RATIO: f64 = 1e-6;

/// Minimum gap between neighbouring lines of points without a target speed, as a ratio of the slower corrected speed. Bound: it separates
/// lines of maps, which are at least 8 % apart, from the variation within one: 1 % with speed control, and some 2 % without.
const SPEED_GAP_RATIO: f64 = 0.04;

/// Points of one line in their original order, with their common target.
pub(crate) struct Group<'a> {
    pub target_speed_rpm: Option<f64>,
    pub points: Vec<&'a IdentifiedPoint>,
}

/// Groups points with a target by its speed, and all others by gaps in corrected speed. Every point is in exactly one group.
pub(crate) fn group_by_speed(points: &[IdentifiedPoint]) -> Vec<Group<'_>> {
    let (mut with_target, mut without_target): (Vec<_>, Vec<_>) =
        points.iter().partition(|point| target_speed_rpm(point).is_some());
    // Stable sorts: equal points stay in the order of measurement.
    with_target.sort_by(|a, b| {
        let key = |p: &IdentifiedPoint| target_speed_rpm(p).unwrap_or_default();
        key(a).total_cmp(&key(b))
    });
    without_target.sort_by(|a, b| a.speed_corrected_rpm.total_cmp(&b.speed_corrected_rpm));
    let mut groups = split(with_target, |a, b| {
        let (a, b) = (target_speed_rpm(a).unwrap_or_default(), target_speed_rpm(b).unwrap_or_default());
        b - a > TARGET_ROUNDING_RATIO * a.abs()
    });
    for group in &mut groups {
        group.target_speed_rpm = group.points.first().and_then(|point| target_speed_rpm(point));
    }
    groups.extend(split(without_target, |a, b| {
        b.speed_corrected_rpm - a.speed_corrected_rpm > SPEED_GAP_RATIO * a.speed_corrected_rpm.abs()
    }));
    groups
}

fn target_speed_rpm(point: &IdentifiedPoint) -> Option<f64> {
    point.target.map(|target| target.speed_rpm).filter(|speed_rpm| speed_rpm.is_finite())
}

/// Splits a sorted list at each point that starts a new line after the previous one.
fn split<'a>(
    points: Vec<&'a IdentifiedPoint>,
    starts_line: impl Fn(&IdentifiedPoint, &IdentifiedPoint) -> bool,
) -> Vec<Group<'a>> {
    let mut groups: Vec<Group<'a>> = Vec::new();
    for point in points {
        match groups.last_mut() {
            Some(group) if !group.points.last().is_some_and(|last| starts_line(last, point)) => {
                group.points.push(point)
            }
            _ => groups.push(Group { target_speed_rpm: None, points: vec![point] }),
        }
    }
    groups
}

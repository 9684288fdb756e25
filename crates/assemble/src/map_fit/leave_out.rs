//! How well a line is foretold by the others.

use super::MapFit;
use super::observations::Observations;
use mapper_core::LeftOutLine;

/// Leaves each line out in turn, fits the others anew from the beginning, and measures the line's points against what
/// that fit says at its speed. Lines without which too little is left are passed over.
pub fn leave_out(fit: &MapFit) -> Vec<LeftOutLine> {
    let count = fit.data.lines_rpm.len();
    (0..count).filter_map(|line| left_out(&fit.data, line, line == 0 || line + 1 == count)).collect()
}

fn left_out(data: &Observations, line: usize, outermost: bool) -> Option<LeftOutLine> {
    let rest = MapFit::of(data.without(line).ok()?).ok()?;
    let (mut distances, mut errors) = (Vec::new(), Vec::new());
    for point in data.points.iter().filter(|point| point.line == line) {
        let speed_rpm = point.speed_ratio * data.nominal_speed_rpm;
        let place = rest.nearest(
            speed_rpm,
            point.flow_kg_s,
            point.pressure_ratio,
            point.flow_scale_kg_s,
            point.ratio_scale,
        );
        distances.push(place.distance_ratio);
        errors.extend(point.eta.map(|eta| (eta - place.eta).abs()));
    }
    Some(LeftOutLine {
        speed_corrected_rpm: data.lines_rpm[line],
        outermost,
        distance_ratio: median(&mut distances)?,
        eta: median(&mut errors),
    })
}

fn median(values: &mut [f64]) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    let (below, above) = (values.len().checked_sub(1)? / 2, values.len() / 2);
    Some(0.5 * (values[below] + values[above]))
}

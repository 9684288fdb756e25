//! Prediction errors of left-out lines.

use crate::map_fit::fitted_surface::surface::MapFit;
use crate::map_fit::prediction_errors::deviation::Deviation;
use crate::map_fit::speed_lines::ends::End;
use mapper_core::LeftOutLine;
use mapper_numerics::parallel;
use mapper_numerics::statistics::{NORMAL_975, median};

/// Leaves each line out in turn, fits the others, and compares the line's points with that fit. Lines without which the rest cannot be
/// fitted are skipped.
///
/// Each search starts from the fit of all lines, which takes a third of the rounds; docs/validation/maps.md compares its result with that of
/// a search from scratch.
pub fn leave_out(fit: &MapFit) -> Vec<LeftOutLine> {
    let count = fit.data.lines_rpm.len();
    let one = |line: usize| {
        let end = if line == 0 { Some(End::Slow) } else { (line + 1 == count).then_some(End::Fast) };
        left_out(fit, line, end)
    };
    let lines: Vec<usize> = (0..count).collect();
    parallel::map(&lines, |line| one(*line)).into_iter().flatten().collect()
}

fn left_out(all: &MapFit, line: usize, end: Option<End>) -> Option<LeftOutLine> {
    let data = &all.data;
    let rest = MapFit::of(data.without_line(line).ok()?, Some(&all.solution)).ok()?;
    let rest = rest.widened(end.as_slice());
    let (mut distances, mut errors) = (Vec::new(), Vec::new());
    let (mut distances_held, mut errors_held) = (0usize, 0usize);
    let held = |off: Deviation| usize::from(off.by <= NORMAL_975 * off.standard_error);
    for point in data.points.iter().filter(|point| point.line == line) {
        let miss = rest.deviations(point);
        distances.push(miss.distance.by);
        distances_held += held(miss.distance);
        if let Some(off) = miss.eta {
            errors.push(off.by);
            errors_held += held(off);
        }
    }
    let share = |held: usize, of: usize| (of > 0).then(|| held as f64 / of as f64);
    Some(LeftOutLine {
        speed_corrected_rpm: data.lines_rpm[line],
        outermost: end.is_some(),
        distance_held_ratio: share(distances_held, distances.len()),
        eta_held_ratio: share(errors_held, errors.len()),
        distance_ratio: median(&distances)?,
        eta: median(&errors),
    })
}

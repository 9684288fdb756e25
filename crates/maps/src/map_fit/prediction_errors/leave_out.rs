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
/// Each search starts from the fit of all lines and so takes a third of the rounds. docs/validation/maps.md compares its result with that
/// of a search from scratch.
pub fn leave_out(fit: &MapFit) -> Vec<LeftOutLine> {
    let count = fit.data.lines_rpm.len();
    let lines: Vec<usize> = (0..count).collect();
    let errors = parallel::map(&lines, |line| {
        let end = if *line == 0 { Some(End::Slow) } else { (line + 1 == count).then_some(End::Fast) };
        errors_without_line(fit, *line, end)
    });
    errors.into_iter().flatten().collect()
}

/// Errors of the fit without a line at that line; `end`: the end of the measured speeds at which it lies.
fn errors_without_line(all: &MapFit, line: usize, end: Option<End>) -> Option<LeftOutLine> {
    let data = &all.data;
    let rest = all.fit_without_line(line)?.widened(end.as_slice());
    let (mut distances, mut errors) = (Vec::new(), Vec::new());
    let (mut distances_covered, mut errors_covered) = (0usize, 0usize);
    let covered = |deviation: Deviation| usize::from(deviation.size <= NORMAL_975 * deviation.standard_error);
    for point in data.points.iter().filter(|point| point.line == line) {
        let deviations = rest.deviations(point);
        distances.push(deviations.distance.size);
        distances_covered += covered(deviations.distance);
        if let Some(deviation) = deviations.eta {
            errors.push(deviation.size);
            errors_covered += covered(deviation);
        }
    }
    let share = |count: usize, of: usize| (of > 0).then(|| count as f64 / of as f64);
    Some(LeftOutLine {
        speed_corrected_rpm: data.lines_rpm[line],
        outermost: end.is_some(),
        distance_held_ratio: share(distances_covered, distances.len()),
        eta_held_ratio: share(errors_covered, errors.len()),
        distance_ratio: median(&distances)?,
        eta: median(&errors),
    })
}

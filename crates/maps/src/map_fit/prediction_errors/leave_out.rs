//! How well a line is predicted by the others.

use crate::map_fit::fitted_surface::surface::MapFit;
use crate::map_fit::prediction_errors::miss::Off;
use crate::map_fit::speed_lines::ends::End;
use mapper_core::LeftOutLine;
use mapper_numerics::parallel;
use mapper_numerics::statistics::{NORMAL_975, median};

/// Leaves each line out in turn, fits the others again, and measures the line's points against what that fit says at its
/// speed. Lines without which too little is left are passed over.
///
/// Each search starts from the fit of all lines, parameters and variances: it ends close to where one from the beginning
/// does (docs/validation/maps.md says how close), in a third of the rounds.
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
    let rest = MapFit::of(data.without(line).ok()?, Some(&all.solution)).ok()?;
    let rest = rest.widened(end.as_slice());
    let (mut distances, mut errors) = (Vec::new(), Vec::new());
    let (mut distances_held, mut errors_held) = (0usize, 0usize);
    let held = |off: Off| usize::from(off.by <= NORMAL_975 * off.standard_error);
    for point in data.points.iter().filter(|point| point.line == line) {
        let miss = rest.miss(point);
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

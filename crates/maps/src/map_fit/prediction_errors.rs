//! Prediction errors of a map fit: deviations at points, left-out lines, and extrapolation beyond the measured speeds.
//!
//! Between lines the roughness of each parameter limits the shape of an unmeasured line. Beyond them that limit is
//! too tight: choke flow at low speed and work at high Mach numbers bend towards one end, but the smooth middle determines the roughness. The
//! outermost line is therefore left out, and the variance beyond the other lines is increased until it explains the deviation
//! of that line. It is never decreased: one line does not justify smaller errors.

use crate::map_fit::fitted_surface::MapFit;
use crate::map_fit::observations::Observation;
use crate::map_fit::speed_lines::{End, EndWidenings, Widening};
use mapper_core::LeftOutLine;
use mapper_numerics::parallel;
use mapper_numerics::statistics::{NORMAL_975, median};

/// A deviation and its standard error, which combines the errors of the line, of points about a line, and of the point itself.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Deviation {
    pub size: f64,
    pub standard_error: f64,
}

/// Deviations of a point from the line at its speed.
pub(crate) struct Deviations {
    /// In units of the line's scales.
    pub distance: Deviation,
    /// Of efficiency, fraction; `None` if the point has none.
    pub eta: Option<Deviation>,
}

impl MapFit {
    pub(crate) fn deviations(&self, point: &Observation) -> Deviations {
        let [distance_rms, eta_rms] = self.solution.rms;
        let place = self.nearest(
            point.speed_ratio * self.data.nominal_speed_rpm,
            point.flow_kg_s,
            point.pressure_ratio,
            point.flow_scale_kg_s,
            point.ratio_scale,
        );
        Deviations {
            distance: Deviation {
                size: place.distance_ratio,
                standard_error: place.distance_standard_error_ratio.hypot(distance_rms),
            },
            eta: point.eta.map(|eta| Deviation {
                size: (eta - place.eta).abs(),
                standard_error: place.eta_standard_error.hypot(eta_rms).hypot(point.eta_error),
            }),
        }
    }
}

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

impl MapFit {
    /// The fit with errors beyond its ends that explain the outermost lines.
    pub(crate) fn widened(mut self, ends: &[End]) -> MapFit {
        let line_of = |end: &End| match end {
            End::Slow => 0,
            End::Fast => self.data.lines_rpm.len() - 1,
        };
        let rests = parallel::map(ends, |end| Some((line_of(end), self.fit_without_line(line_of(end))?)));
        for (end, (line, rest)) in ends.iter().zip(rests).filter_map(|(end, rest)| Some((end, rest?))) {
            let points = self.data.points.iter().filter(|point| point.line == line);
            let factors = estimate_widening(rest.clone(), points);
            match end {
                End::Slow => self.solution.widening.slow = factors,
                End::Fast => self.solution.widening.fast = factors,
            }
            self.without_line.insert(line, rest);
        }
        self
    }
}

/// The widening with which a fit's errors explain the deviations of a line's points, on average.
fn estimate_widening<'a>(
    mut rest: MapFit,
    points: impl Iterator<Item = &'a Observation> + Clone,
) -> Widening {
    // Squares of the deviations, and of their standard errors with these factors.
    let mut sums = |shape: f64, work: f64| {
        rest.solution.widening = EndWidenings::both(Widening { shape, work });
        let [mut distance, mut eta] = [Sums::default(); 2];
        for point in points.clone() {
            let deviations = rest.deviations(point);
            distance.add(deviations.distance);
            deviations.eta.into_iter().for_each(|deviation| eta.add(deviation));
        }
        (distance, eta)
    };
    let shape = factor(sums(0.0, 0.0).0, sums(1.0, 0.0).0);
    let work = factor(sums(shape, 0.0).1, sums(shape, 1.0).1);
    Widening { shape, work }
}

/// Sums of squares over the points of a line.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    deviations: f64,
    standard_errors: f64,
}

impl Sums {
    fn add(&mut self, deviation: Deviation) {
        self.deviations += deviation.size * deviation.size;
        self.standard_errors += deviation.standard_error * deviation.standard_error;
    }
}

/// Factor, at least 1, on the part of the variance beyond the ends, that explains the deviations.
fn factor(not_widened: Sums, widened: Sums) -> f64 {
    let added = widened.standard_errors - not_widened.standard_errors;
    let factor = (widened.deviations - not_widened.standard_errors) / added;
    if factor.is_finite() { factor.max(1.0) } else { 1.0 }
}

//! Widens the errors of a fit beyond the measured speeds.
//!
//! Between lines the roughness of each parameter limits the shape of an unmeasured line. Beyond them that limit is
//! too tight: choke flow at low speed and work at high Mach numbers bend towards one end, but the smooth middle determines the roughness. The outermost line is therefore left out, and the variance beyond the other lines is increased until it explains the deviation
//! of that line. It is never decreased: one line does not justify smaller errors.

use crate::map_fit::fitted_surface::surface::MapFit;
use crate::map_fit::least_squares::observations::Observation;
use crate::map_fit::prediction_errors::deviation::Deviation;
use crate::map_fit::speed_lines::ends::{End, EndWidenings, Widening};
use mapper_numerics::parallel;

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

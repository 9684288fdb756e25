//! How much wider than its roughness says a fit's errors are beyond the measured speeds.
//!
//! Between lines the roughness of each parameter limits the shape of a line that was not measured. Beyond them it is not
//! enough: whatever bends towards one end (choke flow at low speed, work at high Mach numbers) is smooth in the middle, where the
//! roughness is found. So the outermost line is left out, and the variance of what is drawn on is widened until it explains how
//! far that line lies from where the others put it. It is never narrowed: one line does not justify more confidence.

use crate::map_fit::fitted_surface::surface::MapFit;
use crate::map_fit::least_squares::observations::Observation;
use crate::map_fit::prediction_errors::miss::Off;
use crate::map_fit::speed_lines::ends::{Beyond, BothEnds, End};

impl MapFit {
    /// The fit with errors beyond its ends as wide as the outermost lines show.
    pub(crate) fn widened(mut self, ends: &[End]) -> MapFit {
        for end in ends {
            let line = match end {
                End::Slow => 0,
                End::Fast => self.data.lines_rpm.len() - 1,
            };
            let rest =
                self.data.without(line).ok().and_then(|data| MapFit::of(data, Some(&self.solution)).ok());
            let Some(rest) = rest else { continue };
            let factors = shown_by(rest, self.data.points.iter().filter(|point| point.line == line));
            match end {
                End::Slow => self.solution.beyond.slow = factors,
                End::Fast => self.solution.beyond.fast = factors,
            }
        }
        self
    }
}

/// The factors with which a fit's errors explain, on average over a line's points, how far these lie from it.
fn shown_by<'a>(mut rest: MapFit, points: impl Iterator<Item = &'a Observation> + Clone) -> Beyond {
    // Squares of what is off, and of its standard error by a fit whose variance beyond the ends has these factors.
    let mut sums = |shape: f64, work: f64| {
        rest.solution.beyond = BothEnds::both(Beyond { shape, work });
        let [mut distance, mut eta] = [Sums::default(); 2];
        for point in points.clone() {
            let miss = rest.miss(point);
            distance.take(miss.distance);
            miss.eta.into_iter().for_each(|off| eta.take(off));
        }
        (distance, eta)
    };
    let shape = factor(sums(0.0, 0.0).0, sums(1.0, 0.0).0);
    let work = factor(sums(shape, 0.0).1, sums(shape, 1.0).1);
    Beyond { shape, work }
}

/// Sums of squares over the points of a line.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    off: f64,
    explained: f64,
}

impl Sums {
    fn take(&mut self, off: Off) {
        self.off += off.by * off.by;
        self.explained += off.standard_error * off.standard_error;
    }
}

/// The factor on what the variance beyond the ends adds that explains what is off, at least 1.
fn factor(without: Sums, with: Sums) -> f64 {
    let beyond = with.explained - without.explained;
    let factor = (with.off - without.explained) / beyond;
    if factor.is_finite() { factor.max(1.0) } else { 1.0 }
}

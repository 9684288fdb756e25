//! Causes with their courses, weighed against the readings.

use crate::cause::Cause;
use crate::course::{Course, CourseKind};
use crate::readings::Readings;
use nalgebra::DMatrix;

/// A cause, by its position among those that show, with a course.
pub(crate) struct Candidate {
    pub cause: usize,
    pub course: Course,
}

/// All candidates weighed against the readings.
pub(crate) struct Weighed {
    /// Evidence of each (twice the log of the likelihood ratio at its best size).
    pub evidence: Vec<f64>,
    /// Best size of each, and one standard deviation of it.
    pub size: Vec<f64>,
    pub sigma: Vec<f64>,
}

/// Ramps from the start on, steps from after it; both until there is too little left to see them.
pub(crate) fn courses(start_s: f64, end_s: f64, count: usize) -> Vec<Course> {
    let length_s = end_s - start_s;
    let mut courses = Vec::new();
    for index in 0..count {
        let share = index as f64 / count as f64;
        if share <= 0.88 {
            courses.push(Course { kind: CourseKind::Ramp, onset_s: start_s + share * length_s });
        }
        // A step at the very start is a constant.
        if (0.04..=0.97).contains(&share) {
            courses.push(Course { kind: CourseKind::Step, onset_s: start_s + share * length_s });
        }
    }
    courses
}

pub(crate) fn mean_of(readings: &Readings, row: usize, course: Course) -> f64 {
    let block = &readings.blocks[row / readings.columns.len()];
    let offset_s = readings.steps[block.step].offset_s;
    course.mean(block.start_s + offset_s, block.end_s + offset_s)
}

/// Evidence, size and its standard deviation of each candidate.
pub(crate) fn weigh(
    causes: &[(Cause, Vec<f64>)],
    candidates: &[Candidate],
    whitened: &DMatrix<f64>,
    shown: &DMatrix<f64>,
    inverse: &DMatrix<f64>,
) -> Weighed {
    let along = inverse.tr_mul(whitened);
    let mut weighed = Weighed { evidence: Vec::new(), size: Vec::new(), sigma: Vec::new() };
    for (index, candidate) in candidates.iter().enumerate() {
        let information = shown.column(index).dot(&inverse.column(index));
        let (evidence, size) = evidence(causes[candidate.cause].0, along[(index, 0)], information);
        weighed.evidence.push(evidence);
        weighed.size.push(size);
        weighed.sigma.push(if information > 0.0 { information.sqrt().recip() } else { f64::INFINITY });
    }
    weighed
}

/// Evidence and best size; a bearing takes power and never gives any.
pub(crate) fn evidence(cause: Cause, along: f64, information: f64) -> (f64, f64) {
    if information <= 0.0 || !information.is_finite() || (cause == Cause::BearingFriction && along < 0.0) {
        return (0.0, 0.0);
    }
    (along * along / information, along / information)
}

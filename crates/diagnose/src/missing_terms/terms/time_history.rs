//! Time history of a source term: a level, or a part that decays after a jump, during some time spans.

use std::fmt::{Display, Formatter, Result};

/// Time constant of a source term's decaying part, s: similar to that of the housings.
pub const DECAY_S: f64 = 30.0;

/// Time history of a source term within a step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shape {
    /// Constant.
    Level,
    /// `exp(-t/30 s)` after the jump.
    Decay,
}

impl Shape {
    /// Share of its full size at this time after the jump.
    pub fn at(self, since_s: f64) -> f64 {
        match self {
            Shape::Level => 1.0,
            Shape::Decay => (-since_s / DECAY_S).exp(),
        }
    }
}

/// A shape during some time spans.
#[derive(Debug, Clone, PartialEq)]
pub struct TimeHistory {
    /// Time history within a span.
    pub shape: Shape,
    /// Start and end of each, s; a start at minus infinity precedes the recording.
    pub spans_s: Vec<(f64, f64)>,
}

impl TimeHistory {
    /// Zero before a time, s, and 1 from then on.
    pub fn from(begin_s: f64) -> TimeHistory {
        TimeHistory { shape: Shape::Level, spans_s: vec![(begin_s, f64::INFINITY)] }
    }

    /// Its value at a time; NaN means the soak before the recording.
    pub fn at(&self, t_s: f64) -> f64 {
        let mut spans = self.spans_s.iter();
        if t_s.is_nan() {
            let before = spans.any(|(begin_s, _)| *begin_s == f64::NEG_INFINITY);
            return if before && self.shape == Shape::Level { 1.0 } else { 0.0 };
        }
        let here = spans.find(|(begin_s, end_s)| (*begin_s..*end_s).contains(&t_s));
        here.map_or(0.0, |(begin_s, _)| self.shape.at(t_s - begin_s))
    }
}

/// Written as in an effect's script; only a level can be written.
impl Display for TimeHistory {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        let begin_s = self.spans_s.first().map_or(f64::NEG_INFINITY, |(begin_s, _)| *begin_s);
        write!(f, "(if at.t_s < {begin_s:?} {{ 0.0 }} else {{ 1.0 }})")
    }
}

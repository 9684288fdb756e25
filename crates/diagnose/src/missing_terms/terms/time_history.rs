//! Time spans in which a source term acts.

use mapper_inference::time_history::{Shape, TimeHistory};
use std::fmt::{Display, Formatter, Result};

/// Decay of the part of a source term that follows a jump, s: similar to that of the housings.
pub const DECAY: Shape = Shape::Decay(30.0);

/// A time history up to an end.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Span {
    /// History over time, s; an onset at minus infinity precedes the recording.
    pub history: TimeHistory,
    /// Its end, s.
    pub end_s: f64,
}

/// A source term acts in these spans.
#[derive(Debug, Clone, PartialEq)]
pub struct Spans(pub Vec<Span>);

impl Spans {
    /// Zero before a time, s, and 1 from then on.
    pub fn from(begin_s: f64) -> Spans {
        let history = TimeHistory { onset: begin_s, shape: Shape::Step };
        Spans(vec![Span { history, end_s: f64::INFINITY }])
    }

    /// Its value at a time; NaN means the soak before the recording.
    pub fn at(&self, t_s: f64) -> f64 {
        if t_s.is_nan() {
            let acts = |span: &Span| span.history == TimeHistory::THROUGHOUT;
            return f64::from(u8::from(self.0.iter().any(acts)));
        }
        let acts = |span: &&Span| (span.history.onset..span.end_s).contains(&t_s);
        self.0.iter().find(acts).map_or(0.0, |span| span.history.at(t_s))
    }
}

/// Written as in an effect's script; only a step can be written.
impl Display for Spans {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        let begin_s = self.0.first().map_or(f64::NEG_INFINITY, |span| span.history.onset);
        write!(f, "(if at.t_s < {begin_s:?} {{ 0.0 }} else {{ 1.0 }})")
    }
}

//! Search coordinates of effect parameters.

use crate::gap::residuals::study::Hypothesis;
use mapper_physics::rig::effect::{Effect, EffectParameter};
use std::sync::Arc;

/// Search coordinate of a parameter: its value in typical steps, or its logarithm if it spans decades.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Coordinate {
    pub(crate) low: f64,
    pub(crate) high: f64,
    scale: f64,
    logarithmic: bool,
}

impl Coordinate {
    /// The coordinate of a parameter.
    pub fn new(parameter: &EffectParameter) -> Self {
        let logarithmic = parameter.low > 0.0 && parameter.high / parameter.low > 20.0;
        let scale = if logarithmic { 1.0 } else { parameter.typical_step.abs().max(1e-12) };
        Coordinate { low: parameter.low, high: parameter.high, scale, logarithmic }
    }

    /// Whether it is the parameter's logarithm.
    pub fn is_logarithmic(&self) -> bool {
        self.logarithmic
    }

    /// Coordinate of a value.
    pub fn of(&self, value: f64) -> f64 {
        if self.logarithmic { value.max(1e-300).ln() } else { value / self.scale }
    }

    /// Coordinates of the ends of the parameter's range, the lower one first.
    pub fn ends(&self) -> (f64, f64) {
        let ends = (self.of(self.low), self.of(self.high));
        (ends.0.min(ends.1), ends.0.max(ends.1))
    }

    /// A value next to another one, on the side where there is room, and the coordinate's change.
    pub fn next_to(&self, value: f64, distance: f64) -> (f64, f64) {
        let at = self.of(value);
        let fits = |x: &f64| (self.of(self.value(*x)) - x).abs() < 1e-9;
        let away = [at + distance, at - distance].into_iter().find(fits).unwrap_or(at - distance);
        let moved = self.value(away);
        (moved, self.of(moved) - at)
    }

    /// Value of a coordinate, within the parameter's range.
    pub fn value(&self, coordinate: f64) -> f64 {
        let value = if self.logarithmic { coordinate.exp() } else { coordinate * self.scale };
        value.clamp(self.low, self.high)
    }
}

/// Coordinates of all parameters of a hypothesis' effects, in order.
pub fn coordinates(effects: &[Arc<dyn Effect>], hypothesis: &Hypothesis) -> Vec<Coordinate> {
    let parameters = hypothesis.effects.iter().flat_map(|(index, _)| &effects[*index].info().parameters);
    parameters.map(Coordinate::new).collect()
}

/// Sets the `place`-th parameter of all effects to a value.
pub fn set_parameter(hypothesis: &mut Hypothesis, place: usize, value: f64) {
    if let Some(slot) = hypothesis.effects.iter_mut().flat_map(|(_, values)| values.iter_mut()).nth(place) {
        *slot = value;
    }
}

/// Values of all effects' parameters, in order.
pub fn parameters(hypothesis: &Hypothesis) -> Vec<f64> {
    hypothesis.effects.iter().flat_map(|(_, values)| values.iter().copied()).collect()
}

//! Search coordinates of effect parameters, and hypotheses as vectors of unknowns.

use crate::gap::residuals::nuisance::Hypothesis;
use mapper_numerics::least_squares::step_bounds_within;
use mapper_physics::rig::effect::{Effect, EffectInfo, EffectParameter};
use nalgebra::DVector;
use std::sync::Arc;

/// Ratio of the ends of a range above which a parameter is searched by its logarithm. Bound: it spans more than a decade.
const LOGARITHMIC_RATIO: f64 = 20.0;
/// Minimum scale. Bound: avoids a division by zero.
const MIN_SCALE: f64 = 1e-12;
/// Minimum value of a logarithm's argument. Bound: the smallest normal number.
const MIN_ARGUMENT: f64 = 1e-300;
/// Difference between coordinates that count as one. Bound: rounding.
const SAME: f64 = 1e-9;

/// Search coordinate of a parameter: its value in typical steps, or its logarithm if it spans decades.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Coordinate {
    pub(crate) low: f64,
    pub(crate) high: f64,
    scale: f64,
    logarithmic: bool,
}

impl Coordinate {
    pub(crate) fn new(parameter: &EffectParameter) -> Self {
        let logarithmic = parameter.low > 0.0 && parameter.high / parameter.low > LOGARITHMIC_RATIO;
        let scale = if logarithmic { 1.0 } else { parameter.typical_step.abs().max(MIN_SCALE) };
        Coordinate { low: parameter.low, high: parameter.high, scale, logarithmic }
    }

    pub(crate) fn is_logarithmic(&self) -> bool {
        self.logarithmic
    }

    pub(crate) fn of(&self, value: f64) -> f64 {
        if self.logarithmic { value.max(MIN_ARGUMENT).ln() } else { value / self.scale }
    }

    /// Coordinates of the ends of the parameter's range, the lower one first.
    pub(crate) fn ends(&self) -> (f64, f64) {
        let ends = (self.of(self.low), self.of(self.high));
        (ends.0.min(ends.1), ends.0.max(ends.1))
    }

    /// Largest change in one iteration of a descent, down and up.
    pub(crate) fn step_bounds(&self, at: f64) -> (f64, f64) {
        let (low, high) = self.ends();
        step_bounds_within(low, high, at)
    }

    /// A value at this distance from another one, on the side that is within the range, and the coordinate's change.
    pub(crate) fn next_to(&self, value: f64, distance: f64) -> (f64, f64) {
        let at = self.of(value);
        let is_in_range = |x: &f64| (self.of(self.value(*x)) - x).abs() < SAME;
        let away = [at + distance, at - distance].into_iter().find(is_in_range).unwrap_or(at - distance);
        let moved = self.value(away);
        (moved, self.of(moved) - at)
    }

    pub(crate) fn value(&self, coordinate: f64) -> f64 {
        let value = if self.logarithmic { coordinate.exp() } else { coordinate * self.scale };
        value.clamp(self.low, self.high)
    }
}

/// Value of a parameter a typical step from neutral.
pub(crate) fn typical(parameter: &EffectParameter) -> f64 {
    (parameter.neutral + parameter.typical_step).clamp(parameter.low, parameter.high)
}

pub(crate) fn infos<'a>(
    effects: &'a [Arc<dyn Effect>],
    hypothesis: &'a Hypothesis,
) -> impl Iterator<Item = &'a EffectInfo> {
    hypothesis.effects.iter().map(|(index, _)| effects[*index].info())
}

/// Coordinates of all parameters of a hypothesis' effects, in order.
pub(crate) fn coordinates(effects: &[Arc<dyn Effect>], hypothesis: &Hypothesis) -> Vec<Coordinate> {
    infos(effects, hypothesis).flat_map(|info| &info.parameters).map(Coordinate::new).collect()
}

pub(crate) fn parameters(hypothesis: &Hypothesis) -> Vec<f64> {
    hypothesis.effects.iter().flat_map(|(_, values)| values.iter().copied()).collect()
}

/// A hypothesis as a vector of unknowns: its nuisances, then the coordinates of its effects.
pub(crate) fn unknowns(hypothesis: &Hypothesis, coordinates: &[Coordinate]) -> DVector<f64> {
    let of_effects = coordinates.iter().zip(parameters(hypothesis)).map(|(c, value)| c.of(value));
    let count = hypothesis.nuisances.len() + coordinates.len();
    DVector::from_iterator(count, hypothesis.nuisances.iter().copied().chain(of_effects))
}

/// The hypothesis of a vector of unknowns, with the effects of `start`. Parameters stay within their ranges.
pub(crate) fn hypothesis_at(
    start: &Hypothesis,
    coordinates: &[Coordinate],
    unknowns: &DVector<f64>,
) -> Hypothesis {
    let mut hypothesis = start.clone();
    let count = hypothesis.nuisances.len();
    hypothesis.nuisances.copy_from_slice(&unknowns.as_slice()[..count]);
    let values = hypothesis.effects.iter_mut().flat_map(|(_, values)| values);
    for ((value, coordinate), unknown) in values.zip(coordinates).zip(unknowns.iter().skip(count)) {
        *value = coordinate.value(*unknown);
    }
    hypothesis
}

/// The neighbours of a hypothesis along each of its nuisances, with the change of the nuisance.
pub(crate) fn nuisance_neighbours(
    hypothesis: &Hypothesis,
    distance: f64,
) -> impl Iterator<Item = (Hypothesis, f64)> {
    (0..hypothesis.nuisances.len()).map(move |index| {
        let mut moved = hypothesis.clone();
        moved.nuisances[index] += distance;
        (moved, distance)
    })
}

/// The neighbours of a hypothesis along each coordinate of its effects, with the change of the coordinate.
pub(crate) fn effect_neighbours(
    hypothesis: &Hypothesis,
    coordinates: &[Coordinate],
    distance: f64,
) -> impl Iterator<Item = (Hypothesis, f64)> {
    let values = coordinates.iter().zip(parameters(hypothesis)).enumerate();
    values.map(move |(index, (coordinate, value))| {
        let (next, change) = coordinate.next_to(value, distance);
        let mut moved = hypothesis.clone();
        if let Some(value) = moved.effects.iter_mut().flat_map(|(_, values)| values).nth(index) {
            *value = next;
        }
        (moved, change)
    })
}

//! A hypothesis: values of all nuisances and effects, and the steps in which an effect acts.

use mapper_inference::time_history::{Shape, TimeHistory};

/// Effects with their values: indices of the candidates, and one value per parameter.
pub(crate) type EffectValues = Vec<(usize, Vec<f64>)>;

/// A hypothesis: values of all nuisances and effects.
#[derive(Debug, Clone, PartialEq)]
pub struct Hypothesis {
    /// Nuisances, in their sigmas.
    pub nuisances: Vec<f64>,
    /// Effects.
    pub effects: EffectValues,
}

/// Names of a hypothesis' effects, by index, in order.
pub(crate) fn members(hypothesis: &Hypothesis) -> Vec<usize> {
    let mut members: Vec<usize> = hypothesis.effects.iter().map(|(index, _)| *index).collect();
    members.sort_unstable();
    members
}

/// History of a cause that acts from the step with this index on.
pub(crate) fn from_step(first: usize) -> TimeHistory {
    TimeHistory { onset: first as f64, shape: Shape::Step }
}

/// History of a cause that grows evenly from step to step: absent before the step with this index, at full size in the last of `steps`.
pub(crate) fn growing_from(first: usize, steps: usize) -> TimeHistory {
    TimeHistory { onset: first as f64 - 1.0, shape: Shape::Ramp((steps - first) as f64) }
}

/// The step with which a cause begins; `None` if it acts throughout.
pub(crate) fn onset_step(history: TimeHistory) -> Option<usize> {
    let first = if let Shape::Ramp(_) = history.shape { history.onset + 1.0 } else { history.onset };
    first.is_finite().then_some(first as usize)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_grows_begins_with_its_step_and_is_whole_in_the_last() {
        let shares = |history: TimeHistory| [0.0, 1.0, 2.0, 3.0, 4.0].map(|step| history.at(step));
        assert_eq!(shares(from_step(3)), [0.0, 0.0, 0.0, 1.0, 1.0]);
        assert_eq!(shares(growing_from(1, 5)), [0.0, 0.25, 0.5, 0.75, 1.0]);
        assert_eq!(
            [from_step(3), growing_from(1, 5), TimeHistory::THROUGHOUT].map(onset_step),
            [Some(3), Some(1), None]
        );
    }
}

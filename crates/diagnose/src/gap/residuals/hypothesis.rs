//! A hypothesis: values of all nuisances and effects, and the onset and growth of an effect.

/// Effects with their values: indices of the candidates, and one value per parameter.
pub type EffectValues = Vec<(usize, Vec<f64>)>;

/// A hypothesis: values of all nuisances and effects.
#[derive(Debug, Clone, PartialEq)]
pub struct Hypothesis {
    /// Nuisances, in their sigmas.
    pub nuisances: Vec<f64>,
    /// Effects.
    pub effects: EffectValues,
}

/// Names of a hypothesis' effects, by index, in order.
pub fn members(hypothesis: &Hypothesis) -> Vec<usize> {
    let mut members: Vec<usize> = hypothesis.effects.iter().map(|(index, _)| *index).collect();
    members.sort_unstable();
    members
}

/// Onset and growth of an effect within a recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TimeHistory {
    /// Present throughout.
    Throughout,
    /// From the step with this index on.
    From(usize),
    /// Grows evenly from step to step: absent before the step with this index, at full size in the last step.
    Growing(usize),
}

impl TimeHistory {
    /// Share of the full size in a step of a recording with `steps` steps, 0..1.
    pub fn share(self, step: usize, steps: usize) -> f64 {
        match self {
            TimeHistory::Throughout => 1.0,
            TimeHistory::From(first) => f64::from(u8::from(step >= first)),
            TimeHistory::Growing(first) if step < first || steps <= first => 0.0,
            TimeHistory::Growing(first) => (step - first + 1) as f64 / (steps - first) as f64,
        }
    }

    /// The step with which it begins; `None` if it is always present.
    pub fn onset(self) -> Option<usize> {
        match self {
            TimeHistory::Throughout => None,
            TimeHistory::From(first) | TimeHistory::Growing(first) => Some(first),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_grows_begins_with_its_step_and_is_whole_in_the_last() {
        let shares = |history: TimeHistory| (0..5).map(|step| history.share(step, 5)).collect::<Vec<f64>>();
        assert_eq!(shares(TimeHistory::Throughout), [1.0; 5]);
        assert_eq!(shares(TimeHistory::From(3)), [0.0, 0.0, 0.0, 1.0, 1.0]);
        assert_eq!(shares(TimeHistory::Growing(1)), [0.0, 0.25, 0.5, 0.75, 1.0]);
    }
}

//! A hypothesis: values of all nuisances and effects.

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

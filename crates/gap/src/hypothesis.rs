//! A point in the space of everything that may be off.

/// Effects with their values: indices into the candidates, and as many values as each has parameters.
pub type EffectValues = Vec<(usize, Vec<f64>)>;

/// A point in the space of everything that may be off.
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

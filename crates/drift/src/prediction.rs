//! What the model says of a run.

use mapper_observe::channels::OUTPUTS;

/// What the model says of one run.
#[derive(Debug, Clone)]
pub(crate) struct Prediction {
    /// Means over the stretches, [`OUTPUTS`] in each.
    pub means: Vec<[f64; OUTPUTS.len()]>,
    /// Highest place on the speed line within each stretch; 1 is the surge line.
    pub surge_position_ratio: Vec<f64>,
    /// Efficiency and heat-transfer coefficient, W/(m2 K), at the end of each step.
    pub step_ends: Vec<(f64, f64)>,
}

impl Prediction {
    /// Of nothing.
    pub fn empty() -> Self {
        Prediction { means: Vec::new(), surge_position_ratio: Vec::new(), step_ends: Vec::new() }
    }

    /// Puts the prediction of the next run behind this one.
    pub fn append(&mut self, next: Prediction) {
        self.means.extend(next.means);
        self.surge_position_ratio.extend(next.surge_position_ratio);
        self.step_ends.extend(next.step_ends);
    }
}

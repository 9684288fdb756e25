//! Model predictions for a run.

use mapper_observe::channels::OUTPUTS;

/// Model predictions for one run.
#[derive(Debug, Clone)]
pub(crate) struct Prediction {
    /// Means over the segments, [`OUTPUTS`] in each.
    pub means: Vec<[f64; OUTPUTS.len()]>,
    /// Highest position on the speed line within each segment; 1 is the surge line.
    pub surge_position_ratio: Vec<f64>,
    /// Efficiency and heat-transfer coefficient, W/(m2 K), at the end of each step.
    pub step_ends: Vec<(f64, f64)>,
}

impl Prediction {
    /// An empty prediction.
    pub fn empty() -> Self {
        Prediction { means: Vec::new(), surge_position_ratio: Vec::new(), step_ends: Vec::new() }
    }

    /// Appends the prediction of the next run.
    pub fn append(&mut self, next: Prediction) {
        self.means.extend(next.means);
        self.surge_position_ratio.extend(next.surge_position_ratio);
        self.step_ends.extend(next.step_ends);
    }
}

//! Effect of one constant on readings and points.

/// Effect of a constant of one standard deviation on readings and points.
#[derive(Debug, Clone)]
pub(crate) struct Constant {
    /// Readings, segment by segment.
    pub readings: Vec<f64>,
    /// Efficiency at the end of each step, fraction.
    pub eta: Vec<f64>,
    /// Heat-transfer coefficient at the end of each step, W/(m2 K).
    pub h_w_m2k: Vec<f64>,
}

impl Constant {
    /// The same, scaled by this factor.
    pub fn times(&self, factor: f64) -> Constant {
        let times = |values: &[f64]| values.iter().map(|value| factor * value).collect();
        Constant { readings: times(&self.readings), eta: times(&self.eta), h_w_m2k: times(&self.h_w_m2k) }
    }

    /// The sum of both.
    pub fn plus(mut self, other: Constant) -> Constant {
        let add = |into: &mut Vec<f64>, from: &[f64]| {
            into.iter_mut().zip(from).for_each(|(into, from)| *into += from);
        };
        add(&mut self.readings, &other.readings);
        add(&mut self.eta, &other.eta);
        add(&mut self.h_w_m2k, &other.h_w_m2k);
        self
    }
}

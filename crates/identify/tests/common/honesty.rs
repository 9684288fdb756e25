//! Compares errors with their stated intervals: whether intervals are wide enough, and no wider.
#![allow(dead_code, reason = "each user takes its own part")]

use mapper_core::confidence_interval_95;

/// Errors of one quantity and their stated 95 % intervals.
#[derive(Debug, Default)]
pub struct Honesty {
    errors: Vec<f64>,
    /// Half widths as standard errors.
    stated: Vec<f64>,
    held: usize,
}

impl Honesty {
    /// Adds an estimate with its interval and the truth.
    #[track_caller]
    pub fn add(&mut self, value: Option<f64>, low: Option<f64>, high: Option<f64>, truth: f64) {
        let (value, low, high) = (value.unwrap(), low.unwrap(), high.unwrap());
        let (unit_low, unit_high) = confidence_interval_95(0.0, 1.0);
        self.errors.push(value - truth);
        self.stated.push((high - low) / (unit_high - unit_low));
        self.held += usize::from(low <= truth && truth <= high);
    }

    /// Share of the 95 % intervals that cover the truth.
    pub fn held(&self) -> f64 {
        self.held as f64 / self.errors.len() as f64
    }

    /// Share of the errors within one standard error: 68 % of normal ones. Intervals twice too wide make it 95 %, which [`Honesty::held`]
    /// cannot resolve.
    pub fn within_one(&self) -> f64 {
        let within = self.errors.iter().zip(&self.stated).filter(|(error, stated)| error.abs() <= **stated);
        within.count() as f64 / self.errors.len() as f64
    }

    /// Root mean square of the stated standard errors; unit of the quantity.
    pub fn stated_rms(&self) -> f64 {
        (self.stated.iter().map(|stated| stated * stated).sum::<f64>() / self.stated.len() as f64).sqrt()
    }

    /// Ratio of stated to actual standard errors, both as root mean squares: 1 if intervals have the right width.
    pub fn width(&self) -> f64 {
        let square = |values: &[f64]| values.iter().map(|value| value * value).sum::<f64>();
        (square(&self.stated) / square(&self.errors)).sqrt()
    }
}

//! Errors beside what was said of them: whether intervals are as wide as they have to be, and no wider.
#![allow(dead_code, reason = "each user takes its own part")]

use mapper_core::confidence_interval_95;

/// Errors of one quantity and the 95 % intervals that were given with it.
#[derive(Debug, Default)]
pub struct Honesty {
    errors: Vec<f64>,
    /// Half widths as standard errors.
    said: Vec<f64>,
    held: usize,
}

impl Honesty {
    /// Adds an estimate with its interval, beside the truth.
    #[track_caller]
    pub fn add(&mut self, value: Option<f64>, low: Option<f64>, high: Option<f64>, truth: f64) {
        let (value, low, high) = (value.unwrap(), low.unwrap(), high.unwrap());
        let (unit_low, unit_high) = confidence_interval_95(0.0, 1.0);
        self.errors.push(value - truth);
        self.said.push((high - low) / (unit_high - unit_low));
        self.held += usize::from(low <= truth && truth <= high);
    }

    /// Share of the 95 % intervals that hold the truth.
    pub fn held(&self) -> f64 {
        self.held as f64 / self.errors.len() as f64
    }

    /// Share of the errors within one standard error: 68 % of normal ones. Intervals twice as wide as they have to be
    /// make it 95 %, where [`Honesty::held`] has no room to show it.
    pub fn within_one(&self) -> f64 {
        let within = self.errors.iter().zip(&self.said).filter(|(error, said)| error.abs() <= **said);
        within.count() as f64 / self.errors.len() as f64
    }

    /// Root mean square of the standard errors as said; unit of the quantity.
    pub fn said_rms(&self) -> f64 {
        (self.said.iter().map(|said| said * said).sum::<f64>() / self.said.len() as f64).sqrt()
    }

    /// Standard errors as said over errors as found, both as root mean squares: 1 where intervals are as wide as they
    /// have to be.
    pub fn width(&self) -> f64 {
        let square = |values: &[f64]| values.iter().map(|value| value * value).sum::<f64>();
        (square(&self.said) / square(&self.errors)).sqrt()
    }
}

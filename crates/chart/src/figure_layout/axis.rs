//! An axis as the caller describes it.

/// Title with unit, and the range if it does not follow the data.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Axis {
    /// Title; say the unit in it, e.g. `corrected mass flow, kg/s`.
    pub title: String,
    /// Lower end, in the axis' unit; `None` follows the data.
    pub low: Option<f64>,
    /// Upper end, in the axis' unit; `None` follows the data.
    pub high: Option<f64>,
    /// Factor from the drawn values to the numbers at the axis, if the title has another unit; `None` for 1.
    pub written_times: Option<f64>,
    /// Ticks with their labels instead of round numbers, e.g. names of cases.
    pub ticks: Option<Vec<(f64, String)>>,
}

impl Axis {
    /// An axis that follows the data.
    pub fn new(title: impl Into<String>) -> Self {
        Axis { title: title.into(), ..Axis::default() }
    }

    /// Fixes both ends, in the axis' unit. An end that is NaN or infinite follows the data.
    pub fn range(mut self, low: f64, high: f64) -> Self {
        (self.low, self.high) = (Some(low), Some(high));
        self
    }

    /// Fixes the lower end alone, in the axis' unit.
    pub fn from(mut self, low: f64) -> Self {
        self.low = Some(low);
        self
    }

    /// Writes values times `factor` at the axis. One that is not above 0 and finite counts as 1.
    pub fn written_times(mut self, factor: f64) -> Self {
        self.written_times = Some(factor);
        self
    }

    /// Sets ticks by hand.
    pub fn ticks(mut self, ticks: Vec<(f64, String)>) -> Self {
        self.ticks = Some(ticks);
        self
    }
}

//! Settings of an axis.

/// Settings of an axis; without a range it follows the data.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Axis {
    /// Title with the unit, e.g. `corrected mass flow, kg/s`.
    pub title: String,
    /// Lower end, in the axis' unit; `None` follows the data.
    pub low: Option<f64>,
    /// Upper end, in the axis' unit; `None` follows the data.
    pub high: Option<f64>,
    /// Factor from the values of the data to the numbers of the tick labels, if the title has another unit; `None` for 1.
    pub written_times: Option<f64>,
    /// Ticks with labels, instead of round numbers, e.g. names of cases.
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

    /// Fixes the lower end only, in the axis' unit.
    pub fn from(mut self, low: f64) -> Self {
        self.low = Some(low);
        self
    }

    /// Multiplies the numbers of the tick labels by `factor`. A factor that is not positive and finite counts as 1.
    pub fn written_times(mut self, factor: f64) -> Self {
        self.written_times = Some(factor);
        self
    }

    /// Sets the ticks with their labels.
    pub fn ticks(mut self, ticks: Vec<(f64, String)>) -> Self {
        self.ticks = Some(ticks);
        self
    }
}

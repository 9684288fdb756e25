//! The rows of one balance, and the columns of all parameters that affect them.

use crate::faults::readings::{CHANNELS, PerChannel, Readings};
use mapper_inference::hypotheses::Balance;
use mapper_observe::sensor_fault::SensorFault;
use nalgebra::{DMatrix, DVector};

/// A balance of the recording.
#[derive(Debug, Clone)]
pub(crate) struct Rows {
    /// Residuals: measured minus expected.
    pub(crate) residual: Vec<f64>,
    /// Their covariance from noise and from the declared uncertainty of the law behind the balance.
    pub(crate) covariance: DMatrix<f64>,
    /// Readings behind each row.
    pub(crate) readings: Vec<Readings>,
    /// Derivatives of each residual by the readings.
    pub(crate) by_reading: Vec<PerChannel>,
    /// Effect of a machine of another scale on each residual; empty if no machine is declared.
    pub(crate) by_machine: Vec<(Machine, Vec<f64>)>,
}

/// Machine properties that may differ from the declaration.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Machine {
    /// Flow of the compressor map, all over.
    FlowCapacity,
    /// Efficiency of the compressor map, all over.
    Efficiency,
    /// Area of the back-pressure valve.
    ValveArea,
}

/// All of them, in the order of the parameters.
pub(crate) const MACHINE: [Machine; 3] = [Machine::FlowCapacity, Machine::Efficiency, Machine::ValveArea];

impl Rows {
    /// Effect of a reading error on each row. `error`: of a channel's reading.
    fn column(&self, error: impl Fn(usize, &Readings) -> f64) -> DVector<f64> {
        let rows = self.readings.iter().zip(&self.by_reading);
        DVector::from_iterator(
            self.residual.len(),
            rows.map(|(readings, by)| {
                (0..CHANNELS.len())
                    .filter(|channel| by[*channel] != 0.0)
                    .map(|channel| by[channel] * error(channel, readings))
                    .sum()
            }),
        )
    }

    /// The balance with one column for each parameter: declared offsets and gains of [`CHANNELS`], these faults, [`MACHINE`].
    pub(crate) fn balance(&self, faults: &[SensorFault]) -> Balance {
        let offsets =
            (0..CHANNELS.len()).map(|channel| self.column(|other, _| f64::from(u8::from(other == channel))));
        let gains = (0..CHANNELS.len()).map(|channel| {
            self.column(|other, readings| if other == channel { readings.values[channel] } else { 0.0 })
        });
        let faults = faults.iter().map(|fault| {
            self.column(|channel, readings| {
                fault.error_per_unit(CHANNELS[channel], readings.values[channel], readings.run_ratio)
            })
        });
        let machine = MACHINE.iter().map(|machine| {
            let own = self.by_machine.iter().find(|(own, _)| own == machine);
            own.map_or_else(
                || DVector::zeros(self.residual.len()),
                |(_, column)| DVector::from_column_slice(column),
            )
        });
        let columns: Vec<DVector<f64>> = offsets.chain(gains).chain(faults).chain(machine).collect();
        Balance {
            residual: DVector::from_column_slice(&self.residual),
            covariance: self.covariance.clone(),
            columns: DMatrix::from_columns(&columns),
        }
    }
}

/// `column columnᵀ`, scaled: the covariance of an error of one size in all rows.
pub(crate) fn common(column: &[f64], sigma: f64) -> DMatrix<f64> {
    DMatrix::from_fn(column.len(), column.len(), |i, j| sigma * sigma * column[i] * column[j])
}

/// The covariance of errors that no two rows share.
pub(crate) fn own(sigmas: impl ExactSizeIterator<Item = f64>) -> DMatrix<f64> {
    DMatrix::from_diagonal(&DVector::from_iterator(sigmas.len(), sigmas.map(|sigma| sigma * sigma)))
}

/// Standard errors of rows from the noise of the readings and from each row's own error.
pub(crate) fn errors(by_reading: &[PerChannel], noise: &PerChannel, rest: f64) -> Vec<f64> {
    let of = |by: &PerChannel| by.iter().zip(noise).map(|(by, sigma)| (by * sigma).powi(2)).sum::<f64>();
    by_reading.iter().map(|by| (of(by) + rest * rest).sqrt()).collect()
}

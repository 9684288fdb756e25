//! The rows of one balance, and the columns of all parameters that affect them.

use crate::faults::end_readings::{CHANNELS, PerChannel, Readings};
use crate::faults::found_fault::{Machine, Suspect};
use mapper_core::{Channel, FaultKind};
use mapper_inference::hypotheses::Balance;
use mapper_physics::rig::sensor_fault::SensorFault;
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
    /// Effect of a machine of another scale or of a valve with play on each residual.
    pub(crate) by_machine: Vec<(Machine, Vec<f64>)>,
    /// Effects of faults of size 1 on each residual that differ from those of a constant error of the same size.
    pub(crate) by_fault: Vec<(Channel, FaultKind, Vec<f64>)>,
}

impl Rows {
    /// Effect of a fault of size 1 on each row.
    pub(crate) fn by_fault(&self, fault: &SensorFault) -> DVector<f64> {
        let own = |channel: Channel| {
            self.by_fault.iter().find(|(of, kind, _)| *of == channel && *kind == fault.kind)
        };
        let general = self.column(|channel, readings| {
            if own(CHANNELS[channel]).is_some() {
                return 0.0;
            }
            let housing_k = readings.tc_k();
            let Readings { values, run_ratio, exact_at, .. } = readings;
            fault.error_per_unit(CHANNELS[channel], values[channel], housing_k, *run_ratio, *exact_at)
        });
        fault
            .channels
            .iter()
            .filter_map(|channel| own(*channel))
            .fold(general, |sum, (_, _, effect)| sum + DVector::from_column_slice(effect))
    }

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

    /// The balance with one column for each parameter: declared offsets and gains of [`CHANNELS`], the barometer, the suspects.
    pub(crate) fn balance(&self, suspects: &[Suspect]) -> Balance {
        let offsets =
            (0..CHANNELS.len()).map(|channel| self.column(|other, _| f64::from(u8::from(other == channel))));
        let gains = (0..CHANNELS.len()).map(|channel| {
            let error = |readings: &Readings| {
                readings.exact_at.gain_error(CHANNELS[channel], readings.values[channel])
            };
            self.column(|other, readings| if other == channel { error(readings) } else { 0.0 })
        });
        let pressure = |channel: usize| matches!(CHANNELS[channel], Channel::P1 | Channel::P2);
        let barometer = self.column(|channel, _| f64::from(u8::from(pressure(channel))));
        let by_suspect = suspects.iter().map(|suspect| match suspect {
            Suspect::Sensor(fault) => self.by_fault(fault),
            Suspect::Unmodelled(_) => DVector::zeros(self.residual.len()),
            Suspect::Machine(machine) => {
                let own = self.by_machine.iter().find(|(own, _)| own == machine);
                own.map_or_else(
                    || DVector::zeros(self.residual.len()),
                    |(_, column)| DVector::from_column_slice(column),
                )
            }
        });
        let columns: Vec<DVector<f64>> = offsets.chain(gains).chain([barometer]).chain(by_suspect).collect();
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

//! Compares the common reading of a zero with the cell's thermometer and barometer: an error that all sensors share is invisible to the zero.

use crate::IdentifyConfig;
use mapper_core::{Channel, Dimension, Recording, is_reading};
use mapper_numerics::statistics::{EXCLUDE_SIGMAS, mean};
use serde::{Deserialize, Serialize};

/// Uncertainty of a cell's temperature at the machine by a thermometer without a declared offset, K. Source: class B of IEC 60751 and the
/// stratification of a closed cell.
const CELL_SIGMA_K: f64 = 0.5;
/// Uncertainty of a declared barometer reading at the time of the zero, Pa. Bound: a reading in tenths of a kPa, and the weather of a few
/// hours.
const BAROMETER_SIGMA_PA: f64 = 150.0;
/// Standard deviation over the half width of a rectangular distribution. Source: GUM 4.3.7, 1/sqrt(3).
const RECTANGULAR: f64 = 0.577_350_269_189_625_8;

/// A comparison of the sensors' common reading with an instrument of the cell.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CellReference {
    /// Whether temperatures or pressures are compared.
    pub dimension: Dimension,
    /// Common reading of the sensors, K or Pa.
    pub reading: f64,
    /// Reading of the cell's instrument, K or Pa.
    pub reference: f64,
    /// Expected standard deviation of their difference, K or Pa.
    pub sigma: f64,
    /// Correction that was added to every offset, K or Pa: 0 if they contradict each other.
    pub correction: f64,
    /// Remaining standard deviation of the common error, K or Pa.
    pub common_sigma: f64,
}

impl CellReference {
    /// The difference of the sensors from the cell's instrument, if it exceeds the declared uncertainties, K or Pa.
    pub fn contradiction(&self) -> Option<f64> {
        let off = self.reading - self.reference;
        (off.abs() > EXCLUDE_SIGMAS * self.sigma).then_some(off)
    }
}

/// Reading of the cell's thermometer or barometer, and its standard deviation; `None` if there is none.
pub(crate) fn cell_reading(
    recording: &Recording,
    config: &IdentifyConfig,
    (start_s, end_s): (f64, f64),
    dimension: Dimension,
) -> Option<(f64, f64)> {
    if dimension == Dimension::Pressure {
        return Some((config.barometer_pa?, BAROMETER_SIGMA_PA));
    }
    let values = recording.series.get(&Channel::TAmb)?.slice(start_s, end_s).1;
    let usable = values.iter().copied().filter(|value| is_reading(Channel::TAmb, *value));
    let declared = config.sensor(Channel::TAmb).offset_sigma;
    Some((mean(usable)?, if declared > 0.0 { declared } else { CELL_SIGMA_K }))
}

/// Compares the common reading `common` of a group with the instrument of the cell; `None` if there is none. `used`: segment of the soak, s. `sigma`:
/// standard deviation of the common reading.
pub(crate) fn compare(
    recording: &Recording,
    config: &IdentifyConfig,
    span_s: (f64, f64),
    first: Channel,
    common: f64,
    sigma: f64,
) -> Option<CellReference> {
    let dimension = first.info().dimension;
    let (reference, reference_sigma) = cell_reading(recording, config, span_s, dimension)?;
    // Gauge pressures contain the barometer's own error.
    let own = if dimension == Dimension::Pressure { sigma.hypot(config.barometer_sigma_pa) } else { sigma };
    let off = common - reference;
    let expected = own.hypot(reference_sigma);
    let agrees = off.abs() <= EXCLUDE_SIGMAS * expected;
    Some(CellReference {
        dimension,
        reading: common,
        reference,
        sigma: expected,
        // The mean of both readings, weighted by their variances. If they contradict each other, the true value may lie anywhere between them.
        correction: if agrees { off * (sigma / expected).powi(2) } else { 0.0 },
        common_sigma: if agrees {
            sigma * (1.0 - (sigma / expected).powi(2)).max(0.0).sqrt()
        } else {
            sigma.hypot(RECTANGULAR * off)
        },
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn compared(barometer_pa: f64) -> CellReference {
        let config = IdentifyConfig { barometer_pa: Some(barometer_pa), ..IdentifyConfig::default() };
        compare(&Recording::default(), &config, (0.0, 60.0), Channel::P1, 102_000.0, 45.0).unwrap()
    }

    /// Two readings of one pressure: the mean of smallest variance, and its standard deviation (GUM H.2).
    #[test]
    fn a_barometer_that_agrees_corrects_by_its_weight() {
        let found = compared(102_100.0);
        assert_eq!(found.contradiction(), None);
        let weights = [45.0f64.powi(-2), BAROMETER_SIGMA_PA.powi(-2)];
        let best_pa = (weights[0] * 102_000.0 + weights[1] * 102_100.0) / (weights[0] + weights[1]);
        assert!((102_000.0 - found.correction - best_pa).abs() < 1e-6, "{found:?}");
        assert!((found.common_sigma - (weights[0] + weights[1]).sqrt().recip()).abs() < 1e-9);
    }

    /// Both sensors 2 kPa off: named, not corrected, and the interval of 95 % contains the declared barometer.
    #[test]
    fn a_barometer_that_contradicts_is_in_the_interval() {
        let found = compared(100_000.0);
        assert_eq!(found.contradiction(), Some(2000.0));
        assert_eq!(found.correction, 0.0);
        assert!(1.96 * found.common_sigma >= 2000.0, "{found:?}");
    }
}

//! The band of normal values of a metric. Robust statistics prevent one unusual night from widening it.

use mapper_numerics::statistics::{median, robust_sigma};
use serde::Serialize;

/// Half width of the band, robust standard deviations.
const WIDTH_SIGMAS: f64 = 4.0;

/// Minimum half width of a band.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Floor {
    /// In the unit of the metric.
    Absolute(f64),
    /// As a ratio of the absolute value of the median.
    Relative(f64),
}

/// The range of normal values.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Band {
    /// Median of the nights.
    pub median: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
    /// Number of nights that it is based on.
    pub nights: usize,
}

impl Band {
    /// The median -/+ 4 robust standard deviations (from the median absolute deviation), or -/+ the floor if that is wider. Values that are not
    /// finite are ignored. `None` without values.
    pub fn of(values: &[f64], floor: Floor) -> Option<Band> {
        let values: Vec<f64> = values.iter().copied().filter(|value| value.is_finite()).collect();
        let median = median(&values)?;
        let sigma = robust_sigma(values.iter().map(|value| value - median))?;
        let min_half_width = match floor {
            Floor::Absolute(half_width) => half_width,
            Floor::Relative(ratio) => ratio * median.abs(),
        };
        let half_width = (WIDTH_SIGMAS * sigma).max(min_half_width);
        Some(Band { median, low: median - half_width, high: median + half_width, nights: values.len() })
    }

    /// Whether the band contains a value, ends included.
    pub fn contains(&self, value: f64) -> bool {
        (self.low..=self.high).contains(&value)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_nights_give_the_floor() {
        let band = Band::of(&[0.7; 14], Floor::Absolute(5e-4)).unwrap();
        assert!(band.contains(0.7004) && !band.contains(0.702) && !band.contains(0.698));
        assert_eq!(band.nights, 14);
        let band = Band::of(&[-200.0], Floor::Relative(0.01)).unwrap();
        assert!(band.contains(-201.9) && !band.contains(-202.1));
    }

    #[test]
    fn one_odd_night_does_not_widen_the_band() {
        // Normal scatter 0.01; scipy.stats.median_abs_deviation([...]) of these is 0.01.
        let quiet = [0.98, 0.99, 1.0, 1.01, 1.02, 1.0, 0.99];
        let mut odd = quiet.to_vec();
        odd.push(50.0);
        let (quiet, odd) =
            (Band::of(&quiet, Floor::Absolute(0.0)).unwrap(), Band::of(&odd, Floor::Absolute(0.0)).unwrap());
        assert!(odd.high - odd.low < 1.5 * (quiet.high - quiet.low), "{odd:?} {quiet:?}");
        assert!(!odd.contains(1.2));
    }

    #[test]
    fn nothing_gives_nothing() {
        assert_eq!(Band::of(&[], Floor::Absolute(1.0)), None);
        assert_eq!(Band::of(&[f64::NAN], Floor::Absolute(1.0)), None);
    }
}

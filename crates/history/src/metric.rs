//! The figures of a run that are compared, and the band of what is usual.

use mapper_numerics::statistics::{median, robust_sigma};
use serde::{Deserialize, Serialize};

/// Declares the metrics with their names, their descriptions for users, their display units with the factor from the stored value, and the
/// minimum half widths of their bands.
macro_rules! metrics {
    ($($(#[doc = $doc:literal])* $metric:ident $name:literal $description:literal $unit:literal $factor:literal $floor:ident $half_width:literal,)*) => {
        /// A metric of a run. Efficiencies are fractions.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
        #[serde(rename_all = "snake_case")]
        pub enum Metric {
            $($(#[doc = $doc])* $metric,)*
        }

        impl Metric {
            /// All of them, in the order in which they are shown.
            pub const ALL: [Metric; 11] = [$(Metric::$metric),*];

            /// Name on the command line, in JSON, and of the column in the file.
            pub fn name(self) -> &'static str {
                match self {
                    $(Metric::$metric => $name,)*
                }
            }

            /// Description for users.
            pub fn description(self) -> &'static str {
                match self {
                    $(Metric::$metric => $description,)*
                }
            }

            /// Display unit, and the factor from the stored value to it.
            pub fn display_unit(self) -> (&'static str, f64) {
                match self {
                    $(Metric::$metric => ($unit, $factor),)*
                }
            }

            /// Minimum half width of its band.
            ///
            /// Because seeds are fixed, an unchanged program repeats its results exactly and the scatter of the nights is 0; the floor then
            /// decides. It is a quarter of the smallest change that must be detected (0.2 points of efficiency), and far above the rounding
            /// differences of another compiler (1e-9).
            pub fn floor(self) -> Floor {
                match self {
                    $(Metric::$metric => Floor::$floor($half_width),)*
                }
            }
        }
    };
}

metrics! {
    /// Points with the verdict `good`.
    GoodPoints "good_points" "points that are good" "points" 1.0 Absolute 0.5,
    /// Mean identified efficiency, fraction.
    EtaMean "eta_mean" "mean efficiency" "%" 100.0 Absolute 5e-4,
    /// Mean true efficiency, fraction.
    EtaTrueMean "eta_true_mean" "mean true efficiency" "%" 100.0 Absolute 5e-4,
    /// Median absolute error of the efficiency, fraction.
    EtaMedianError "eta_median_error" "median error of the efficiency" "%points" 100.0 Absolute 5e-4,
    /// Largest absolute error of the efficiency, fraction.
    EtaWorstError "eta_worst_error" "largest error of the efficiency" "%points" 100.0 Absolute 5e-4,
    /// Share of the points whose 95 % interval contains the true efficiency, ratio.
    EtaCoverage "eta_coverage" "intervals that contain the true efficiency" "%" 100.0 Absolute 0.02,
    /// Mean identified heat-transfer coefficient, W/(m2 K).
    HMean "h_mean" "mean heat-transfer coefficient" "W/(m2 K)" 1.0 Relative 2.5e-3,
    /// Mean true heat-transfer coefficient, W/(m2 K).
    HTrueMean "h_true_mean" "mean true heat-transfer coefficient" "W/(m2 K)" 1.0 Relative 2.5e-3,
    /// Median absolute relative error of the heat-transfer coefficient, ratio.
    HMedianError "h_median_error" "median error of the heat-transfer coefficient" "%" 100.0 Absolute 2.5e-3,
    /// Largest absolute relative error of the heat-transfer coefficient, ratio.
    HWorstError "h_worst_error" "largest error of the heat-transfer coefficient" "%" 100.0 Absolute 2.5e-3,
    /// Duration of the run in the rig's own time, minutes.
    RigMinutes "rig_minutes" "time on the rig" "min" 1.0 Relative 2.5e-3,
}

impl Metric {
    /// The metric of this name.
    pub fn find(name: &str) -> Option<Metric> {
        Metric::ALL.into_iter().find(|metric| metric.name() == name)
    }
}

impl std::fmt::Display for Metric {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

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

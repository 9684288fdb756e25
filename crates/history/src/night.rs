//! A night with its runs and points, the figures of a run and the quantities of a point that are compared, and the band of what is usual.

use mapper_numerics::statistics::{median, robust_sigma};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Identity of a run from night to night.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct RunKey {
    /// Name of the campaign.
    pub campaign: String,
    /// Name of the machine.
    pub machine: String,
    /// Method of identification.
    pub method: String,
    /// Seed of search and simulated rig.
    pub seed: u64,
}

impl std::fmt::Display for RunKey {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} {} {} seed {}", self.campaign, self.machine, self.method, self.seed)
    }
}

/// One identified point with its truth.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PointRow {
    /// Target speed, rpm.
    pub speed_rpm: f64,
    /// Valve opening relative to the nominal area.
    pub valve_opening_ratio: f64,
    /// Number of the visit to this point, from 0; repeats visit a point again.
    pub visit: usize,
    /// Identified efficiency, fraction.
    pub eta: Option<f64>,
    /// True efficiency, fraction.
    pub eta_true: Option<f64>,
    /// Identified heat-transfer coefficient, W/(m2 K).
    pub h_w_m2k: Option<f64>,
    /// True heat-transfer coefficient, W/(m2 K).
    pub h_true_w_m2k: Option<f64>,
}

impl PointRow {
    /// The point in words.
    pub fn label(&self) -> String {
        let visit = if self.visit == 0 { String::new() } else { format!(", visit {}", self.visit + 1) };
        let (krpm, valve) =
            ((self.speed_rpm / 10.0).round() / 100.0, (1e3 * self.valve_opening_ratio).round() / 10.0);
        format!("{krpm} krpm, valve area {valve} %{visit}")
    }
}

/// One run of a night.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RunRow {
    /// Which run.
    #[serde(flatten)]
    pub key: RunKey,
    /// SHA-256 of the campaign as parsed; empty if the run failed before.
    pub campaign_sha256: String,
    /// SHA-256 of the nominal model; empty if the run failed before.
    pub model_sha256: String,
    /// Why the run failed; `None` if it did not.
    pub failure: Option<String>,
    /// Its metrics.
    pub figures: BTreeMap<Metric, f64>,
    /// Its points.
    pub points: Vec<PointRow>,
}

/// All runs of one night.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Night {
    /// Name of the nightly campaign; nights of other names are never compared.
    pub name: String,
    /// Start, ms since 1970-01-01 00:00 UTC.
    pub started_ms: i64,
    /// Wall-clock duration, s.
    pub duration_s: f64,
    /// Program and version.
    pub program: String,
    /// Whether the changes of tonight are accepted: this night starts a new band.
    pub accepted: bool,
    /// The runs.
    pub runs: Vec<RunRow>,
}

/// One quantity of a point: values and errors, because a changed model shifts truth and result equally.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum PointQuantity {
    /// True efficiency, fraction.
    EtaTrue,
    /// Identified efficiency, fraction.
    Eta,
    /// Identified minus true efficiency, fraction.
    EtaError,
    /// True heat-transfer coefficient, W/(m2 K).
    HTrue,
    /// Identified heat-transfer coefficient, W/(m2 K).
    H,
    /// Identified over true heat-transfer coefficient, minus one, ratio.
    HError,
}

impl PointQuantity {
    /// All of them.
    pub const ALL: [PointQuantity; 6] = [
        PointQuantity::EtaTrue,
        PointQuantity::Eta,
        PointQuantity::EtaError,
        PointQuantity::HTrue,
        PointQuantity::H,
        PointQuantity::HError,
    ];

    /// Value at a point; `None` if the point has none.
    pub fn of(self, point: &PointRow) -> Option<f64> {
        match self {
            PointQuantity::EtaTrue => point.eta_true,
            PointQuantity::Eta => point.eta,
            PointQuantity::EtaError => Some(point.eta? - point.eta_true?),
            PointQuantity::HTrue => point.h_true_w_m2k,
            PointQuantity::H => point.h_w_m2k,
            PointQuantity::HError => Some(point.h_w_m2k? / point.h_true_w_m2k? - 1.0),
        }
        .filter(|value| value.is_finite())
    }

    /// Name for users.
    pub fn words(self) -> &'static str {
        match self {
            PointQuantity::EtaTrue => "true efficiency",
            PointQuantity::Eta => "identified efficiency",
            PointQuantity::EtaError => "error of the efficiency",
            PointQuantity::HTrue => "true h",
            PointQuantity::H => "identified h",
            PointQuantity::HError => "error of h",
        }
    }

    /// Minimum half width of the band; see [`crate::Metric::floor`].
    pub fn floor(self) -> Floor {
        match self {
            PointQuantity::EtaTrue | PointQuantity::Eta | PointQuantity::EtaError => Floor::Absolute(5e-4),
            // h reacts to small changes of any input; only a change of one per cent matters.
            PointQuantity::HTrue | PointQuantity::H => Floor::Relative(0.01),
            PointQuantity::HError => Floor::Absolute(0.01),
        }
    }

    /// Formats a shift: in points for efficiencies, in per cent of `level` for h.
    pub fn format_shift(self, shift: f64, level: f64) -> String {
        match self {
            PointQuantity::EtaTrue | PointQuantity::Eta | PointQuantity::EtaError => {
                format!("{:+.2} points", 100.0 * shift)
            }
            PointQuantity::HTrue | PointQuantity::H => format!("{:+.2} %", 100.0 * shift / level),
            PointQuantity::HError => format!("{:+.2} %", 100.0 * shift),
        }
    }
}

/// Declares the metrics: names, descriptions, display units with their factor, and the minimum half widths of their bands.
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
    EtaMedianError "eta_median_error" "median error of the efficiency" "points" 100.0 Absolute 5e-4,
    /// Largest absolute error of the efficiency, fraction.
    EtaWorstError "eta_worst_error" "largest error of the efficiency" "points" 100.0 Absolute 5e-4,
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
    /// The median -/+ 4 robust standard deviations, or -/+ the floor if that is wider; of finite values. `None` without any.
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

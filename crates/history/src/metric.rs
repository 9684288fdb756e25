//! The metrics of a run that are stored and compared.

use crate::Floor;
use serde::{Deserialize, Serialize};

/// A metric of a run. Efficiencies are fractions.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Metric {
    /// Points with the verdict `good`.
    GoodPoints,
    /// Mean identified efficiency, fraction.
    EtaMean,
    /// Mean true efficiency, fraction.
    EtaTrueMean,
    /// Median absolute error of the efficiency, fraction.
    EtaMedianError,
    /// Largest absolute error of the efficiency, fraction.
    EtaWorstError,
    /// Share of the points whose 95 % interval contains the true efficiency, ratio.
    EtaCoverage,
    /// Mean identified heat-transfer coefficient, W/(m2 K).
    HMean,
    /// Mean true heat-transfer coefficient, W/(m2 K).
    HTrueMean,
    /// Median absolute relative error of the heat-transfer coefficient, ratio.
    HMedianError,
    /// Largest absolute relative error of the heat-transfer coefficient, ratio.
    HWorstError,
    /// Duration of the run in the rig's own time, minutes.
    RigMinutes,
}

impl Metric {
    /// All of them, in the order in which they are shown.
    pub const ALL: [Metric; 11] = [
        Metric::GoodPoints,
        Metric::EtaMean,
        Metric::EtaTrueMean,
        Metric::EtaMedianError,
        Metric::EtaWorstError,
        Metric::EtaCoverage,
        Metric::HMean,
        Metric::HTrueMean,
        Metric::HMedianError,
        Metric::HWorstError,
        Metric::RigMinutes,
    ];

    /// Name on the command line, in JSON, and of the column in the file.
    pub fn name(self) -> &'static str {
        match self {
            Metric::GoodPoints => "good_points",
            Metric::EtaMean => "eta_mean",
            Metric::EtaTrueMean => "eta_true_mean",
            Metric::EtaMedianError => "eta_median_error",
            Metric::EtaWorstError => "eta_worst_error",
            Metric::EtaCoverage => "eta_coverage",
            Metric::HMean => "h_mean",
            Metric::HTrueMean => "h_true_mean",
            Metric::HMedianError => "h_median_error",
            Metric::HWorstError => "h_worst_error",
            Metric::RigMinutes => "rig_minutes",
        }
    }

    /// Description for users.
    pub fn description(self) -> &'static str {
        match self {
            Metric::GoodPoints => "points that are good",
            Metric::EtaMean => "mean efficiency",
            Metric::EtaTrueMean => "mean true efficiency",
            Metric::EtaMedianError => "median error of the efficiency",
            Metric::EtaWorstError => "largest error of the efficiency",
            Metric::EtaCoverage => "intervals that contain the true efficiency",
            Metric::HMean => "mean heat-transfer coefficient",
            Metric::HTrueMean => "mean true heat-transfer coefficient",
            Metric::HMedianError => "median error of the heat-transfer coefficient",
            Metric::HWorstError => "largest error of the heat-transfer coefficient",
            Metric::RigMinutes => "time on the rig",
        }
    }

    /// The metric of this name.
    pub fn find(name: &str) -> Option<Metric> {
        Metric::ALL.into_iter().find(|metric| metric.name() == name)
    }

    /// Display unit, and the factor from the stored value to it.
    pub fn display_unit(self) -> (&'static str, f64) {
        match self {
            Metric::GoodPoints => ("points", 1.0),
            Metric::EtaMean | Metric::EtaTrueMean | Metric::EtaCoverage => ("%", 100.0),
            Metric::EtaMedianError | Metric::EtaWorstError => ("%points", 100.0),
            Metric::HMean | Metric::HTrueMean => ("W/(m2 K)", 1.0),
            Metric::HMedianError | Metric::HWorstError => ("%", 100.0),
            Metric::RigMinutes => ("min", 1.0),
        }
    }

    /// Minimum half width of its band.
    ///
    /// Because seeds are fixed, an unchanged program repeats its results exactly and the scatter of the nights is 0; the floor then decides. It is
    /// a quarter of the smallest change that must be detected (0.2 points of efficiency), and far above the rounding differences of another
    /// compiler (1e-9).
    pub fn floor(self) -> Floor {
        match self {
            Metric::GoodPoints => Floor::Absolute(0.5),
            Metric::EtaMean | Metric::EtaTrueMean | Metric::EtaMedianError | Metric::EtaWorstError => {
                Floor::Absolute(5e-4)
            }
            Metric::EtaCoverage => Floor::Absolute(0.02),
            Metric::HMean | Metric::HTrueMean => Floor::Relative(2.5e-3),
            Metric::HMedianError | Metric::HWorstError => Floor::Absolute(2.5e-3),
            Metric::RigMinutes => Floor::Relative(2.5e-3),
        }
    }
}

impl std::fmt::Display for Metric {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

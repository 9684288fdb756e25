//! The metrics of a run that are stored and compared.

use crate::Floor;
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

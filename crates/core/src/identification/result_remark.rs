//! Remarks on the results of an identification.

use crate::coded_enum::coded_enum;
use crate::{Channel, Method};

coded_enum! {
/// A remark on the results as a whole, by its stable code. `reason` is the message of the underlying error.
ResultRemark {
    /// A recording could be read in parts only; `file` is given if there are several.
    "recording_incomplete" RecordingIncomplete { file: Option<String>, reason: String },
    /// Channels of the usual method are missing, so that the efficiencies are those of conventional mapping.
    "conventional_mapping" ConventionalMapping { usual: Method, missing: Vec<Channel> },
    /// Parameters of `joint` keep their declared values; the result depends on them.
    "held_fixed" HeldFixed { parameters: Vec<String> },
    /// Gauge pressures are added to an ambient pressure that was not measured.
    "unknown_ambient_pressure" UnknownAmbientPressure { pressure_pa: f64, sigma_pa: f64 },
    /// The recording starts with the machine at rest, and the campaign does not use this as a zero.
    "unused_rest" UnusedRest { start_s: f64, end_s: f64 },
    /// The points are corrected for a cause that the diagnosis names.
    "corrected" Corrected { causes: Vec<String>, probability: f64 },
    /// The intervals contain what causes of a gap would change for which the points are not corrected; largest standard uncertainty of an
    /// efficiency.
    "widened_by_gap" WidenedByGap { causes: Vec<String>, largest_sigma: f64 },
    /// The drift of a sensor was subtracted.
    "drift_subtracted" DriftSubtracted { reason: String },
    /// No map can be made from the points.
    "no_map" NoMap { reason: String },
    /// The map has no fitted surface.
    "map_not_fitted" MapNotFitted { reason: String },
    /// A map format was not written.
    "format_not_written" FormatNotWritten { reason: String },
    /// Another run has no map to compare with.
    "nothing_to_compare" NothingToCompare { run: String },
}
}

impl ResultRemark {
    /// Whether all efficiencies depend on it, so that it is shown next to their verdict.
    pub fn concerns_all_points(&self) -> bool {
        use ResultRemark::{
            ConventionalMapping, Corrected, DriftSubtracted, HeldFixed, UnknownAmbientPressure, WidenedByGap,
        };
        matches!(
            self,
            ConventionalMapping { .. }
                | HeldFixed { .. }
                | UnknownAmbientPressure { .. }
                | Corrected { .. }
                | WidenedByGap { .. }
                | DriftSubtracted { .. }
        )
    }
}

//! Variation of efficiency over the map: the interface between a map's shape and users of its slope.

/// Efficiency as a smooth function of corrected speed and corrected flow.
///
/// A compressor's own map is one ([`CompressorCharacteristic`](crate::compressor_map::characteristic::CompressorCharacteristic) gives it
/// over pressure ratio); a surface through identified points is another. Users may use only differences, as the joint
/// identification does: it needs the change of efficiency while an operating point settles.
pub trait EfficiencyShape: std::fmt::Debug + Send + Sync {
    /// Isentropic efficiency, fraction, at a corrected shaft speed and a corrected flow, both in the implementor's reference
    /// state. Finite for every finite argument; outside the underlying points it is an extrapolation.
    fn efficiency(&self, speed_corrected_rpm: f64, flow_corrected_kg_s: f64) -> f64;
}

//! How efficiency varies over the map: the seam between whoever knows a map's shape and whoever needs its slope.

/// Efficiency as a smooth function of corrected speed and corrected flow.
///
/// A compressor's own map is one ([`CompressorCharacteristic`](crate::characteristic::CompressorCharacteristic) gives it
/// over pressure ratio); a surface through identified points is another. Users may take differences alone, as the joint
/// identification does: it needs to know how efficiency moves while an operating point settles.
pub trait EfficiencyShape: std::fmt::Debug + Send + Sync {
    /// Isentropic efficiency, fraction, at a corrected shaft speed and a corrected flow, both in the reference state that
    /// the implementor names. Finite for every finite argument; beyond the points it stems from it is an extrapolation.
    fn efficiency(&self, speed_corrected_rpm: f64, flow_corrected_kg_s: f64) -> f64;
}

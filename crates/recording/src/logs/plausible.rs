//! Plausible ranges of the channels: they reveal a wrong unit before anything is computed.

use mapper_core::{Channel, is_plausible_range};
use mapper_table::{kind_of, unit};
use mapper_yaml::units::{Kind, Unit};

/// Deepest gauge pressure, ratio to the ambient one. Bound: throttled inlets reach a half; below zero absolute nothing exists.
const MAX_SUCTION_RATIO: f64 = 0.7;

/// Share of the readings ignored at each end of the range. Bound: spikes and dropouts do not indicate a wrong unit.
pub(crate) const TRIMMED_SHARE: f64 = 0.02;

/// The standard atmosphere (ISO 2533), Pa. Source: the ambient pressure of a log that does not contain it.
pub(crate) const STANDARD_ATMOSPHERE_PA: f64 = 101_325.0;

/// Range of an ambient pressure, Pa. Bound: altitudes of up to 5 km, and the highest weather.
pub const AMBIENT_RANGE_PA: (f64, f64) = (5e4, 1.1e5);

/// Units that logs omit because their program or stand always uses them.
const USUAL_UNITS: [&str; 20] = [
    "K", "degC", "degF", "Pa", "kPa", "mbar", "bar", "psia", "inHg", "kgf/cm2", "rpm", "krpm", "kg/s", "g/s",
    "kg/h", "kg/min", "lb/min", "lb/s", "%", "1",
];

/// Units in which values from `low` to `high` would be plausible. `offset` is added to them: the ambient pressure in Pa for gauge
/// pressures, else 0.
pub fn fitting_units(channel: Channel, low: f64, high: f64, offset: f64) -> Vec<&'static Unit> {
    let kind = kind_of(channel);
    let usual = |unit: &&Unit| USUAL_UNITS.contains(&unit.symbol());
    let fitting = |unit: &&'static Unit| {
        is_plausible_range(channel, unit.to_inside(low) + offset, unit.to_inside(high) + offset)
    };
    let bare = unit(kind, "1").ok();
    kind.units().iter().chain(bare).filter(usual).filter(fitting).collect()
}

/// Whether pressures in this range (Pa) look like gauge readings: too low for absolute ones, and plausible after the ambient pressure
/// is added.
pub fn looks_like_gauge(channel: Channel, low_pa: f64, high_pa: f64) -> bool {
    /// An ambient pressure, Pa. Bound: only the size matters here.
    const AMBIENT_PA: f64 = 1e5;
    kind_of(channel) == Kind::Pressure
        && !is_plausible_range(channel, low_pa, high_pa)
        && is_plausible_range(channel, low_pa + AMBIENT_PA, high_pa + AMBIENT_PA)
        && low_pa > -MAX_SUCTION_RATIO * AMBIENT_PA
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_usual_mistakes_of_units_show() {
        // A car's compressor at 40 kg/h to 1100 kg/h taken for g/s and for kg/s.
        assert!(is_plausible_range(Channel::CompressorFlow, 0.011, 0.31));
        assert!(!is_plausible_range(Channel::CompressorFlow, 40.0, 1100.0));
        let symbols: Vec<_> = fitting_units(Channel::CompressorFlow, 40.0, 1100.0, 0.0)
            .iter()
            .map(|unit| unit.symbol())
            .collect();
        assert!(symbols.contains(&"kg/h") && !symbols.contains(&"kg/s"), "{symbols:?}");
        // degC taken for K, K for degC, rpm in thousands.
        assert!(
            !is_plausible_range(Channel::T1, 19.0, 25.0) && !is_plausible_range(Channel::T1, 565.0, 573.0)
        );
        assert!(
            !is_plausible_range(Channel::ShaftSpeed, 50.0, 150.0)
                && is_plausible_range(Channel::ShaftSpeed, 0.0, 1.5e5)
        );
        // A dead channel does not indicate a wrong unit.
        assert!(is_plausible_range(Channel::ShaftSpeed, 0.0, 0.0));
    }

    #[test]
    fn gauge_pressures_show_at_the_inlet() {
        assert!(looks_like_gauge(Channel::P1, -4e3, 400.0));
        assert!(!looks_like_gauge(Channel::P1, 9.7e4, 1.01e5));
        assert!(looks_like_gauge(Channel::P2, 9e3, 1.4e5));
    }
}

//! Whether the course of a column can be a channel's: a wrong unit shows before anything is computed.

use crate::logs::units::{kind_of, unit};
use mapper_core::{Channel, plausible};
use mapper_yaml::units::{Kind, Unit};

/// Share of a course left out at each end when its range is judged: spikes and dropouts.
pub(crate) const OUTER: f64 = 0.02;

/// The standard atmosphere (ISO 2533), Pa: the ambient pressure of a log that does not hold it.
pub(crate) const STANDARD_ATMOSPHERE_PA: f64 = 101_325.0;

/// Range of an ambient pressure, Pa.
pub const AMBIENT_PA: (f64, f64) = (5e4, 1.1e5);

/// Whether readings whose course lies between `low` and `high` (without its outermost twentieths) can be those of a channel.
pub fn fits(channel: Channel, low: f64, high: f64) -> bool {
    let running = plausible(channel).running;
    let (least, most) = (*running.start(), *running.end());
    match kind_of(channel) {
        // 0 at rest, but not all the time; a channel that is 0 throughout is dead, which is not a matter of units.
        Kind::Speed | Kind::MassFlow => high <= most && (high >= least || high == 0.0 && low == 0.0),
        _ => low >= least && high <= most,
    }
}

/// Units that logs leave out: those of their program or stand. Others are written down.
const UNWRITTEN: [&str; 15] = [
    "K", "degC", "Pa", "kPa", "mbar", "bar", "psia", "rpm", "krpm", "kg/s", "g/s", "kg/h", "lb/min", "%", "1",
];

/// Units in which values of this course would be plausible, `over` (0, or for gauge pressures the ambient pressure in Pa) added to
/// them.
pub fn fitting_units(channel: Channel, low: f64, high: f64, over: f64) -> Vec<&'static Unit> {
    let kind = kind_of(channel);
    let usual = |unit: &&Unit| UNWRITTEN.contains(&unit.symbol());
    let fitting =
        |unit: &&'static Unit| fits(channel, unit.to_inside(low) + over, unit.to_inside(high) + over);
    let bare = unit(kind, "1").ok();
    kind.units().iter().chain(bare).filter(usual).filter(fitting).collect()
}

/// Whether absolute pressures of this course (Pa) look like readings over the ambient pressure: too low for absolute ones,
/// and plausible once it is added.
pub fn looks_like_gauge(channel: Channel, low_pa: f64, high_pa: f64) -> bool {
    const AMBIENT: f64 = 1e5;
    kind_of(channel) == Kind::Pressure
        && !fits(channel, low_pa, high_pa)
        && fits(channel, low_pa + AMBIENT, high_pa + AMBIENT)
        && low_pa > -0.7 * AMBIENT
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_usual_mistakes_of_units_show() {
        // A car's compressor at 40 kg/h to 1100 kg/h taken for g/s and for kg/s.
        assert!(fits(Channel::CompressorFlow, 0.011, 0.31));
        assert!(!fits(Channel::CompressorFlow, 40.0, 1100.0));
        let symbols: Vec<_> = fitting_units(Channel::CompressorFlow, 40.0, 1100.0, 0.0)
            .iter()
            .map(|unit| unit.symbol())
            .collect();
        assert!(symbols.contains(&"kg/h") && !symbols.contains(&"kg/s"), "{symbols:?}");
        // degC taken for K, K for degC, rpm in thousands.
        assert!(!fits(Channel::T1, 19.0, 25.0) && !fits(Channel::T1, 565.0, 573.0));
        assert!(!fits(Channel::ShaftSpeed, 50.0, 150.0) && fits(Channel::ShaftSpeed, 0.0, 1.5e5));
        // A dead channel is not a matter of units.
        assert!(fits(Channel::ShaftSpeed, 0.0, 0.0));
    }

    #[test]
    fn gauge_pressures_show_at_the_inlet() {
        assert!(looks_like_gauge(Channel::P1, -4e3, 400.0));
        assert!(!looks_like_gauge(Channel::P1, 9.7e4, 1.01e5));
        assert!(looks_like_gauge(Channel::P2, 9e3, 1.4e5));
    }
}

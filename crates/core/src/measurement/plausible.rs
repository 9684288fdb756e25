//! Plausible readings of a turbocharger on a gas stand, in one table for all checks.

use crate::{Channel, Dimension};
use std::ops::RangeInclusive;

/// Plausible readings of a channel, in its unit.
#[derive(Debug, Clone, PartialEq)]
pub struct Plausible {
    /// Readings of a running machine, from a car's turbocharger (wheels of 30 mm) to a ship's (of 300 mm).
    pub running: RangeInclusive<f64>,
    /// Any single reading, including standstill, spikes and faults of the meter: a value outside is invalid.
    pub any: RangeInclusive<f64>,
}

/// The plausible readings of a channel.
///
/// | | running | why | any |
/// |---|---|---|---|
/// | shaft speed | 1e3..6e5 rpm | idle of the largest machines to a wheel of 20 mm at a tip speed of 630 m/s | 0..1e7 |
/// | flows | 1e-4..20 kg/s | leakage of a small machine at idle to engines of 10 MW | -100..100 |
/// | P1 | 30..600 kPa | absolute; throttled inlet at altitude to the outlet of an upstream stage | 100..1e9 |
/// | other pressures | 50 kPa..2 MPa | absolute; gauge readings at part load are lower; up to three stages of boost | 100..1e9 |
/// | relative humidity | 0..1.05 | saturated air, with the error of a hygrometer | any |
/// | T1, ambient, dew point | 220..390 K | arctic cell to the outlet of an upstream stage without a cooler | 100..3000 |
/// | T2 | 220..700 K | limit of compressor wheels | 100..3000 |
/// | compressor housing | 220..800 K | above the limit of aluminium | 100..3000 |
/// | oil, water | 220..480 K | oil burns above, and water boils at 18 bar | 100..3000 |
/// | turbine side | 220..1600 K | above the limit of turbine materials | 100..3000 |
pub fn plausible(channel: Channel) -> Plausible {
    let running = match channel {
        Channel::ShaftSpeed => 1e3..=6e5,
        Channel::CompressorFlow | Channel::TurbineFlow | Channel::OilFlow | Channel::WaterFlow => 1e-4..=20.0,
        Channel::P1 => 3e4..=6e5,
        Channel::P2 | Channel::P3 | Channel::P4 | Channel::P3Command => 5e4..=2e6,
        Channel::T1 | Channel::TAmb | Channel::DewPoint => 220.0..=390.0,
        Channel::T2 => 220.0..=700.0,
        Channel::Tc => 220.0..=800.0,
        Channel::T3 | Channel::T4 | Channel::Tt | Channel::T3Command => 220.0..=1600.0,
        Channel::TOil | Channel::TOilOut | Channel::TOilCommand | Channel::TWater | Channel::TWaterOut => {
            220.0..=480.0
        }
        Channel::ValveCommand => 0.0..=10.0,
        Channel::RelativeHumidity => 0.0..=1.05,
    };
    let any = match channel.info().dimension {
        Dimension::RotationalSpeed => 0.0..=1e7,
        Dimension::MassFlow => -100.0..=100.0,
        Dimension::Pressure => 100.0..=1e9,
        Dimension::Temperature => 100.0..=3000.0,
        Dimension::Ratio => f64::MIN..=f64::MAX,
    };
    Plausible { running, any }
}

/// Readings of a correctly wired and scaled sensor, standstill included, in the unit of the dimension. A value
/// outside means a wrong byte order, unit or scale, or a defective sensor. Narrower than [`Plausible::any`], which allows spikes; wider
/// than [`Plausible::running`], since a stand may be at rest.
pub fn measurable(dimension: Dimension) -> RangeInclusive<f64> {
    match dimension {
        // Noise around 0.
        Dimension::RotationalSpeed => -1e3..=1e6,
        Dimension::MassFlow => -1.0..=20.0,
        Dimension::Pressure => 1e3..=5e6,
        Dimension::Temperature => 200.0..=1600.0,
        Dimension::Ratio => -0.1..=10.0,
    }
}

//! The quantities of a table of points.

use mapper_yaml::units::Kind;

/// Quantities of a table of points.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// Corrected speed; the measured speed in a table of measured points.
    Speed,
    /// Speed over the root of T1.
    ReducedSpeed,
    /// Corrected flow; the measured flow in a table of measured points.
    Flow,
    /// Volume flow at the inlet, at the reference state.
    VolumeFlow,
    /// Flow times the root of T1 over P1.
    ReducedFlow,
    /// Total pressure ratio.
    PressureRatio,
    /// Isentropic efficiency.
    Efficiency,
    /// Position of a turbine's vanes.
    Vane,
    /// Measured inlet pressure.
    P1,
    /// Measured outlet pressure.
    P2,
    /// Measured inlet temperature.
    T1,
    /// Measured outlet temperature.
    T2,
    /// Temperature of the compressor housing.
    Tc,
    /// Humidity of the air: water per dry air, or relative.
    Humidity,
    /// Ambient pressure, the reference of gauge pressures.
    Ambient,
    /// Measured turbine inlet pressure.
    P3,
    /// Measured turbine outlet pressure.
    P4,
    /// Measured turbine inlet temperature.
    T3,
    /// Measured turbine outlet temperature.
    T4,
    /// Measured flow of the turbine, in a table that has the compressor's as well.
    TurbineFlow,
    /// Temperature of the oil that enters the bearing housing.
    Oil,
}

impl Quantity {
    /// Every quantity.
    pub(crate) const ALL: [Quantity; 21] = [
        Quantity::Speed,
        Quantity::ReducedSpeed,
        Quantity::Flow,
        Quantity::VolumeFlow,
        Quantity::ReducedFlow,
        Quantity::PressureRatio,
        Quantity::Efficiency,
        Quantity::Vane,
        Quantity::P1,
        Quantity::P2,
        Quantity::T1,
        Quantity::T2,
        Quantity::Tc,
        Quantity::Humidity,
        Quantity::Ambient,
        Quantity::P3,
        Quantity::P4,
        Quantity::T3,
        Quantity::T4,
        Quantity::TurbineFlow,
        Quantity::Oil,
    ];

    /// Its key in a map description.
    pub fn key(self) -> &'static str {
        match self {
            Quantity::Speed => "speed",
            Quantity::ReducedSpeed => "reduced_speed",
            Quantity::Flow => "flow",
            Quantity::VolumeFlow => "volume_flow",
            Quantity::ReducedFlow => "reduced_flow",
            Quantity::PressureRatio => "pressure_ratio",
            Quantity::Efficiency => "efficiency",
            Quantity::Vane => "vane",
            Quantity::P1 => "p1",
            Quantity::P2 => "p2",
            Quantity::T1 => "t1",
            Quantity::T2 => "t2",
            Quantity::Tc => "tc",
            Quantity::Humidity => "humidity",
            Quantity::Ambient => "ambient_pressure",
            Quantity::P3 => "p3",
            Quantity::P4 => "p4",
            Quantity::T3 => "t3",
            Quantity::T4 => "t4",
            Quantity::TurbineFlow => "turbine_flow",
            Quantity::Oil => "oil_temperature",
        }
    }

    /// The quantity of a key.
    pub(crate) fn of_key(key: &str) -> Option<Quantity> {
        Quantity::ALL.into_iter().find(|quantity| quantity.key() == key)
    }

    /// Whether a point may be without it.
    pub(crate) fn is_optional(self) -> bool {
        matches!(
            self,
            Quantity::Tc
                | Quantity::Humidity
                | Quantity::Ambient
                | Quantity::P3
                | Quantity::P4
                | Quantity::T3
                | Quantity::T4
                | Quantity::TurbineFlow
                | Quantity::Oil
        )
    }

    /// Whether both are forms of one physical quantity.
    pub(crate) fn is_same_quantity(self, other: Quantity) -> bool {
        let form = |quantity| match quantity {
            Quantity::ReducedSpeed => Quantity::Speed,
            Quantity::VolumeFlow | Quantity::ReducedFlow => Quantity::Flow,
            quantity => quantity,
        };
        form(self) == form(other)
    }

    /// Its units in messages.
    pub(crate) fn unit_list(self) -> String {
        match self {
            Quantity::VolumeFlow => "m3/s, m3/min, m3/h, l/s, CFM".to_owned(),
            Quantity::ReducedFlow => "kg/s*K^0.5/kPa, kg/s*K^0.5/MPa, kg/s*K^0.5/bar".to_owned(),
            Quantity::Humidity => "%, g/kg, kg/kg".to_owned(),
            _ => self.kind().unit_list(),
        }
    }

    /// Its name in messages.
    pub fn name(self) -> &'static str {
        match self {
            Quantity::Speed => "speed",
            Quantity::ReducedSpeed => "speed over the root of temperature",
            Quantity::Flow => "mass flow",
            Quantity::VolumeFlow => "volume flow",
            Quantity::ReducedFlow => "flow times the root of temperature over pressure",
            Quantity::PressureRatio => "pressure ratio",
            Quantity::Efficiency => "efficiency",
            Quantity::Vane => "vane position",
            Quantity::P1 => "P1",
            Quantity::P2 => "P2",
            Quantity::T1 => "T1",
            Quantity::T2 => "T2",
            Quantity::Tc => "housing temperature",
            Quantity::Humidity => "humidity",
            Quantity::Ambient => "ambient pressure",
            Quantity::P3 => "P3",
            Quantity::P4 => "P4",
            Quantity::T3 => "T3",
            Quantity::T4 => "T4",
            Quantity::TurbineFlow => "turbine flow",
            Quantity::Oil => "oil temperature",
        }
    }

    /// Kind of its units.
    pub(crate) fn kind(self) -> Kind {
        match self {
            Quantity::Speed | Quantity::ReducedSpeed => Kind::Speed,
            Quantity::Flow | Quantity::TurbineFlow | Quantity::VolumeFlow | Quantity::ReducedFlow => {
                Kind::MassFlow
            }
            Quantity::PressureRatio | Quantity::Efficiency | Quantity::Vane | Quantity::Humidity => {
                Kind::Fraction
            }
            Quantity::P1 | Quantity::P2 | Quantity::P3 | Quantity::P4 | Quantity::Ambient => Kind::Pressure,
            Quantity::T1 | Quantity::T2 | Quantity::T3 | Quantity::T4 | Quantity::Tc | Quantity::Oil => {
                Kind::Temperature
            }
        }
    }
}

//! The quantities of a table of points.

use mapper_core::Channel;
use mapper_yaml::units::Kind;

/// Declares the quantities with their keys in a map description, their names in messages, and the kinds of their units.
macro_rules! quantities {
    ($($(#[doc = $doc:literal])* $quantity:ident $key:literal $name:literal $kind:ident,)*) => {
        /// Quantities of a table of points.
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub enum Quantity {
            $($(#[doc = $doc])* $quantity,)*
        }

        impl Quantity {
            /// Its key in a map description.
            pub fn key(self) -> &'static str {
                match self {
                    $(Quantity::$quantity => $key,)*
                }
            }

            pub(crate) fn of_key(key: &str) -> Option<Quantity> {
                match key {
                    $($key => Some(Quantity::$quantity),)*
                    _ => None,
                }
            }

            /// Its name in messages.
            pub fn name(self) -> &'static str {
                match self {
                    $(Quantity::$quantity => $name,)*
                }
            }

            /// Kind of its units.
            pub(crate) fn kind(self) -> Kind {
                match self {
                    $(Quantity::$quantity => Kind::$kind,)*
                }
            }
        }
    };
}

quantities! {
    /// Corrected speed; the measured speed in a table of measured points.
    Speed "speed" "speed" Speed,
    /// Speed over the root of T1.
    ReducedSpeed "reduced_speed" "speed over the root of temperature" Speed,
    /// Corrected flow; the measured flow in a table of measured points.
    Flow "flow" "mass flow" MassFlow,
    /// Volume flow at the inlet, at the reference state.
    VolumeFlow "volume_flow" "volume flow" MassFlow,
    /// Flow times the root of T1 over P1.
    ReducedFlow "reduced_flow" "flow times the root of temperature over pressure" MassFlow,
    /// Total pressure ratio.
    PressureRatio "pressure_ratio" "pressure ratio" Fraction,
    /// Isentropic efficiency.
    Efficiency "efficiency" "efficiency" Fraction,
    /// Position of a turbine's vanes.
    Vane "vane" "vane position" Fraction,
    /// Measured inlet pressure.
    P1 "p1" "P1" Pressure,
    /// Measured outlet pressure.
    P2 "p2" "P2" Pressure,
    /// Measured inlet temperature.
    T1 "t1" "T1" Temperature,
    /// Measured outlet temperature.
    T2 "t2" "T2" Temperature,
    /// Temperature of the compressor housing.
    Tc "tc" "housing temperature" Temperature,
    /// Humidity of the air: water per dry air, or relative.
    Humidity "humidity" "humidity" Fraction,
    /// Ambient pressure, the reference of gauge pressures.
    Ambient "ambient_pressure" "ambient pressure" Pressure,
    /// Measured turbine inlet pressure.
    P3 "p3" "P3" Pressure,
    /// Measured turbine outlet pressure.
    P4 "p4" "P4" Pressure,
    /// Measured turbine inlet temperature.
    T3 "t3" "T3" Temperature,
    /// Measured turbine outlet temperature.
    T4 "t4" "T4" Temperature,
    /// Measured flow of the turbine, in a table that has the compressor's as well.
    TurbineFlow "turbine_flow" "turbine flow" MassFlow,
    /// Temperature of the oil that enters the bearing housing.
    Oil "oil_temperature" "oil temperature" Temperature,
}

impl Quantity {
    /// The quantity that a channel of a stand measures, if tables of points have it.
    pub(crate) fn of_channel(channel: Channel) -> Option<Quantity> {
        let all = [
            (Channel::P1, Quantity::P1),
            (Channel::P2, Quantity::P2),
            (Channel::P3, Quantity::P3),
            (Channel::P4, Quantity::P4),
            (Channel::T1, Quantity::T1),
            (Channel::T2, Quantity::T2),
            (Channel::T3, Quantity::T3),
            (Channel::T4, Quantity::T4),
            (Channel::Tc, Quantity::Tc),
            (Channel::TOil, Quantity::Oil),
        ];
        all.into_iter().find(|(known, _)| *known == channel).map(|(_, quantity)| quantity)
    }

    /// Whether a point may be without it.
    pub(crate) fn is_optional(self) -> bool {
        use Quantity::{Ambient, Humidity, Oil, P3, P4, T3, T4, Tc, TurbineFlow};
        matches!(self, Tc | Humidity | Ambient | P3 | P4 | T3 | T4 | TurbineFlow | Oil)
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
}

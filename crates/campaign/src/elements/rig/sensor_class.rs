//! Accuracy classes of sensors: the tolerances of standards as standard uncertainties, and the gain of a sensor that declares none.

use mapper_core::{Channel, DeclaredUncertainty, Dimension};
use schemars::JsonSchema;
use serde::Deserialize;

/// Standard deviation of a value that is equally likely anywhere between -1 and 1. Source: GUM 4.3.7, 1/sqrt(3).
const RECTANGULAR: f64 = 0.577_350_269_189_625_8;
/// Gain tolerance of a counter of blade passages, ratio. Bound: quartz clocks are within 0.01 %.
const COUNTER_LIMIT_RATIO: f64 = 1e-4;
/// Gain tolerance of a pressure transducer that declares none, ratio. Source: accuracy class 0.1, the best of EN 837-1.
const PRESSURE_LIMIT_RATIO: f64 = 1e-3;

/// Tolerance class of a thermometer. Its gain contains the deviation from a straight line.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, JsonSchema)]
pub(crate) enum ThermometerClass {
    /// Thermocouple type K, class 1 of IEC 60584-1: 1.5 K or 0.4 %.
    K1,
    /// Thermocouple type K, class 2: 2.5 K or 0.75 %.
    K2,
    /// Thermocouple type N, class 1: as type K.
    N1,
    /// Thermocouple type N, class 2: as type K.
    N2,
    /// Resistance thermometer, class A of IEC 60751: 0.15 K + 0.002 |t|.
    #[serde(rename = "Pt100_A")]
    Pt100A,
    /// Resistance thermometer, class B: 0.30 K + 0.005 |t|.
    #[serde(rename = "Pt100_B")]
    Pt100B,
}

impl ThermometerClass {
    /// Class of a thermometer that declares no gain. Judgement: test stands buy the better class of the usual thermocouple.
    const USUAL: ThermometerClass = ThermometerClass::K1;

    /// Offset, K, and gain, ratio, one standard deviation each. Source: IEC 60584-1:2013, table 12; IEC 60751:2022, table 3. A thermocouple may use
    /// its whole tolerance at 0 degC (reference junction), and its whole relative tolerance in the slope.
    fn errors(self) -> DeclaredUncertainty {
        let (offset_k, gain_ratio) = match self {
            ThermometerClass::K1 | ThermometerClass::N1 => (1.5, 0.004),
            ThermometerClass::K2 | ThermometerClass::N2 => (2.5, 0.0075),
            ThermometerClass::Pt100A => (0.15, 0.002),
            ThermometerClass::Pt100B => (0.30, 0.005),
        };
        errors(offset_k, gain_ratio)
    }
}

/// Type of a flow meter. Limits of the error, per cent of the reading, at the flows of a map.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub(crate) enum FlowMeterType {
    /// Venturi nozzle at critical flow, ISO 9300: 0.5 %.
    CriticalNozzle,
    /// Coriolis meter, for gas: 0.5 %.
    Coriolis,
    /// Orifice, nozzle or Venturi tube, ISO 5167: 1 %.
    Orifice,
    /// Turbine or rotary meter, ISO 9951: 1 %.
    Turbine,
    /// Vortex meter, ISO/TR 12764: 1 %.
    Vortex,
    /// Hot-film or thermal meter, ISO 14511: 2 %.
    HotFilm,
}

impl FlowMeterType {
    /// Judgement: limits of the named standards and of manufacturers for calibrated meters in clean air; density included.
    fn errors(self) -> DeclaredUncertainty {
        let limit_ratio = match self {
            FlowMeterType::CriticalNozzle | FlowMeterType::Coriolis => 0.005,
            FlowMeterType::Orifice | FlowMeterType::Turbine | FlowMeterType::Vortex => 0.01,
            FlowMeterType::HotFilm => 0.02,
        };
        errors(0.0, limit_ratio)
    }
}

/// How a thermocouple sits on a housing: how far it reads towards the cell, k in `T = T_housing - k (T_housing - T_cell)`.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Mounting {
    /// In a hole of at least five diameters.
    Embedded,
    /// Glued or welded to the surface.
    Glued,
    /// Clamped or taped to the surface.
    Clamped,
}

impl Mounting {
    /// k, ratio, one standard deviation above 0. Judgement: surface thermocouples read 2 to 10 % towards the cell, by mounting.
    pub(crate) fn contact_sigma_ratio(self) -> f64 {
        match self {
            Mounting::Embedded => 0.005,
            Mounting::Glued => 0.03,
            Mounting::Clamped => 0.1,
        }
    }
}

/// The share by which a housing's thermocouple reads towards the cell if no mounting is declared, one standard deviation above 0.
pub fn default_contact_sigma_ratio() -> f64 {
    Mounting::Glued.contact_sigma_ratio()
}

/// Errors that a class permits: `noise_sigma` is 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ClassErrors(DeclaredUncertainty);

impl From<ThermometerClass> for ClassErrors {
    fn from(class: ThermometerClass) -> Self {
        ClassErrors(class.errors())
    }
}

impl From<FlowMeterType> for ClassErrors {
    fn from(meter: FlowMeterType) -> Self {
        ClassErrors(meter.errors())
    }
}

impl ClassErrors {
    /// Errors of a pressure transducer of this class, ratio to its full scale. Zero and span may each use the whole class.
    pub(crate) fn transducer(class_ratio: f64, full_scale_pa: f64) -> Self {
        ClassErrors(errors(class_ratio * full_scale_pa, class_ratio))
    }

    /// Errors of a speed sensor that counts blades: those of its clock.
    pub(crate) fn counter() -> Self {
        ClassErrors(errors(0.0, COUNTER_LIMIT_RATIO))
    }

    /// `declared`, with the errors of the class for those that are not written.
    pub(crate) fn fill(
        self,
        declared: DeclaredUncertainty,
        has_offset: bool,
        has_gain: bool,
    ) -> DeclaredUncertainty {
        let DeclaredUncertainty { offset_sigma, gain_sigma_ratio, .. } = self.0;
        DeclaredUncertainty {
            offset_sigma: if has_offset { declared.offset_sigma } else { offset_sigma },
            gain_sigma_ratio: if has_gain { declared.gain_sigma_ratio } else { gain_sigma_ratio },
            ..declared
        }
    }
}

fn errors(offset_limit: f64, gain_limit_ratio: f64) -> DeclaredUncertainty {
    DeclaredUncertainty {
        noise_sigma: 0.0,
        offset_sigma: RECTANGULAR * offset_limit,
        gain_sigma_ratio: RECTANGULAR * gain_limit_ratio,
    }
}

/// Gain error of a sensor that declares none, ratio, one standard deviation: a thermocouple of class 1, a pressure transducer of class 0.1, a counter
/// of blades. 0 for flow meters, whose default is `tolerances: {flow_meter_gain: ...}`, and for humidity and valve, whose gain no method uses.
pub fn default_gain_sigma_ratio(channel: Channel) -> f64 {
    match channel.info().dimension {
        Dimension::Temperature => ThermometerClass::USUAL.errors().gain_sigma_ratio,
        Dimension::Pressure => RECTANGULAR * PRESSURE_LIMIT_RATIO,
        Dimension::RotationalSpeed => RECTANGULAR * COUNTER_LIMIT_RATIO,
        Dimension::MassFlow | Dimension::Ratio => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// IEC 60584-1 permits 1.5 K up to 375 degC and 0.4 % above, IEC 60751 class A 0.35 K at 100 degC: no limit is exceeded by more than the sum of
    /// offset and gain, and three standard deviations of a rectangular distribution contain all of it.
    #[test]
    fn a_class_contains_the_tolerance_of_its_standard() {
        for (class, t_c, limit_k) in [
            (ThermometerClass::K1, 100.0, 1.5),
            (ThermometerClass::K1, 800.0, 3.2),
            (ThermometerClass::K2, 100.0, 2.5),
            (ThermometerClass::K2, 800.0, 6.0),
            (ThermometerClass::Pt100A, 100.0, 0.35),
            (ThermometerClass::Pt100B, 100.0, 0.80),
        ] {
            let DeclaredUncertainty { offset_sigma, gain_sigma_ratio, .. } = class.errors();
            let sigma_k = offset_sigma.hypot(gain_sigma_ratio * t_c);
            let ratio = sigma_k / (limit_k / 3.0f64.sqrt());
            assert!((0.7..1.6).contains(&ratio), "{class:?} at {t_c} degC: {sigma_k} K, limit {limit_k} K");
        }
    }

    #[test]
    fn what_is_written_overrides_the_class() {
        let class = ClassErrors::transducer(0.001, 500e3);
        let written = DeclaredUncertainty { noise_sigma: 60.0, offset_sigma: 100.0, gain_sigma_ratio: 0.0 };
        let filled = class.fill(written, true, false);
        assert_eq!((filled.noise_sigma, filled.offset_sigma), (60.0, 100.0));
        assert!((filled.gain_sigma_ratio - 0.001 / 3.0f64.sqrt()).abs() < 1e-12);
        let bought = class.fill(written, false, false);
        assert!((bought.offset_sigma - 500.0 / 3.0f64.sqrt()).abs() < 1e-9);
    }
}

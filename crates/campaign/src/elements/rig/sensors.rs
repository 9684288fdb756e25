//! `sensors:`

use crate::checking::Check;
use crate::elements::rig::calibration::{self, CalibrationFile};
use crate::elements::rig::redundant_sensors::{
    DeclaredSensors, Sensor, SensorDeclaration, Sensors, SharedSettings, check_redundant_sensors,
    sensor_places,
};
use crate::elements::rig::sensor_class::{ClassErrors, FlowMeterType, Mounting, ThermometerClass};
use crate::si_values::value_or;
use crate::units::{
    Dimension, Fraction, Length, MassFlow, Pressure, PressureDifference, Quantity, Speed, Temperature,
    TemperatureDifference,
};
use mapper_core::{Channel, DeclaredUncertainty};
use mapper_yaml::{FindingKind, Step, steps};
use schemars::JsonSchema;
use serde::Deserialize;
use std::collections::BTreeMap;

/// Declares the sensors of the file: description, symbol, channel, type.
macro_rules! sensors {
    ($(#[doc = $doc:literal] $symbol:literal $field:ident: $channel:ident, $sensors:ty;)+) => {
        /// Declared uncertainty of each measured channel, by its symbol; one standard deviation throughout.
        #[derive(Debug, Deserialize, JsonSchema)]
        #[serde(deny_unknown_fields)]
        pub(crate) struct SensorsFile {
            $(#[doc = $doc] #[serde(rename = $symbol)] $field: $sensors,)+
        }

        impl SensorsFile {
            /// The declared uncertainties of each channel that has a sensor.
            pub(crate) fn declarations(&self) -> BTreeMap<Channel, SensorDeclaration> {
                let all = [$((Channel::$channel, self.$field.declared(Channel::$channel)),)+];
                all.into_iter().filter_map(|(channel, declared)| Some((channel, declared?))).collect()
            }
        }

        /// Symbols of all channels that have a sensor.
        pub(crate) const CALIBRATED: &[&str] = &[$($symbol),+];
    };
}

sensors! {
    /// Shaft speed.
    "N" n: ShaftSpeed, Sensors<SpeedSensor>;
    /// Compressor mass flow.
    "m_c" m_c: CompressorFlow, Sensors<FlowSensor>;
    /// Compressor inlet pressure.
    "P1" p1: P1, Sensors<PressureSensor>;
    /// Compressor inlet total temperature.
    "T1" t1: T1, Sensors<TemperatureSensor>;
    /// Compressor outlet pressure.
    "P2" p2: P2, Sensors<PressureSensor>;
    /// Compressor outlet total temperature.
    "T2" t2: T2, Sensors<ProbeSensor>;
    /// Compressor housing temperature.
    "Tc" tc: Tc, Sensors<HousingSensor>;
    /// Turbine mass flow.
    "m_t" m_t: TurbineFlow, Option<Sensors<FlowSensor>>;
    /// Turbine inlet pressure.
    "P3" p3: P3, Option<Sensors<PressureSensor>>;
    /// Turbine inlet total temperature.
    "T3" t3: T3, Option<Sensors<TemperatureSensor>>;
    /// Turbine outlet pressure.
    "P4" p4: P4, Option<Sensors<PressureSensor>>;
    /// Turbine outlet total temperature.
    "T4" t4: T4, Option<Sensors<TemperatureSensor>>;
    /// Turbine housing temperature.
    "Tt" tt: Tt, Option<Sensors<HousingSensor>>;
    /// Oil inlet temperature.
    "T_oil" t_oil: TOil, Option<Sensors<TemperatureSensor>>;
    /// Ambient temperature.
    "T_amb" t_amb: TAmb, Option<Sensors<TemperatureSensor>>;
    /// Oil outlet temperature.
    "T_oil_out" t_oil_out: TOilOut, Option<Sensors<TemperatureSensor>>;
    /// Oil mass flow.
    "m_oil" m_oil: OilFlow, Option<Sensors<FlowSensor>>;
    /// Cooling water inlet temperature.
    "T_water" t_water: TWater, Option<Sensors<TemperatureSensor>>;
    /// Cooling water outlet temperature.
    "T_water_out" t_water_out: TWaterOut, Option<Sensors<TemperatureSensor>>;
    /// Cooling water mass flow.
    "m_water" m_water: WaterFlow, Option<Sensors<FlowSensor>>;
    /// Relative humidity of the inlet air; with `T_amb`, or with T1 if that is not measured. It replaces `report: {humidity: ...}`.
    "RH" rh: RelativeHumidity, Option<Sensors<HumiditySensor>>;
    /// Dew point of the inlet air; it replaces `RH`.
    "T_dew" t_dew: DewPoint, Option<Sensors<TemperatureSensor>>;
}

fn declaration<D: Dimension>(
    noise: Quantity<D>,
    offset: Option<Quantity<D>>,
    gain: Option<Quantity<Fraction>>,
) -> SensorDeclaration {
    SensorDeclaration {
        declared: DeclaredUncertainty {
            noise_sigma: noise.value,
            offset_sigma: value_or(offset, 0.0),
            gain_sigma_ratio: value_or(gain, 0.0),
        },
        gain_is_declared: gain.is_some(),
        static_tap_pipe_diameter_m: None,
        contact_sigma_ratio: None,
        probe_diameter_m: 0.0,
        redundant: None,
        calibrations: Vec::new(),
    }
}

impl SensorDeclaration {
    /// With the errors of a class for those that are not written.
    fn with_class(self, class: Option<ClassErrors>, has_offset: bool) -> Self {
        let Some(class) = class else { return self };
        let declared = class.fill(self.declared, has_offset, self.gain_is_declared);
        SensorDeclaration { declared, gain_is_declared: true, ..self }
    }
}

/// Declares a kind of sensor: the dimensions of its readings and of their differences, the `schemars` attributes of its noise, its offset
/// and its common offset, the description of its gain, further keys, and their effect on the declaration.
macro_rules! sensor {
    (
        $(#[$doc:meta])* $sensor:ident: $reading:ty, $dimension:ty,
        noise: [$($noise:tt)*], offset: [$($offset:tt)*], common: [$($common:tt)*], gain: $gain:tt,
        { $($own:tt)* } $declaration:expr
    ) => {
        $(#[$doc])*
        #[derive(Debug, Deserialize, JsonSchema)]
        #[serde(deny_unknown_fields)]
        pub(crate) struct $sensor {
            /// Noise of one sample.
            #[schemars($($noise)*)]
            noise: Quantity<$dimension>,
            /// Fixed offset after calibration; that of the class, otherwise 0, if none is given.
            #[schemars($($offset)*)]
            offset: Option<Quantity<$dimension>>,
            #[doc = $gain]
            #[schemars(extend("x-min" = "0 %", "x-max" = "100 %"))]
            gain: Option<Quantity<Fraction>>,
            $($own)*
            /// Number of sensors like this one on the channel, 1 to 16; 1 if none is given.
            #[schemars(range(min = 1, max = 16), example = 4)]
            count: Option<usize>,
            /// Display name of this sensor in a list of several; `T2/3` and so on if none is given.
            #[schemars(regex(pattern = r"^.{1,40}$"))]
            name: Option<String>,
            /// Offset that all sensors of the channel share and that does not average out (one calibration bath, stratification, radiation); 0 if none is given.
            #[schemars($($common)*)]
            common_offset: Option<Quantity<$dimension>>,
            /// Calibration of this sensor, according to its certificate.
            calibration: Option<CalibrationFile<Quantity<$reading>, Quantity<$dimension>>>,
        }

        impl Sensor for $sensor {
            fn declaration(&self) -> SensorDeclaration {
                let own: fn(&$sensor, SensorDeclaration) -> SensorDeclaration = $declaration;
                let common = declaration(self.noise, self.offset, self.gain);
                let calibrations = vec![self.calibration.as_ref().map(CalibrationFile::calibration)];
                own(self, SensorDeclaration { calibrations, ..common })
            }

            fn shared_settings(&self) -> SharedSettings<'_> {
                SharedSettings {
                    count: self.count.unwrap_or(1),
                    name: self.name.as_deref(),
                    common_offset: value_or(self.common_offset, 0.0),
                }
            }
        }
    };
}

sensor! {
    /// Speed sensor.
    SpeedSensor: Speed, Speed,
    noise: [extend("x-min" = "0 rpm"), example = &"30 rpm"],
    offset: [extend("x-min" = "0 rpm"), example = &"0 rpm"],
    common: [extend("x-min" = "0 rpm")],
    gain: " Fixed error of the gain; if none is given, identification takes 0.006 %, that of a counter's clock (0.01 %).",
    {
        /// Number of blades that the sensor counts in one revolution: the gain is then that of its clock, 0.01 %.
        #[schemars(range(min = 1, max = 60), example = 12)]
        blades: Option<usize>,
    }
    |sensor, declaration| {
        declaration.with_class(sensor.blades.map(|_| ClassErrors::counter()), sensor.offset.is_some())
    }
}

sensor! {
    /// Flow meter.
    FlowSensor: MassFlow, MassFlow,
    noise: [extend("x-min" = "0 kg/s")],
    offset: [extend("x-min" = "0 kg/s"), example = &"0 kg/s"],
    common: [extend("x-min" = "0 kg/s")],
    gain: " Fixed error of the gain; if neither gain nor class is given, `tolerances: {flow_meter_gain: ...}` applies.",
    {
        /// Type of the meter, which sets its gain.
        class: Option<FlowMeterType>,
    }
    |sensor, declaration| declaration.with_class(sensor.class.map(Into::into), sensor.offset.is_some())
}

sensor! {
    /// Hygrometer.
    HumiditySensor: Fraction, Fraction,
    noise: [extend("x-min" = "0 %"), example = &"0.2 %"],
    offset: [extend("x-min" = "0 %"), example = &"2 %"],
    common: [extend("x-min" = "0 %")],
    gain: " Fixed error of the gain; 0 if none is given.",
    {} |_, declaration| declaration
}

sensor! {
    /// Pressure sensor.
    PressureSensor: Pressure, PressureDifference,
    noise: [extend("x-min" = "0 Pa"), example = &"20 Pa"],
    offset: [extend("x-min" = "0 Pa")],
    common: [extend("x-min" = "0 Pa")],
    gain: " Fixed error of the gain; if none is given, identification takes 0.058 % (accuracy class 0.1).",
    {
        /// Accuracy class, per cent of the full scale: sets offset and gain, with `full_scale`.
        #[schemars(extend("x-above" = "0 %", "x-max" = "10 %"), example = &"0.1 %")]
        class: Option<Quantity<Fraction>>,
        /// Upper end of the transducer's range; needed for a class.
        #[schemars(extend("x-above" = "0 kPa", "x-max" = "10 MPa"), example = &"500 kPa")]
        full_scale: Option<Quantity<Pressure>>,
        /// Pressure at the tap: `total` (the default), or `static`, converted with `pipe_diameter`.
        tap: Option<TapName>,
        /// Inner diameter of the pipe at the tap; needed for a static tap.
        #[schemars(extend("x-above" = "0 mm", "x-max" = "1 m"), example = &"40 mm")]
        pipe_diameter: Option<Quantity<Length>>,
    }
    |sensor, declaration| {
        let diameter = sensor.pipe_diameter.map(|diameter| diameter.value);
        let static_tap_pipe_diameter_m = diameter.filter(|_| sensor.tap == Some(TapName::Static));
        let class = sensor.class.zip(sensor.full_scale);
        let class = class.map(|(class, full_scale)| ClassErrors::transducer(class.value, full_scale.value));
        SensorDeclaration { static_tap_pipe_diameter_m, ..declaration }
            .with_class(class, sensor.offset.is_some())
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub(crate) enum TapName {
    Total,
    Static,
}

sensor! {
    /// Temperature sensor.
    TemperatureSensor: Temperature, TemperatureDifference,
    noise: [extend("x-min" = "0 K"), example = &"0.1 K"],
    offset: [extend("x-min" = "0 K")],
    common: [extend("x-min" = "0 K")],
    gain: " Fixed error of the gain, counted from 20 degC; if none is given, that of the class, otherwise of a thermocouple of class 1 (0.23 %).",
    {
        /// Tolerance class, which sets offset and gain if they are not given.
        class: Option<ThermometerClass>,
    }
    |sensor, declaration| declaration.with_class(sensor.class.map(Into::into), sensor.offset.is_some())
}

sensor! {
    /// Temperature sensor on a housing.
    HousingSensor: Temperature, TemperatureDifference,
    noise: [extend("x-min" = "0 K"), example = &"0.1 K"],
    offset: [extend("x-min" = "0 K")],
    common: [extend("x-min" = "0 K")],
    gain: " Fixed error of the gain, counted from 20 degC; if none is given, that of the class, otherwise of a thermocouple of class 1 (0.23 %).",
    {
        /// Tolerance class, which sets offset and gain if they are not given.
        class: Option<ThermometerClass>,
        /// How it sits on the housing: `embedded` in a hole, `glued` to the surface (if none is given), or `clamped`: it then reads towards the cell by 0.5, 3 or 10 % (one standard deviation).
        mounting: Option<Mounting>,
    }
    |sensor, declaration| {
        let contact_sigma_ratio = sensor.mounting.map(Mounting::contact_sigma_ratio);
        SensorDeclaration { contact_sigma_ratio, ..declaration }
            .with_class(sensor.class.map(Into::into), sensor.offset.is_some())
    }
}

sensor! {
    /// Temperature probe with its own inertia.
    ProbeSensor: Temperature, TemperatureDifference,
    noise: [extend("x-min" = "0 K"), example = &"0.1 K"],
    offset: [extend("x-min" = "0 K")],
    common: [extend("x-min" = "0 K")],
    gain: " Fixed error of the gain, counted from 20 degC; if none is given, that of the class, otherwise of a thermocouple of class 1 (0.23 %).",
    {
        /// Tolerance class, which sets offset and gain if they are not given.
        class: Option<ThermometerClass>,
        /// Diameter of the probe's tip; 0 mm, the default, is a probe without inertia.
        #[schemars(extend("x-min" = "0 mm", "x-max" = "20 mm"), example = &"1.5 mm")]
        probe_diameter: Option<Quantity<Length>>,
    }
    |sensor, declaration| {
        SensorDeclaration { probe_diameter_m: value_or(sensor.probe_diameter, 0.0), ..declaration }
            .with_class(sensor.class.map(Into::into), sensor.offset.is_some())
    }
}

/// Checks that a class of a pressure transducer has the range to which it refers.
fn check_range(check: &mut Check<'_>, sensor: &[Step]) {
    let of = |key: &str| [sensor, &steps![key]].concat();
    let (has_class, has_range) = (check.get(&of("class")).is_some(), check.get(&of("full_scale")).is_some());
    if has_class && !has_range {
        let message = "a class is a percentage of the full scale, which is not given".to_owned();
        check.note(FindingKind::MissingKey, &of("class"), message, "add e.g. `full_scale: 500 kPa`");
    }
    if has_range && !has_class {
        let message = "`full_scale` has no effect without a class".to_owned();
        check.note(
            FindingKind::Conflict,
            &of("full_scale"),
            message,
            "add e.g. `class: 0.1 %`, or leave it out",
        );
    }
}

/// Checks that a static tap has the diameter of its pipe.
pub(crate) fn check(check: &mut Check<'_>) {
    for symbol in ["P1", "P2", "P3", "P4"] {
        for sensor in sensor_places(check, symbol) {
            check_range(check, &sensor);
            let of = |key: &str| [sensor.as_slice(), &steps![key]].concat();
            let has_diameter = check.get(&of("pipe_diameter")).is_some();
            if check.text(&of("tap")) == Some("static") && !has_diameter {
                let message =
                    "converting a static pressure to a total one needs the pipe's inner diameter".to_owned();
                check.note(FindingKind::MissingKey, &of("tap"), message, "add e.g. `pipe_diameter: 40 mm`");
            }
        }
    }
    for symbol in CALIBRATED {
        check_redundant_sensors(check, symbol);
        for sensor in sensor_places(check, symbol) {
            calibration::check(check, &[&sensor[..], &steps!["calibration"]].concat());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_static_tap_keeps_its_pipe_and_a_total_one_has_none() {
        for (tap, diameter_m) in [("static", Some(0.04)), ("total", None)] {
            let text = format!("{{noise: 20 Pa, tap: {tap}, pipe_diameter: 40 mm}}");
            let sensor: PressureSensor = crate::testing::any(&text).unwrap();
            assert_eq!(sensor.declaration().static_tap_pipe_diameter_m, diameter_m, "{tap}");
        }
    }

    #[test]
    fn the_symbols_are_those_of_channels() {
        for symbol in CALIBRATED {
            serde_json::from_value::<Channel>((*symbol).into()).unwrap();
        }
    }

    /// IEC 60584-1, class 1: 0.4 % as the limit of a rectangular distribution. What is written comes before the class, and a written 0 is no
    /// missing gain.
    #[test]
    fn a_class_sets_what_is_not_written() {
        let of = |text: &str| crate::testing::any::<TemperatureSensor>(text).unwrap().declaration();
        let bought = of("{noise: 0.1 K, class: K1}");
        assert!((bought.declared.offset_sigma - 1.5 / 3.0f64.sqrt()).abs() < 1e-9);
        assert!((bought.declared.gain_sigma_ratio - 0.004 / 3.0f64.sqrt()).abs() < 1e-9);
        assert!(bought.gain_is_declared);
        let calibrated = of("{noise: 0.1 K, class: K1, offset: 0.2 K, gain: 0 %}");
        assert_eq!((calibrated.declared.offset_sigma, calibrated.declared.gain_sigma_ratio), (0.2, 0.0));
        assert!(!of("{noise: 0.1 K, offset: 0.2 K}").gain_is_declared);
        assert!(crate::testing::any::<TemperatureSensor>("{noise: 0.1 K, class: K3}").is_err());
    }

    #[test]
    fn a_mounting_sets_the_contact_of_a_housing() {
        let of = |text: &str| crate::testing::any::<HousingSensor>(text).unwrap().declaration();
        assert_eq!(of("{noise: 0.1 K, mounting: clamped}").contact_sigma_ratio, Some(0.1));
        assert_eq!(of("{noise: 0.1 K}").contact_sigma_ratio, None);
    }

    fn several(text: &str) -> SensorDeclaration {
        crate::testing::any::<Sensors<ProbeSensor>>(text).unwrap().declaration(Channel::T2)
    }

    #[test]
    fn a_count_and_a_list_of_equal_sensors_are_the_same_and_one_is_none_of_several() {
        let one = "{noise: 0.1 K, offset: 0.24 K, probe_diameter: 1 mm}";
        let alike = several("{noise: 0.1 K, offset: 0.24 K, probe_diameter: 1 mm, count: 4}");
        assert_eq!(alike, several(&format!("[{one}, {one}, {one}, {one}]")));
        // A quarter of the variance each.
        assert!((alike.declared.noise_sigma - 0.05).abs() < 1e-12);
        assert!((alike.declared.offset_sigma - 0.12).abs() < 1e-12);
        assert!((alike.probe_diameter_m - 1e-3).abs() < 1e-12);
        let names: Vec<String> = alike.redundant.unwrap().elements.into_iter().map(|e| e.name).collect();
        assert_eq!(names, ["T2/1", "T2/2", "T2/3", "T2/4"]);
        let single = several(one);
        assert_eq!((single.redundant.clone(), single.declared.offset_sigma), (None, 0.24));
        assert_eq!(single, several(&format!("[{one}]")));
    }

    #[test]
    fn a_common_offset_does_not_average_out() {
        let four = several("{noise: 0.1 K, offset: 0.24 K, common_offset: 0.16 K, count: 4}");
        // 0.12 and 0.16 in quadrature; for a single sensor 0.24 and 0.07.
        assert!((four.declared.offset_sigma - 0.2).abs() < 1e-12);
        let one = several("{noise: 0.1 K, offset: 0.24 K, common_offset: 0.07 K}");
        assert!((one.declared.offset_sigma - 0.25).abs() < 1e-12);
        let named = several("[{noise: 0.1 K, name: TC_21}, {noise: 0.1 K, common_offset: 0.16 K}]");
        let redundant = named.redundant.unwrap();
        assert_eq!(redundant.elements[0].name, "TC_21");
        assert!((redundant.common_offset_sigma - 0.16).abs() < 1e-12);
    }

    /// Plans carry the hash of the campaign's JSON: a campaign without several sensors must not mention them.
    #[test]
    fn the_json_of_a_single_sensor_has_no_word_of_several() {
        let single = serde_json::to_value(several("{noise: 0.1 K, offset: 0.25 K}")).unwrap();
        let keys: Vec<&String> = single.as_object().unwrap().keys().collect();
        assert_eq!(keys, ["declared", "probe_diameter_m", "static_tap_pipe_diameter_m"]);
    }
}

//! The settings of the driver as a campaign writes them below `modbus`.

use crate::link::Table;
use crate::registers::{Form, Order};
use mapper_core::{BackendError, Channel, GuardName, SetpointRange};
use mapper_yaml::units::{Duration, Frequency, Pressure, PressureRate, Quantity, Temperature};
use serde::Deserialize;
use serde_json::Value;
use std::collections::BTreeMap;
use std::net::SocketAddr;

/// Name of the driver.
pub(crate) const NAME: &str = "modbus";

/// Below `modbus`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Settings {
    /// Address and port of the controller, in numbers: a name would have to be looked up, which may hang.
    pub(crate) address: SocketAddr,
    /// Number of the unit behind it; 255 for the controller itself.
    #[serde(default = "own_unit")]
    pub(crate) unit: u8,
    /// Name of the rig, of which there is one; its address if not said.
    pub(crate) rig: Option<String>,
    /// How often it is read; 10 Hz if not said.
    pub(crate) rate: Option<Quantity<Frequency>>,
    /// Time for each request; 200 ms if not said.
    pub(crate) timeout: Option<Quantity<Duration>>,
    /// Which word of a number comes first.
    #[serde(default)]
    pub(crate) words: Order,
    /// Which byte of a word comes first.
    #[serde(default)]
    pub(crate) bytes: Order,
    /// Where each channel stands.
    pub(crate) read: BTreeMap<Channel, Place>,
    /// Where each setpoint goes.
    pub(crate) write: Writes,
    /// Setpoints that the rig takes.
    pub(crate) accepts: Accepts,
    /// Its way into the safe state.
    pub(crate) safe: Safe,
}

fn own_unit() -> u8 {
    255
}

/// A number in registers: what stands there times `scale` plus `offset` is SI.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Place {
    /// Address of the first register, from 0 as it goes over the wire: 40001 of a manual is holding register 0.
    pub(crate) register: u16,
    #[serde(default, rename = "type")]
    pub(crate) form: Form,
    #[serde(default = "one")]
    pub(crate) scale: f64,
    #[serde(default)]
    pub(crate) offset: f64,
    #[serde(default = "holding")]
    pub(crate) table: Table,
}

fn one() -> f64 {
    1.0
}

fn holding() -> Table {
    Table::Holding
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Writes {
    pub(crate) p3: Place,
    pub(crate) t3: Place,
    pub(crate) valve: Place,
    pub(crate) oil_temperature: Place,
    /// 1: air on, 0: off.
    pub(crate) air: Place,
    /// Counts up twice a second: the controller cuts the air by itself where it stands still.
    pub(crate) heartbeat: Place,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Accepts {
    pub(crate) p3: [Quantity<Pressure>; 2],
    pub(crate) t3: [Quantity<Temperature>; 2],
    pub(crate) valve: [f64; 2],
    pub(crate) oil_temperature: [Quantity<Temperature>; 2],
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Safe {
    /// How fast P3 goes down; cut at once if not said.
    pub(crate) pressure_slew: Option<Quantity<PressureRate>>,
    /// Opening of the valve on the way.
    pub(crate) opening: f64,
    /// Longest time of the way.
    pub(crate) within: Quantity<Duration>,
}

/// What is wrong with them.
#[derive(Debug, thiserror::Error)]
pub(crate) enum SettingError {
    #[error("{0}; docs/rig.md has an example of all settings")]
    Form(serde_json::Error),
    #[error("{value} {unit} is outside {low} to {high} {unit}")]
    Outside { value: f64, unit: &'static str, low: f64, high: f64 },
    #[error("the register cannot hold {value} (SI) with this type, scale and offset")]
    DoesNotFit { value: f64 },
    #[error("the rig has to measure {0}: a guard needs it")]
    NotMeasured(Channel),
    #[error("a setpoint is written to holding registers; leave `table` out")]
    NotWritten,
    #[error("two values are written to register {0}")]
    Shared(u16),
}

/// Guards that no rig runs without.
pub(crate) const NEEDS: [(GuardName, Channel); 2] =
    [(GuardName::Overspeed, Channel::ShaftSpeed), (GuardName::TurbineInletPressure, Channel::P3)];

pub(crate) fn wrong(path: impl Into<String>, error: SettingError) -> BackendError {
    BackendError::Settings { backend: NAME.to_owned(), path: path.into(), source: Box::new(error) }
}

fn within(path: &str, value: f64, unit: &'static str, low: f64, high: f64) -> Result<f64, BackendError> {
    match (low..=high).contains(&value) {
        true => Ok(value),
        false => Err(wrong(path, SettingError::Outside { value, unit, low, high })),
    }
}

impl Settings {
    /// Reads and checks them.
    pub(crate) fn read(value: &Value) -> Result<Settings, BackendError> {
        let settings: Settings = serde_path_to_error::deserialize(value).map_err(|error| {
            let path = error.path().to_string();
            wrong(path.trim_start_matches('.'), SettingError::Form(error.into_inner()))
        })?;
        settings.check()?;
        Ok(settings)
    }

    /// Samples per second, Hz.
    pub(crate) fn rate_hz(&self) -> f64 {
        self.rate.as_ref().map_or(10.0, |rate| rate.inside)
    }

    /// Time for a request, s.
    pub(crate) fn timeout_s(&self) -> f64 {
        self.timeout.as_ref().map_or(0.2, |timeout| timeout.inside)
    }

    /// Each value that is written, with the range of what it may be, SI.
    fn written(&self) -> [(&'static str, Place, SetpointRange); 6] {
        let Writes { p3, t3, valve, oil_temperature, air, heartbeat } = &self.write;
        let range = |low: f64, high: f64| SetpointRange { low, high };
        let Accepts { p3: p3_pa, t3: t3_k, valve: opening, oil_temperature: oil_k } = &self.accepts;
        [
            ("p3", *p3, range(p3_pa[0].inside, p3_pa[1].inside)),
            ("t3", *t3, range(t3_k[0].inside, t3_k[1].inside)),
            ("valve", *valve, range(opening[0], opening[1])),
            ("oil_temperature", *oil_temperature, range(oil_k[0].inside, oil_k[1].inside)),
            ("air", *air, range(0.0, 1.0)),
            ("heartbeat", *heartbeat, range(0.0, 9999.0)),
        ]
    }

    /// What the rig accepts: of P3, T3, valve, oil.
    pub(crate) fn ranges(&self) -> [SetpointRange; 4] {
        let [p3, t3, valve, oil, ..] = self.written().map(|(.., range)| range);
        [p3, t3, valve, oil]
    }

    fn check(&self) -> Result<(), BackendError> {
        // The heartbeat goes out with the samples.
        within("rate", self.rate_hz(), "Hz", 2.0, 50.0)?;
        within("timeout", self.timeout_s(), "s", 0.01, 0.8)?;
        within("safe.within", self.safe.within.inside, "s", 0.1, 120.0)?;
        for (_, channel) in NEEDS {
            if !self.read.contains_key(&channel) {
                return Err(wrong("read", SettingError::NotMeasured(channel)));
            }
        }
        let places = self.read.iter().map(|(channel, place)| (format!("read.{channel}"), place));
        for (path, place) in places {
            within(&format!("{path}.scale"), place.scale.abs(), "", 1e-12, 1e12)?;
            within(&format!("{path}.register"), f64::from(place.register), "", 0.0, f64::from(u16::MAX - 4))?;
        }
        let mut taken: Vec<u16> = Vec::new();
        for (name, place, range) in self.written() {
            let path = format!("write.{name}");
            if place.table != Table::Holding {
                return Err(wrong(format!("{path}.table"), SettingError::NotWritten));
            }
            within(&format!("{path}.scale"), place.scale.abs(), "", 1e-12, 1e12)?;
            within(&format!("{path}.register"), f64::from(place.register), "", 0.0, f64::from(u16::MAX - 4))?;
            within(&format!("accepts.{name}"), range.high - range.low, "", 0.0, f64::MAX)?;
            for value in [range.low, range.high] {
                if self.registers(&place, value).is_none() {
                    return Err(wrong(path, SettingError::DoesNotFit { value }));
                }
            }
            for register in place.register..place.register + place.form.count() {
                if taken.contains(&register) {
                    return Err(wrong(path, SettingError::Shared(register)));
                }
                taken.push(register);
            }
        }
        Ok(())
    }

    /// What goes into the registers of a value, SI.
    pub(crate) fn registers(&self, place: &Place, value: f64) -> Option<Vec<u16>> {
        place.form.registers((value - place.offset) / place.scale, self.words, self.bytes)
    }

    /// The value in registers, SI; NaN where there is none.
    pub(crate) fn value(&self, place: &Place, registers: &[u16]) -> f64 {
        let number = place.form.number(registers, self.words, self.bytes).unwrap_or(f64::NAN);
        let value = number * place.scale + place.offset;
        if value.is_finite() { value } else { f64::NAN }
    }
}

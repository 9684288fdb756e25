//! The settings of the driver as a campaign writes them below `modbus`.

use crate::link::Table;
use crate::registers::{NumberFormat, Order};
use mapper_controller::{
    AcceptedRanges, LimitError, SafeSettings, Stand, Target, WriteSettings, check_range, check_resolution,
    check_scale,
};
use mapper_core::{BackendError, Channel};
use mapper_yaml::units::{Duration, Frequency, Quantity};
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
    /// IP address and port of the controller; a host name would need a look-up, which may hang.
    #[serde(deserialize_with = "mapper_driver::address")]
    pub(crate) address: SocketAddr,
    /// Unit number behind the address; 255 for the controller itself.
    #[serde(default = "own_unit")]
    pub(crate) unit: u8,
    /// Unique name of the rig; default: its address.
    pub(crate) rig: Option<String>,
    /// Polling rate; default 10 Hz.
    pub(crate) rate: Option<Quantity<Frequency>>,
    /// Timeout of each request; default 200 ms.
    pub(crate) timeout: Option<Quantity<Duration>>,
    #[serde(default)]
    pub(crate) words: Order,
    #[serde(default)]
    pub(crate) bytes: Order,
    #[serde(deserialize_with = "mapper_driver::by_channel")]
    pub(crate) read: BTreeMap<Channel, RegisterSettings>,
    pub(crate) write: WriteSettings<RegisterSettings>,
    pub(crate) accepts: AcceptedRanges,
    pub(crate) safe: SafeSettings,
}

fn own_unit() -> u8 {
    255
}

/// A number in registers; the SI value is the number times `scale` plus `offset`.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct RegisterSettings {
    /// Address of the first register, from 0 as on the wire: 40001 of a manual is holding register 0.
    pub(crate) register: u16,
    #[serde(default, rename = "type")]
    pub(crate) form: NumberFormat,
    #[serde(default = "default_scale")]
    pub(crate) scale: f64,
    #[serde(default)]
    pub(crate) offset: f64,
    #[serde(default = "holding")]
    pub(crate) table: Table,
}

fn default_scale() -> f64 {
    1.0
}

fn holding() -> Table {
    Table::Holding
}

#[derive(Debug, thiserror::Error)]
pub(crate) enum SettingError {
    #[error("{0}; docs/how-to/rig.md has an example of all settings")]
    Form(serde_json::Error),
    #[error(transparent)]
    Limit(#[from] LimitError),
    #[error("the register cannot hold {value} (SI) with this type, scale and offset")]
    DoesNotFit { value: f64 },
    #[error("a setpoint is written to holding registers; remove `table`")]
    NotWritten,
    #[error("two values are written to register {0}")]
    Shared(u16),
    #[error(
        "{other} reads register {register} too; give each channel its own register, or remove one of them"
    )]
    ReadTwice { register: u16, other: Channel },
    #[error("`write.{key}` writes register {register}: the setpoint would be read instead of a measurement")]
    ReadsSetpoint { register: u16, key: &'static str },
}

pub(crate) fn settings_error(path: impl Into<String>, error: SettingError) -> BackendError {
    BackendError::Settings { backend: NAME.to_owned(), path: path.into(), source: Box::new(error) }
}

fn bound(path: &str, value: f64, unit: &'static str, low: f64, high: f64) -> Result<f64, BackendError> {
    check_range(value, unit, low, high).map_err(|error| settings_error(path, error.into()))
}

impl Settings {
    pub(crate) fn read(value: &Value) -> Result<Settings, BackendError> {
        let settings: Settings = serde_path_to_error::deserialize(value).map_err(|error| {
            let path = error.path().to_string();
            settings_error(path.trim_start_matches('.'), SettingError::Form(error.into_inner()))
        })?;
        settings.check()?;
        Ok(settings)
    }

    pub(crate) fn timeout_s(&self) -> f64 {
        self.timeout.as_ref().map_or(0.2, |timeout| timeout.value)
    }

    pub(crate) fn stand(&self) -> Stand {
        Stand {
            backend: NAME,
            version: env!("CARGO_PKG_VERSION"),
            rig: self.rig.clone().unwrap_or_else(|| format!("modbus {}", self.address)),
            // Behind a gateway each unit is a separate stand.
            reached_at: format!("{} unit {}", self.address, self.unit),
            rate_hz: self.rate.as_ref().map_or(10.0, |rate| rate.value),
            channels: self.read.keys().copied().collect(),
            accepts: self.accepts,
            safe: self.safe,
        }
    }

    fn check(&self) -> Result<(), BackendError> {
        bound("timeout", self.timeout_s(), "s", 0.01, 0.8)?;
        self.stand().check().map_err(|(path, error)| settings_error(path, error.into()))?;
        for (channel, entry) in &self.read {
            self.check_register(&format!("read.{channel}"), entry)?;
        }
        self.check_read_registers()?;
        let mut used: Vec<u16> = Vec::new();
        for target in Target::ALL {
            let (path, entry) = (format!("write.{}", target.name()), self.write.of(target));
            if entry.table != Table::Holding {
                return Err(settings_error(format!("{path}.table"), SettingError::NotWritten));
            }
            self.check_register(&path, entry)?;
            let range = self.accepts.range(target);
            if entry.form.is_whole() {
                check_resolution(target, entry.scale, range)
                    .map_err(|error| settings_error(path.clone(), error.into()))?;
            }
            for value in [range.low, range.high] {
                if self.registers(entry, value).is_none() {
                    return Err(settings_error(path, SettingError::DoesNotFit { value }));
                }
            }
            for register in entry.registers() {
                if used.contains(&register) {
                    return Err(settings_error(path, SettingError::Shared(register)));
                }
                used.push(register);
            }
        }
        Ok(())
    }

    /// Each channel has its own register, which is not a written one.
    fn check_read_registers(&self) -> Result<(), BackendError> {
        let mut used: BTreeMap<(Table, u16), Channel> = BTreeMap::new();
        for (channel, entry) in &self.read {
            let at = |error| settings_error(format!("read.{channel}.register"), error);
            for register in entry.registers() {
                if let Some(other) = used.insert((entry.table, register), *channel)
                    && other != *channel
                {
                    return Err(at(SettingError::ReadTwice { register, other }));
                }
                let goes_to = |target: &Target| self.write.of(*target).registers().contains(&register);
                if let Some(target) =
                    Target::ALL.into_iter().find(goes_to).filter(|_| entry.table == Table::Holding)
                {
                    return Err(at(SettingError::ReadsSetpoint { register, key: target.name() }));
                }
            }
        }
        Ok(())
    }

    fn check_register(&self, path: &str, entry: &RegisterSettings) -> Result<(), BackendError> {
        check_scale(entry.scale).map_err(|error| settings_error(format!("{path}.scale"), error.into()))?;
        bound(&format!("{path}.register"), f64::from(entry.register), "", 0.0, f64::from(u16::MAX - 4))
            .map(drop)
    }

    pub(crate) fn registers(&self, entry: &RegisterSettings, value: f64) -> Option<Vec<u16>> {
        entry.form.registers((value - entry.offset) / entry.scale, self.words, self.bytes)
    }

    pub(crate) fn value(&self, entry: &RegisterSettings, registers: &[u16]) -> f64 {
        entry.value(registers, self.words, self.bytes)
    }
}

impl RegisterSettings {
    pub(crate) fn registers(&self) -> std::ops::Range<u16> {
        self.register..self.register.saturating_add(self.form.count())
    }

    /// The value in registers of this order, SI; NaN without a value.
    pub(crate) fn value(&self, registers: &[u16], words: Order, bytes: Order) -> f64 {
        let number = self.form.number(registers, words, bytes).unwrap_or(f64::NAN);
        number * self.scale + self.offset
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn settings() -> Value {
        json!({
            "address": "127.0.0.1:502",
            "read": {"N": {"register": 0}, "T2": {"register": 10}, "P3": {"register": 16}},
            "write": {
                "p3": {"register": 100}, "t3": {"register": 102}, "valve": {"register": 104}, "oil_temperature": {"register": 106},
                "air": {"register": 110, "type": "u16"}, "heartbeat": {"register": 111, "type": "u16"},
            },
            "accepts": {"p3": ["105 kPa", "400 kPa"], "t3": ["280 K", "900 K"], "valve": [0.1, 2.5], "oil_temperature": ["280 K", "400 K"]},
            "safe": {"opening": 1.0, "within": "20 s"},
        })
    }

    /// Path and message of the error.
    fn refused(at: [&str; 2], value: Value) -> (String, String) {
        let mut settings = settings();
        settings[at[0]][at[1]] = value;
        match Settings::read(&settings) {
            Err(BackendError::Settings { path, source, .. }) => (path, source.to_string()),
            other => panic!("{settings}: {}", other.is_ok()),
        }
    }

    /// Settings that would silently cause wrong reads or writes.
    #[test]
    fn contradictory_settings_are_refused_with_their_path() {
        assert!(Settings::read(&settings()).is_ok());
        for (at, value, path, words) in [
            // The same register, one of its two words, and a written one.
            (["read", "T2"], json!({"register": 16}), "read.P3.register", "T2 reads register 16"),
            (["read", "T2"], json!({"register": 17}), "read.P3.register", "T2 reads register 17"),
            (["read", "P3"], json!({"register": 100}), "read.P3.register", "`write.p3`"),
            (
                ["read", "P3"],
                json!({"register": 16, "scale": 0}),
                "read.P3.scale",
                "a scale of 0 loses the value",
            ),
            (["write", "valve"], json!({"register": 104, "scale": 0}), "write.valve.scale", "a scale of 0"),
            // An opening of 0.7 would be written as 1.
            (
                ["write", "valve"],
                json!({"register": 104, "type": "u16"}),
                "write.valve",
                "steps of 1 from 0.1 to 2.5",
            ),
            (["write", "p3"], json!({"register": 100, "type": "u16"}), "write.p3", "cannot hold 105000"),
            (["write", "t3"], json!({"register": 101}), "write.t3", "written to register 101"),
        ] {
            let (found, message) = refused(at, value);
            assert!(found == path && message.contains(words), "{found}: {message}");
        }
        // The same address in the other table, and integers that are fine enough.
        let mut fine = settings();
        fine["read"]["P3"] = json!({"register": 10, "table": "input"});
        fine["write"]["valve"] = json!({"register": 104, "type": "u16", "scale": 0.01});
        fine["write"]["p3"] = json!({"register": 100, "type": "u16", "scale": 1000.0});
        assert!(Settings::read(&fine).is_ok());
    }
}

//! The settings of the driver as a campaign writes them below `ak`.

use mapper_backend_ak::telegram::{Code, TelegramError};
use mapper_core::{BackendError, Channel};
use mapper_yaml::units::{Duration, Frequency, Quantity};
use serde::Deserialize;
use serde_json::Value;
use std::collections::BTreeMap;
use std::net::SocketAddr;

/// Name of the driver.
pub(crate) const NAME: &str = "ak";
/// Maximum request rate that instruments support, Hz.
const MAX_HZ: f64 = 10.0;

/// Below `ak`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Settings {
    /// IP address and port of the instrument; a host name would need a look-up, which may hang.
    #[serde(deserialize_with = "mapper_driver::address")]
    pub(crate) address: SocketAddr,
    /// Polling rate; default 2 Hz.
    rate: Option<Quantity<Frequency>>,
    /// Timeout of each answer; default 300 ms.
    timeout: Option<Quantity<Duration>>,
    /// Location of each channel.
    #[serde(deserialize_with = "mapper_driver::by_channel")]
    pub(crate) read: BTreeMap<Channel, AnswerNumber>,
}

/// A number in an answer; the SI value is the number times `scale` plus `offset`.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct AnswerNumber {
    /// Request code that begins with A, such as AKON.
    pub(crate) code: String,
    /// Channel of the instrument; 0 is the instrument as a whole.
    #[serde(default)]
    pub(crate) channel: u8,
    /// Position of the number in the answer, from 1.
    #[serde(default = "first")]
    pub(crate) value: usize,
    #[serde(default = "default_scale")]
    pub(crate) scale: f64,
    #[serde(default)]
    pub(crate) offset: f64,
}

fn first() -> usize {
    1
}

fn default_scale() -> f64 {
    1.0
}

#[derive(Debug, thiserror::Error)]
pub(crate) enum SettingError {
    #[error("{0}; docs/how-to/rig.md has an example of all settings")]
    Form(serde_json::Error),
    #[error("{value} {unit} is outside {low} to {high} {unit}")]
    Outside { value: f64, unit: &'static str, low: f64, high: f64 },
    #[error("a scale of {0} loses the value; it is between 1e-12 and 1e12, or between -1e12 and -1e-12")]
    Scale(f64),
    #[error(
        "{0} reads the same number of the answer; give each channel its own number, or remove one of them"
    )]
    ReadTwice(Channel),
    #[error(transparent)]
    Code(#[from] TelegramError),
    #[error(
        "{0} would control or configure the instrument; this driver only reads, with codes that begin with A"
    )]
    Controls(Code),
    #[error(
        "{requests} requests at {rate_hz} Hz exceed the {MAX_HZ} answers per second of instruments; lower `rate` or read fewer codes"
    )]
    TooMany { requests: usize, rate_hz: f64 },
    #[error("no channel is read")]
    Nothing,
}

fn settings_error(path: impl Into<String>, error: SettingError) -> BackendError {
    BackendError::Settings { backend: NAME.to_owned(), path: path.into(), source: Box::new(error) }
}

fn within(path: &str, value: f64, unit: &'static str, low: f64, high: f64) -> Result<(), BackendError> {
    let error = SettingError::Outside { value, unit, low, high };
    (low..=high).contains(&value).then_some(()).ok_or_else(|| settings_error(path, error))
}

impl Settings {
    /// Reads and checks the settings. Each request appears once, with the channels in its answer.
    pub(crate) fn read(value: &Value) -> Result<(Settings, Requests), BackendError> {
        let settings: Settings = serde_path_to_error::deserialize(value).map_err(|error| {
            let path = error.path().to_string();
            settings_error(path.trim_start_matches('.'), SettingError::Form(error.into_inner()))
        })?;
        within("rate", settings.rate_hz(), "Hz", 0.1, MAX_HZ)?;
        within("timeout", settings.timeout_s(), "s", 0.01, 0.8)?;
        let mut requests = Requests::new();
        for (channel, number) in &settings.read {
            let path = format!("read.{channel}");
            if !(1e-12..=1e12).contains(&number.scale.abs()) {
                return Err(settings_error(format!("{path}.scale"), SettingError::Scale(number.scale)));
            }
            within(&format!("{path}.value"), number.value as f64, "", 1.0, 1000.0)?;
            let code: Code =
                number.code.parse().map_err(|error: TelegramError| settings_error(&path, error.into()))?;
            if !code.is_read_request() {
                return Err(settings_error(path, SettingError::Controls(code)));
            }
            let channels_of_request = requests.entry((code, number.channel)).or_default();
            if let Some((other, _)) =
                channels_of_request.iter().find(|(_, other)| other.value == number.value)
            {
                return Err(settings_error(path, SettingError::ReadTwice(*other)));
            }
            channels_of_request.push((*channel, number.clone()));
        }
        let rate_hz = settings.rate_hz();
        match requests.len() {
            0 => Err(settings_error("read", SettingError::Nothing)),
            count if count as f64 * rate_hz > MAX_HZ => {
                Err(settings_error("rate", SettingError::TooMany { requests: count, rate_hz }))
            }
            _ => Ok((settings, requests)),
        }
    }

    pub(crate) fn rate_hz(&self) -> f64 {
        self.rate.as_ref().map_or(2.0, |rate| rate.value)
    }

    pub(crate) fn timeout_s(&self) -> f64 {
        self.timeout.as_ref().map_or(0.3, |timeout| timeout.value)
    }
}

/// Code and channel of each request, and the position of each mapper channel in its answer.
pub(crate) type Requests = BTreeMap<(Code, u8), Vec<(Channel, AnswerNumber)>>;

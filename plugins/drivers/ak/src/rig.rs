//! An AK instrument as a read-only backend.

use crate::settings::{NAME, Requests, Settings};
use mapper_backend_ak::telegram::{Answer, Assembler, Code, TelegramError, parse_answer, write_request};
use mapper_core::{
    Backend, BackendError, Channel, ChannelColumn, Event, EventKind, RigDescription, SafeTrajectory,
    SampleBatch, SetpointRange, SetpointRanges, Setpoints,
};
use mapper_driver::Outage;
use serde_json::Value;
use std::collections::BTreeMap;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};

/// Setpoints are never sent to an instrument, but an implausible one is still an error.
const PLAUSIBLE: SetpointRanges = SetpointRanges {
    p3_pa: SetpointRange { low: 50e3, high: 1e6 },
    t3_k: SetpointRange { low: 200.0, high: 1500.0 },
    valve_opening_ratio: SetpointRange { low: 0.0, high: 10.0 },
    oil_temperature_k: SetpointRange { low: 200.0, high: 500.0 },
};

pub(crate) fn open(value: &Value) -> Result<Box<dyn Backend>, BackendError> {
    let (settings, requests) = Settings::read(value)?;
    Ok(Box::new(Instrument { settings, requests, stream: None, armed: None }))
}

#[derive(Debug, thiserror::Error)]
enum RequestError {
    #[error("{0}")]
    Io(#[from] std::io::Error),
    #[error("the instrument did not answer {0} in time")]
    Late(Code),
    #[error("the instrument closed the connection")]
    Closed,
    #[error(transparent)]
    Telegram(#[from] TelegramError),
}

struct Armed {
    sequence: u64,
    last_s: f64,
    error: u8,
    silent: Outage,
}

struct Instrument {
    settings: Settings,
    requests: Requests,
    stream: Option<TcpStream>,
    armed: Option<Armed>,
}

impl Instrument {
    fn armed(&mut self, call: &'static str) -> Result<&mut Armed, BackendError> {
        self.armed.as_mut().ok_or(BackendError::OutOfOrder { call, state: "not armed", needed: "armed" })
    }

    /// Sends a request and reads its answer. A failure closes the connection: a late answer would be taken for the next one.
    fn request(&mut self, code: Code, channel: u8) -> Result<Answer, RequestError> {
        let within = Duration::from_secs_f64(self.settings.timeout_s());
        let deadline = Instant::now() + within;
        let mut stream = match self.stream.take() {
            Some(stream) => stream,
            None => TcpStream::connect_timeout(&self.settings.address, within)?,
        };
        stream.set_write_timeout(Some(within))?;
        stream.write_all(&write_request(code, channel, ""))?;
        let (mut assembler, mut bytes) = (Assembler::default(), [0u8; 512]);
        loop {
            let left = deadline.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Err(RequestError::Late(code));
            }
            stream.set_read_timeout(Some(left))?;
            let count = match stream.read(&mut bytes) {
                Ok(0) => return Err(RequestError::Closed),
                Ok(count) => count,
                Err(error)
                    if matches!(
                        error.kind(),
                        std::io::ErrorKind::WouldBlock | std::io::ErrorKind::TimedOut
                    ) =>
                {
                    return Err(RequestError::Late(code));
                }
                Err(error) => return Err(error.into()),
            };
            let complete = bytes.iter().take(count).find_map(|byte| assembler.push(*byte));
            if let Some(body) = complete {
                let answer = parse_answer(&body, code)?;
                self.stream = Some(stream);
                return Ok(answer);
            }
        }
    }
}

impl Backend for Instrument {
    fn describe(&self) -> RigDescription {
        RigDescription {
            backend: NAME.to_owned(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            channels: self.settings.read.keys().copied().collect(),
            sample_rate_hz: self.settings.rate_hz(),
            simulated_time: false,
            controls: false,
            exclusive: Some(format!("ak {}", self.settings.address)),
            reached_at: None,
            needs_guarded: Vec::new(),
            accepts: Some(PLAUSIBLE),
            safe: SafeTrajectory { p3_slew_pa_s: None, valve_opening_ratio: 1.0, within_s: 1.0 },
        }
    }

    fn arm(&mut self) -> Result<(), BackendError> {
        if self.armed.is_some() {
            return Err(BackendError::OutOfOrder { call: "arm", state: "armed", needed: "not armed" });
        }
        for (code, channel) in self.requests.keys().copied().collect::<Vec<_>>() {
            let requested = self.request(code, channel);
            requested.map_err(|error| BackendError::Lost { t_s: 0.0, source: Box::new(error) })?;
        }
        self.armed = Some(Armed { sequence: 0, last_s: -1.0, error: 0, silent: Outage::default() });
        Ok(())
    }

    /// An instrument takes no setpoints.
    fn set(&mut self, setpoints: &Setpoints) -> Result<(), BackendError> {
        PLAUSIBLE.check(setpoints)?;
        self.armed("set").map(drop)
    }

    fn poll(&mut self, until_s: f64) -> Result<SampleBatch, BackendError> {
        let armed = self.armed("poll")?;
        let (first_sequence, before) = (armed.sequence, armed.error);
        if !(until_s >= 0.0 && until_s > armed.last_s) {
            return Ok(SampleBatch { first_sequence, ..SampleBatch::default() });
        }
        (armed.last_s, armed.sequence) = (until_s, first_sequence + 1);
        let (mut values, mut error, mut failure) = (BTreeMap::<Channel, f64>::new(), before, None);
        for ((code, channel), numbers) in self.requests.clone() {
            // If the instrument does not answer, the sample has no readings, and the guards count how long that lasts.
            let answer = match self.request(code, channel) {
                Ok(answer) => answer,
                Err(error) => {
                    failure = Some(error.to_string());
                    continue;
                }
            };
            error = answer.error;
            for (channel, entry) in numbers {
                let value = answer.number(entry.value).map(|number| number * entry.scale + entry.offset);
                values.insert(channel, value.filter(|value| value.is_finite()).unwrap_or(f64::NAN));
            }
        }
        let armed = self.armed("poll")?;
        armed.error = error;
        let silent = armed.silent.update("missing readings", until_s, failure);
        let status = (error != before).then(|| format!("{}: error status {error}", self.settings.address));
        let note = |message| Event { t_s: until_s, kind: EventKind::Note, message };
        let column = |channel: &Channel| ChannelColumn {
            channel: *channel,
            values: vec![values.get(channel).copied().unwrap_or(f64::NAN)],
        };
        Ok(SampleBatch {
            first_sequence,
            t_s: vec![until_s],
            columns: self.settings.read.keys().map(column).collect(),
            events: silent.into_iter().chain(status).map(note).collect(),
            ..SampleBatch::default()
        })
    }

    fn hold(&mut self) -> Result<(), BackendError> {
        self.armed("hold").map(drop)
    }

    fn make_safe(&mut self) -> Result<(), BackendError> {
        self.armed("make_safe").map(drop)
    }

    fn disarm(&mut self) -> Result<(), BackendError> {
        self.armed("disarm")?;
        (self.armed, self.stream) = (None, None);
        Ok(())
    }
}

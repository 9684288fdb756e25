//! A driver program as a backend.

use crate::find::{DriverError, Endpoint, PREFIX, SearchPath, file_name};
use crate::link::{Lease, Link, ROUNDING_S, SampleQueue};
use crate::protocol::{
    Code, Configure, DescribeResult, Failure, Hello, MAGIC, Message, Poll, Samples, VERSION, Welcome, batch,
    read_description, read_error,
};
use crate::secrets::Secrets;
use mapper_core::{
    Backend, BackendError, RigDescription, SampleBatch, SetpointRange, SetpointRanges, Setpoints,
};
use serde::Serialize;
use serde_json::{Value, json};
use std::path::Path;
use std::time::{Duration, Instant};

/// Timeouts for a driver's responses.
#[derive(Debug, Clone, Copy)]
pub struct Timeouts {
    /// For the handshake.
    pub hello: Duration,
    /// For settings, description, arming and release, which may open connections.
    pub slow: Duration,
    /// For setpoints and the safe state.
    pub call: Duration,
    /// For simulated time to advance, per call.
    pub simulation: Duration,
    /// For a sample in real time, after its due time.
    pub late: Duration,
    /// Without calls for this long, the lease of a rig in real time is no longer renewed.
    pub silence: Duration,
}

/// Values of docs/reference/protocol.md.
pub const DEFAULT_TIMEOUTS: Timeouts = Timeouts {
    hello: Duration::from_secs(5),
    slow: Duration::from_secs(10),
    call: Duration::from_secs(2),
    simulation: Duration::from_secs(60),
    late: Duration::from_millis(150),
    silence: Duration::from_secs(5),
};

/// Time for a driver to exit by itself.
const EXIT_TIMEOUT: Duration = Duration::from_secs(2);

/// A rig that a driver program controls.
pub struct Driver {
    name: String,
    link: Link,
    session: Option<String>,
    /// Whether the driver knows the hold command. Older drivers hold setpoints without it.
    supports_hold: bool,
    description: Option<RigDescription>,
    secrets: Secrets,
    timeouts: Timeouts,
    last_request: u64,
    armed: Option<Lease>,
    /// Whether arming was requested and neither refused nor followed by a release, so that this session may own the rig.
    in_doubt: bool,
    queue: SampleQueue,
    sample_error: Option<DriverError>,
    now_s: f64,
}

impl Driver {
    /// Finds the driver called `name`, starts it and sends its settings. `built_in`: names of other backends, for the error message.
    pub fn find(
        search_path: &SearchPath,
        name: &str,
        settings: &Value,
        built_in: &str,
        hint: &str,
    ) -> Result<Driver, BackendError> {
        let setup_error = |error| settings_error(name, String::new(), error);
        let Some(endpoint) = search_path.find(name) else {
            if let Some(program) = search_path.find_not_executable(name) {
                return Err(setup_error(DriverError::NotExecutable { program }));
            }
            let searched = match search_path.programs.len() {
                0 => "any directory, since PATH is empty".to_owned(),
                _ => search_path
                    .programs
                    .iter()
                    .map(|p| p.display().to_string())
                    .collect::<Vec<_>>()
                    .join(", "),
            };
            let program = file_name(name).unwrap_or_else(|| format!("{PREFIX}<name>"));
            return Err(setup_error(DriverError::NotFound {
                program,
                built_in: built_in.to_owned(),
                searched,
                hint: hint.to_owned(),
            }));
        };
        let variable = |name: &str| std::env::var(name).ok();
        // A driver that was already running has its own environment.
        let needed = matches!(endpoint, Endpoint::Program(_));
        let secrets = Secrets::of(settings, &variable, needed)
            .map_err(|(path, error)| settings_error(name, path, error))?;
        Driver::start(&endpoint, name, settings, secrets, DEFAULT_TIMEOUTS)
    }

    /// Starts a driver program, without secrets.
    pub fn start_program(
        program: &Path,
        name: &str,
        settings: &Value,
        timeouts: Timeouts,
    ) -> Result<Driver, BackendError> {
        Driver::start(&Endpoint::Program(program.to_owned()), name, settings, Secrets::default(), timeouts)
    }

    /// Connects to a driver that listens on a socket, without secrets.
    pub fn connect_socket(
        socket: &Path,
        name: &str,
        settings: &Value,
        timeouts: Timeouts,
    ) -> Result<Driver, BackendError> {
        Driver::start(&Endpoint::Socket(socket.to_owned()), name, settings, Secrets::default(), timeouts)
    }

    fn start(
        endpoint: &Endpoint,
        name: &str,
        settings: &Value,
        secrets: Secrets,
        timeouts: Timeouts,
    ) -> Result<Driver, BackendError> {
        let setup_error = |error| settings_error(name, String::new(), error);
        let mut driver = Driver {
            name: name.to_owned(),
            link: match endpoint {
                Endpoint::Program(program) => Link::start(program),
                #[cfg(unix)]
                Endpoint::Socket(socket) => Link::connect(socket),
                #[cfg(not(unix))]
                Endpoint::Socket(socket) => Err(DriverError::NotListening {
                    socket: socket.clone(),
                    source: std::io::ErrorKind::Unsupported.into(),
                }),
            }
            .map_err(setup_error)?,
            session: None,
            supports_hold: false,
            description: None,
            secrets,
            timeouts,
            last_request: 0,
            armed: None,
            in_doubt: false,
            queue: SampleQueue::default(),
            sample_error: None,
            now_s: 0.0,
        };
        let version = driver.greet()?;
        let settings = Configure { settings: settings.clone() };
        driver.request("configure", &settings, timeouts.slow)?;
        let answer = driver.request("describe", &json!({}), timeouts.slow)?;
        let described: DescribeResult = serde_json::from_value(answer)
            .map_err(|error| driver.lost_error(DriverError::InvalidMessage(error.to_string())))?;
        let rig = read_description(&described.description, name, &version)
            .map_err(|error| driver.lost_error(error.into()))?;
        driver.description = Some(rig);
        Ok(driver)
    }

    fn greet(&mut self) -> Result<String, BackendError> {
        let hello = Hello {
            magic: MAGIC.to_owned(),
            protocol: VERSION,
            name: "mapper".to_owned(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            frame_limit_bytes: crate::protocol::FRAME_LIMIT_BYTES,
        };
        let answer = self.request("hello", &hello, self.timeouts.hello)?;
        // Secrets are removed from the driver's text.
        let setup_error = |error| self.lost_error(error);
        let welcome: Welcome = serde_json::from_value(answer).map_err(|error| {
            setup_error(DriverError::NotADriver(format!("its hello is incomplete: {error}")))
        })?;
        let driver_hello = welcome.hello;
        if driver_hello.magic != MAGIC {
            return Err(setup_error(DriverError::NotADriver("its hello has another magic word".to_owned())));
        }
        if driver_hello.protocol.major != VERSION.major {
            return Err(setup_error(DriverError::Version { theirs: driver_hello.protocol, ours: VERSION }));
        }
        if driver_hello.name != self.name {
            return Err(setup_error(DriverError::Name(driver_hello.name)));
        }
        self.supports_hold = driver_hello.protocol.minor >= crate::protocol::HOLD_SINCE_MINOR;
        self.link.limit_frames(driver_hello.frame_limit_bytes);
        self.session = Some(welcome.session);
        Ok(driver_hello.version)
    }

    fn rig(&self) -> Result<&RigDescription, BackendError> {
        self.description.as_ref().ok_or(BackendError::OutOfOrder {
            call: "describe",
            state: "not described",
            needed: "described",
        })
    }

    fn simulated(&self) -> bool {
        self.description.as_ref().is_some_and(|rig| rig.simulated_time)
    }

    fn lost_error(&self, error: DriverError) -> BackendError {
        let source = Box::new(DriverError::Message(self.secrets.hide(&error.to_string())));
        // Before the description arrives no rig can be lost.
        match self.description {
            Some(_) => BackendError::Lost { t_s: self.now_s, source },
            None => BackendError::Settings { backend: self.name.clone(), path: String::new(), source },
        }
    }

    fn request(
        &mut self,
        call: &'static str,
        params: &impl Serialize,
        within: Duration,
    ) -> Result<Value, BackendError> {
        let params = serde_json::to_value(params)
            .map_err(|error| self.lost_error(DriverError::InvalidMessage(error.to_string())))?;
        self.last_request += 1;
        let request = Message {
            id: Some(self.last_request),
            session: self.session.clone(),
            deadline_s: Some(within.as_secs_f64()),
            method: Some(call.to_owned()),
            params,
            ..Message::default()
        };
        self.link
            .sender()
            .and_then(|sender| sender.send(&request))
            .map_err(|error| self.lost_error(error))?;
        if let Some(lease) = &self.armed {
            lease.record_call();
        }
        let end = Instant::now() + within;
        loop {
            let left = end.saturating_duration_since(Instant::now());
            let incoming = self.link.receive(left).map_err(|error| self.lost_error(error))?;
            let Some(message) = incoming else {
                return Err(BackendError::Deadline { call, limit_s: within.as_secs_f64() });
            };
            match (message.id, message.error, message.result) {
                (Some(id), Some(failure), _) if id == self.last_request => {
                    let mut message = failure.message;
                    // An earlier sample error explains more than the end of the lease.
                    if let (Code::LeaseEnded, Some(sample_error)) = (failure.code, &self.sample_error) {
                        message = format!("{message}; {sample_error}");
                    }
                    let failure = Failure { message: self.secrets.hide(&message), ..failure };
                    return Err(self.refusal_error(failure, call));
                }
                (Some(id), None, result) if id == self.last_request => {
                    return Ok(result.unwrap_or(Value::Null));
                }
                // A late response to an earlier request.
                (Some(_), ..) => {}
                (None, ..) => self.process_note(message.method.as_deref(), message.params),
            }
            if left.is_zero() {
                // A driver that sends endless messages does not count as responding.
                return Err(BackendError::Deadline { call, limit_s: within.as_secs_f64() });
            }
        }
    }

    fn refusal_error(&self, failure: Failure, call: &'static str) -> BackendError {
        match read_error(failure, &self.name, call, self.now_s) {
            // Before the description arrives no rig can be lost.
            BackendError::Lost { source, .. } if self.description.is_none() => {
                BackendError::Settings { backend: self.name.clone(), path: String::new(), source }
            }
            error => error,
        }
    }

    fn process_note(&mut self, method: Option<&str>, params: Value) {
        let (Some(rig), true) = (&self.description, self.sample_error.is_none()) else { return };
        match method {
            Some("samples") => {
                let read = || {
                    let samples: Samples = serde_json::from_value(params)
                        .map_err(|error| DriverError::InvalidMessage(error.to_string()))?;
                    if samples.stream != "rig" {
                        return Ok(());
                    }
                    let mut batch = batch(samples, &rig.channels)?;
                    for event in &mut batch.events {
                        event.message = self.secrets.hide(&event.message);
                    }
                    Ok(self.queue.push(batch)?)
                };
                self.sample_error = read().err();
            }
            Some("lost") => {
                let reason = params.get("message").and_then(Value::as_str).unwrap_or("the rig was lost");
                self.sample_error = Some(DriverError::Message(reason.to_owned()));
            }
            Some("note") => {
                if let Some(reason) = params.get("message").and_then(Value::as_str) {
                    self.queue.note(self.now_s, &self.secrets.hide(reason));
                }
            }
            _ => {}
        }
    }

    fn require_armed(&self, call: &'static str) -> Result<(), BackendError> {
        match self.armed {
            Some(_) => Ok(()),
            None => Err(BackendError::OutOfOrder { call, state: "not armed", needed: "armed" }),
        }
    }

    /// Waits until a rig in real time has delivered the samples due at `until_s`, or is late.
    fn wait_for_samples(&mut self, until_s: f64) -> Result<(), BackendError> {
        let sample_s = 1.0 / self.rig()?.sample_rate_hz;
        let ahead = Duration::try_from_secs_f64((until_s - self.now_s).max(0.0)).unwrap_or(Duration::MAX);
        let late = self.timeouts.late + Duration::try_from_secs_f64(sample_s).unwrap_or_default();
        let end = Instant::now().checked_add(ahead.saturating_add(late));
        if let Some(lease) = &self.armed {
            lease.record_call();
        }
        // The tolerance of nearly one period accepts the last sample before `until_s`.
        while !self.queue.has_reached(until_s - 0.999 * sample_s) && self.sample_error.is_none() {
            let left = end.map_or(Duration::MAX, |end| end.saturating_duration_since(Instant::now()));
            let Some(message) = self.link.receive(left).map_err(|error| self.lost_error(error))? else {
                break;
            };
            if message.id.is_none() {
                self.process_note(message.method.as_deref(), message.params);
            }
        }
        // Processes messages that have already arrived.
        while let Ok(Some(message)) = self.link.receive(Duration::ZERO) {
            if message.id.is_none() {
                self.process_note(message.method.as_deref(), message.params);
            }
            if self.sample_error.is_some() {
                break;
            }
        }
        Ok(())
    }
}

fn settings_error(backend: &str, path: String, error: DriverError) -> BackendError {
    BackendError::Settings { backend: backend.to_owned(), path, source: Box::new(error) }
}

impl Backend for Driver {
    fn describe(&self) -> RigDescription {
        self.description.clone().unwrap_or_else(|| RigDescription {
            backend: self.name.clone(),
            sample_rate_hz: 1.0,
            simulated_time: true,
            ..RigDescription::default()
        })
    }

    fn arm(&mut self) -> Result<(), BackendError> {
        if self.armed.is_some() {
            return Err(BackendError::OutOfOrder { call: "arm", state: "armed", needed: "not armed" });
        }
        self.in_doubt = true;
        (self.queue, self.sample_error, self.now_s) = (SampleQueue::default(), None, 0.0);
        let answer = self.request("arm", &json!({}), self.timeouts.slow);
        if let Err(error) = answer {
            // After a refusal the rig stays with its earlier owner.
            self.in_doubt = matches!(error, BackendError::Deadline { .. });
            return Err(error);
        }
        let silence = (!self.simulated()).then_some(self.timeouts.silence);
        let sender = self.link.sender().map_err(|error| self.lost_error(error))?.clone();
        self.armed = Some(Lease::new(sender, self.session.clone().unwrap_or_default(), silence)?);
        Ok(())
    }

    fn set(&mut self, setpoints: &Setpoints) -> Result<(), BackendError> {
        // Non-finite numbers cannot be written in a frame, whatever range the rig accepts.
        let unlimited_range = SetpointRange { low: f64::MIN, high: f64::MAX };
        let unlimited = SetpointRanges {
            p3_pa: unlimited_range,
            t3_k: unlimited_range,
            valve_opening_ratio: unlimited_range,
            oil_temperature_k: unlimited_range,
        };
        self.rig()?.accepts.unwrap_or(unlimited).check(setpoints)?;
        self.require_armed("set")?;
        self.request("set", setpoints, self.timeouts.call).map(drop)
    }

    fn poll(&mut self, until_s: f64) -> Result<SampleBatch, BackendError> {
        self.require_armed("poll")?;
        let until_s = if until_s.is_finite() { until_s } else { self.now_s };
        if self.simulated() {
            self.request("poll", &Poll { until_s }, self.timeouts.simulation)?;
        } else {
            self.wait_for_samples(until_s)?;
        }
        self.now_s = self.now_s.max(until_s);
        if let Some(error) = self.sample_error.take() {
            return Err(self.lost_error(error));
        }
        let channels = self.rig()?.channels.clone();
        // The driver's own simulated time is exact, and no sample waits for it.
        let rounding_s = if self.simulated() { 0.0 } else { ROUNDING_S };
        Ok(self.queue.take(until_s, rounding_s, &channels))
    }

    fn hold(&mut self) -> Result<(), BackendError> {
        self.require_armed("hold")?;
        if self.supports_hold {
            self.request("hold", &json!({}), self.timeouts.call).map(drop)
        } else {
            Ok(())
        }
    }

    fn make_safe(&mut self) -> Result<(), BackendError> {
        self.require_armed("make_safe")?;
        self.request("make_safe", &json!({}), self.timeouts.call).map(drop)
    }

    fn disarm(&mut self) -> Result<(), BackendError> {
        self.require_armed("disarm")?;
        self.request("disarm", &json!({}), self.timeouts.slow)?;
        (self.armed, self.in_doubt) = (None, false);
        Ok(())
    }
}

impl Drop for Driver {
    fn drop(&mut self) {
        // The thread of the lease also holds the pipe.
        self.armed = None;
        self.link.close(self.in_doubt, EXIT_TIMEOUT);
    }
}

//! The rig behind a controller.

use crate::Controller;
use crate::limits::{
    AcceptedRanges, LimitError, MAX_HEARTBEAT, REQUIRED_GUARDS, SafeSettings, Target, check_range,
    check_readings,
};
use mapper_core::{
    Backend, BackendError, Channel, ChannelColumn, Event, EventKind, Provenance, Quality, RigDescription,
    RigMode, SampleBatch, Setpoints,
};
use mapper_driver::Outage;
use std::collections::{BTreeMap, BTreeSet};

/// Interval of the heartbeat count, s.
const HEARTBEAT_S: f64 = 0.5;
/// Time without an accepted heartbeat after which the air counts as cut, s: twice the time of the watchdog (docs/how-to/rig.md, duties of the PLC).
const HEARTBEAT_LOST_S: f64 = 4.0;
/// The commands, as channels.
const COMMANDS: [Channel; 4] =
    [Channel::P3Command, Channel::T3Command, Channel::ValveCommand, Channel::TOilCommand];

/// One reading.
#[derive(Debug, Clone, PartialEq)]
pub struct Reading {
    /// SI; NaN without a value.
    pub value: f64,
    /// Time of the source, s since arming; `None`: the time of arrival.
    pub source_t_s: Option<f64>,
    /// Quality as reported by the controller.
    pub quality: Quality,
    /// Why it is not good, as the controller reports it; may be empty.
    pub reason: String,
}

impl Reading {
    /// A good reading with its time of arrival.
    pub fn good(value: f64) -> Reading {
        Reading { value, source_t_s: None, quality: Quality::Good, reason: String::new() }
    }

    /// Marks a value that is not a finite number as bad.
    fn judge(&mut self) {
        if !self.value.is_finite() {
            self.quality = Quality::Bad;
            if self.reason.is_empty() {
                self.reason = format!("no number: {}", self.value);
            }
            self.value = f64::NAN;
        }
    }
}

/// Properties of a stand that do not depend on its controller's protocol.
#[derive(Debug)]
pub struct Stand {
    /// Name of the driver.
    pub backend: &'static str,
    /// Version of the driver.
    pub version: &'static str,
    /// Unique name of the rig.
    pub rig: String,
    /// Host and port of the controller.
    pub reached_at: String,
    /// Samples per second, Hz.
    pub rate_hz: f64,
    /// Channels to read.
    pub channels: Vec<Channel>,
    /// Accepted setpoints.
    pub accepts: AcceptedRanges,
    /// The safe trajectory.
    pub safe: SafeSettings,
}

impl Stand {
    /// Checks the settings that every stand needs.
    pub fn check(&self) -> Result<(), (String, LimitError)> {
        let at = |path: &str| {
            let path = path.to_owned();
            move |error| (path, error)
        };
        // The heartbeat is sent with the samples.
        check_range(self.rate_hz, "Hz", 2.0, 50.0).map_err(at("rate"))?;
        check_range(self.safe.within.value, "s", 0.1, 120.0).map_err(at("safe.within"))?;
        for (_, channel) in REQUIRED_GUARDS {
            if !self.channels.contains(&channel) {
                return Err(("read".to_owned(), LimitError::NotMeasured(channel)));
            }
        }
        for target in Target::ALL {
            let range = self.accepts.range(target);
            let path = format!("accepts.{}", target.name());
            check_range(range.high - range.low, "", 0.0, f64::MAX).map_err(at(&path))?;
        }
        let opening = self.accepts.range(Target::Valve);
        check_range(self.safe.opening, "", opening.low, opening.high).map_err(at("safe.opening")).map(drop)
    }
}

/// Makes the rig behind this controller. It connects when it is armed.
pub fn rig(stand: Stand, controller: impl Controller + 'static) -> Box<dyn Backend> {
    Box::new(Rig { stand, controller, armed: None })
}

struct Rig<C> {
    stand: Stand,
    controller: C,
    armed: Option<Armed>,
}

struct Armed {
    setpoints: Option<Setpoints>,
    /// Whether it was made safe since the last setpoint.
    safe: bool,
    sequence: u64,
    last_s: f64,
    heartbeat: u16,
    /// Time of the last heartbeat, s.
    last_heartbeat_s: f64,
    reported: BTreeSet<(Channel, Quality, String)>,
    unread: Outage,
    unsent_heartbeats: Outage,
    /// Time of the last heartbeat that the controller accepted, s; `None` once its loss was reported.
    accepted_heartbeat_s: Option<f64>,
}

impl Armed {
    fn next_heartbeat(&mut self) -> f64 {
        self.heartbeat = (self.heartbeat + 1) % (MAX_HEARTBEAT + 1);
        f64::from(self.heartbeat)
    }
}

impl<C: Controller> Rig<C> {
    fn armed(&mut self, call: &'static str) -> Result<&mut Armed, BackendError> {
        self.armed.as_mut().ok_or(BackendError::OutOfOrder { call, state: "not armed", needed: "armed" })
    }

    fn lost(&self, error: C::Error) -> BackendError {
        let t_s = self.armed.as_ref().map_or(0.0, |armed| armed.last_s.max(0.0));
        BackendError::Lost { t_s, source: Box::new(error) }
    }

    fn write(&mut self, values: &[(Target, f64)]) -> Result<(), BackendError> {
        self.controller.write(values).map_err(|error| self.lost(error))
    }

    /// Sends the heartbeat if it is due. If it does not arrive, the controller cuts the air, as intended.
    fn send_heartbeat(&mut self, until_s: f64) -> Option<String> {
        let armed = self.armed.as_mut().filter(|armed| until_s - armed.last_heartbeat_s >= HEARTBEAT_S)?;
        armed.last_heartbeat_s = until_s;
        let sent = self.controller.write(&[(Target::Heartbeat, armed.next_heartbeat())]);
        if sent.is_ok() {
            armed.accepted_heartbeat_s = Some(until_s);
        }
        let failure = sent.err().map(|error| error.to_string());
        armed.unsent_heartbeats.update("heartbeats that the controller did not accept", until_s, failure)
    }

    fn report_trip(&mut self, until_s: f64) -> Option<Event> {
        let armed = self.armed.as_mut()?;
        let since_s = armed.accepted_heartbeat_s.filter(|since_s| until_s - since_s > HEARTBEAT_LOST_S)?;
        armed.accepted_heartbeat_s = None;
        let message = format!(
            "no heartbeat was accepted since {since_s:.1} s, so that the controller's watchdog cuts the air"
        );
        Some(Event { t_s: until_s, kind: EventKind::RigTripped, message })
    }

    fn report_bad_readings(&mut self, readings: &BTreeMap<Channel, Reading>) -> Option<String> {
        let reported = &mut self.armed.as_mut()?.reported;
        let bad_readings = readings.iter().filter(|(_, reading)| reading.quality != Quality::Good);
        let new: Vec<String> = bad_readings
            .filter(|(channel, reading)| {
                reported.insert((**channel, reading.quality, reading.reason.clone()))
            })
            .map(|(channel, Reading { quality, reason, .. })| {
                let word = if *quality == Quality::Uncertain { "uncertain" } else { "bad" };
                let reason = if reason.is_empty() { String::new() } else { format!(" ({reason})") };
                format!("{} {word}{reason}", channel.symbol())
            })
            .collect();
        (!new.is_empty()).then(|| {
            format!(
                "bad or uncertain readings: {}; check these sensors (the recording has the quality of each reading)",
                new.join(", ")
            )
        })
    }

    /// Minimum heater setpoint, K.
    fn heater_off_k(&self) -> f64 {
        self.stand.accepts.range(Target::T3).low
    }

    fn channels(&self) -> Vec<Channel> {
        self.stand
            .channels
            .iter()
            .copied()
            .filter(|measured| !COMMANDS.contains(measured))
            .chain(COMMANDS)
            .collect()
    }
}

fn command(channel: Channel, setpoints: Option<Setpoints>) -> f64 {
    let Some(setpoints) = setpoints else { return f64::NAN };
    match channel {
        Channel::P3Command => setpoints.p3_pa,
        Channel::T3Command => setpoints.t3_k,
        Channel::ValveCommand => setpoints.valve_opening_ratio,
        _ => setpoints.oil_temperature_k,
    }
}

fn provenance(readings: &BTreeMap<Channel, Reading>, t_s: f64) -> Vec<Provenance> {
    let needs_provenance =
        |reading: &Reading| reading.source_t_s.is_some() || reading.quality != Quality::Good;
    let provenance_of = |(channel, reading): (&Channel, &Reading)| Provenance {
        channel: *channel,
        source_t_s: vec![reading.source_t_s.unwrap_or(t_s)],
        quality: vec![reading.quality],
    };
    readings
        .iter()
        .filter(|(channel, reading)| needs_provenance(reading) && !COMMANDS.contains(channel))
        .map(provenance_of)
        .collect()
}

impl<C: Controller> Backend for Rig<C> {
    fn describe(&self) -> RigDescription {
        RigDescription {
            backend: self.stand.backend.to_owned(),
            version: self.stand.version.to_owned(),
            channels: self.channels(),
            sample_rate_hz: self.stand.rate_hz,
            simulated_time: false,
            controls: true,
            exclusive: Some(self.stand.rig.clone()),
            reached_at: Some(self.stand.reached_at.clone()),
            needs_guarded: REQUIRED_GUARDS.map(|(guard, _)| guard).to_vec(),
            accepts: Some(self.stand.accepts.ranges()),
            safe: self.stand.safe.trajectory(),
        }
    }

    fn arm(&mut self) -> Result<(), BackendError> {
        if self.armed.is_some() {
            return Err(BackendError::OutOfOrder { call: "arm", state: "armed", needed: "not armed" });
        }
        if let Err(error) = self.controller.open() {
            self.controller.close();
            return Err(self.lost(error));
        }
        // A wrong word order or scale would also be wrong in every write.
        let (readings, _) = self.controller.read(0.0);
        let readings = readings.iter().map(|(channel, reading)| (*channel, reading.value));
        if let Err(implausible) = check_readings(&self.controller, readings) {
            self.controller.close();
            let (backend, path) = (self.stand.backend.to_owned(), format!("read.{}", implausible.channel));
            return Err(BackendError::Settings { backend, path, source: implausible });
        }
        let heater_off_k = self.heater_off_k();
        // A killed driver may have left the air on, and a heartbeat must not restore it.
        let outputs_off = self
            .controller
            .write(&[(Target::Air, 0.0), (Target::T3, heater_off_k)])
            .and_then(|()| self.controller.write(&[(Target::Heartbeat, 0.0)]));
        if let Err(error) = outputs_off {
            self.controller.close();
            return Err(self.lost(error));
        }
        self.armed = Some(Armed {
            setpoints: None,
            safe: false,
            sequence: 0,
            last_s: -1.0,
            heartbeat: 0,
            last_heartbeat_s: 0.0,
            reported: BTreeSet::new(),
            unread: Outage::default(),
            unsent_heartbeats: Outage::default(),
            accepted_heartbeat_s: Some(0.0),
        });
        Ok(())
    }

    fn set(&mut self, setpoints: &Setpoints) -> Result<(), BackendError> {
        self.stand.accepts.ranges().check(setpoints)?;
        let heartbeat = self.armed("set")?.next_heartbeat();
        let on = setpoints.mode == RigMode::Running;
        if on {
            // Not polled for a while, the watchdog has expired and would cut the air as soon as it comes on.
            self.write(&[(Target::Heartbeat, heartbeat)])?;
        }
        // The valve first: lower back pressure is always safe.
        let values = [
            (Target::Valve, setpoints.valve_opening_ratio),
            (Target::P3, setpoints.p3_pa),
            // Without air, no flow carries the heat away.
            (Target::T3, if on { setpoints.t3_k } else { self.heater_off_k() }),
            (Target::OilTemperature, setpoints.oil_temperature_k),
        ];
        // Air off is written first, air on last.
        let off = (!on).then_some((Target::Air, 0.0));
        let on = on.then_some((Target::Air, 1.0));
        let values: Vec<_> = off.into_iter().chain(values).chain(on).collect();
        self.write(&values)?;
        let armed = self.armed("set")?;
        (armed.setpoints, armed.safe) = (Some(*setpoints), false);
        Ok(())
    }

    fn poll(&mut self, until_s: f64) -> Result<SampleBatch, BackendError> {
        let armed = self.armed("poll")?;
        let (first_sequence, setpoints) = (armed.sequence, armed.setpoints);
        if !(until_s >= 0.0 && until_s > armed.last_s) {
            return Ok(SampleBatch { first_sequence, ..SampleBatch::default() });
        }
        armed.last_s = until_s;
        armed.sequence += 1;
        let heartbeat = self.send_heartbeat(until_s);
        // If the controller does not answer, the sample has no readings, and the guards count how long that lasts.
        let (mut readings, failure) = self.controller.read(until_s);
        readings.values_mut().for_each(Reading::judge);
        let unread = &mut self.armed("poll")?.unread;
        let unread = unread.update("missing readings", until_s, failure.map(|error| error.to_string()));
        let column = |channel: Channel| {
            let value = if COMMANDS.contains(&channel) {
                command(channel, setpoints)
            } else {
                readings.get(&channel).map_or(f64::NAN, |reading| reading.value)
            };
            ChannelColumn { channel, values: vec![value] }
        };
        let bad = self.report_bad_readings(&readings);
        let trip = self.report_trip(until_s);
        let note = |message| Event { t_s: until_s, kind: EventKind::Note, message };
        Ok(SampleBatch {
            first_sequence,
            t_s: vec![until_s],
            columns: self.channels().into_iter().map(column).collect(),
            provenance: provenance(&readings, until_s),
            events: [self.controller.remark(), heartbeat, unread, bad]
                .into_iter()
                .flatten()
                .map(note)
                .chain(trip)
                .collect(),
            ..SampleBatch::default()
        })
    }

    fn hold(&mut self) -> Result<(), BackendError> {
        let armed = self.armed("hold")?;
        match armed.setpoints.filter(|_| !armed.safe) {
            Some(setpoints) => self.set(&setpoints),
            // Setpoints from before the safe state would restore the air.
            None => Ok(()),
        }
    }

    fn make_safe(&mut self) -> Result<(), BackendError> {
        let armed = self.armed("make_safe")?;
        armed.safe = true;
        let open = armed.setpoints.map_or(0.0, |setpoints| setpoints.valve_opening_ratio);
        let highest = self.stand.accepts.range(Target::Valve).high;
        let valve = open.max(self.stand.safe.opening).min(highest);
        // The heater last: even if the controller refuses it, the valve is open.
        self.write(&[(Target::Air, 0.0), (Target::Valve, valve), (Target::T3, self.heater_off_k())])
    }

    fn disarm(&mut self) -> Result<(), BackendError> {
        self.armed("disarm")?;
        self.armed = None;
        self.controller.close();
        Ok(())
    }
}

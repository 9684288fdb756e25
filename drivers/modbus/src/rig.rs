//! The rig behind the controller.

use crate::blocks::{Block, blocks};
use crate::link::{Link, LinkError, Table};
use crate::settings::{NAME, NEEDS, Place, SettingError, Settings, wrong};
use mapper_core::{
    Backend, BackendError, Channel, ChannelColumn, RigDescription, RigMode, SafeTrajectory, SampleBatch,
    SetpointRanges, Setpoints,
};
use serde_json::Value;
use std::collections::BTreeMap;
use std::time::Duration;

/// How often the heartbeat counts, s.
const HEARTBEAT_S: f64 = 0.5;
/// It counts from 0 to this.
const HEARTBEAT_MAX: u16 = 9999;
/// What was told, as channels.
const COMMANDS: [Channel; 4] =
    [Channel::P3Command, Channel::T3Command, Channel::ValveCommand, Channel::TOilCommand];

/// Makes the rig; nothing is connected.
pub(crate) fn open(value: &Value) -> Result<Box<dyn Backend>, BackendError> {
    let settings = Settings::read(value)?;
    let within = Duration::from_secs_f64(settings.timeout_s());
    let link = Link::new(settings.address, settings.unit, within)
        .map_err(|error| wrong("", SettingError::Form(serde::de::Error::custom(error))))?;
    let tables = [Table::Holding, Table::Input];
    let pieces = |table: Table| {
        let of_table = settings.read.values().filter(move |place| place.table == table);
        let pieces = of_table.map(|place| Block { start: place.register, count: place.form.count() });
        blocks(&pieces.collect::<Vec<_>>()).into_iter().map(move |block| (table, block))
    };
    let blocks = tables.into_iter().flat_map(pieces).collect();
    Ok(Box::new(Rig { settings, link, blocks, armed: None }))
}

struct Rig {
    settings: Settings,
    link: Link,
    blocks: Vec<(Table, Block)>,
    armed: Option<Armed>,
}

struct Armed {
    told: Option<Setpoints>,
    sequence: u64,
    last_s: f64,
    heartbeat: u16,
    /// When it counted last, s.
    beaten_s: f64,
}

impl Rig {
    fn armed(&mut self, call: &'static str) -> Result<&mut Armed, BackendError> {
        self.armed.as_mut().ok_or(BackendError::OutOfOrder { call, state: "not armed", needed: "armed" })
    }

    fn lost(&self, error: LinkError) -> BackendError {
        BackendError::Lost {
            t_s: self.armed.as_ref().map_or(0.0, |armed| armed.last_s.max(0.0)),
            source: Box::new(error),
        }
    }

    fn write(&mut self, place: Place, value: f64) -> Result<(), BackendError> {
        let Some(registers) = self.settings.registers(&place, value) else {
            return Err(wrong("write", SettingError::DoesNotFit { value }));
        };
        self.link.write(place.register, &registers).map_err(|error| self.lost(error))
    }

    /// Every register that a channel wants; a block that cannot be read has none. After the first failure the others are not
    /// asked for: each would wait for its own deadline.
    fn registers(&mut self) -> (BTreeMap<(Table, u16), u16>, Option<LinkError>) {
        let mut all = BTreeMap::new();
        for (table, block) in self.blocks.clone() {
            match self.link.read(table, block) {
                Ok(registers) => {
                    all.extend((block.start..).zip(registers).map(|(at, value)| ((table, at), value)));
                }
                Err(LinkError::Refused { .. }) => {}
                Err(error) => return (all, Some(error)),
            }
        }
        (all, None)
    }

    fn beat(&mut self, until_s: f64) {
        let place = self.settings.write.heartbeat;
        let Some(armed) = self.armed.as_mut().filter(|armed| until_s - armed.beaten_s >= HEARTBEAT_S) else {
            return;
        };
        armed.beaten_s = until_s;
        armed.heartbeat = (armed.heartbeat + 1) % (HEARTBEAT_MAX + 1);
        let count = f64::from(armed.heartbeat);
        // Where it does not arrive the controller cuts the air by itself, which is what it is for.
        let _ = self.write(place, count);
    }

    fn channels(&self) -> Vec<Channel> {
        self.settings.read.keys().copied().filter(|one| !COMMANDS.contains(one)).chain(COMMANDS).collect()
    }
}

impl Backend for Rig {
    fn describe(&self) -> RigDescription {
        let [p3_pa, t3_k, valve_opening_ratio, oil_temperature_k] = self.settings.ranges();
        let safe = &self.settings.safe;
        RigDescription {
            backend: NAME.to_owned(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            channels: self.channels(),
            sample_rate_hz: self.settings.rate_hz(),
            simulated_time: false,
            controls: true,
            exclusive: Some(
                self.settings.rig.clone().unwrap_or_else(|| format!("modbus {}", self.settings.address)),
            ),
            needs_guarded: NEEDS.map(|(guard, _)| guard).to_vec(),
            accepts: Some(SetpointRanges { p3_pa, t3_k, valve_opening_ratio, oil_temperature_k }),
            safe: SafeTrajectory {
                p3_slew_pa_s: safe.pressure_slew.as_ref().map(|slew| slew.inside),
                valve_opening_ratio: safe.opening,
                within_s: safe.within.inside,
            },
        }
    }

    fn arm(&mut self) -> Result<(), BackendError> {
        if self.armed.is_some() {
            return Err(BackendError::OutOfOrder { call: "arm", state: "armed", needed: "not armed" });
        }
        for (table, block) in self.blocks.clone() {
            self.link.read(table, block).map_err(|error| self.lost(error))?;
        }
        self.write(self.settings.write.heartbeat, 0.0)?;
        self.armed = Some(Armed { told: None, sequence: 0, last_s: -1.0, heartbeat: 0, beaten_s: 0.0 });
        Ok(())
    }

    fn set(&mut self, setpoints: &Setpoints) -> Result<(), BackendError> {
        if let Some(accepts) = &self.describe().accepts {
            accepts.check(setpoints)?;
        }
        self.armed("set")?;
        let (write, on) = (&self.settings.write, setpoints.mode == RigMode::Running);
        let (p3, t3, valve, oil, air) = (write.p3, write.t3, write.valve, write.oil_temperature, write.air);
        if !on {
            self.write(air, 0.0)?;
        }
        // The valve first: less back pressure is never worse.
        self.write(valve, setpoints.valve_opening_ratio)?;
        self.write(p3, setpoints.p3_pa)?;
        self.write(t3, setpoints.t3_k)?;
        self.write(oil, setpoints.oil_temperature_k)?;
        if on {
            self.write(air, 1.0)?;
        }
        self.armed("set")?.told = Some(*setpoints);
        Ok(())
    }

    fn poll(&mut self, until_s: f64) -> Result<SampleBatch, BackendError> {
        let armed = self.armed("poll")?;
        let (first_sequence, told) = (armed.sequence, armed.told);
        if !(until_s >= 0.0 && until_s > armed.last_s) {
            return Ok(SampleBatch { first_sequence, ..SampleBatch::default() });
        }
        armed.last_s = until_s;
        armed.sequence += 1;
        self.beat(until_s);
        // A controller that does not answer gives samples without readings: the guards count how long.
        let (registers, _) = self.registers();
        let value = |place: &Place| {
            let words: Vec<u16> = (place.register..place.register + place.form.count())
                .filter_map(|at| registers.get(&(place.table, at)).copied())
                .collect();
            self.settings.value(place, &words)
        };
        let command = |channel: Channel| {
            let Some(told) = told else { return f64::NAN };
            match channel {
                Channel::P3Command => told.p3_pa,
                Channel::T3Command => told.t3_k,
                Channel::ValveCommand => told.valve_opening_ratio,
                _ => told.oil_temperature_k,
            }
        };
        let column = |channel: Channel| {
            let place = self.settings.read.get(&channel).filter(|_| !COMMANDS.contains(&channel));
            let reading = place.map_or_else(|| command(channel), value);
            ChannelColumn { channel, values: vec![reading] }
        };
        Ok(SampleBatch {
            first_sequence,
            t_s: vec![until_s],
            columns: self.channels().into_iter().map(column).collect(),
            ..SampleBatch::default()
        })
    }

    fn make_safe(&mut self) -> Result<(), BackendError> {
        let open = self.armed("make_safe")?.told.map_or(0.0, |told| told.valve_opening_ratio);
        let (air, valve) = (self.settings.write.air, self.settings.write.valve);
        let highest = self.settings.ranges()[2].high;
        self.write(air, 0.0)?;
        self.write(valve, open.max(self.settings.safe.opening).min(highest))
    }

    fn disarm(&mut self) -> Result<(), BackendError> {
        self.armed("disarm")?;
        self.armed = None;
        self.link.close();
        Ok(())
    }
}

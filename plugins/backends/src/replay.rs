//! Replays a recording as a rig.

use crate::ACCEPTED_SETPOINTS;
use mapper_core::{
    Backend, BackendError, Channel, ChannelColumn, Element, ElementColumn, Event, EventKind, Group,
    Recording, RigDescription, RigMode, SafeTrajectory, SampleBatch, Series, Setpoints,
};
use mapper_physics::rig::backend_plugin::{BackendPlugin, NominalRig};
use mapper_recording::{ChannelMap, ChannelMapError, ReadOptions, RecordError, read_recording};
use std::path::Path;

/// Name of the backend, in campaigns and descriptions.
pub const NAME: &str = "replay";

/// Replay as a plugin for campaigns.
pub const PLUGIN: BackendPlugin = BackendPlugin {
    name: NAME,
    summary: "replays a recording: {recording: FILE, channels: MAP.yaml}; `channels` for a log of another program",
    make,
};

#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum ReplayError {
    #[error("write the path of an MCAP file, e.g. {{recording: runs/x/recording.mcap}}")]
    NoRecording,
    #[error(transparent)]
    Unreadable(#[from] RecordError),
    #[error(transparent)]
    ChannelMap(#[from] ChannelMapError),
    #[error("the recording being replayed has ended")]
    Ended,
}

fn make(_: &NominalRig, settings: &serde_json::Value) -> Result<Box<dyn Backend>, BackendError> {
    let settings_error = |key: &str, problem: ReplayError| BackendError::Settings {
        backend: NAME.to_owned(),
        path: key.to_owned(),
        source: Box::new(problem),
    };
    let path = |key: &str| settings.get(key).and_then(|value| value.as_str()).map(Path::new);
    let recording = path("recording").ok_or_else(|| settings_error("recording", ReplayError::NoRecording))?;
    let map = path("channels").map(ChannelMap::load).transpose();
    let map =
        map.map_err(|error| settings_error("channels", error.into()))?.unwrap_or_else(ChannelMap::native);
    let report = read_recording(recording, &map, &ReadOptions::default())
        .map_err(|error| settings_error("recording", error.into()))?;
    Ok(Box::new(ReplayBackend::new(&report.recording)))
}

/// Maximum relative difference between a setpoint and the recorded command: the resolution of a file with values in kPa
/// and three decimals.
const SETPOINT_TOLERANCE_RATIO: f64 = 1e-4;

/// Replays a [`Recording`]. Its commands cannot change: setpoints are accepted and compared with the recorded commands, and differences
/// are noted as events.
///
/// The replay has a sample at every recorded time. Commands hold between their samples; any other channel is NaN without a sample. The end
/// of the recording is reported as the loss of the rig.
#[derive(Debug)]
pub struct ReplayBackend {
    t_s: Vec<f64>,
    columns: Vec<ChannelColumn>,
    elements: Vec<ElementColumn>,
    events: Vec<Event>,
    armed: bool,
    /// Samples and events returned by polls so far.
    samples_played: usize,
    events_played: usize,
    /// Setpoints not yet compared with the recording.
    pending: Option<Setpoints>,
}

impl ReplayBackend {
    /// Plays this recording.
    pub fn new(recording: &Recording) -> ReplayBackend {
        let measured = |channel: &Channel| channel.info().group != Group::Command;
        let only_commands = !recording.series.keys().any(measured);
        let mut t_s: Vec<f64> = recording
            .series
            .iter()
            .filter(|(channel, _)| only_commands || measured(channel))
            .flat_map(|(_, series)| series.t_s.iter().copied())
            .chain(recording.elements.values().flat_map(|series| series.t_s.iter().copied()))
            .collect();
        t_s.sort_by(f64::total_cmp);
        t_s.dedup();
        let columns = recording
            .series
            .iter()
            .map(|(channel, series)| {
                let values = if measured(channel) {
                    values_at_samples(series, &t_s)
                } else {
                    t_s.iter().map(|t| series.held(*t).unwrap_or(f64::NAN)).collect()
                };
                ChannelColumn { channel: *channel, values }
            })
            .collect();
        let element = |(element, series): (&Element, &Series)| ElementColumn {
            element: *element,
            values: values_at_samples(series, &t_s),
        };
        let elements = recording.elements.iter().map(element).collect();
        let mut events = recording.events.clone();
        events.sort_by(|a, b| a.t_s.total_cmp(&b.t_s));
        ReplayBackend {
            t_s,
            columns,
            elements,
            events,
            armed: false,
            samples_played: 0,
            events_played: 0,
            pending: None,
        }
    }

    /// Time of the last sample, s.
    pub fn end_s(&self) -> Option<f64> {
        self.t_s.last().copied()
    }

    fn require_armed(&self, call: &'static str) -> Result<(), BackendError> {
        if self.armed {
            Ok(())
        } else {
            Err(BackendError::OutOfOrder { call, state: "not armed", needed: "armed" })
        }
    }

    /// Notes on setpoints that differ from the recorded commands at a sample.
    fn note_differences(&self, setpoints: &Setpoints, sample: usize) -> Vec<Event> {
        let Some(t_s) = self.t_s.get(sample).copied() else { return Vec::new() };
        let commands = [
            (Channel::P3Command, setpoints.p3_pa),
            (Channel::T3Command, setpoints.t3_k),
            (Channel::ValveCommand, setpoints.valve_opening_ratio),
            (Channel::TOilCommand, setpoints.oil_temperature_k),
        ];
        let recorded = |channel| self.columns.iter().find(|column| column.channel == channel);
        commands.into_iter()
            .filter_map(|(channel, value)| {
                let command = recorded(channel)?.values.get(sample).copied()?;
                let differs = (value - command).abs() > SETPOINT_TOLERANCE_RATIO * command.abs();
                differs.then(|| Event {
                    t_s,
                    kind: EventKind::Note,
                    message: format!(
                        "{channel} is set to {value} {unit}, but was {command} {unit} in the recording being replayed",
                        unit = channel.unit()
                    ),
                })
            })
            .collect()
    }
}

impl Backend for ReplayBackend {
    fn describe(&self) -> RigDescription {
        RigDescription {
            backend: NAME.to_owned(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            channels: self.columns.iter().map(|column| column.channel).collect(),
            sample_rate_hz: sample_rate_hz(&self.t_s),
            simulated_time: true,
            controls: false,
            exclusive: None,
            reached_at: None,
            needs_guarded: Vec::new(),
            accepts: Some(ACCEPTED_SETPOINTS),
            safe: SafeTrajectory::default(),
        }
    }

    fn arm(&mut self) -> Result<(), BackendError> {
        if self.armed {
            return Err(BackendError::OutOfOrder { call: "arm", state: "armed", needed: "not armed" });
        }
        (self.armed, self.samples_played, self.events_played, self.pending) = (true, 0, 0, None);
        Ok(())
    }

    fn set(&mut self, setpoints: &Setpoints) -> Result<(), BackendError> {
        ACCEPTED_SETPOINTS.check(setpoints)?;
        self.require_armed("set")?;
        self.pending = Some(*setpoints);
        Ok(())
    }

    fn poll(&mut self, until_s: f64) -> Result<SampleBatch, BackendError> {
        self.require_armed("poll")?;
        let start = self.samples_played;
        let end = start.max(self.t_s.partition_point(|t| *t <= until_s));
        if start == end && self.end_s().is_none_or(|end_s| until_s > end_s) {
            let source = Box::new(ReplayError::Ended);
            return Err(BackendError::Lost { t_s: self.end_s().unwrap_or(0.0), source });
        }
        let events_end = self.events_played.max(self.events.partition_point(|event| event.t_s <= until_s));
        let mut events = self.events[self.events_played..events_end].to_vec();
        if start < end
            && let Some(setpoints) =
                self.pending.take().filter(|setpoints| setpoints.mode == RigMode::Running)
        {
            // Setpoints apply from the last poll, so they affect the next sample.
            events.extend(self.note_differences(&setpoints, start));
            events.sort_by(|a, b| a.t_s.total_cmp(&b.t_s));
        }
        (self.samples_played, self.events_played) = (end, events_end);
        Ok(SampleBatch {
            first_sequence: start as u64,
            t_s: self.t_s[start..end].to_vec(),
            columns: self
                .columns
                .iter()
                .map(|column| ChannelColumn {
                    channel: column.channel,
                    values: column.values[start..end].to_vec(),
                })
                .collect(),
            elements: self
                .elements
                .iter()
                .map(|column| ElementColumn {
                    element: column.element,
                    values: column.values[start..end].to_vec(),
                })
                .collect(),
            events,
            ..SampleBatch::default()
        })
    }

    fn hold(&mut self) -> Result<(), BackendError> {
        self.require_armed("hold")
    }

    fn make_safe(&mut self) -> Result<(), BackendError> {
        self.require_armed("make_safe")
    }

    fn disarm(&mut self) -> Result<(), BackendError> {
        self.require_armed("disarm")?;
        self.armed = false;
        Ok(())
    }
}

/// Values at these times, NaN if the series has no sample. Both are strictly increasing.
fn values_at_samples(series: &Series, t_s: &[f64]) -> Vec<f64> {
    let mut own = series.t_s.iter().zip(&series.values).peekable();
    t_s.iter()
        .map(|t| {
            while own.next_if(|(own_t, _)| *own_t < t).is_some() {}
            own.peek().filter(|(own_t, _)| *own_t == t).map_or(f64::NAN, |(_, value)| **value)
        })
        .collect()
}

/// Sample rate from the median interval, which pauses do not affect; 0 below two samples.
fn sample_rate_hz(t_s: &[f64]) -> f64 {
    let mut intervals_s: Vec<f64> = t_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
    intervals_s.sort_by(f64::total_cmp);
    intervals_s.get(intervals_s.len() / 2).map_or(0.0, |interval_s| 1.0 / interval_s)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;

    fn setpoints(p3_pa: f64) -> Setpoints {
        Setpoints {
            mode: RigMode::Running,
            p3_pa,
            t3_k: 773.15,
            valve_opening_ratio: 0.5,
            oil_temperature_k: 323.15,
        }
    }

    /// T2 at 10 Hz with a gap, the command at 1 Hz and at its change.
    fn recording() -> Recording {
        let times_s = |indices: std::ops::Range<u32>| indices.map(|i| f64::from(i) / 10.0);
        let t_s: Vec<f64> = times_s(0..30).filter(|t| !(1.2..1.5).contains(t)).collect();
        let t2 = Series { values: t_s.iter().map(|t| 300.0 + t).collect(), t_s };
        let p3 = Series { t_s: vec![0.0, 1.0, 1.7, 2.0], values: vec![1.5e5, 1.5e5, 2e5, 2e5] };
        Recording {
            series: BTreeMap::from([(Channel::T2, t2), (Channel::P3Command, p3)]),
            events: vec![Event { t_s: 0.5, kind: EventKind::SurgeEntered, message: "surge".to_owned() }],
            ..Recording::default()
        }
    }

    #[test]
    fn a_replay_returns_the_recorded_samples_for_any_polls() {
        let recording = recording();
        for polls_s in [vec![9.0], vec![0.95, 0.96, 1.3, 2.9], (0..31).map(|i| f64::from(i) / 10.0).collect()]
        {
            let mut rig = ReplayBackend::new(&recording);
            rig.arm().unwrap();
            let (mut played, mut commanded, mut events, mut sequence) =
                (Series::default(), vec![], vec![], 0);
            for until_s in polls_s {
                match rig.poll(until_s) {
                    Ok(batch) => {
                        assert_eq!(batch.first_sequence, sequence);
                        sequence += batch.t_s.len() as u64;
                        played.values.extend(batch.column(Channel::T2).unwrap());
                        commanded.extend(batch.column(Channel::P3Command).unwrap().to_vec());
                        played.t_s.extend(batch.t_s);
                        events.extend(batch.events);
                    }
                    Err(error) => assert!(matches!(error, BackendError::Lost { .. })),
                }
            }
            assert_eq!(&played, recording.require(Channel::T2).unwrap());
            let change = played.t_s.iter().position(|t| *t >= 1.7).unwrap();
            assert!(commanded[..change].iter().all(|p3_pa| *p3_pa == 1.5e5));
            assert!(commanded[change..].iter().all(|p3_pa| *p3_pa == 2e5));
            assert_eq!(events, recording.events);
        }
    }

    #[test]
    fn the_end_of_the_recording_is_the_loss_of_the_rig() {
        let mut rig = ReplayBackend::new(&recording());
        rig.arm().unwrap();
        assert_eq!(rig.poll(100.0).unwrap().t_s.len(), 27);
        assert!(matches!(rig.poll(101.0), Err(BackendError::Lost { t_s: 2.9, .. })));
        rig.make_safe().unwrap();
        rig.disarm().unwrap();
    }

    #[test]
    fn setpoints_that_differ_from_the_recorded_ones_are_noted() {
        let mut rig = ReplayBackend::new(&recording());
        rig.arm().unwrap();
        rig.set(&setpoints(1.5e5)).unwrap();
        rig.poll(0.4).unwrap();
        rig.set(&setpoints(2e5)).unwrap();
        let events = rig.poll(0.45).unwrap().events;
        assert!(events.is_empty(), "no sample has shown it yet");
        let events = rig.poll(1.0).unwrap().events;
        assert_eq!(
            events.iter().map(|e| e.kind).collect::<Vec<_>>(),
            [EventKind::SurgeEntered, EventKind::Note]
        );
        assert!(events[1].message.contains("P3_command is set to 200000 Pa"), "{}", events[1].message);
    }

    #[test]
    fn the_life_cycle_is_kept() {
        let mut rig = ReplayBackend::new(&recording());
        assert!(matches!(rig.poll(1.0), Err(BackendError::OutOfOrder { call: "poll", .. })));
        assert!(rig.set(&setpoints(1e5)).is_err());
        rig.arm().unwrap();
        assert!(rig.arm().is_err());
        let description = rig.describe();
        assert_eq!(description.channels, [Channel::T2, Channel::P3Command]);
        // Differences of tenths have rounding errors.
        assert!((description.sample_rate_hz - 10.0).abs() < 1e-9);
        let mut empty = ReplayBackend::new(&Recording::default());
        empty.arm().unwrap();
        assert!(matches!(empty.poll(0.1), Err(BackendError::Lost { .. })));
    }
}

//! Recordings: reading and writing MCAP, and mapping other programs' recordings onto the rig's channels.
//!
//! A recording is one MCAP file: a message in JSON per device group and sample, units in each channel's metadata and
//! in its schema, step markers on `/step`, events on `/event`, plan and campaign attached. The simulator's
//! truth is under `/truth`; [`read_recording`] never returns it, only [`score`] reads it.
//!
//! All input is untrusted: files may be truncated, damaged, or not MCAP at all. Recoverable data
//! are returned together with a list of [`ReadWarning`]s.
#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod channel_mapping;
mod error;
mod format;
pub mod logs;
mod mcap;
mod reading;
mod samples;
pub mod score;
mod step_detection;
mod truth;
mod warning;
mod writing;

pub use channel_mapping::channel_map::{
    AmbientPressure, Barometer, ChannelMap, ChannelSource, MachineConstants, WindowLimits,
};
pub use channel_mapping::channel_map_yaml::ChannelMapError;
pub use error::{BadBatch, RecordError};
pub use format::FormatVersion;
pub use mapper_yaml::Findings;
pub use mapper_yaml::units::{Kind, Unit, UnitError};
pub use mcap::chunk::ChunkError;
pub use reading::read_options::ReadOptions;
pub use reading::recording_reader::{
    ReadReport, read_marks, read_recording, read_recording_from, read_steps,
};
pub use warning::{DamagedPart, ReadWarning};
pub use writing::recording_file::RecordingHeader;
pub use writing::topics::{StepPhase, Topic, event_message, readings_message, step_message};
pub use writing::writer::RecordingWriter;

//! Recordings: reading and writing MCAP, and mapping other programs' recordings onto the rig's channels.
//!
//! A recording is one MCAP file: a message in JSON per device group and sample, units in each channel's metadata and
//! in its schema, step markers on `/step`, events on `/event`, plan and campaign attached. The simulator's
//! truth is under `/truth`; [`read_recording`] never returns it, only [`score`] reads it.
//!
//! All input is untrusted: files may be truncated, damaged, or not MCAP at all. Recoverable data
//! are returned together with a list of [`ReadWarning`]s.
#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

pub mod logs;
mod batch;
mod channel_map;
mod channel_map_schema;
mod channel_map_yaml;
mod chunk;
mod clock_steps;
mod complaints;
mod continuity;
mod definitions;
mod error;
mod format;
mod framing;
mod log_blocks;
mod log_clock;
mod log_read;
mod measured_valve;
mod message;
mod plausibility;
mod provenance;
mod read;
mod read_options;
mod recording_file;
mod records;
mod rig_sink;
mod scan;
mod schema;
pub mod score;
mod series_builder;
mod sink;
mod steps;
mod steps_found;
mod topics;
mod truth;
mod warning;
mod writer;

pub use channel_map::{
    AmbientPressure, Barometer, ChannelMap, ChannelSource, MachineConstants, WindowLimits,
};
pub use channel_map_yaml::ChannelMapError;
pub use chunk::ChunkError;
pub use error::{BadBatch, RecordError};
pub use format::FormatVersion;
pub use mapper_yaml::Findings;
pub use mapper_yaml::units::{Kind, Unit, UnitError};
pub use read::{ReadReport, read_marks, read_recording, read_recording_from, read_steps};
pub use read_options::ReadOptions;
pub use recording_file::RecordingHeader;
pub use topics::{StepPhase, Topic, event_message, readings_message, step_message};
pub use warning::{DamagedPart, ReadWarning};
pub use writer::RecordingWriter;

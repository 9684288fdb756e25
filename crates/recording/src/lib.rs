//! Writes and reads recordings of runs: [`RecordingWriter`] for the runner, [`read_recording`] for everything that evaluates a run or a log of
//! another program.
//!
//! A recording is one MCAP file. Each device group has a topic with one JSON message per sample; schema and channel metadata name the
//! units. Step markers are on `/step`, events on `/event`; plan and campaign are attached. The simulator's truth is under `/truth`:
//! [`read_recording`] never returns it, only [`score`] reads it. A [`ChannelMap`] assigns the topics or columns of other programs to
//! the rig's channels.
//!
//! Every file is untrusted: it may be truncated, damaged, or not MCAP at all. Readers return the recoverable data and a list of
//! [`ReadWarning`]s.
#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod channel_mapping;
mod error;
mod jump_steps;
pub(crate) mod log_reader;
pub mod logs;
mod mcap;
pub(crate) mod recording_reader;
mod run_file;
mod samples;
pub(crate) mod scan;
pub mod score;
mod steps;
pub(crate) mod topics;
pub(crate) mod writer;

pub use crate::topics::FormatVersion;
pub use channel_mapping::channel_map::{
    AmbientPressure, Barometer, ChannelMap, ChannelSource, MachineConstants, WindowLimits,
};
pub use channel_mapping::channel_map_yaml::ChannelMapError;
pub use error::{BatchError, DamagedPart, ReadWarning, RecordError, StepsFound};
pub use mapper_yaml::Findings;
pub use mapper_yaml::units::{Kind, Unit, UnitError};
pub use mcap::{ChunkError, recording_program};
pub use recording_reader::{ReadReport, read_marks, read_recording, read_recording_from};
pub use run_file::{DiskFaults, RunFile};
pub use scan::ReadOptions;
pub use topics::{RecordingHeader, StepPhase};
pub use writer::RecordingWriter;

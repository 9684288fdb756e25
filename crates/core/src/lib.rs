//! The data types that all crates of `mapper` share, and the two interfaces to the outside: [`Backend`] (a rig) and [`Clock`].
//!
//! The program is a chain of functions from data to data: campaign -> [`Plan`] -> [`Recording`] -> [`IdentifiedPoint`] ->
//! [`CompressorMap`]. This crate defines these types and every measured quantity ([`Channel`]). It does no input or output.
//!
//! Conventions: SI units (kelvin, pascal, kg/s), except shaft speed in rpm as on every map; each `f64`
//! that crosses a boundary carries its unit in its name; pressures and temperatures are total unless a name contains
//! `static`; corrected quantities are stored with their [`ReferenceState`].

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod enums;
mod identification;
pub mod json_messages;
mod maps;
mod measurement;
mod rig;
pub mod test_plan;
mod text;
pub mod unit_factors;

pub use enums::UnknownName;
pub use identification::identified::{
    BudgetRow, CommonErrors, EstimateUncertainty, IdentifiedPoint, Margins, Method, MethodResult,
    MethodResults, PointBudgets, ResultRemark, UncertaintyBudget, Verdict, Window, confidence_interval_95,
    half_width_95, nan_where_null, standard_error_of,
};
pub use identification::settings::{
    ACCEPTANCE_WINDOW_S, ALPHA_AREA_SIGMA_RATIO, AcceptanceCriteria, Choice, JointSettings, ModelTolerances,
    SettleBands, StructureTolerances, WindowRule,
};
pub use identification::thermal_model::{
    ConvectionLaw, CorrelatedPair, IdentifiedHousing, IdentifiedInlet, InletConvection, Origin, SharedValue,
    ThermalModel,
};
pub use identification::turbine_point::{TurbineCommonErrors, TurbineDoubt, TurbineHousing, TurbinePoint};
pub use identification::warning::{
    Bound, CalibrationDefect, EndEvidence, EtaSignal, FitFailure, LeftOut, MapRegion, ModelDoubt,
    ModelEvidence, NoCompression, PoorFit, Scaled, SeenAtRest, StepConflict, SuspectedFault, Swapped, TooFew,
    Warning, WideInterval,
};
pub use json_messages::{JsonMessages, Sentences, with_sentences};
pub use maps::imported_map::{
    DescribedColumn, DesignPoint, ImportRemark, ImportedColumn, ImportedMap, LineEnd, MapDescription,
    MeasuredPoint, MeasuredTurbinePoint, StaticTaps, TurbineReadings,
};
pub use maps::map::{
    CompressorMap, FittedLine, FittedMap, FittedNode, LeftOutLine, MapPoint, SpeedLine, SpeedShift,
};
pub use maps::map_format::{
    DrawMap, ExportError, ImportError, MAP_FILE_SIZE_LIMIT, MapFormat, MapFormats, MapUnits, ReadMap,
    ReadTurbine, TurbineFormat, WriteMap, WriteTurbine,
};
pub use maps::reference_state::{
    EfficiencyDefinition, NAMED_REFERENCES, NamedReference, ReferenceState, UnknownEfficiency,
    usual_references,
};
pub use maps::turbine_map::{
    FittedTurbine, FittedTurbineLine, FittedTurbineNode, ImportedTurbine, TurbineMap, TurbineMapPoint,
};
pub use measurement::channel::{
    CALIBRATED_AT_K, CHANNELS, Channel, ChannelInfo, DeclaredUncertainty, Dimension, Group,
    MODELLED_CHANNELS, NoiseColour, SAMPLE_INTERVAL_S, UnknownChannel,
};
pub use measurement::joined_recordings::{StepOrigin, join_recordings};
pub use measurement::jump::{
    JUMPS, SAME_COMMAND_RATIO, SLOW_JUMP_MULTIPLE, StepPoint, is_commanded_jump, is_jump, is_same_command,
    jump_ratio,
};
pub use measurement::plausible::{
    COARSE_REPEAT_S, COARSE_REPEAT_SAMPLES, FaultKind, FrozenLimit, Implausible, NOISY_REPEAT_S, Plausible,
    check_running, is_plausible_range, is_possible, is_reading, measurable, plausible, repeats,
};
pub use measurement::recording::{
    ChannelColumn, ElementColumn, Event, EventKind, FastSamples, Provenance, Quality, ReadingOrigin,
    Recording, RecordingError, SampleBatch, Series, StepMarker, TruthColumn,
};
pub use measurement::redundant::{DeclaredElement, Element, MAX_ELEMENTS, RedundantSensors, UnknownElement};
pub use rig::actuators::{ActuatorMotion, RigActuators};
pub use rig::avoided_speeds::{AvoidedCrossing, AvoidedRange, AvoidedSpeeds, AvoidedTime};
pub use rig::backend::{
    Backend, BackendCause, BackendError, Clock, PacedClock, RigDescription, RigMode, SetpointRange,
    SetpointRanges, Setpoints, UnpacedClock, WallClock,
};
pub use rig::guard::{
    GuardName, GuardSet, LargestChange, Reaction, RunEnding, SafeTrajectory, SignalGuard, SpeedBand,
    SurgeVariation, Trip,
};
pub use rig::limits::{Limits, OnDrift, SURGE_ALLOWED_S, Soak, SpeedControlSettings, SpeedResponse};
pub use rig::surge::{SoftSurge, SurgeFoundBy, SurgeMark, SurgeNotFound, SurgeSearchSettings};
pub use test_plan::plan::{
    Advice, CampaignChange, Plan, PlanFigures, PlanInputHashes, PlanRemark, PlanStep, Predicted, Ramp, Ramps,
    StepKind, Transition, UndeclaredForecast, VerdictForecast,
};
pub use test_plan::points::{Dwell, Jump, OperatingPoint, Repeats, Timing, VisitOrder, valve_area_text};
pub use test_plan::step_number::step_number;
pub use text::{
    coloured_text, krpm, one_line, probability_text, readable, shorten_numbers, temperature, terminal_json,
    terminal_text, with_unit,
};

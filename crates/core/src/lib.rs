//! The data types that all crates of `mapper` share, and the two interfaces to the outside: [`Backend`] (a rig) and [`Clock`].
//!
//! The program is a chain of functions from data to data: campaign -> [`Plan`] -> [`Recording`] -> [`IdentifiedPoint`] ->
//! [`CompressorMap`]. This crate defines these types and every measured quantity ([`Channel`]). It does no input or output.
//!
//! Conventions: SI units (kelvin, pascal, kg/s), except shaft speed in rpm as on every map; each `f64`
//! that crosses a boundary carries its unit in its name; pressures and temperatures are total unless a name contains
//! `static`; corrected quantities are stored with their [`ReferenceState`].

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod coded_enum;
mod identification;
mod maps;
mod measurement;
mod named_enum;
mod rig;
mod schema;
pub mod test_plan;
mod text;
pub mod unit_factors;

pub use identification::acceptance::{ACCEPTANCE_WINDOW_S, AcceptanceCriteria};
pub use identification::common_errors::CommonErrors;
pub use identification::identified::{
    EstimateUncertainty, IdentifiedPoint, Method, MethodResult, MethodResults, Verdict, Window,
    confidence_interval_95, half_width_95, standard_error_of,
};
pub use identification::inlet_convection::InletConvection;
pub use identification::joint_settings::{ALPHA_AREA_SIGMA_RATIO, Choice, JointSettings};
pub use identification::model_tolerances::{ModelTolerances, StructureTolerances};
pub use identification::result_remark::ResultRemark;
pub use identification::settle_bands::SettleBands;
pub use identification::thermal_model::{
    ConvectionLaw, CorrelatedPair, IdentifiedInlet, Origin, SharedValue, ThermalModel,
};
pub use identification::uncertainty_budget::{BudgetRow, PointBudgets, UncertaintyBudget};
pub use identification::warning::{
    Bound, CalibrationDefect, EndEvidence, EtaSignal, FitFailure, HeatCorrected, LeftOut, MapRegion,
    ModelDoubt, ModelEvidence, NoCompression, PoorFit, Scaled, StepConflict, SuspectedFault, Swapped, TooFew,
    Warning, WideInterval,
};
pub use identification::window_rule::WindowRule;
pub use maps::efficiency_definition::{EfficiencyDefinition, UnknownEfficiency};
pub use maps::fitted_map::{FittedLine, FittedMap, FittedNode, LeftOutLine};
pub use maps::imported_map::{
    ImportRemark, ImportedColumn, ImportedMap, LineEnd, MeasuredPoint, MeasuredTurbinePoint, TurbineReadings,
};
pub use maps::map::{CompressorMap, MapPoint, SpeedLine, SpeedShift};
pub use maps::map_description::{DescribedColumn, DesignPoint, MapDescription, StaticTaps};
pub use maps::map_format::{
    DrawMap, MAP_FILE_SIZE_LIMIT, MapFormat, MapFormats, MapUnits, ReadMap, ReadTurbine, TurbineFormat,
    WriteMap, WriteTurbine,
};
pub use maps::map_format_error::{ExportError, ImportError};
pub use maps::reference_state::{NAMED_REFERENCES, NamedReference, ReferenceState, usual_references};
pub use maps::turbine_map::{
    FittedTurbine, FittedTurbineLine, FittedTurbineNode, ImportedTurbine, TurbineMap, TurbineMapPoint,
};
pub use measurement::channel::{
    CHANNELS, Channel, ChannelInfo, Dimension, Group, MODELLED_CHANNELS, UnknownChannel,
};
pub use measurement::declared_uncertainty::{DeclaredUncertainty, NoiseColour, SAMPLE_INTERVAL_S};
pub use measurement::event::{Event, EventKind};
pub use measurement::fault_kind::FaultKind;
pub use measurement::frozen::{COARSE_REPEAT_S, COARSE_REPEAT_SAMPLES, FrozenLimit, NOISY_REPEAT_S, repeats};
pub use measurement::joined_recordings::{StepOrigin, join_recordings};
pub use measurement::jump::{
    JUMPS, SAME_COMMAND_RATIO, SLOW_JUMP_MULTIPLE, StepPoint, is_commanded_jump, is_jump, is_same_command,
    jump_ratio,
};
pub use measurement::plausible::{
    Implausible, Plausible, check_running, is_plausible_range, is_possible, is_reading, measurable, plausible,
};
pub use measurement::recording::{ReadingOrigin, Recording, RecordingError, Series};
pub use measurement::redundant::{DeclaredElement, Element, MAX_ELEMENTS, RedundantSensors, UnknownElement};
pub use measurement::sample::{ChannelColumn, ElementColumn, Provenance, Quality, SampleBatch, TruthColumn};
pub use measurement::step_marker::StepMarker;
pub use named_enum::UnknownName;
pub use rig::backend::{
    Backend, BackendCause, BackendError, RigDescription, RigMode, SetpointRange, SetpointRanges, Setpoints,
};
pub use rig::clock::{Clock, PacedClock, UnpacedClock, WallClock};
pub use rig::guard::{
    GuardName, GuardSet, LargestChange, Reaction, SafeTrajectory, SignalGuard, SpeedBand, SurgeVariation,
};
pub use rig::limits::{Limits, SURGE_ALLOWED_S};
pub use rig::on_drift::OnDrift;
pub use rig::run_ending::{RunEnding, Trip};
pub use rig::soak::Soak;
pub use rig::speed_response::{SpeedControlSettings, SpeedResponse};
pub use rig::surge::{SurgeFoundBy, SurgeMark, SurgeNotFound, SurgeSearchSettings};
pub use test_plan::jump::{Jump, Repeats};
pub use test_plan::operating_point::OperatingPoint;
pub use test_plan::plan::{Plan, PlanBound, PlanFigures, PlanInputHashes, PlanStep, Predicted, StepKind};
pub use test_plan::plan_remark::{NoBound, PlanRemark};
pub use test_plan::step_number::step_number;
pub use test_plan::timing::{Dwell, Timing};
pub use test_plan::verdict_forecast::{Advice, CampaignChange, UndeclaredForecast, VerdictForecast};
pub use test_plan::visit_order::VisitOrder;
pub use text::one_line::one_line;
pub use text::probability_text::probability_text;
pub use text::terminal_text::{coloured_text, terminal_json, terminal_text};
pub use text::with_unit::{readable, shorten_numbers, temperature, with_unit};

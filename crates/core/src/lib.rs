//! The data that flows through `mapper`, and the two interfaces to the outside: [`Backend`] and [`Clock`].
//!
//! Campaign -> [`Plan`] -> [`Recording`] -> [`IdentifiedPoint`] -> [`CompressorMap`]: every arrow is a function
//! from data to data. This crate holds the data, names every measured quantity once ([`Channel`]), and does no IO.
//!
//! Conventions: SI inside (kelvin, pascal, kg/s) except shaft speed, which is in rpm as on every map; each `f64`
//! that crosses a boundary carries its unit in its name; pressures and temperatures are total unless a name contains
//! `static`; corrected quantities are stored with their [`ReferenceState`].

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod backend;
mod channel;
mod clock;
mod common_errors;
mod declared_uncertainty;
mod efficiency_definition;
mod event;
mod fitted_map;
mod guard;
mod held_point;
mod identified;
mod imported_map;
mod inlet_convection;
mod joined;
mod joint_settings;
mod jump;
mod limits;
mod map;
mod map_columns;
mod map_description;
mod map_format;
mod map_format_error;
mod model_tolerances;
mod on_drift;
mod one_line;
mod operating_point;
mod plan;
mod plausible;
mod recording;
mod redundant;
mod reference_state;
mod run_down;
mod run_ending;
mod sample;
mod schema;
mod settle_bands;
mod soak;
mod speed_response;
mod step_marker;
pub mod step_number;
mod surge;
mod terminal_text;
mod thermal_model;
mod timing;
mod turbine_map;
mod uncertainty_budget;
mod verdict_forecast;
mod visit_order;
mod window_rule;
mod with_unit;

pub use backend::{
    Backend, BackendCause, BackendError, RigDescription, RigMode, SetpointRange, SetpointRanges, Setpoints,
};
pub use channel::{CHANNELS, Channel, ChannelInfo, Dimension, Group, UnknownChannel};
pub use clock::{Clock, PacedClock, UnpacedClock, Wall};
pub use common_errors::CommonErrors;
pub use declared_uncertainty::{DeclaredUncertainty, NoiseColour};
pub use efficiency_definition::{EfficiencyDefinition, UnknownEfficiency};
pub use event::{Event, EventKind};
pub use fitted_map::{FittedLine, FittedMap, FittedNode, LeftOutLine};
pub use guard::{
    GuardName, GuardSet, LargestChange, Reaction, SafeTrajectory, SignalGuard, SpeedBand, SurgeVariation,
};
pub use held_point::{HeldPoint, JUMPS, VALVE_JUMP_RATIO};
pub use identified::{
    EstimateUncertainty, IdentifiedPoint, Method, Verdict, Warning, Window, confidence_interval_95,
    half_width_95, standard_error_of,
};
pub use imported_map::{ImportRemark, ImportedColumn, ImportedMap};
pub use inlet_convection::InletConvection;
pub use joined::{StepOrigin, joined};
pub use joint_settings::{
    ALPHA_AREA_SIGMA_RATIO, Choice, ConvectionWithinStep, EfficiencyWithinStep, JointSettings,
};
pub use jump::{Jump, Repeats};
pub use limits::{Limits, SURGE_ALLOWED_S};
pub use map::{CompressorMap, MapPoint, SpeedLine, SpeedShift};
pub use map_columns::MAP_COLUMNS;
pub use map_description::{DescribedColumn, DesignPoint, MapDescription, StaticTaps};
pub use map_format::{
    DrawMap, MAP_FILE_SIZE_LIMIT, MapFormat, MapFormats, MapUnits, ReadMap, ReadTurbine, TurbineFormat,
    WriteMap, WriteTurbine,
};
pub use map_format_error::{ExportError, ImportError};
pub use model_tolerances::ModelTolerances;
pub use on_drift::OnDrift;
pub use one_line::one_line;
pub use operating_point::OperatingPoint;
pub use plan::{MadeFrom, Plan, PlanBound, PlanFigures, PlanStep, Predicted, StepKind};
pub use plausible::{Plausible, measurable, plausible};
pub use recording::{ReadingOrigin, Recording, RecordingError, Series};
pub use redundant::{DeclaredElement, Element, MAX_ELEMENTS, RedundantSensors, UnknownElement};
pub use reference_state::{NAMED_REFERENCES, NamedReference, ReferenceState, usual_references};
pub use run_ending::RunEnding;
pub use sample::{ChannelColumn, ElementColumn, Provenance, Quality, SampleBatch, TruthColumn};
pub use settle_bands::SettleBands;
pub use soak::Soak;
pub use speed_response::{SpeedControlSettings, SpeedResponse};
pub use step_marker::StepMarker;
pub use step_number::step_number;
pub use surge::{SurgeFoundBy, SurgeMark, SurgeSeek};
pub use terminal_text::terminal_text;
pub use thermal_model::{
    ConvectionLaw, Entangled, FoundInlet, Origin, ProfilePoint, SharedValue, ThermalModel,
};
pub use timing::{Dwell, Timing};
pub use turbine_map::{
    FittedTurbine, FittedTurbineLine, FittedTurbineNode, ImportedTurbine, TurbineMap, TurbineMapPoint,
};
pub use uncertainty_budget::{BudgetRow, PointBudgets, UncertaintyBudget};
pub use verdict_forecast::{Advice, CampaignChange, VerdictForecast};
pub use visit_order::VisitOrder;
pub use window_rule::WindowRule;
pub use with_unit::{readable, temperature, with_unit};

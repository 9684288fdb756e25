//! Turbocharger compressor maps from transients: adiabatic efficiency and heat-transfer coefficient at every point, each with its interval.
//!
//! This crate is the front door of the whole system, with every plug-in. A campaign file becomes a map in one line:
//!
//! ```no_run
//! use mapper::Campaign;
//!
//! let map = Campaign::load("campaigns/turbo_a.yaml")?.run()?.map()?;
//! println!("{} speed lines", map.lines.len());
//! # Ok::<(), mapper::Error>(())
//! ```
//!
//! # Campaigns
//!
//! A [`Campaign`] is a checked YAML file: machine, boundary conditions, sensors with their uncertainty, rig, operating points, timing, limits.
//! Values carry units, and become SI units when they are read. [`Campaign::load`] reports all mistakes at once, each with its line:
//!
//! ```
//! use mapper::{Campaign, ErrorKind, Input};
//!
//! let error = Campaign::from_yaml("campaign: empty\n", "empty.yaml").err().ok_or("no mistake")?;
//! assert_eq!(error.kind(), ErrorKind::BadInput);
//! assert_eq!(error.input(), Some(Input::Campaign));
//! # Ok::<(), &str>(())
//! ```
//!
//! [`Campaign::plan`] orders the points so that each jump changes the temperature of the housing as much as possible, because a transient with a
//! large gradient determines heat transfer and efficiency well. The plan forecasts every step on the nominal machine; limits are checked before
//! anything moves.
//!
//! ```
//! let campaign = mapper::Campaign::load("../../examples/short.yaml")?;
//! let plan = campaign.plan()?;
//! assert!(plan.steps.len() >= campaign.settings().points.len());
//! assert!(plan.steps.iter().all(|step| step.to.speed_rpm <= campaign.settings().limits.speed_max_rpm));
//! # Ok::<(), mapper::Error>(())
//! ```
//!
//! # Runs
//!
//! [`Campaign::run`] drives the rig through the plan, records every sample, identifies the points, assembles the map and writes the report, in a new directory of the
//! run ([`Run::directory`]). [`RunOptions`] choose directory, clock, stop flag and observer. Guards watch every sample; a run that one of them stopped has
//! [`Run::ending`], a safe rig and a recording.
//!
//! ```
//! use mapper::{Campaign, Event, EventKind, RunEnding, RunOptions};
//!
//! let runs = tempfile::tempdir()?;
//! let campaign = Campaign::load("../../examples/short.yaml")?;
//! let run = campaign.run_with(RunOptions::below(runs.path()))?;
//! assert_eq!(*run.ending(), RunEnding::Completed);
//! for point in run.points() {
//!     if let (Some(eta), Some(h_w_m2k)) = (point.eta, point.h_w_m2k) {
//!         println!("step {}: eta = {eta:.3}, h = {h_w_m2k:.0} W/(m2 K)", mapper::step_number(point.step));
//!     }
//! }
//! assert_eq!(run.map()?.lines.len(), 3, "one line for each speed");
//!
//! // The recording can be identified again, with the same result.
//! let again = run.recording()?.identify(&campaign)?;
//! assert!(again.points().eq(run.points()));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! The rig is a backend that the campaign names: the virtual lab, a replay, or a driver, which is a separate program behind a protocol. A rig in
//! real time needs a clock in [`RunOptions::clock`]; the command `mapper run` has one, and handles all signals.
//!
//! # Recordings
//!
//! A [`Recording`] is a run, or a log of another program read by a channel map that says which column is which channel:
//!
//! ```no_run
//! use mapper::{Campaign, Recording};
//!
//! let campaign = Campaign::load("my_turbo.yaml")?;
//! let recording = Recording::open_log("stand.csv", "channels.yaml")?;
//! let map = recording.identify(&campaign)?.map()?;
//! # Ok::<(), mapper::Error>(())
//! ```
//!
//! # Identification
//!
//! [`Recording::identify`] fits the heat balances of gas and housing to each transient (eqs. 1-12 of Burke et al.). The method `joint` fits all
//! steps together and subtracts a zero of the sensors; `dynamic` is the paper's, step by step; `steady` is the conventional one. Every point has an
//! interval, a verdict and its reasons. [`identify`] takes several recordings of one machine.
//!
//! # Maps
//!
//! A [`CompressorMap`] has speed lines, and a fitted surface if there are enough points. [`write_map`] writes it in any of the formats of the
//! plug-ins, [`read_map`] reads one.
//!
//! # Diagnosis
//!
//! [`Recording::diagnose`] explains where the rig departs from the nominal machine: it searches the effect library for the causes that bring
//! model and recording together, states probability, location and gap reduction of each, finds closure terms for what no effect explains, and
//! proposes the next experiment. [`Recording::correct`] also identifies the readings without the causes found.
//!
//! ```no_run
//! use mapper::{Campaign, DiagnosisOptions, Recording};
//!
//! let campaign = Campaign::load("campaigns/gap_rig.yaml")?;
//! let recording = Recording::open("runs/gap_rig-run")?;
//! let options = DiagnosisOptions { effects: vec!["coolant_passage.rhai".into()], ..Default::default() };
//! println!("{:#}", recording.diagnose_with(&campaign, &options)?.json()?);
//! # Ok::<(), mapper::Error>(())
//! ```
//!
//! # Plug-ins
//!
//! [`plugins()`] lists backends, drivers, effects, map formats and log formats of this distribution; [`Campaign::with_plugins`] and
//! [`Recording::read`] take others. A backend implements [`Backend`], an effect [`Effect`]. [`Registry::empty`] has none: without an effect
//! library a diagnosis is an error, not an empty answer.
//!
//! # Errors
//!
//! Every function returns one [`Error`]. [`Error::kind`] is what a program decides by, its text is for people.
//!
//! # What is behind
//!
//! `mapper-campaign` checks the file, `mapper-planner` orders the points, `mapper-runner` drives the backend, `mapper-recording` keeps the
//! samples, `mapper-identify` makes points of them, `mapper-maps` a map, `mapper-diagnose` a diagnosis; `mapper-session` joins them, and the
//! command line and the Python package use this crate. ARCHITECTURE.md has the map of all crates,
//! docs/explanation/one_campaign.md follows one campaign through them.

#![warn(
    clippy::missing_errors_doc,
    reason = "strangers read this documentation; inside, the type of an error says what can fail"
)]

mod campaign;
mod diagnosis;
mod error;
mod identification;
mod plugins;
mod recording;
mod run;

pub use campaign::Campaign;
pub use diagnosis::{Correction, Diagnosis, DiagnosisOptions};
pub use error::{Error, show_in_campaign};
pub use identification::{Identification, identify};
pub use mapper_core::{
    Backend, Channel, Clock, CompressorMap, Event, EventKind, IdentifiedPoint, Jump, MapFormat, Method,
    OperatingPoint, PacedClock, Plan, PlanStep, ReferenceState, RigDescription, RunEnding, SampleBatch,
    Series, Setpoints, StepMarker, TurbineMap, TurbinePoint, UnpacedClock, Verdict, Warning, step_number,
};
pub use mapper_diagnose::gap::CorrectedMap;
pub use mapper_physics::rig::backend_plugin::BackendPlugin;
pub use mapper_physics::rig::effect::Effect;
pub use mapper_recording::ChannelMap;
pub use mapper_report::with_messages;
pub use mapper_session::{
    ErrorKind, Existing, Gap, Identified, Input, Recorded, Registry, Rehearsal, Results, SessionEvent,
};
pub use plugins::{driver_locations, plugins, read_map, write_map};
pub use recording::Recording;
pub use run::{BeforeArming, Observer, Run, RunOptions};

/// A campaign's checked settings in SI units.
pub use mapper_campaign::Campaign as CampaignSettings;

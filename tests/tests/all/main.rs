//! The program as a user runs it, and the rules of the source tree.
//!
//! Tests that need Python or Chromium are marked ignored, and shown so, where `cargo xtask test` has not prepared it.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod circles;
mod constants;
mod corrected;
mod dependencies;
mod documentation;
mod doomed;
mod drift;
mod drift_refusals;
mod drift_watched;
mod drivers;
mod first_campaign;
mod fleet;
mod fleet_cluster;
mod fmu;
mod full_disk;
mod gases;
mod help;
mod interrupted;
mod library_errors;
mod licences;
mod logs;
mod machines;
mod maps;
mod mistakes;
mod night;
mod nightly;
mod pages;
mod pipes;
mod plans;
mod promises;
mod readers;
mod recordings;
mod rehearsal;
mod resumed;
mod sensors;
mod sequences;
mod shipped_campaign;
mod sizes;
mod sound_rigs;
mod sources;
mod speed_lines;
mod step_numbers;
mod stopped;
mod studio;
mod surge;
mod terminal;
mod tested;
mod together;
mod tour;
mod transient;
mod words;
mod zero;

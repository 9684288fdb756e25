//! `mapper backend`.

use crate::environment::{registry, rig_states_directory};
use crate::output::failure::{Code, Failure};
use crate::output::standard_output;
use clap::{Args, Subcommand};
use mapper_core::{RigMode, Setpoints};
use mapper_driver_host::conformance::{Candidate, check_rules};
use mapper_driver_host::{DriverLocation, Endpoint, INCLUDED_DRIVERS};
use mapper_session::{RigStates, nominal_model};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// List the backends, or check one against the rules for every backend
#[derive(Debug, Args)]
pub struct Backend {
    #[command(subcommand)]
    command: BackendCommand,
    /// Print one JSON object on standard output
    #[arg(long, global = true)]
    pub json: bool,
}

#[derive(Debug, Subcommand)]
enum BackendCommand {
    /// List the backends that campaigns may name
    List,
    /// Check the backend of a campaign against every rule of the interface. It arms the rig, sends setpoints and makes it safe: never use it on a rig with a machine
    Check {
        /// Name of the backend
        name: String,
        /// Campaign whose machine, limits and backend settings are used
        #[arg(long, value_name = "FILE")]
        campaign: PathBuf,
    },
}

impl Backend {
    pub fn run(&self) -> Result<(), Failure> {
        match &self.command {
            BackendCommand::List => self.list(),
            BackendCommand::Check { name, campaign } => self.check(name, campaign),
        }
    }

    fn list(&self) -> Result<(), Failure> {
        let installed = mapper::driver_locations().all();
        let driver = |found: &DriverLocation| {
            let known = INCLUDED_DRIVERS.iter().find(|(name, ..)| *name == found.name);
            let summary = known.map_or("driver", |(_, summary, _)| summary);
            match &found.at {
                Endpoint::Program(program) => {
                    json!({"name": found.name, "summary": summary, "program": program})
                }
                Endpoint::Socket(socket) => {
                    json!({"name": found.name, "summary": summary, "socket": socket})
                }
            }
        };
        let absent =
            INCLUDED_DRIVERS.iter().filter(|(name, ..)| !installed.iter().any(|one| one.name == *name));
        let built_in = registry().backends;
        let backends: Vec<Value> = built_in
            .iter()
            .map(|plugin| json!({"name": plugin.name, "summary": plugin.summary}))
            .chain(installed.iter().map(driver))
            .chain(
                absent.map(|(name, summary, line)| json!({"name": name, "summary": summary, "build": line})),
            )
            .collect();
        if self.json {
            return standard_output::print_json(&json!({ "backends": backends }));
        }
        let mut table = mapper_report::Table::new(["backend", "summary"]).with_texts([1]);
        for entry in &backends {
            let word = |key: &str| entry[key].as_str();
            let location = match (word("program"), word("socket"), word("build")) {
                (Some(program), ..) => format!("; {program}"),
                (_, Some(socket), _) => format!("; at the socket {socket}"),
                (.., Some(line)) => format!("; not found, built by: {line}"),
                _ => String::new(),
            };
            let summary = word("summary").unwrap_or_default();
            table.row([word("name").unwrap_or_default().to_owned(), format!("{summary}{location}")]);
        }
        let mut document = mapper_report::Document::default();
        document.table(table);
        standard_output::show(&document)
    }

    fn check(&self, name: &str, path: &Path) -> Result<(), Failure> {
        let mut campaign = mapper_campaign::load(path).map_err(Failure::of_campaign)?;
        let registry = registry();
        let named = campaign.backend.name.clone();
        if named != name {
            // Built-in backends need no settings; a driver needs an address, which the settings of another backend do not contain.
            if !registry.backends.iter().any(|plugin| plugin.name == name) {
                let is_known = INCLUDED_DRIVERS.iter().any(|(known, ..)| *known == name);
                let message = match is_known || mapper::driver_locations().find(name).is_some() {
                    false => format!("there is no backend `{name}`; `mapper backend list` shows all"),
                    true => format!(
                        "this campaign names `{named}`, not `{name}`, and has no settings for `{name}`; use `mapper backend check {named} --campaign {}`",
                        path.display()
                    ),
                };
                return Err(Failure::new(Code::BadInput, message));
            }
            campaign.backend =
                mapper_campaign::campaign::BackendChoice { name: name.to_owned(), settings: json!({}) };
        }
        let model = nominal_model(&campaign)?;
        // Mistakes in the settings are reported as those of a campaign.
        let rig = registry
            .make_backend(&campaign, &model)
            .map_err(|error| Failure::in_campaign(error, path))?
            .describe();
        // A rig that is in use or locked out must not be touched.
        let states = RigStates::new(&rig_states_directory(None));
        let claim = rig.exclusive.as_deref().map(|rig| states.claim(rig, None)).transpose()?;
        let make = || match registry.make_backend(&campaign, &model) {
            Ok(backend) => Ok(backend),
            Err(mapper_session::SessionError::Backend(error)) => Err(error),
            Err(error) => Err(mapper_core::BackendError::Lost { t_s: 0.0, source: Box::new(error) }),
        };
        let limits = &campaign.limits;
        let setpoints = Setpoints {
            mode: RigMode::Running,
            // A low P3 keeps any machine slow.
            p3_pa: limits.p3_min_pa + 0.1 * (limits.p3_max_pa - limits.p3_min_pa),
            t3_k: campaign.boundary.t3_k,
            valve_opening_ratio: 1.0,
            oil_temperature_k: campaign.boundary.oil_temperature_k,
        };
        let candidate = Candidate { name, make: &make, setpoints, duration_s: None };
        let results = check_rules(&candidate);
        if let Some(claim) = claim {
            claim.release()?;
        }
        let results = results.map_err(|error| Failure::new(Code::Rig, error))?;
        let broken = results.iter().filter(|(_, kept)| kept.is_err()).count();
        if self.json {
            let rules = results.iter().map(
                |(rule, kept)| json!({"rule": rule, "kept": kept.is_ok(), "found": kept.as_ref().err()}),
            );
            standard_output::print_json(&json!({"backend": name, "rules": rules.collect::<Vec<_>>()}))?;
        } else {
            let lines = results.iter().map(|(rule, kept)| match kept {
                Ok(()) => format!("kept    {rule}\n"),
                Err(finding) => format!("BROKEN  {rule}: {finding}\n"),
            });
            standard_output::print(&lines.collect::<String>())?;
        }
        match broken {
            0 => Ok(()),
            _ => Err(Failure::new(Code::Rig, format!("`{name}` breaks {broken} of {} rules", results.len()))),
        }
    }
}

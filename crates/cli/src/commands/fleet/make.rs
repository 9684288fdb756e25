//! `mapper fleet make`: splits a study into items.

use crate::fleet_directory::with_machine;
use crate::output::failure::Failure;
use crate::output::{output_options, standard_output};
use clap::Args;
use mapper_fleet::{CreatedStudy, kind_of, open_study};
use mapper_validation::studies::program;
use serde_json::json;
use std::path::PathBuf;

/// Make the items of a study; in an existing study, items are added and removed and results are kept
#[derive(Debug, Args)]
pub struct Make {
    /// Study (YAML): its kind and the input of the kind
    pub study: PathBuf,
    /// Directory for items, parts and result
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub json: bool,
}

impl Make {
    pub fn run(&self) -> Result<(), Failure> {
        with_machine(|registry, kinds, machine| {
            let study = open_study(&self.study).map_err(mapper_fleet::FleetError::from)?;
            let kind = kind_of(&study, kinds)?;
            let progress = output_options::progress();
            progress.begin("making items");
            let made = CreatedStudy::create(&study, kind, &self.out, &program(registry), machine.name);
            progress.clear();
            let made = made?;
            let items = made.fleet.study.items.len();
            if self.json {
                let (new, gone) = (made.new, made.gone);
                return standard_output::print_json(
                    &json!({ "directory": self.out, "items": items, "new": new, "gone": gone }),
                );
            }
            let changed = if made.new == items && made.gone == 0 {
                String::new()
            } else {
                format!(", {} of them new; {} were removed", made.new, made.gone)
            };
            standard_output::print(&format!(
                "{items} items in {dir}{changed}\nEstimate their cost: mapper fleet estimate {dir}\n",
                dir = self.out.display()
            ))
        })
    }
}

//! `mapper fleet make`: a study becomes items.

use crate::fleet_place::on_this_machine;
use crate::output::failure::Failure;
use crate::output::{output_options, standard_output};
use clap::Args;
use mapper_fleet::{Made, kind_of, open_study};
use mapper_validation::studies::program;
use serde_json::json;
use std::path::PathBuf;

/// Make the items of a study; if they exist, items come and go and results stay
#[derive(Debug, Args)]
pub struct Make {
    /// Study (YAML): its kind and what the kind needs
    pub study: PathBuf,
    /// Directory for items, parts and result
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub json: bool,
}

impl Make {
    /// Makes the items.
    pub fn run(&self) -> Result<(), Failure> {
        on_this_machine(|registry, kinds, machine| {
            let study = open_study(&self.study).map_err(mapper_fleet::FleetError::from)?;
            let kind = kind_of(&study, kinds)?;
            let progress = output_options::progress();
            progress.begin("making items");
            let made = Made::make(&study, kind, &self.out, &program(registry), machine.name);
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
                format!(", {} of them new; {} are gone", made.new, made.gone)
            };
            standard_output::print(&format!(
                "{items} items in {dir}{changed}\nWhat they cost: mapper fleet estimate {dir}\n",
                dir = self.out.display()
            ))
        })
    }
}

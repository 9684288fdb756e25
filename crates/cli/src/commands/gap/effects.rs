//! `mapper gap effects`.

use crate::failure::Failure;
use crate::{output, registry};
use clap::Args;
use mapper_report::with_heads;
use serde_json::json;
use std::path::PathBuf;

/// List the effects that a rig may have and the nominal model does not
#[derive(Debug, Args)]
pub struct Effects {
    /// Also check and list a suspected effect written in rhai; may be repeated
    #[arg(long = "effect", value_name = "FILE")]
    pub effects: Vec<PathBuf>,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub json: bool,
}

impl Effects {
    /// Lists the catalogue.
    pub fn run(&self) -> Result<(), Failure> {
        let effects = registry::registry().effects_with(&self.effects)?;
        if self.json {
            let list: Vec<_> = effects.iter().map(|effect| effect.info().clone()).collect();
            return output::print_json(&json!({ "effects": list }));
        }
        let heads = ["effect", "where", "parameter", "unit", "neutral", "range", "what it is"];
        let mut table = with_heads(&heads.map(str::to_owned));
        for effect in &effects {
            let info = effect.info();
            for parameter in &info.parameters {
                table.add_row([
                    info.id.to_string(),
                    info.submodel.name().to_owned(),
                    parameter.name.to_string(),
                    if parameter.unit == "1" { "-".to_owned() } else { parameter.unit.to_string() },
                    parameter.neutral.to_string(),
                    format!("{}..{}", parameter.low, parameter.high),
                    info.description.to_string(),
                ]);
            }
        }
        output::print(&format!("{table}\n"))
    }
}

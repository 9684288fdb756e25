//! `mapper gap effects`.

use crate::environment::registry;
use crate::output::failure::Failure;
use crate::output::standard_output;
use clap::Args;
use mapper_report::{Document, Table};
use serde_json::json;
use std::path::PathBuf;

/// List the effects that are not in the nominal model but may exist on a rig
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
    pub fn run(&self) -> Result<(), Failure> {
        let effects = registry().effects_with(&self.effects)?;
        if self.json {
            let list: Vec<_> = effects.iter().map(|effect| effect.info().clone()).collect();
            return standard_output::print_json(&json!({ "effects": list }));
        }
        let heads = ["effect", "part", "unit", "neutral", "range"];
        let mut table = Table::new(heads).with_texts([1, 2]);
        let mut legend = Document::default();
        for effect in &effects {
            let info = effect.info();
            legend.text(format!("{}: {}", info.id, info.description));
            for parameter in &info.parameters {
                let name = if parameter.name == info.id { "" } else { &*parameter.name };
                table.row([
                    format!("{} {name}", info.id).trim_end().to_owned(),
                    info.submodel.name().to_owned(),
                    if parameter.unit == "1" { "-".to_owned() } else { parameter.unit.to_string() },
                    parameter.neutral.to_string(),
                    format!("{} .. {}", parameter.low, parameter.high),
                ]);
            }
        }
        let mut document = Document::default();
        document.table(table);
        document.append(legend);
        standard_output::show(&document)
    }
}

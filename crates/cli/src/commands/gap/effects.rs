//! `mapper gap effects`.

use crate::environment::registry;
use crate::output::failure::Failure;
use crate::output::standard_output;
use clap::Args;
use mapper_physics::rig::effect::Effect;
use mapper_report::{Document, Table};
use mapper_validation::blind::visibility;
use serde_json::json;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// List the effects that are not in the nominal model but may exist on a rig
#[derive(Debug, Args)]
pub struct Effects {
    /// Also check and list a suspected effect written in rhai; may be repeated
    #[arg(long = "effect", value_name = "FILE")]
    pub effects: Vec<PathBuf>,
    /// Print how well each effect can be distinguished from a residual source term on this campaign (YAML)
    #[arg(long, value_name = "CAMPAIGN")]
    pub signatures: Option<PathBuf>,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub json: bool,
}

impl Effects {
    pub fn run(&self) -> Result<(), Failure> {
        let effects = registry().effects_with(&self.effects)?;
        if let Some(campaign) = &self.signatures {
            return self.print_signatures(campaign, effects);
        }
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

    /// The matrix of effects against balances on a recording of the campaign without causes.
    fn print_signatures(&self, campaign: &Path, effects: Vec<Arc<dyn Effect>>) -> Result<(), Failure> {
        let campaign = mapper_campaign::load(campaign).map_err(Failure::of_campaign)?;
        let matrix = visibility(&campaign, effects, campaign.seed)?.by_balance();
        let names = &matrix.balances;
        if self.json {
            let rows: Vec<_> = matrix
                .effects
                .iter()
                .map(|(id, sigma, shares)| {
                    let of: serde_json::Map<_, _> =
                        names.iter().cloned().zip(shares.iter().map(|share| json!(share))).collect();
                    json!({ "effect": id, "sigma": sigma, "shares": of })
                })
                .collect();
            return standard_output::print_json(&json!({ "signatures": rows }));
        }
        let letters: Vec<String> = (0..names.len()).map(|place| (place + 1).to_string()).collect();
        let heads: Vec<String> = ["effect", "sigma"].map(str::to_owned).into_iter().chain(letters).collect();
        let mut table = Table::new(&heads);
        for (id, sigma, shares) in &matrix.effects {
            let shares = shares.iter().map(|share| format!("{:.0}", 100.0 * share));
            table.row([id.clone(), format!("{sigma:.0}")].into_iter().chain(shares));
        }
        let mut document = Document::default();
        document.table(table);
        document.text(
            "% of each effect's signature (one typical step) that a residual source term in one balance could explain:",
        );
        document.list(names.iter().enumerate().map(|(place, name)| format!("{:>2}  {name}", place + 1)));
        standard_output::show(&document)
    }
}

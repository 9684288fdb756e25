//! `mapper gap effects`.

use crate::failure::Failure;
use crate::gap_arguments::EffectsArguments;
use crate::{output, registry, table};
use serde_json::json;

/// Lists the catalogue.
pub fn effects(arguments: &EffectsArguments) -> Result<(), Failure> {
    let effects = registry::effects_with(&arguments.effects)?;
    if arguments.json {
        let list: Vec<_> = effects.iter().map(|effect| effect.info().clone()).collect();
        return output::print_json(&json!({ "effects": list }));
    }
    let heads = ["effect", "where", "parameter", "unit", "neutral", "range", "what it is"];
    let mut table = table::with_heads(&heads.map(str::to_owned));
    for effect in &effects {
        let info = effect.info();
        for parameter in &info.parameters {
            table.add_row([
                info.id.to_string(),
                info.submodel.name().to_owned(),
                parameter.name.to_string(),
                parameter.unit.to_string(),
                parameter.neutral.to_string(),
                format!("{}..{}", parameter.low, parameter.high),
                info.description.to_string(),
            ]);
        }
    }
    output::print(&format!("{table}\n"))
}

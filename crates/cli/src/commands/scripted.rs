//! What `mapper plan` says of a campaign with a sequence script.

use crate::arguments::PlanArguments;
use crate::commands::plan as plan_command;
use crate::exit_code::Code;
use crate::failure::Failure;
use crate::output;
use crate::sequence_run::{Rehearsal, rehearse};
use mapper_campaign::Campaign;
use mapper_campaign::campaign::SequenceSource;
use mapper_physics::model::Model;
use std::fmt::Write;

/// Rehearses the script and prints the forecast plan.
pub fn plan(
    arguments: &PlanArguments,
    campaign: &Campaign,
    model: &Model,
    source: &SequenceSource,
) -> Result<(), Failure> {
    let Rehearsal { plan, notes } = rehearse(campaign, model, source)?;
    if let Some(path) = &arguments.out {
        output::write_new(path, (output::to_json(&plan)? + "\n").as_bytes())?;
    }
    if arguments.json {
        let mut json = serde_json::to_value(&plan).map_err(|error| Failure::new(Code::Failure, error))?;
        json["forecast"] = true.into();
        json["notes"] = notes.into();
        return output::print_json(&json);
    }
    let mut text = plan_command::text(campaign, &plan);
    // Writing to a String cannot fail.
    for note in notes {
        let _ = writeln!(text, "note: {note}");
    }
    let _ = writeln!(
        text,
        "Forecast: the script {} was rehearsed on the nominal machine; what it measures on the rig may lead it another \
         way.",
        source.path.display()
    );
    output::print(&text)
}

//! `mapper check`.

use crate::arguments::CheckArguments;
use crate::exit_code::Code;
use crate::failure::Failure;
use crate::registry::{BackendContext, make_backend};
use crate::{assembly_line, output, table};
use mapper_campaign::CampaignError;
use mapper_sequence::Script;
use serde_json::json;

/// Checks a campaign and says in a line what it is.
pub fn check(arguments: &CheckArguments) -> Result<(), Failure> {
    let campaign = match mapper_campaign::load(&arguments.campaign) {
        Ok(campaign) => campaign,
        Err(CampaignError::Mistakes(findings)) if arguments.json => {
            output::print_json(
                &json!({"campaign": null, "findings": findings.list, "omitted": findings.omitted}),
            )?;
            return Err(Failure::told(Code::BadInput));
        }
        Err(error) => return Err(Failure::of_campaign(error)),
    };
    let model = assembly_line::nominal_model(&campaign)?;
    // The backend reads its settings now, so that a mistake in them does not wait for the night.
    make_backend(&BackendContext { campaign: &campaign, model: &model })
        .map_err(|error| Failure::of_backend(&error, &arguments.campaign))?;
    Failure::check_formats(&campaign, &arguments.campaign)?;
    if let Some(source) = &campaign.sequence {
        let script = Script { path: source.path.clone(), text: source.text.clone() };
        mapper_sequence::check(&script).map_err(|error| Failure::new(Code::BadInput, error))?;
    }
    let timing = &campaign.timing;
    let soak_s = campaign.zero.map_or(0.0, |zero| zero.duration_s);
    let duration_s =
        soak_s + timing.warm_up_s + campaign.points.len() as f64 * timing.dwell_s + timing.cool_down_s;
    if arguments.json {
        return output::print_json(&json!({
            "campaign": campaign.name,
            "points": campaign.points.len(),
            "minutes": duration_s / 60.0,
            "backend": campaign.backend.name,
            "findings": [],
            "omitted": 0,
        }));
    }
    output::print(&format!(
        "{}: no mistakes. {} points on `{}` in {} of the rig's time.\n",
        arguments.campaign.display(),
        campaign.points.len(),
        campaign.backend.name,
        table::duration(duration_s),
    ))
}

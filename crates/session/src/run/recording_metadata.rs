//! Metadata of a recording.

use crate::recording::files::PROGRAM;
use mapper_campaign::Campaign;
use mapper_core::{Plan, RigDescription};
use std::collections::BTreeMap;

/// Metadata of a run for its recording.
pub(crate) fn metadata(campaign: &Campaign, plan: &Plan) -> BTreeMap<String, String> {
    let reference = campaign.reference;
    let always = [
        ("campaign", campaign.name.clone()),
        ("machine", campaign.machine.name.clone()),
        ("seed", campaign.seed.to_string()),
        ("program", PROGRAM.to_owned()),
        ("reference_temperature_k", reference.t_ref_k.to_string()),
        ("reference_pressure_pa", reference.p_ref_pa.to_string()),
        ("campaign_sha256", plan.made_from.campaign_sha256.clone()),
        ("model_sha256", plan.made_from.model_sha256.clone()),
    ];
    let readers: Vec<&str> = campaign.readers.iter().map(|reader| reader.name.as_str()).collect();
    let sometimes = [
        ("readers", (!readers.is_empty()).then(|| readers.join(", "))),
        ("script_sha256", plan.made_from.script_sha256.clone()),
        ("serial_number", campaign.machine.serial_number.clone()),
        ("operator", campaign.report.operator.clone()),
    ];
    let sometimes = sometimes.into_iter().filter_map(|(key, value)| Some((key, value?)));
    always.into_iter().chain(sometimes).map(|(key, value)| (key.to_owned(), value)).collect()
}

/// Epoch time of run time 0, ns, for a run started at `started_ns`; 0 for simulated time, so that equal runs give equal bytes.
pub fn start_time_ns(rig: &RigDescription, started_ns: u64) -> u64 {
    if rig.simulated_time { 0 } else { started_ns }
}

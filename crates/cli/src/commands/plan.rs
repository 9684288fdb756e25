//! `mapper plan`.

use crate::arguments::PlanArguments;
use crate::commands::scripted;
use crate::failure::Failure;
use crate::table::{self, Display, number};
use crate::{assembly_line, output};
use mapper_campaign::Campaign;
use mapper_core::{OperatingPoint, Plan};
use std::fmt::Write;

/// Makes the plan of a campaign and prints it.
pub fn plan(arguments: &PlanArguments) -> Result<(), Failure> {
    let campaign = mapper_campaign::load(&arguments.campaign).map_err(Failure::of_campaign)?;
    let model = assembly_line::nominal_model(&campaign)?;
    if let Some(source) = &campaign.sequence {
        return scripted::plan(arguments, &campaign, &model, source);
    }
    let plan = assembly_line::plan(&campaign, &model)?;
    if let Some(path) = &arguments.out {
        output::write_new(path, (output::to_json(&plan)? + "\n").as_bytes())?;
    }
    if arguments.json {
        return output::print_json(&plan);
    }
    output::print(&text(&campaign, &plan))
}

fn place(display: &Display, point: OperatingPoint) -> String {
    format!("{} @ {}", display.speed(point.speed_rpm), point.valve_opening_ratio)
}

/// The plan as a table with its figures below.
pub fn text(campaign: &Campaign, plan: &Plan) -> String {
    let display = Display::new(&campaign.display);
    let mut steps = table::with_heads(&[
        "step".to_owned(),
        format!("from {} @ opening", campaign.display.speed),
        format!("to {} @ opening", campaign.display.speed),
        display.pressure_head("P3"),
        display.flow_head("flow"),
        "PR 1".to_owned(),
        display.temperature_head("T2"),
        "dT2 K".to_owned(),
        "dTc K".to_owned(),
        "settles s".to_owned(),
        "min".to_owned(),
        "done after".to_owned(),
    ]);
    for step in &plan.steps {
        let predicted = &step.predicted;
        steps.add_row([
            (step.index + 1).to_string(),
            step.from.map_or_else(|| "-".to_owned(), |from| place(&display, from)),
            place(&display, step.to),
            display.pressure(step.p3_pa),
            display.flow(predicted.flow_kg_s),
            format!("{:.3}", predicted.pressure_ratio),
            display.temperature(predicted.t2_k),
            number(predicted.dt2_k, 1),
            number(predicted.dtc_k, 1),
            number(predicted.settle_s, 1),
            format!("{:.1}", predicted.minutes),
            table::duration(step.start_s + step.dwell_s),
        ]);
    }
    let figures = &plan.figures;
    let mut text = format!("{steps}\n\n");
    // Writing to a String cannot fail.
    let _ = writeln!(
        text,
        "{}: {} steps, order {}, {} in all (warm-up {}, cool-down {}).",
        plan.campaign,
        plan.steps.len(),
        plan.objective,
        table::duration(plan.duration_s()),
        table::duration(plan.warm_up_s),
        table::duration(plan.cool_down_s),
    );
    let _ = writeln!(
        text,
        "Housing gradient within the windows: {:.1} K in all, {} K at the least.",
        figures.sum_gradient_k,
        number(figures.worst_gradient_k, 1),
    );
    let made_from = &plan.made_from;
    let short = |hash: &str| hash.chars().take(12).collect::<String>();
    let _ = writeln!(
        text,
        "Made from campaign {} and model {}.",
        short(&made_from.campaign_sha256),
        short(&made_from.model_sha256),
    );
    text
}

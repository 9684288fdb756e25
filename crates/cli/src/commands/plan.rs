//! `mapper plan`.

use crate::arguments::PlanArguments;
use crate::commands::scripted;
use crate::drive::soak_s;
use crate::exit_code::Code;
use crate::failure::Failure;
use crate::table::{self, Display, number};
use crate::{assembly_line, output, plan_picture};
use mapper_campaign::Campaign;
use mapper_core::{OperatingPoint, Plan, PlanBound, StepKind};
use mapper_planner::{Comparison, JumpForecast, PlanRequest, STABLE_DRIFT_K_MIN, WayOfMapping};
use std::fmt::Write;

/// Makes the plan of a campaign and prints it.
pub fn plan(arguments: &PlanArguments) -> Result<(), Failure> {
    let campaign = mapper_campaign::load(&arguments.campaign).map_err(Failure::of_campaign)?;
    let model = assembly_line::nominal_model(&campaign)?;
    if let Some(source) = &campaign.sequence {
        if !(arguments.why.is_empty() && arguments.append.is_empty()) {
            let message = "this campaign's steps come from its script: write the jump there; --why and --append are for campaigns with a grid";
            return Err(Failure::new(Code::BadInput, message));
        }
        return scripted::plan(arguments, &campaign, &model, source);
    }
    if let [from, to] = arguments.why.as_slice() {
        return assembly_line::with_plan_request(&campaign, &model, |request| {
            let jump = mapper_planner::explain_jump(request, *from, *to)
                .map_err(|error| Failure::new(Code::NoPlan, error))?;
            output::print(&why_text(&campaign, &jump))
        });
    }
    let plan = assembly_line::with_plan_request(&campaign, &model, |request| {
        let appended = match arguments.append.as_slice() {
            [from, to] => Some(mapper_core::Jump { from: *from, to: *to }),
            _ => None,
        };
        let effort = arguments.effort.unwrap_or(request.effort);
        let request = PlanRequest { effort, appended, ..request.clone() };
        mapper_planner::make_plan(&request).map_err(|error| Failure::new(Code::NoPlan, error))
    })?;
    if let Some(path) = &arguments.out {
        output::write_new(path, (output::to_json(&plan)? + "\n").as_bytes())?;
    }
    let comparison = (arguments.compare || arguments.svg.is_some())
        .then(|| {
            assembly_line::with_plan_request(&campaign, &model, |request| {
                mapper_planner::compare(request, &plan).map_err(|error| Failure::new(Code::NoPlan, error))
            })
        })
        .transpose()?;
    if let (Some(path), Some(comparison)) = (&arguments.svg, &comparison) {
        output::write_new(path, plan_picture::svg(&campaign, &model, &plan, comparison).as_bytes())?;
    }
    if arguments.json {
        let mut value = serde_json::to_value(&plan).map_err(|error| Failure::new(Code::Failure, error))?;
        if let (Some(object), Some(comparison)) = (value.as_object_mut(), &comparison) {
            object.insert("comparison".to_owned(), comparison_json(comparison));
        }
        if let (Some(object), Some(zero)) = (value.as_object_mut(), campaign.zero) {
            object.insert("soak_s".to_owned(), serde_json::json!(zero.duration_s));
        }
        return output::print_json(&value);
    }
    let mut text = text(&campaign, &plan);
    if let Some(comparison) = &comparison {
        text.push_str(&comparison_text(comparison));
    }
    output::print(&text)
}

fn ways(comparison: &Comparison) -> [(&'static str, &'static str, &WayOfMapping); 3] {
    [
        ("proposed", "this plan", &comparison.proposed),
        ("conventional", "conventional, with stabilisation", &comparison.conventional),
        ("along_speed_lines", "along speed lines, same method", &comparison.along_speed_lines),
    ]
}

fn comparison_json(comparison: &Comparison) -> serde_json::Value {
    let entry = |(key, _, way): (&str, &str, &WayOfMapping)| {
        let value = serde_json::json!({
            "minutes": way.minutes,
            "worst_error_eta": way.worst_error_eta,
            "mean_error_eta": way.mean_error_eta,
            "order": way.order,
        });
        (key.to_owned(), value)
    };
    serde_json::Value::Object(ways(comparison).map(entry).into_iter().collect())
}

fn comparison_text(comparison: &Comparison) -> String {
    let mut text =
        "\nPredicted error of the efficiency, %points (without warm-up and cool-down):\n".to_owned();
    for (_, name, way) in ways(comparison) {
        // Writing to a String cannot fail.
        let _ = writeln!(
            text,
            "  {name:<34}{:>7.0} min   worst {:>6}   mean {:>6}",
            way.minutes,
            percent(way.worst_error_eta, 2),
            percent(way.mean_error_eta, 2)
        );
    }
    let _ = writeln!(
        text,
        "Conventional: T2 and housing must drift by less than {STABLE_DRIFT_K_MIN} K/min; its error is that of heat transfer and of declared offsets."
    );
    text
}

fn place(display: &Display, point: OperatingPoint) -> String {
    format!("{} @ {}", display.speed(point.speed_rpm), point.valve_opening_ratio)
}

fn percent(fraction: Option<f64>, decimals: usize) -> String {
    number(fraction.map(|fraction| 100.0 * fraction), decimals)
}

fn bound_text(bound: &PlanBound) -> String {
    let mut text = format!(
        "No order has more than {:.1} K in all, or {:.1} K at the least",
        bound.sum_gradient_k, bound.worst_gradient_k
    );
    // Writing to a String cannot fail.
    if let Some(gap) = bound.gap_percent {
        let _ = write!(text, ": this one is within {gap:.1} % of what is possible");
    }
    if let Some(tolerance) = bound.proof_tolerance_percent.filter(|_| bound.proven) {
        let _ = write!(text, ", and proven to be the best within {tolerance:.1} %");
    }
    let _ = writeln!(
        text,
        ". The search's housing model is off by at most {:.2} K along this plan.",
        bound.model_error_k
    );
    text
}

/// One edge of the jump graph in words.
fn why_text(campaign: &Campaign, jump: &JumpForecast) -> String {
    let display = Display::new(&campaign.display);
    let predicted = &jump.predicted;
    let mut text = format!(
        "{} -> {} (from the steady state of the first)\n",
        place(&display, jump.from),
        place(&display, jump.to)
    );
    let change = jump.p3_change_pa / 1e3;
    let rows = [
        ("change of P3", format!("{change:+.1} kPa")),
        ("dT2 in the window", format!("{} K", number(predicted.dt2_k, 2))),
        ("dTc in the window", format!("{} K", number(predicted.dtc_k, 2))),
        ("settles after", format!("{} s", number(predicted.settle_s, 1))),
        ("standard error of eta", format!("{} %points", percent(predicted.sigma_eta, 2))),
        ("bias of the method", format!("{} %points", percent(predicted.bias_eta, 2))),
        ("beyond the surge line", format!("{:.2} s at a stretch", jump.longest_surge_s)),
        ("highest speed", format!("{} {}", display.speed(jump.highest_speed_rpm), campaign.display.speed)),
        (
            "highest T2",
            format!("{} {}", display.temperature(jump.highest_t2_k), campaign.display.temperature),
        ),
    ];
    for (what, value) in rows {
        let _ = writeln!(text, "  {what:<24}{value}");
    }
    if jump.rejections.is_empty() {
        text.push_str("Allowed.\n");
    }
    for rejection in &jump.rejections {
        let _ = writeln!(text, "Not allowed: {rejection}.");
    }
    text
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
        "sigma_eta %".to_owned(),
        "bias %".to_owned(),
        "sigma_h %".to_owned(),
        "settles s".to_owned(),
        "min".to_owned(),
        "ETA".to_owned(),
    ]);
    // The machine rests before the plan begins.
    let soak_s = soak_s(campaign);
    for step in &plan.steps {
        let predicted = &step.predicted;
        steps.add_row([
            match step.kind {
                StepKind::Point => (step.index + 1).to_string(),
                StepKind::Repeat => format!("{} repeat", step.index + 1),
            },
            step.from.map_or_else(|| "-".to_owned(), |from| place(&display, from)),
            place(&display, step.to),
            display.pressure(step.p3_pa),
            display.flow(predicted.flow_kg_s),
            format!("{:.3}", predicted.pressure_ratio),
            display.temperature(predicted.t2_k),
            number(predicted.dt2_k, 1),
            number(predicted.dtc_k, 1),
            percent(predicted.sigma_eta, 2),
            percent(predicted.bias_eta, 2),
            percent(predicted.sigma_h_rel, 1),
            number(predicted.settle_s, 1),
            format!("{:.1}", predicted.minutes),
            table::eta(soak_s + step.start_s + step.dwell_s),
        ]);
    }
    let figures = &plan.figures;
    let mut text = format!("{steps}\n\n");
    // Writing to a String cannot fail.
    let _ = writeln!(
        text,
        "{}: {} steps, order {}, {} in all ({}warm-up {}, cool-down {}).",
        plan.campaign,
        plan.steps.len(),
        plan.objective,
        table::duration(soak_s + plan.duration_s()),
        campaign.zero.map_or_else(String::new, |zero| format!("soak {}, ", table::duration(zero.duration_s))),
        table::duration(plan.warm_up_s),
        table::duration(plan.cool_down_s),
    );
    let _ = writeln!(
        text,
        "Housing gradient within the windows: {:.1} K in all, {} K at the least.",
        figures.sum_gradient_k,
        number(figures.worst_gradient_k, 1),
    );
    if figures.worst_sigma_eta.is_some() {
        let _ = writeln!(
            text,
            "Predicted error of the efficiency, %points: standard error {} at worst; with the method's own bias {} at worst, {} rms.",
            percent(figures.worst_sigma_eta, 2),
            percent(figures.worst_error_eta, 2),
            percent(figures.rms_error_eta, 2),
        );
    }
    if let Some(bound) = &plan.bound {
        text.push_str(&bound_text(bound));
    }
    if let Some(remark) = &plan.bound_remark {
        let _ = writeln!(text, "Bound: {remark}.");
    }
    for remark in &plan.remarks {
        let _ = writeln!(text, "Note: {remark}.");
    }
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

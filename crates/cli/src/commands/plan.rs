//! `mapper plan`.

use crate::environment::registry;
use crate::interrupt;
use crate::output::failure::{Code, Failure};
use crate::output::standard_output::{self, FileOutput};
use clap::Args;
use mapper_campaign::Campaign;
use mapper_campaign::campaign::SequenceSource;
use mapper_campaign::units::{Kind, parse};
use mapper_core::{Jump, OperatingPoint, Plan as StepPlan, VisitOrder};
use mapper_physics::simulation::model::Model;
use mapper_planner::{PlanRequest, make_plan, plan_other_orders};
use mapper_report::{
    comparison_json, jump_forecast, jump_json, plan_comparison, plan_document, plan_svg, with_messages,
};
use mapper_session::{PlanInputs, Session, SessionError, json_text, nominal_model, plan_of, rehearse};
use std::path::PathBuf;

/// Show the steps of a campaign: order, turbine pressure, expected results, duration
#[derive(Debug, Args)]
pub struct Plan {
    /// Campaign file (YAML)
    pub campaign: PathBuf,
    /// Also store the plan in this new file, for `mapper run --plan`
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Draw the order on the map next to the one along speed lines, as figure 13 of the paper, in this new SVG file
    #[arg(long, value_name = "FILE")]
    pub svg: Option<PathBuf>,
    /// Also compare with the other orders of the same points and with conventional mapping
    #[arg(long)]
    pub compare: bool,
    /// Add this jump after all other steps, e.g. one that a gap diagnosis recommends: 130krpm@0.5 50krpm@0.7
    #[arg(long, num_args = 2, value_names = ["FROM", "TO"], value_parser = parse_operating_point)]
    pub append: Vec<OperatingPoint>,
    /// Show the expected results of the jump between two points, and the limits that it violates, e.g. 110krpm@0.5 50krpm@0.7
    #[arg(long, num_args = 2, value_names = ["FROM", "TO"], value_parser = parse_operating_point)]
    pub why: Vec<OperatingPoint>,
    /// Effort of the search: 1 is normal, 100 takes a hundred times as long
    #[arg(long, value_name = "FACTOR", hide_short_help = true)]
    pub effort: Option<f64>,
    #[command(flatten)]
    pub output: FileOutput,
}

/// A point as `speed@opening`; the speed carries its unit.
fn parse_operating_point(text: &str) -> Result<OperatingPoint, String> {
    let form = || format!("`{text}` is not a point; write speed@opening, e.g. 110krpm@0.5");
    let (speed, opening) = text.split_once('@').ok_or_else(form)?;
    let opening: f64 = opening.trim().parse().map_err(|_| form())?;
    let digits = speed.find(|c: char| c.is_ascii_alphabetic()).unwrap_or(speed.len());
    // Elsewhere a blank precedes the unit; here it would need quotes.
    let spaced = format!("{} {}", speed[..digits].trim(), speed[digits..].trim());
    let speed_rpm = parse(Kind::Speed, spaced.trim()).map_err(|error| error.to_string())?;
    if !(opening > 0.0 && opening <= 2.5 && speed_rpm > 0.0) {
        return Err(form());
    }
    Ok(OperatingPoint { speed_rpm, valve_opening_ratio: opening })
}

impl Plan {
    pub fn run(&self) -> Result<(), Failure> {
        let campaign = mapper_campaign::load(&self.campaign).map_err(Failure::of_campaign)?;
        let model = nominal_model(&campaign)?;
        let (registry, stop) = (registry(), interrupt::stop_flag()?);
        let session = Session { stop: &stop, ..Session::new(&registry) };
        if let Some(source) = &campaign.sequence {
            return self.run_script(&session, &campaign, &model, source);
        }
        let inputs = PlanInputs::of(&campaign)?;
        let request = inputs.request(&campaign, &model);
        if let [from, to] = self.why.as_slice() {
            let jump = mapper_planner::explain_jump(&request, *from, *to).map_err(SessionError::from)?;
            return if self.output.json {
                standard_output::print_json(&jump_json(&jump))
            } else {
                standard_output::show(&jump_forecast(&campaign, &jump))
            };
        }
        let appended = self.append.first().zip(self.append.get(1)).map(|(&from, &to)| Jump { from, to });
        let request = PlanRequest { effort: self.effort.unwrap_or(request.effort), appended, ..request };
        let mut plan = plan_of(&campaign, &request)?;
        plan.remarks.extend(session.forecast_guard_trip(&campaign, &model, &plan)?);
        let others = self.compare.then(|| plan_other_orders(&request, &plan)).transpose();
        let others = others.map_err(SessionError::from)?;
        self.store(&plan)?;
        if let Some(path) = &self.svg {
            let request = PlanRequest { order: VisitOrder::SpeedLines, appended: None, ..request.clone() };
            // The limits may not allow this order.
            let speed_lines = make_plan(&request).ok();
            self.output.write(path, plan_svg(&campaign, &model, &plan, speed_lines.as_ref()).as_bytes())?;
        }
        if self.output.json {
            let mut value = plan_json(&campaign, &plan)?;
            if let Some(others) = &others {
                value["comparison"] = comparison_json(&plan, others);
            }
            return standard_output::print_json(&value);
        }
        let mut document = plan_document(&campaign, &plan);
        document.append(others.map(|others| plan_comparison(&plan, &others)).unwrap_or_default());
        standard_output::show(&document)
    }

    fn run_script(
        &self,
        session: &Session<'_>,
        campaign: &Campaign,
        model: &Model,
        source: &SequenceSource,
    ) -> Result<(), Failure> {
        if !(self.why.is_empty() && self.append.is_empty()) {
            let message = "--why and --append need a campaign with a grid, but the steps of this campaign come from its script; add the jump to the script";
            return Err(Failure::new(Code::BadInput, message));
        }
        let mapper_session::Rehearsal { plan, notes } = rehearse(session, campaign, model, source)?;
        self.store(&plan)?;
        if self.output.json {
            let mut value = plan_json(campaign, &plan)?;
            value["forecast"] = true.into();
            value["notes"] = notes.into();
            return standard_output::print_json(&value);
        }
        let mut document = plan_document(campaign, &plan);
        notes.into_iter().for_each(|note| document.text(format!("note: {note}")));
        document.text(format!(
            "Forecast: the script {} was rehearsed on the nominal machine; on the rig it may take other steps, depending on the measurements.",
            source.path.display()
        ));
        standard_output::show(&document)
    }

    fn store(&self, plan: &StepPlan) -> Result<(), Failure> {
        let Some(path) = &self.out else { return Ok(()) };
        Ok(self.output.write(path, json_text(plan)?.as_bytes())?)
    }
}

fn plan_json(campaign: &Campaign, plan: &StepPlan) -> Result<serde_json::Value, Failure> {
    let mut value = with_messages(|| serde_json::to_value(plan)).map_err(SessionError::from)?;
    if let Some(zero) = campaign.zero {
        value["soak_s"] = zero.duration_s.into();
    }
    Ok(value)
}

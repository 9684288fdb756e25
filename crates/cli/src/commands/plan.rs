//! `mapper plan`.

use crate::exit_code::Code;
use crate::failure::Failure;
use crate::output::Replace;
use crate::{interrupt, output, registry};
use clap::Args;
use mapper_campaign::Campaign;
use mapper_campaign::campaign::SequenceSource;
use mapper_campaign::units::{Kind, parse};
use mapper_core::{OperatingPoint, Plan as StepPlan, VisitOrder};
use mapper_physics::model::Model;
use mapper_planner::{PlanRequest, error_bound};
use mapper_report::{comparison_json, comparison_text, jump_json, jump_text, plan_svg, plan_text};
use mapper_session::{
    Rehearsal, Session, SessionError, compared, json_text, nominal_model, plan_of, rehearse,
    with_plan_request,
};
use std::path::PathBuf;

/// Show the steps of a campaign: order, turbine pressure, what each is expected to give, how long it takes
#[derive(Debug, Args)]
pub struct Plan {
    /// Campaign file (YAML)
    pub campaign: PathBuf,
    /// Print the plan as one JSON object on standard output
    #[arg(long)]
    pub json: bool,
    /// Also store the plan in this new file, for `mapper run --plan`
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Draw the order on the map next to the one along speed lines, as figure 13 of the paper, in this new SVG file
    #[arg(long, value_name = "FILE")]
    pub svg: Option<PathBuf>,
    /// Also compare with conventional mapping and with the same points along speed lines
    #[arg(long)]
    pub compare: bool,
    /// Make this jump after all other steps, e.g. the one that a gap diagnosis asks for: 130krpm@0.5 50krpm@0.7
    #[arg(long, num_args = 2, value_names = ["FROM", "TO"], value_parser = operating_point)]
    pub append: Vec<OperatingPoint>,
    /// Say what the jump between two points gives and what forbids it, e.g. 110krpm@0.5 50krpm@0.7
    #[arg(long, num_args = 2, value_names = ["FROM", "TO"], value_parser = operating_point)]
    pub why: Vec<OperatingPoint>,
    /// Effort of the search: 1 is normal, 100 takes a hundred times as long
    #[arg(long, value_name = "FACTOR", hide_short_help = true)]
    pub effort: Option<f64>,
    #[command(flatten)]
    pub replace: Replace,
}

/// A point as `speed@opening`; the speed carries its unit.
fn operating_point(text: &str) -> Result<OperatingPoint, String> {
    let form = || format!("`{text}` is not a point; write speed@opening, e.g. 110krpm@0.5");
    let (speed, opening) = text.split_once('@').ok_or_else(form)?;
    let opening: f64 = opening.trim().parse().map_err(|_| form())?;
    let digits = speed.find(|c: char| c.is_ascii_alphabetic()).unwrap_or(speed.len());
    // Units are written apart from their value elsewhere; here a blank would need quotes.
    let spaced = format!("{} {}", speed[..digits].trim(), speed[digits..].trim());
    let speed_rpm = parse(Kind::Speed, spaced.trim()).map_err(|error| error.to_string())?;
    if !(opening > 0.0 && opening <= 2.5 && speed_rpm > 0.0) {
        return Err(form());
    }
    Ok(OperatingPoint { speed_rpm, valve_opening_ratio: opening })
}

impl Plan {
    /// Makes the plan of a campaign and prints it.
    pub fn run(&self) -> Result<(), Failure> {
        let campaign = mapper_campaign::load(&self.campaign).map_err(Failure::of_campaign)?;
        let model = nominal_model(&campaign)?;
        if let Some(source) = &campaign.sequence {
            return self.scripted(&campaign, &model, source);
        }
        if let [from, to] = self.why.as_slice() {
            let jump = with_plan_request(&campaign, &model, |request| {
                mapper_planner::explain_jump(request, *from, *to).map_err(SessionError::from)
            })?;
            return match self.json {
                true => output::print_json(&jump_json(&jump)),
                false => output::print(&jump_text(&campaign, &jump)),
            };
        }
        let (plan, comparison, along_lines) = with_plan_request(&campaign, &model, |request| {
            let appended = match self.append.as_slice() {
                [from, to] => Some(mapper_core::Jump { from: *from, to: *to }),
                _ => None,
            };
            let effort = self.effort.unwrap_or(request.effort);
            let asked = PlanRequest { effort, appended, ..request.clone() };
            let mut plan = plan_of(&campaign, &asked)?;
            if asked.order.needs_method() {
                plan.error_bound = error_bound(&asked, &plan).map_err(SessionError::from)?;
            }
            let comparison = self.compare.then(|| compared(&campaign, request, &plan)).transpose()?;
            // Limits that the plan keeps may forbid this order.
            let along_lines = || {
                let order = VisitOrder::SpeedLines;
                plan_of(&campaign, &PlanRequest { order, appended: None, ..asked.clone() }).ok()
            };
            let along_lines = self.svg.is_some().then(along_lines).flatten();
            Ok::<_, SessionError>((plan, comparison, along_lines))
        })?;
        self.store(&plan)?;
        if let Some(path) = &self.svg {
            let picture = plan_svg(&campaign, &model, &plan, along_lines.as_ref());
            self.replace.write(path, picture.as_bytes())?;
        }
        if self.json {
            let mut value = serde_json::to_value(&plan).map_err(SessionError::from)?;
            if let Some(comparison) = &comparison {
                value["comparison"] = comparison_json(comparison);
            }
            if let Some(zero) = campaign.zero {
                value["soak_s"] = zero.duration_s.into();
            }
            return output::print_json(&value);
        }
        let mut text = plan_text(&campaign, &plan);
        if let Some(comparison) = &comparison {
            text.push_str(&comparison_text(comparison));
        }
        output::print(&text)
    }

    /// Rehearses a script and prints the forecast plan.
    fn scripted(&self, campaign: &Campaign, model: &Model, source: &SequenceSource) -> Result<(), Failure> {
        if !(self.why.is_empty() && self.append.is_empty()) {
            let message = "the steps of this campaign come from its script: write the jump there; --why and --append are for campaigns with a grid";
            return Err(Failure::new(Code::BadInput, message));
        }
        let (registry, stop) = (registry::registry(), interrupt::stop_flag()?);
        let session = Session { stop: &stop, ..Session::new(&registry) };
        let Rehearsal { plan, notes } = rehearse(&session, campaign, model, source)?;
        self.store(&plan)?;
        if self.json {
            let mut value = serde_json::to_value(&plan).map_err(SessionError::from)?;
            value["forecast"] = true.into();
            value["notes"] = notes.into();
            if let Some(zero) = campaign.zero {
                value["soak_s"] = zero.duration_s.into();
            }
            return output::print_json(&value);
        }
        let notes: String = notes.iter().map(|note| format!("note: {note}\n")).collect();
        output::print(&format!(
            "{}{notes}Forecast: the script {} was rehearsed on the nominal machine; what it measures on the rig may lead it \
             another way.\n",
            plan_text(campaign, &plan),
            source.path.display()
        ))
    }

    fn store(&self, plan: &StepPlan) -> Result<(), Failure> {
        let Some(path) = &self.out else { return Ok(()) };
        Ok(self.replace.write(path, json_text(plan)?.as_bytes())?)
    }
}

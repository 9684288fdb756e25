//! The test report of a run or of identified recordings: one document for the Markdown file and for the page.

use crate::diagnosis::gap_results::correction_table;
use crate::document::{Document, Table};
use crate::formatting::{Display, Message, duration};
use crate::page::widgets::{OtherRun, map_widget, plan_widget, step_widget};
use crate::plan::plan_document::{avoided_time, executed_plan_table};
use crate::point_results::point_tables::{budget_section, wheel_section};
use crate::point_results::point_warnings::doubts;
use crate::point_results::points::{
    END_S, allowance_sentence, disagreement_text, point_tables, shared_errors_text, verdict_sentence,
};
use crate::point_results::summary::{PointResults, score_sentences};
use crate::test_report::conditions::{
    JudgedPoints, acceptance_section, balance_section, condition_table, instruments_section, witness_table,
};
use crate::test_report::key_figures::{PointsOrigin, assumed_sentence, key_figures};
use crate::test_report::zero_and_sensors::zero_sentence;
use crate::turbine::turbine_section;
use mapper_campaign::Campaign;
use mapper_core::{
    AvoidedCrossing, AvoidedTime, Channel, DeclaredUncertainty, Event, EventKind, Method, Plan, PointBudgets,
    Recording, ReferenceState, StepKind, TurbineMap, Verdict, step_number,
};
use mapper_diagnose::gap::{Diagnosed, Evidence, PointCorrection};
use mapper_identify::{FittedReadings, ZeroOutcome};
use mapper_observe::energy_balance::Gases;
use mapper_recording::score::summarise;
use std::collections::BTreeMap;

/// Content of a test report.
pub struct RunReport<'a> {
    /// Name of the machine.
    pub machine: &'a str,
    /// Rig, conditions, calibration, display units; `None` for a log without a campaign.
    pub campaign: Option<&'a Campaign>,
    /// The executed plan; `None` if there is none.
    pub plan: Option<&'a Plan>,
    /// Date of the test, as displayed; `None` if unknown.
    pub tested_at: Option<&'a str>,
    /// Program, version and commit.
    pub program: &'a str,
    /// Points, map and what they share.
    pub results: PointResults<'a>,
    /// The readings, as identified.
    pub recording: &'a Recording,
    /// Uncertainty of each channel used in the identification.
    pub used: &'a BTreeMap<Channel, DeclaredUncertainty>,
    /// The identified recordings; empty for a run, whose directory has its recording.
    pub sources: &'a [ReportSource],
    /// End of the run, or origin of the points.
    pub origin: PointsOrigin,
    /// Reference state of corrected quantities.
    pub reference: ReferenceState,
    /// The gases, with the definition of the efficiencies.
    pub gases: Gases,
    /// How the points were identified.
    pub method: Method,
    /// Declared share of the internal area before compression.
    pub alpha_area_ratio: f64,
    /// Events during the run.
    pub events: &'a [Event],
    /// Uncertainty budgets of the points.
    pub budgets: &'a [PointBudgets],
    /// Efficiencies before and after a correction for the causes of a gap; empty without one.
    pub corrections: &'a [PointCorrection],
    /// Whether a picture of the map is next to the report as `map.svg`.
    pub has_picture: bool,
    /// Each step, by its index, with the readings that the fit predicts.
    pub fitted: &'a [(usize, Vec<FittedReadings>)],
    /// The diagnosis of the gap to the nominal model, if there is one.
    pub gap: Option<(&'a Diagnosed, &'a Evidence)>,
    /// The map of the turbine, if there is one.
    pub turbine_map: Option<&'a TurbineMap>,
    /// Maps for comparison.
    pub others: &'a [OtherRun<'a>],
}

/// A recording that points were identified from.
#[derive(Debug, Clone, PartialEq)]
pub struct ReportSource {
    /// Its file.
    pub file: String,
    /// Time of its start in nanoseconds since 1970-01-01 UTC; 0 if unknown.
    pub start_time_ns: u64,
    /// Duration from the first sample to the last, s.
    pub duration_s: f64,
    /// Steps marked or found in it.
    pub steps: usize,
}

impl RunReport<'_> {
    pub(crate) fn display(&self) -> Display {
        self.campaign.map_or_else(Display::default, |campaign| Display::new(&campaign.display))
    }

    /// The report as Markdown.
    pub fn markdown(&self) -> String {
        let mut document = self.cover();
        document.verdict(self.verdict(), self.verdict_sentence());
        document.append(self.summary());
        document.append(self.body());
        let mut report = Document::default();
        report.section(self.title(), document);
        // The title is the only heading of level 1.
        report.markdown_at(1)
    }

    pub(crate) fn title(&self) -> String {
        format!("Compressor map of {}", self.machine)
    }

    pub(crate) fn cover(&self) -> Document {
        let mut document = Document::default();
        document.facts("", cover_facts(self));
        if self.is_simulated() {
            document.strong("Simulated rig: nothing was measured on a real machine.");
        }
        document.text(format!(
            "Efficiency is isentropic, total to total ({}); corrected to {}; method {}.",
            self.gases.compressor.efficiency.description(),
            self.reference,
            self.method
        ));
        document
    }

    fn is_simulated(&self) -> bool {
        self.results.points.iter().any(|scored| scored.truth.is_some())
    }

    pub(crate) fn verdict(&self) -> Verdict {
        let PointResults { points, map, remarks, .. } = self.results;
        let is_clean = !points.is_empty()
            && points.iter().all(|scored| scored.point.verdict == Verdict::Good)
            && map.is_some()
            && self.origin.is_complete()
            && !remarks.iter().any(mapper_core::ResultRemark::concerns_all_points);
        if is_clean { Verdict::Good } else { Verdict::Doubtful }
    }

    pub(crate) fn verdict_sentence(&self) -> String {
        verdict_sentence(self.results.identified())
    }

    pub(crate) fn summary(&self) -> Document {
        let mut document = Document::default();
        document.text(self.origin.sentence());
        let concern_all =
            |all: bool| self.results.remarks.iter().filter(move |remark| remark.concerns_all_points() == all);
        for premise in concern_all(true) {
            document.strong(format!("All efficiencies depend on this: {}", premise.message()));
        }
        document.text(
            key_figures(self.results.map, self.results.points, self.campaign, self.plan).unwrap_or_default(),
        );
        document.text(allowance_sentence(self.results.identified()).unwrap_or_default());
        let actions = self.recommended_actions();
        if !actions.is_empty() {
            document.text("Before the map is used:");
            document.list(actions);
        } else if self.verdict() == Verdict::Good {
            document.text("Nothing needs attention before the map is used.");
        }
        if concern_all(false).next().is_some() {
            document.text("Remarks:");
            document.list(concern_all(false).map(Message::message));
        }
        document
    }

    fn recommended_actions(&self) -> Vec<String> {
        let PointResults { points, dynamic, zero, .. } = self.results;
        let mut actions: Vec<String> = Vec::new();
        actions.extend(self.surges());
        actions.extend(disagreement_text(points, dynamic, &self.display()));
        if matches!(zero, ZeroOutcome::Refused(_)) {
            actions.extend(zero_sentence(zero));
        }
        for verdict in [Verdict::Unusable, Verdict::Doubtful] {
            // Findings about the most steps come first. Three sentences are enough here; the rest is listed with the notes.
            let mut warnings = doubts(self.results.identified().filter(|point| point.verdict == verdict));
            warnings.sort_by_key(|doubt| std::cmp::Reverse(doubt.count()));
            actions.extend(
                warnings.iter().take(3).map(|doubt| format!("{}: {}", doubt.steps(), doubt.message())),
            );
        }
        actions
    }

    fn surges(&self) -> Option<String> {
        let approaches = self.recording.steps.iter().filter(|step| step.kind == StepKind::Approach);
        let searched_from_s = approaches.map(|step| step.start_s).fold(f64::INFINITY, f64::min);
        let entered = self.events.iter().filter(|event| event.kind == EventKind::SurgeEntered);
        let times_s: Vec<f64> = entered.map(|event| event.t_s).filter(|t_s| *t_s < searched_from_s).collect();
        let first_s = times_s.first()?;
        let count = match times_s.len() {
            1 => "once".to_owned(),
            more => format!("{more} times"),
        };
        Some(format!(
            "the compressor surged {count}, first at {first_s:.1} s; the jumps of the plan came too close to the surge line of this machine: \
             raise `limits.surge_margin`, and measure the motion of the stand (`rig.actuators`)"
        ))
    }

    pub(crate) fn body(&self) -> Document {
        let display = self.display();
        let mut document = Document::default();
        document.named_section("map", "Map", self.map_section());
        let mut step = Document::default();
        step.widget(step_widget(&self.results, &display), "");
        document.named_section("step", "Transient of a point", step);
        document.named_section("conditions", "Conditions and instruments", self.conditions(&display));
        document.named_section("points", "Points by speed line", self.points(&display));
        document.named_section("turbine", "Turbine", turbine_section(self.results.turbine, self.turbine_map));
        let mut corrections = Document::default();
        corrections.table(correction_table(self.corrections));
        document.named_section("corrections", "Before and after the correction", corrections);
        document.named_section("budget", "Uncertainty budget", budget_section(self.budgets));
        document.named_section("plan", "Executed plan", self.executed_plan(&display));
        if let Some((diagnosed, evidence)) = self.gap {
            document.named_section(
                "gap",
                "Gap to the nominal model",
                crate::diagnosis::gap_text::gap_document(diagnosed, evidence),
            );
        }
        document.named_section("notes", "Notes", self.notes(&display));
        let mut provenance = Document::default();
        provenance.facts("", provenance_facts(self));
        document.named_section("provenance", "Provenance", provenance);
        document
    }

    fn map_section(&self) -> Document {
        let mut document = Document::default();
        // The only link of the report.
        let picture = if self.has_picture { "![map](map.svg)" } else { "" };
        document.widget(map_widget(&self.results, self.others, &self.display()), picture);
        document
    }

    fn conditions(&self, display: &Display) -> Document {
        let mut document = Document::default();
        document.facts("Test", condition_facts(self));
        document.table(condition_table(self.campaign, self.recording, display));
        document.table(witness_table(self.recording, display));
        // Steps are counted through all recordings.
        let before =
            self.sources.iter().scan(0, |sum, source| Some(std::mem::replace(sum, *sum + source.steps)));
        let rows = self.sources.iter().zip(before).map(|(source, before)| source_row(source, before));
        let heads = ["recording", "begins", "lasts", "steps"];
        document.table(Table::new(heads).caption("Recordings").all_texts().rows(rows));
        let RunReport { campaign, recording, gases, used, .. } = *self;
        let judged = JudgedPoints { campaign, recording, gases, points: self.results.points, used };
        document.section("Acceptance", acceptance_section(&judged));
        document.folded_section("Energy balance", balance_section(&judged));
        if let Some(campaign) = campaign {
            let zero = self.results.zero.found();
            document
                .section("Instruments", instruments_section(campaign, used, zero, self.tested_at, display));
        }
        document
    }

    fn points(&self, display: &Display) -> Document {
        let mut document = Document::default();
        document.text(format!(
            "+/- covers the 95 % interval, whose ends are in points.json: noise, declared sensor offsets, and the estimated error of the \
             method while the flow changes; those of flow and pressure ratio are of their sensors. dT2: change of T2 in the window. T2, P2 \
             and T3 are means over the last {END_S} s of the step, when the gas has settled and the housing has not."
        ));
        document.text(shared_errors_text(self.results.identified(), display).unwrap_or_default());
        let tables = point_tables(self.results.map, self.results.points, self.recording, display);
        tables.into_iter().for_each(|table| document.table(table));
        let wheel = self.campaign.and_then(|campaign| {
            wheel_section(campaign, self.results.points, self.recording, self.gases.compressor, display)
        });
        if let Some(wheel) = wheel {
            document.folded_section("Wheel and outlet pipe", wheel);
        }
        document
    }

    fn executed_plan(&self, display: &Display) -> Document {
        let mut document = Document::default();
        let Some(plan) = self.plan else {
            document.text("The run has no plan; its steps were found in the recording.");
            return document;
        };
        let was_run = |index: usize| self.recording.steps.iter().any(|marker| marker.index == index);
        let missing = match plan.steps.iter().filter(|step| !was_run(step.index)).count() {
            0 => String::new(),
            missing => format!("; {missing} of {} steps were not run", plan.steps.len()),
        };
        document.text(format!(
            "Order `{}`, {} planned{missing}. The thermal gradient of a step, dTc, is the change of the housing temperature within the \
             window that was used; sigma is one standard error.",
            plan.objective,
            duration(plan.duration_s())
        ));
        if let Some((step, crossing)) = self.slowest_crossing() {
            document.text(format!(
                "The longest time within the speeds to avoid was {}, in step {step}.",
                avoided_time(&crossing)
            ));
        }
        document.widget(plan_widget(), "");
        document.table(executed_plan_table(plan, self.recording, self.results.points, display));
        document
    }

    /// The step, by its number, with the slowest recorded crossing of the speeds to avoid.
    fn slowest_crossing(&self) -> Option<(usize, AvoidedCrossing)> {
        let avoid = self.campaign?.limits.avoid;
        let crossings = self.recording.steps.iter().filter_map(|step| {
            let speed = self.recording.series.get(&Channel::ShaftSpeed)?;
            let mut time = AvoidedTime::default();
            time.add_all(&avoid, speed.slice(step.start_s, step.end_s));
            Some((step_number(step.index), time.slowest(&avoid)?))
        });
        crossings.max_by(|a, b| a.1.ratio().total_cmp(&b.1.ratio()))
    }

    fn notes(&self, display: &Display) -> Document {
        let mut document = Document::default();
        if let Some(score) = summarise(self.results.points) {
            let mut body = Document::default();
            body.list(score_sentences(&score));
            document.section("Comparison with the simulator's truth", body);
        }
        document.append(self.results.common_parts(display, true));
        let mut warnings = Document::default();
        warnings.list(
            doubts(self.results.identified())
                .iter()
                .map(|doubt| format!("{} (`{}`): {}", doubt.steps(), doubt.code, doubt.message())),
        );
        let mut events = Document::default();
        events.list(
            self.events.iter().take(MAX_EVENTS).map(|event| format!("{:.1} s: {}", event.t_s, event.message)),
        );
        if let Some(further) = self.events.len().checked_sub(MAX_EVENTS).filter(|further| *further > 0) {
            events.text(format!("{further} further events are in the recording."));
        }
        for (heading, mut body) in [("Warnings and remarks", warnings), ("Events", events)] {
            if body.is_empty() {
                body.text("None.");
            }
            document.section(heading, body);
        }
        document
    }
}

/// Maximum number of events in a report. Judgement: more are not read; the recording has all of them.
const MAX_EVENTS: usize = 200;

/// A formatted time since 1970-01-01 UTC, ns; `None` for 0, the start of simulated time and of logs that know only seconds.
pub fn instant(ns: u64) -> Option<String> {
    let seconds = i64::try_from(ns / 1_000_000_000).ok().filter(|seconds| *seconds > 0)?;
    Some(jiff::Timestamp::from_second(seconds).ok()?.strftime("%Y-%m-%d %H:%M:%S UTC").to_string())
}

fn source_row(source: &ReportSource, before: usize) -> [String; 4] {
    [
        source.file.clone(),
        instant(source.start_time_ns).unwrap_or_else(|| "not stated".to_owned()),
        duration(source.duration_s),
        match source.steps {
            0 => "none".to_owned(),
            steps => format!("{} to {}", before + 1, before + steps),
        },
    ]
}

/// Names and values of the cover: customer, machine, place, date and persons.
fn cover_facts(report: &RunReport<'_>) -> Vec<(&'static str, String)> {
    let Some(campaign) = report.campaign else {
        return vec![("machine", report.machine.to_owned()), ("tested", stated(report.tested_at))];
    };
    let declared = &campaign.report;
    let optional = |name, value: &Option<String>| value.clone().map(|value| (name, value));
    let mut rows: Vec<(&str, String)> = Vec::new();
    rows.extend(optional("customer", &declared.customer));
    rows.extend(optional("report number", &declared.number));
    rows.extend([
        ("machine", campaign.machine.name.clone()),
        ("serial number", stated(campaign.machine.serial_number.as_deref())),
        ("tested", stated(report.tested_at)),
        ("test cell", stated(declared.test_cell.as_deref())),
        ("operator", stated(declared.operator.as_deref())),
    ]);
    rows.extend(optional("checked by", &declared.checked_by));
    rows.extend(optional("approved by", &declared.approved_by));
    rows
}

fn stated(value: Option<&str>) -> String {
    value.unwrap_or("not stated").to_owned()
}

fn condition_facts(report: &RunReport<'_>) -> Vec<(&'static str, String)> {
    let mut rows = report.campaign.map(campaign_rows).unwrap_or_default();
    if report.is_simulated()
        && let Some((_, rig)) = rows.iter_mut().find(|(what, _)| *what == "rig")
    {
        rig.push_str(" (simulated)");
    }
    rows.push(("reference state of corrected quantities", report.reference.to_string()));
    rows.push(("definition of efficiency", report.gases.compressor.efficiency.description()));
    rows.push(("gas", report.gases.compressor.description()));
    rows
}

fn provenance_facts(report: &RunReport<'_>) -> Vec<(&'static str, String)> {
    let mut rows = vec![("program", report.program.to_owned())];
    rows.push(("identification", format!("{}, alpha_A = {}", report.method, report.alpha_area_ratio)));
    rows.extend(report.campaign.map(|campaign| ("campaign", campaign.name.clone())));
    if let Some((campaign, plan)) = report.campaign.zip(report.plan) {
        rows.push(("duration", whole_duration(campaign, plan)));
        rows.push(("order", plan.objective.clone()));
        rows.push(("seed", plan.seed.to_string()));
        rows.push(("campaign SHA-256", plan.made_from.campaign_sha256.clone()));
        rows.push(("model SHA-256", plan.made_from.model_sha256.clone()));
    }
    rows
}

fn campaign_rows(campaign: &Campaign) -> Vec<(&'static str, String)> {
    let (display, report) = (Display::new(&campaign.display), &campaign.report);
    let missing = || stated(None);
    let mut rows = vec![
        ("rig", campaign.backend.name.clone()),
        (
            "barometer",
            report
                .barometer_pa
                .map_or_else(missing, |pa| format!("{} {}", display.pressure(pa), campaign.display.pressure)),
        ),
        (
            "relative humidity",
            report.humidity_ratio.map_or_else(missing, |ratio| format!("{:.0} %", 100.0 * ratio)),
        ),
    ];
    let stand: Vec<String> = report.stand.iter().map(|(name, value)| format!("{name}: {value}")).collect();
    rows.extend((!stand.is_empty()).then(|| ("stand", stand.join("; "))));
    let pipe_mm = |diameter_m: f64| format!("{:.1} mm", 1e3 * diameter_m);
    let (compressor, turbine) = (&campaign.machine.params.compressor, &campaign.machine.params.turbine);
    rows.push((
        "pipes",
        format!(
            "compressor inlet {}, outlet {}; turbine inlet {}",
            pipe_mm(compressor.inlet_diameter_m),
            pipe_mm(compressor.outlet_diameter_m),
            pipe_mm(turbine.inlet_diameter_m)
        ),
    ));
    rows.extend(assumed_sentence(campaign).map(|sentence| ("sizes of the machine", sentence)));
    if let Some(k) = report.cell_temperature_k {
        rows.push(("cell", format!("{} {}", display.temperature(k), campaign.display.temperature)));
    }
    let follows = campaign.follow_outlet;
    for (what, holds) in
        [("turbine inlet temperature", follows.turbine_inlet), ("oil temperature", follows.oil)]
    {
        if holds {
            rows.push((what, "held at the compressor's outlet temperature".to_owned()));
        }
    }
    rows
}

fn whole_duration(campaign: &Campaign, plan: &Plan) -> String {
    match campaign.zero {
        Some(soak) => format!(
            "{}, {} of it at rest",
            duration(soak.duration_s + plan.duration_s()),
            duration(soak.duration_s)
        ),
        None => duration(plan.duration_s()),
    }
}

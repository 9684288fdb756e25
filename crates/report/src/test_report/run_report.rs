//! The test report of a run, as Markdown.

use crate::diagnosis::correction_text::{CORRECTION_CAPTION, CORRECTION_HEADS, correction_rows};
use crate::formatting::display::Display;
use crate::formatting::duration::duration;
use crate::formatting::markdown::{self, Align};
use crate::point_results::budget_table::budget_section;
use crate::point_results::disagreement::disagreement_text;
use crate::point_results::lines_of_points::verdict_sentence;
use crate::point_results::point_table::{point_cells, point_groups, point_heads};
use crate::point_results::point_warnings::doubts;
use crate::point_results::points::score_text;
use crate::point_results::result_remark_text::result_remark_text;
use crate::point_results::shared_errors::shared_errors_text;
use crate::test_report::acceptance::{JudgedPoints, acceptance_sections};
use crate::test_report::assumed_text::assumed_sentence;
use crate::test_report::conditions::{CONDITION_HEADS, condition_rows};
use crate::test_report::ending_text::PointsOrigin;
use crate::test_report::instruments::{
    INSTRUMENT_HEADS, INSTRUMENT_WORDS, REGISTER_HEADS, instrument_rows, register_rows,
};
use crate::test_report::key_figures::key_figures;
use crate::test_report::repeated_jumps::repeated_jumps_text;
use crate::test_report::surge_text::{SurgeReport, surge_text};
use crate::test_report::zero_text::{ZERO_HEADS, zero_rows, zero_words};
use mapper_campaign::Campaign;
use mapper_core::{
    Channel, CompressorMap, DeclaredUncertainty, Event, IdentifiedPoint, Method, Plan, PointBudgets,
    Recording, ReferenceState, ResultRemark, terminal_text,
};
use mapper_diagnose::gap::PointCorrection;
use mapper_identify::{DynamicEfficiency, ZeroOutcome};
use mapper_maps::RepeatedJump;
use mapper_observe::FusedChannel;
use mapper_observe::energy_balance::Gases;
use mapper_recording::score::{ScoreSummary, ScoredPoint};
use std::collections::BTreeMap;
use std::fmt::Write;

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
    /// The map; `None` if there is none.
    pub map: Option<&'a CompressorMap>,
    /// The readings, as identified.
    pub recording: &'a Recording,
    /// Uncertainty of each channel used in the identification.
    pub used: &'a BTreeMap<Channel, DeclaredUncertainty>,
    /// The identified recordings; empty for a run, whose directory has its recording.
    pub sources: &'a [ReportSource],
    /// End of the run, or origin of the points.
    pub origin: PointsOrigin,
    /// Further remarks: on the recording, the method and the map.
    pub remarks: &'a [ResultRemark],
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
    /// Identified points, repeats included.
    pub points: &'a [ScoredPoint],
    /// Jumps that were made more than once.
    pub repeats: &'a [RepeatedJump],
    /// Results of the dynamic method for the same steps, if another method was used.
    pub dynamic: &'a [DynamicEfficiency],
    /// Result of the isothermal zero.
    pub zero: &'a ZeroOutcome,
    /// Result for channels with several sensors.
    pub sensors: &'a [FusedChannel],
    /// Uncertainty budgets of the points.
    pub budgets: &'a [PointBudgets],
    /// Efficiencies before and after a correction for the causes of a gap; empty without one.
    pub corrections: &'a [PointCorrection],
    /// Deviations of the points from the simulator's truth; `None` on a real rig.
    pub score: Option<&'a ScoreSummary>,
    /// Result of the search for surge; `None` if there was none.
    pub surge: Option<&'a SurgeReport>,
    /// Whether a picture of the map is next to the report as `map.svg`.
    pub has_picture: bool,
}

impl<'a> RunReport<'a> {
    /// The campaign's display units, or the usual ones.
    pub(crate) fn display(&self) -> Display {
        self.campaign.map_or_else(Display::default, |campaign| Display::new(&campaign.display))
    }

    /// The points without their truth.
    pub(crate) fn identified(&self) -> impl Iterator<Item = &'a IdentifiedPoint> + use<'a> {
        self.points.iter().map(|scored| &scored.point)
    }

    /// The points and their readings, for energy balance and acceptance.
    pub(crate) fn judged_points(&self) -> JudgedPoints<'a> {
        let RunReport { campaign, recording, gases, points, used, .. } = *self;
        JudgedPoints { campaign, recording, gases, points, used }
    }
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

/// The picture of the map, the only link.
const PICTURE: &str = "![map](map.svg)\n\n";

/// The report as Markdown. Names and messages from outside are in it, but neither HTML, links nor colours.
pub fn run_report(report: &RunReport<'_>) -> String {
    let text = terminal_text(&markdown_report(report));
    let inert = markdown::without_html_and_links;
    inert(&text).replacen(&inert(PICTURE), PICTURE, 1)
}

fn markdown_report(report: &RunReport<'_>) -> String {
    let RunReport {
        machine,
        campaign,
        sources,
        ref origin,
        remarks,
        events,
        points,
        repeats,
        dynamic,
        sensors,
        score,
        surge,
        has_picture,
        recording,
        ..
    } = *report;
    let display = report.display();
    // Writing to a String cannot fail, here and below.
    let mut text = format!("# Compressor map of {machine}\n\n{}\n", facts(&cover_facts(report)));
    if let Some(disagreement) = disagreement_text(points, dynamic, &display) {
        let _ = writeln!(text, "**{}**\n", disagreement.trim_end());
    }
    let verdict = verdict_sentence(report.identified());
    let _ = writeln!(text, "**{verdict}** {}\n", origin.sentence());
    let remark_texts = |concerns_all: bool| {
        let those = remarks.iter().filter(|remark| remark.concerns_all_points() == concerns_all);
        those.map(result_remark_text).collect::<Vec<_>>()
    };
    let (premises, others) = (remark_texts(true), remark_texts(false));
    for premise in premises {
        let _ = writeln!(text, "**All efficiencies depend on this:** {premise}.\n");
    }
    if let Some(words) = key_figures(report.map, points, campaign, report.plan) {
        let _ = writeln!(text, "{words}\n");
    }
    if !others.is_empty() {
        let _ = writeln!(text, "{}", others.iter().map(|remark| format!("- {remark}\n")).collect::<String>());
    }
    if has_picture {
        text.push_str(PICTURE);
    }
    text.push_str("## Conditions\n\n");
    text.push_str(&facts(&condition_facts(report)));
    let rows = condition_rows(campaign, recording, &display);
    if !rows.is_empty() {
        text.push_str("\nRead at the ends of the steps:\n\n");
        text.push_str(&markdown::table(&CONDITION_HEADS, Align::Left, &rows));
    }
    text.push('\n');
    if !sources.is_empty() {
        // Steps are counted through all recordings.
        let before = sources.iter().scan(0, |sum, source| Some(std::mem::replace(sum, *sum + source.steps)));
        let rows: Vec<[String; 4]> =
            sources.iter().zip(before).map(|(source, before)| source_row(source, before)).collect();
        text.push_str(&markdown::table(&["recording", "begins", "lasts", "steps"], Align::Left, &rows));
        text.push('\n');
    }
    if let Some(campaign) = campaign {
        text.push_str(&instruments_section(campaign, report, &display));
    }
    if !sensors.is_empty() {
        let lines: String = sensors.iter().map(|fused| format!("- {fused}\n")).collect();
        let _ = writeln!(
            text,
            "## Several sensors\n\nFused by their declared uncertainty (one standard deviation).\n\n{lines}"
        );
    }
    if let Some(score) = score {
        let _ = writeln!(text, "{}", score_text(score));
    }
    points_section(&mut text, &display, report);
    if !report.corrections.is_empty() {
        let _ = writeln!(text, "\n## Before and after the correction\n\n{CORRECTION_CAPTION}\n");
        text.push_str(&markdown::table(&CORRECTION_HEADS, Align::Right, correction_rows(report.corrections)));
    }
    text.push_str(&budget_section(report.budgets));
    text.push_str(&acceptance_sections(&report.judged_points()));
    if let Some(surge) = surge {
        let _ = write!(text, "\n## Surge\n\n{}", surge_text(surge, &display));
    }
    if let Some(words) = zero_words(report.zero) {
        let _ = writeln!(text, "\n## Isothermal zero\n\n{words}\n");
        text.push_str(&markdown::table(&ZERO_HEADS, Align::Left, zero_rows(report.zero, &display)));
    }
    if !repeats.is_empty() {
        let sentences = repeated_jumps_text(repeats, &display);
        let _ = write!(
            text,
            "\n## Drift\n\nRepeats are not part of the map. Fixed offsets cancel in the changes between them.\n\n{}",
            sentences.lines().map(|line| format!("- {line}\n")).collect::<String>()
        );
    }
    text.push_str("\n## Events\n\n");
    if events.is_empty() {
        text.push_str("None.\n");
    }
    for event in events {
        let _ = writeln!(text, "- {:.1} s: {}", event.t_s, event.message);
    }
    let _ = write!(text, "\n## Provenance\n\n{}", facts(&provenance_facts(report)));
    text
}

/// A formatted time since 1970-01-01 UTC, ns; `None` for 0: simulated time starts there, and so does a log that knows
/// only seconds, which is not a date.
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

fn facts(rows: &[(&'static str, String)]) -> String {
    let rows = rows.iter().map(|(what, value)| [(*what).to_owned(), value.clone()]);
    markdown::table(&["", ""], Align::Left, rows)
}

/// Names and values of the cover: customer, machine, place, date and persons.
pub fn cover_facts(report: &RunReport<'_>) -> Vec<(&'static str, String)> {
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

/// The declared conditions of rig and cell: name and value in words.
pub fn condition_facts(report: &RunReport<'_>) -> Vec<(&'static str, String)> {
    let mut rows = report.campaign.map(campaign_rows).unwrap_or_default();
    if report.score.is_some()
        && let Some((_, rig)) = rows.iter_mut().find(|(what, _)| *what == "rig")
    {
        rig.push_str(" (simulated)");
    }
    rows.push(("reference state of corrected quantities", report.reference.to_string()));
    rows.push(("definition of efficiency", report.gases.compressor.efficiency.description()));
    rows.push(("gas", report.gases.compressor.description()));
    rows
}

/// Method and settings behind the numbers: name and value in words.
pub fn provenance_facts(report: &RunReport<'_>) -> Vec<(&'static str, String)> {
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

/// Soak and steps, as counted by `mapper check` and `mapper plan`.
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

fn instruments_section(campaign: &Campaign, report: &RunReport<'_>, display: &Display) -> String {
    let rows = instrument_rows(campaign, report.used, display);
    let mut text = format!("## Instruments\n\n{INSTRUMENT_WORDS}\n\n");
    text.push_str(&markdown::table(&INSTRUMENT_HEADS, Align::Left, &rows));
    text.push('\n');
    let register = register_rows(campaign, report.tested_at, display);
    if !register.is_empty() {
        text.push_str("### Calibration register\n\n");
        text.push_str(&markdown::table(&REGISTER_HEADS, Align::Left, &register));
        text.push('\n');
    }
    text
}

fn points_section(text: &mut String, display: &Display, report: &RunReport<'_>) {
    text.push_str(
        "## Points by speed line\n\nIntervals are 95 %: noise, declared sensor offsets, and the estimated error of the method while \
         the flow changes. T2, P2 and T3 are means over the last 2 s of the step, when the gas has settled and the housing has not.\n\n",
    );
    if let Some(shared) = shared_errors_text(report.identified(), display) {
        let _ = writeln!(text, "{shared}\n");
    }
    for group in point_groups(report.map, report.identified(), display) {
        let rows = group
            .points
            .iter()
            .map(|point| point_cells(report.recording, point, display).map(|cell| cell.text));
        let _ = writeln!(text, "### {}\n", group.caption);
        text.push_str(&markdown::table(&point_heads(display), Align::Right, rows));
        text.push('\n');
    }
    text.push_str("## Doubts and remarks\n\n");
    let doubts = doubts(report.identified());
    for doubt in &doubts {
        let _ = writeln!(text, "- {} ({}): {}", doubt.steps(), doubt.code, doubt.message());
    }
    if doubts.is_empty() {
        text.push_str("None.\n");
    }
}

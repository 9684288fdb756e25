//! The results of a run or of identified recordings: their parts, and both views of a terminal.

use crate::document::{Describe, Document};
use crate::formatting::{Display, Message, percent};
use crate::point_results::point_warnings::{doubts, reasons};
use crate::point_results::points::{
    allowance_sentence, disagreement_text, points_by_line, shared_errors_text, verdict_sentence, wide_table,
};
use crate::test_report::zero_and_sensors::{SurgeReport, surge_section, zero_section};
use crate::turbine::{summary_sentence, turbine_section};
use mapper_core::{CompressorMap, IdentifiedPoint, ResultRemark, ThermalModel, Verdict};
use mapper_identify::{DynamicEfficiency, ZeroOutcome};
use mapper_maps::RepeatedJump;
use mapper_observe::FusedChannel;
use mapper_recording::score::{ScoreSummary, ScoredPoint, ScoredTurbinePoint, summarise};

/// What an identification found.
#[derive(Clone, Copy)]
pub struct PointResults<'a> {
    /// Identified points, repeats included.
    pub points: &'a [ScoredPoint],
    /// The map; `None` if there is none.
    pub map: Option<&'a CompressorMap>,
    /// Results of the dynamic method for the same steps, if another method was used.
    pub dynamic: &'a [DynamicEfficiency],
    /// Jumps that were made more than once.
    pub repeats: &'a [RepeatedJump],
    /// Parameters that all points share.
    pub thermal: Option<&'a ThermalModel>,
    /// Result of the isothermal zero.
    pub zero: &'a ZeroOutcome,
    /// Result for channels with several sensors.
    pub sensors: &'a [FusedChannel],
    /// Result of the search for surge; `None` if there was none.
    pub surge: Option<&'a SurgeReport>,
    /// The turbine at the points.
    pub turbine: &'a [ScoredTurbinePoint],
    /// Further remarks: on the recording, the method and the map.
    pub remarks: &'a [ResultRemark],
}

impl<'a> PointResults<'a> {
    pub(crate) fn identified(&self) -> impl Iterator<Item = &'a IdentifiedPoint> + use<'a> {
        self.points.iter().map(|scored| &scored.point)
    }

    /// The points for a terminal, and reasons against them. `more`: the command for the rest; `warnings`: of the recordings; `truth`: with it.
    pub fn short(&self, display: &Display, more: &str, warnings: &[String], truth: bool) -> Document {
        let mut document = Document::default();
        document.text(disagreement_text(self.points, self.dynamic, display).unwrap_or_default());
        document.append(points_by_line(self.points, self.map, display, truth));
        reasons(self.identified()).into_iter().for_each(|doubt| document.text(doubt));
        if let Some(score) = summarise(self.points).filter(|_| truth) {
            score_sentences(&score).into_iter().for_each(|sentence| document.text(sentence));
        }
        if let Some(surge) = self.surge {
            document.append(surge_section(surge, display, truth));
        }
        // Omit sensors that all agree.
        let disagreeing = self.sensors.iter().filter(|fused| !fused.left_out.is_empty());
        disagreeing.for_each(|fused| document.text(fused.to_string()));
        self.closing(&mut document, warnings);
        document.text(format!(
            "+/- covers the 95 % interval; -a/+b are the distances to its ends if they differ by more than a half. Common errors, repeats, sensors and zero: {more}, or the page of the run."
        ));
        document.text(allowance_sentence(self.identified()).unwrap_or_default());
        document.text(summary_sentence(self.turbine).unwrap_or_default());
        document.append(self.conclusion());
        document
    }

    /// Everything for a terminal; `warnings` and `truth` as above.
    pub fn full(&self, display: &Display, warnings: &[String], truth: bool) -> Document {
        let mut document = Document::default();
        document.text(disagreement_text(self.points, self.dynamic, display).unwrap_or_default());
        document.table(wide_table(self.points, display, truth));
        document.text("+/- covers the 95 % interval; -a/+b: distances to its ends, if they differ by more than a half. dT2: change of T2 in the window.");
        document.text(allowance_sentence(self.identified()).unwrap_or_default());
        let doubted = self.identified().filter(|point| point.verdict != Verdict::Good);
        for doubt in doubts(doubted) {
            document.text(format!("{}: {}", doubt.steps(), doubt.message()));
        }
        if let Some(score) = summarise(self.points).filter(|_| truth) {
            score_sentences(&score).into_iter().for_each(|sentence| document.text(sentence));
        }
        document.text(shared_errors_text(self.identified(), display).unwrap_or_default());
        document.append(self.common_parts(display, truth));
        document.section("Turbine", turbine_section(self.turbine, None));
        self.closing(&mut document, warnings);
        document.append(self.conclusion());
        document
    }

    pub(crate) fn common_parts(&self, display: &Display, truth: bool) -> Document {
        let mut document = Document::default();
        document.section("Drift", repeats_section(self.repeats, display));
        document.section(
            "Shared by all points (+/- 95 %)",
            self.thermal.map(Describe::document).unwrap_or_default(),
        );
        document.append(self.sensors.document());
        document.section("Isothermal zero", zero_section(self.zero, display));
        if let Some(surge) = self.surge {
            document.section("Surge", surge_section(surge, display, truth));
        }
        document
    }

    fn closing(&self, document: &mut Document, warnings: &[String]) {
        let others = self.remarks.iter().filter(|remark| !remark.concerns_all_points());
        others.for_each(|remark| document.text(remark.message()));
        warnings.iter().for_each(|warning| document.text(format!("recording: {warning}")));
    }

    fn conclusion(&self) -> Document {
        let has = |verdict| self.identified().any(|point| point.verdict == verdict);
        let worst = [Verdict::Unusable, Verdict::Doubtful].into_iter().find(|verdict| has(*verdict));
        let mut body = Document::default();
        body.verdict(worst.unwrap_or(Verdict::Good), verdict_sentence(self.identified()));
        let premises = self.remarks.iter().filter(|remark| remark.concerns_all_points());
        premises.for_each(|premise| body.strong(premise.message()));
        let mut document = Document::default();
        document.section("Verdict", body);
        document
    }
}

fn repeats_section(jumps: &[RepeatedJump], display: &Display) -> Document {
    let sentence = |jump: &RepeatedJump| {
        let found: Vec<String> = jump.eta.iter().map(|eta| format!("{:.2}", 100.0 * eta)).collect();
        format!(
            "Repeats of the jump from {} to {}: efficiency {} %; from first to last {:+.2} points (standard error from noise {} points).",
            display.place_in_words(jump.from),
            display.place_in_words(jump.to),
            found.join(", "),
            100.0 * jump.eta_change,
            percent(jump.eta_change_standard_error, 2),
        )
    };
    let mut document = Document::default();
    if !jumps.is_empty() {
        document.text("Repeats are not on the map. Fixed offsets of the sensors cancel in the change from one to the next.");
        document.list(jumps.iter().map(sentence));
    }
    document
}

pub(crate) fn score_sentences(score: &ScoreSummary) -> Vec<String> {
    let mut sentences = vec![format!(
        "Against the simulator's truth ({} points): median error of efficiency {:.2} points, {:.2} at worst, {:.0} % \
         within 1 point; the 95 % interval contains the truth at {:.0} % (points share the offsets of their sensors, so \
         that their intervals are right or wrong together).",
        score.points,
        100.0 * score.eta_median_error,
        100.0 * score.eta_worst_error,
        100.0 * score.eta_within_one_point_ratio,
        100.0 * score.eta_coverage_ratio,
    )];
    if let (Some(median), Some(worst)) = (score.h_median_error_ratio, score.h_worst_error_ratio) {
        sentences.push(format!(
            "Median error of the heat-transfer coefficient {:.1} %, {:.1} % at worst; its 95 % interval contains the truth at {}.",
            100.0 * median,
            100.0 * worst,
            score.h_coverage_ratio.map_or_else(|| "no point".to_owned(), |ratio| format!("{:.0} %", 100.0 * ratio)),
        ));
    }
    sentences
}

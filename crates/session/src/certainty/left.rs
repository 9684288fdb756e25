//! What is left of a run, weighed: other steps in place of those to come, with the dwells that they would get.

use super::{Dwell, DwellPrices, Planned};
use mapper_core::PlanStep;
use mapper_identify::{StepInformation, WorthNow};
use mapper_numerics::parallel;
use mapper_physics::forecast::ForecastRow;

/// Steps to come, with the dwells that each may have.
#[derive(Debug, Clone)]
pub(crate) struct ToCome {
    steps: Vec<Planned>,
    tables: Vec<Vec<Dwell>>,
}

/// What a run comes to with the steps to come that it has.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Weighed {
    /// Error of all points, rms, fraction; open, without what the map's smoothness says.
    pub(crate) error: f64,
    /// Time of the steps to come, s.
    pub(crate) left_s: f64,
}

impl DwellPrices {
    /// What a step tells by its rows alone.
    pub(crate) fn tells(&self, step: &PlanStep, rows: &[ForecastRow]) -> Option<StepInformation> {
        let planned = Planned::of(step.clone(), rows.to_vec());
        let end_s = rows.last()?.t_s;
        self.information.of_forecast(&planned.forecast(end_s), &self.forecast_config)
    }

    /// What steps are worth by what is known so far and forecast of the rest.
    pub(crate) fn worth_now(&self) -> Option<WorthNow> {
        let told: Vec<&StepInformation> =
            self.told_at(&self.tables, self.price).into_iter().flatten().collect();
        self.information.worth_now(&told)
    }

    /// Steps that may be put in place of those to come, with their rows.
    pub(crate) fn to_come(&self, steps: &[PlanStep], rows: Vec<Vec<ForecastRow>>) -> ToCome {
        let steps: Vec<Planned> =
            steps.iter().zip(rows).map(|(step, rows)| Planned::of(step.clone(), rows)).collect();
        ToCome { tables: parallel::map(&steps, |planned| self.dwells_of(planned)), steps }
    }

    /// Puts steps in place of those to come, but for the first `stay` and the last `kept` of them, and finds the price anew; what
    /// stood there.
    pub(crate) fn put(&mut self, to_come: ToCome, stay: usize, kept: usize) -> ToCome {
        let made = stay + self.steps.iter().take_while(|planned| planned.told.is_some()).count();
        let made = made.min(self.steps.len());
        let end = self.steps.len().saturating_sub(kept).max(made);
        let before = ToCome {
            steps: self.steps.splice(made..end, to_come.steps).collect(),
            tables: self.tables.splice(made..end, to_come.tables).collect(),
        };
        self.settle();
        before
    }

    /// A step that was left out comes once more, before the last `behind` ones.
    pub(crate) fn try_again(&mut self, step: &PlanStep, behind: usize) {
        let left_out = |planned: &&Planned| planned.step.to == step.to && planned.step.kind == step.kind;
        let Some(planned) = self.steps.iter().rev().find(left_out).cloned() else { return };
        let planned = Planned { told: None, ..planned };
        let to_come = ToCome { tables: vec![self.dwells_of(&planned)], steps: vec![planned] };
        let place = self.steps.len() - behind.min(self.steps.len());
        self.steps.splice(place..place, to_come.steps);
        self.tables.splice(place..place, to_come.tables);
        self.settle();
    }

    /// What the run comes to.
    pub(crate) fn weighed(&self) -> Option<Weighed> {
        let error = self.error(&self.told_at(&self.tables, self.price))?;
        Some(Weighed { error, left_s: self.left_dwells_s().iter().sum() })
    }

    /// The dwells of the steps to come, s.
    pub(crate) fn left_dwells_s(&self) -> Vec<f64> {
        let times_s = self.times_s(&self.tables, self.price).zip(&self.steps);
        times_s.filter(|(_, planned)| planned.told.is_none()).map(|(dwell_s, _)| dwell_s).collect()
    }

    /// Points that are measured.
    pub(crate) fn points(&self) -> usize {
        self.steps.iter().filter(|planned| planned.step.kind.measures()).count()
    }

    /// Housing temperature at the end of the last step, K, as it was read; once.
    pub(crate) fn take_tc_k(&mut self) -> Option<f64> {
        self.tc_k.take()
    }
}

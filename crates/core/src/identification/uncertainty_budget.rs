//! Uncertainty budget of a number in the form of the GUM (JCGM 100:2008, 4 to 6 and annex G).

use serde::{Deserialize, Serialize};

/// One source of uncertainty.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct BudgetRow {
    /// Name, e.g. `offset of T1`.
    pub source: String,
    /// Standard uncertainty of the source, in `unit`.
    pub standard_uncertainty: f64,
    /// Unit of the source.
    pub unit: String,
    /// Change of the number per unit of the source.
    pub sensitivity: f64,
    /// Product of the two, in the unit of the number.
    pub contribution: f64,
    /// Degrees of freedom of the standard uncertainty; `None` for a declared uncertainty, which counts as exactly known.
    pub degrees_of_freedom: Option<f64>,
}

/// All sources of one number. They are independent of each other.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct UncertaintyBudget {
    /// The number.
    pub value: f64,
    /// The sources.
    pub rows: Vec<BudgetRow>,
    /// Half of its 95 % interval.
    pub expanded_uncertainty: f64,
    /// Ratio of that to the combined standard uncertainty.
    pub coverage_factor: f64,
    /// Degrees of freedom of the combined standard uncertainty by the formula of Welch and Satterthwaite; `None` if all are known exactly.
    pub degrees_of_freedom: Option<f64>,
}

impl UncertaintyBudget {
    /// The budget of a number with this half of its 95 % interval.
    pub fn of(value: f64, rows: Vec<BudgetRow>, expanded_uncertainty: f64) -> Self {
        let mut budget =
            UncertaintyBudget { value, rows, expanded_uncertainty, ..UncertaintyBudget::default() };
        let combined = budget.combined_standard_uncertainty();
        budget.coverage_factor = expanded_uncertainty / combined;
        let share = |row: &BudgetRow| Some(row.contribution.powi(4) / row.degrees_of_freedom?);
        let shares: f64 = budget.rows.iter().filter_map(share).sum();
        budget.degrees_of_freedom = (shares > 0.0).then(|| combined.powi(4) / shares);
        budget
    }

    /// Root of the sum of squares of the contributions, in the unit of the number.
    pub fn combined_standard_uncertainty(&self) -> f64 {
        self.rows.iter().map(|row| row.contribution * row.contribution).sum::<f64>().sqrt()
    }
}

/// The budgets of one point.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PointBudgets {
    /// Index of the step, from 0; files have its number, from 1.
    #[serde(with = "crate::test_plan::step_number")]
    pub step: usize,
    /// Efficiency, fraction.
    pub eta: Option<UncertaintyBudget>,
    /// Heat-transfer coefficient, W/(m2 K).
    pub h_w_m2k: Option<UncertaintyBudget>,
    /// Pressure ratio.
    pub pressure_ratio: UncertaintyBudget,
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The example of GUM H.1 (end gauge): contributions of 25, 9.7, 2.9 and 16.6 nm with 18, 25.6, exact and 2 degrees of freedom, rows of
    /// equal kind combined: 32 nm (31.7 without rounding) and 16 effective degrees of freedom, as the guide says with its 50 for the thermal row.
    #[test]
    fn the_end_gauge_of_the_guide_has_its_combined_uncertainty() {
        let row = |contribution: f64, degrees_of_freedom: Option<f64>| BudgetRow {
            source: String::new(),
            standard_uncertainty: contribution,
            unit: "nm".to_owned(),
            sensitivity: 1.0,
            contribution,
            degrees_of_freedom,
        };
        let rows =
            vec![row(25.0, Some(18.0)), row(9.7, Some(25.6)), row(2.9, Some(50.0)), row(16.6, Some(2.0))];
        let budget = UncertaintyBudget::of(50_000_838.0, rows, 93.0);
        assert!((budget.combined_standard_uncertainty() - 31.7).abs() < 0.1, "{budget:?}");
        let freedom = budget.degrees_of_freedom.unwrap();
        assert!((16.0..17.5).contains(&freedom), "{freedom}");
    }
}

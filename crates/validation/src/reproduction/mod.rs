//! Recomputes the simulated figures of the paper with the model of the virtual lab, and compares each with the statements of the paper.
//!
//! [`reproduce`] returns data and pictures. The same program gives the same bytes at any time and on any computer.

mod figures;
mod lab;
#[cfg(test)]
#[path = "../../tests/inside/model_table.rs"]
mod model_table;
#[cfg(test)]
#[path = "../../tests/inside/paper_heat.rs"]
mod paper_heat;
mod picture;

pub use crate::reproduction::lab::ReproduceError;
pub use lab::{FigureResult, Statement, Table, Verdict, picture_path};
pub use picture::{figure_json, reproduction_page};

/// Numbers of the reproduced figures, in order. Figures 1, 3 and 4 are drawings without results.
pub const FIGURES: [&str; 10] = ["2", "5", "6", "7", "8", "9", "10", "11", "12", "13"];

/// Reproduces all figures; `progress` receives the number of each figure before it is computed.
pub fn reproduce(mut progress: impl FnMut(&str)) -> Result<Vec<FigureResult>, ReproduceError> {
    let model = mapper_physics::simulation::model::Model::nominal();
    let mut results = Vec::with_capacity(FIGURES.len());
    for number in FIGURES {
        progress(number);
        results.push(match number {
            "2" => figures::figure_2::figure(&lab::run_all(&model, lab::RUN_S)?)?,
            "5" => figures::figure_5::figure()?,
            "6" => figures::figure_6::figure(&lab::run_all(&model, lab::RUN_S)?)?,
            "7" => figures::figure_7::figure(&lab::run_all(&model, figures::figure_7::RUN_S)?)?,
            "8" => figures::figure_8::figure()?,
            "9" => figures::figure_9::figure()?,
            "10" => figures::figure_10::figure()?,
            "11" => figures::figure_11::figure()?,
            "12" => figures::figure_12::figure()?,
            _ => figures::figure_12::figure_13()?,
        });
    }
    Ok(results)
}

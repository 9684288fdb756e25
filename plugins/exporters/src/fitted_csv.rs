//! The fitted surface as CSV: one row a node, errors beside it, extrapolation marked.

use crate::{ExportError, heading::heading};
use mapper_core::CompressorMap;
use std::fmt::Write;

pub(crate) fn export(map: &CompressorMap) -> Result<Vec<u8>, ExportError> {
    let fitted = map.fitted.as_ref().ok_or(ExportError::NeedsFit { format: "fitted" })?;
    let mut text = heading(map, "#");
    let _ = writeln!(
        text,
        "# fitted speed lines; scatter of the points about them: {:.2} % of distance, {:.2} points of efficiency",
        100.0 * fitted.distance_rms_ratio,
        100.0 * fitted.eta_rms
    );
    text.push_str(
        "# *_standard_error: one standard error; flow and pressure ratio: the parts of the error across the line\n\
         # beta: 0 at the choke end, 1 at the surge end; line: measured or not; support: measured or extrapolated\n\
         speed_corrected_rpm,beta,flow_corrected_kg_s,pressure_ratio,eta,work_ratio,flow_standard_error_kg_s,\
         pressure_ratio_standard_error,eta_standard_error,line,support\n",
    );
    for line in &fitted.lines {
        let kind = if line.measured { "measured" } else { "between_or_beyond" };
        for (beta, node) in fitted.beta_ratio.iter().zip(&line.nodes) {
            let support = if node.extrapolated { "extrapolated" } else { "measured" };
            let _ = writeln!(
                text,
                "{},{beta},{},{},{},{},{},{},{},{kind},{support}",
                line.speed_corrected_rpm,
                node.flow_corrected_kg_s,
                node.pressure_ratio,
                node.eta,
                node.work_ratio,
                node.flow_standard_error_kg_s,
                node.pressure_ratio_standard_error,
                node.eta_standard_error,
            );
        }
    }
    Ok(text.into_bytes())
}

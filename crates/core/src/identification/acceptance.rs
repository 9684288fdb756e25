//! Criteria by which a test code accepts a point.

use crate::Channel;
use serde::Serialize;
use std::collections::BTreeMap;

/// Criteria of acceptance, with their source.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AcceptanceCriteria {
    /// Name of the code.
    pub name: String,
    /// Where the values come from.
    pub source: String,
    /// Time at the end of a step over which they are judged, s.
    pub window_s: f64,
    /// Permitted fluctuation of each channel: highest minus lowest reading over the mean, temperatures and pressures absolute.
    pub fluctuation_ratio: BTreeMap<Channel, f64>,
    /// Permitted size of the losses in the energy balance over the power of the turbine.
    pub heat_balance_ratio: Option<f64>,
}

/// Time over which criteria without a window are judged, s. Judgement: the gas is settled, and a step of 40 s has it.
pub const ACCEPTANCE_WINDOW_S: f64 = 20.0;

impl AcceptanceCriteria {
    /// ASME PTC 10-1997, the rows of its table 3.4 that a turbocharger has.
    pub fn ptc_10() -> Self {
        let fluctuations = [
            (Channel::ShaftSpeed, 0.005),
            (Channel::P1, 0.02),
            (Channel::T1, 0.005),
            (Channel::P2, 0.02),
            (Channel::TWater, 0.005),
            (Channel::WaterFlow, 0.02),
        ];
        AcceptanceCriteria {
            name: "ASME PTC 10".to_owned(),
            source: "ASME PTC 10-1997, table 3.4, permissible fluctuations of test readings; the code is not public".to_owned(),
            window_s: ACCEPTANCE_WINDOW_S,
            fluctuation_ratio: fluctuations.into(),
            heat_balance_ratio: None,
        }
    }
}

//! Criteria by which a test code accepts a point.

use crate::Channel;
use serde::Serialize;
use std::collections::BTreeMap;

/// Criteria of acceptance, with their source.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AcceptanceCriteria {
    /// Name of the code.
    pub name: String,
    /// Source of the values.
    pub source: String,
    /// Time at the end of a step over which the criteria are judged, s.
    pub window_s: f64,
    /// Permitted fluctuation of each channel: highest minus lowest reading, relative to the mean; temperatures and pressures absolute.
    pub fluctuation_ratio: BTreeMap<Channel, f64>,
    /// Permitted losses in the energy balance, relative to the turbine power.
    pub heat_balance_ratio: Option<f64>,
}

/// Window of criteria that do not define one, s. Judgement: the gas has settled by then, and a step of 40 s is long enough.
pub const ACCEPTANCE_WINDOW_S: f64 = 20.0;

impl AcceptanceCriteria {
    /// ASME PTC 10-1997: the rows of table 3.4 that apply to a turbocharger.
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

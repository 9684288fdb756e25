//! The isothermal zero of a recording whose campaign asks for one.

use mapper_campaign::Campaign;
use mapper_core::Recording;
use mapper_identify::{IdentifyConfig, IsothermalZero, ZeroSettings, isothermal_zero, zeroed};
use std::fmt::Write;

/// What came of it.
pub enum Zero {
    /// Offsets were taken off.
    Found(IsothermalZero),
    /// The campaign asks for a zero and the recording has none, for this reason; declared offsets stand.
    Refused(String),
    /// No zero was asked for.
    NotAsked,
}

/// Takes the offsets off the recording, and leaves what is not known of them in the configuration.
pub fn apply(
    recording: Recording,
    config: IdentifyConfig,
    campaign: &Campaign,
) -> (Recording, IdentifyConfig, Zero) {
    if campaign.zero.is_none() {
        return (recording, config, Zero::NotAsked);
    }
    match isothermal_zero(&recording, &config, &ZeroSettings::default()) {
        Ok(zero) => {
            let (recording, config) = zeroed(recording, config, &zero);
            (recording, config, Zero::Found(zero))
        }
        Err(error) => (recording, config, Zero::Refused(error.to_string())),
    }
}

impl Zero {
    /// For machines: offsets and what is left of them, K or Pa, with the stretch they come from; `null` without one.
    pub fn json(&self) -> serde_json::Value {
        match self {
            Zero::Found(zero) => serde_json::json!(zero),
            Zero::Refused(reason) => serde_json::json!({"refused": reason}),
            Zero::NotAsked => serde_json::Value::Null,
        }
    }

    /// For people.
    pub fn text(&self) -> String {
        match self {
            Zero::NotAsked => String::new(),
            Zero::Refused(reason) => {
                format!("\nno isothermal zero: {reason}. The declared offsets stand.\n")
            }
            Zero::Found(zero) => {
                let mut text = format!(
                    "\nisothermal zero from {:.0} to {:.0} s, taken off the readings (+/- 95 %):\n",
                    zero.start_s, zero.end_s
                );
                for (channel, offset) in &zero.offsets {
                    let half = 1.96 * zero.left_sigma.get(channel).copied().unwrap_or(f64::NAN);
                    let _ = writeln!(text, "  {channel:<6} {offset:+.2} +/- {half:.2} {}", channel.unit());
                }
                text
            }
        }
    }
}

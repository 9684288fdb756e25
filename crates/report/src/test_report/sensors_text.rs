//! Several sensors of a channel, as text.

use mapper_campaign::Campaign;
use mapper_observe::FusedChannel;

/// A line for each channel that has several sensors: their combination, and the omitted sensors with reasons; empty if no
/// channel has several.
pub fn sensors_text(channels: &[FusedChannel]) -> String {
    if channels.is_empty() {
        return String::new();
    }
    let lines: String = channels.iter().map(|fused| format!("  {fused}\n")).collect();
    format!("\nseveral sensors, fused by their declared uncertainty (one standard deviation):\n{lines}")
}

/// A line for each channel for which a campaign declares several sensors; empty if it declares none.
pub fn declared_sensors_text(campaign: &Campaign) -> String {
    let several = campaign.sensors.iter().filter_map(|(channel, sensor)| {
        let fused = FusedChannel {
            channel: *channel,
            sensors: sensor.redundant.as_ref()?.elements.len(),
            left_out: Vec::new(),
            contradiction: None,
            declared: sensor.declared,
            probe_diameter_m: sensor.probe_diameter_m,
        };
        Some(format!("  {fused}\n"))
    });
    several.collect()
}

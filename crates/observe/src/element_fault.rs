//! Faults of the redundant sensors of a channel, and the result of their fusion, as values and text.

use mapper_core::{Channel, DeclaredUncertainty, Element, FaultKind};
use serde::Serialize;
use std::fmt;

/// Reason for excluding a redundant sensor, a kind of the catalogue of sensor faults.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ElementFault {
    /// Its kind: offset, lag, frozen or silent.
    pub kind: FaultKind,
    /// Its reading minus that of the others, in the channel's unit; its lag minus that of the others, s; its constant reading; or its fraction of
    /// missing readings.
    pub size: f64,
    /// The offset in declared standard deviations of it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sigmas: Option<f64>,
    /// Start of the constant reading in run time, s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub from_s: Option<f64>,
}

impl ElementFault {
    pub(crate) fn new(kind: FaultKind, size: f64) -> ElementFault {
        ElementFault { kind, size, sigmas: None, from_s: None }
    }
}

/// An excluded sensor.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FaultyElement {
    /// Number.
    pub element: Element,
    /// Display name.
    pub name: String,
    /// Number of sensors that it was compared with.
    pub others: usize,
    /// The reason.
    pub fault: ElementFault,
}

impl fmt::Display for FaultyElement {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (name, unit) = (&self.name, self.element.channel.unit());
        let others = match self.others {
            1 => "the other one".to_owned(),
            others => format!("the other {others}"),
        };
        let ElementFault { kind, size, sigmas, from_s } = self.fault;
        match kind {
            FaultKind::Offset => {
                let side = if size < 0.0 { "below" } else { "above" };
                let sigmas = sigmas.unwrap_or(f64::NAN);
                write!(
                    f,
                    "{name} reads {} {unit} {side} {others} ({sigmas:.1} sigma)",
                    ShortNumber(size.abs())
                )?;
            }
            FaultKind::Lag => {
                let later = if size < 0.0 { "earlier" } else { "later" };
                write!(f, "{name} follows changes {:.1} s {later} than {others}", size.abs())?;
            }
            FaultKind::Frozen => {
                let from_s = from_s.unwrap_or(f64::NAN);
                write!(f, "{name} is frozen at {size:.6} {unit} from {from_s:.0} s on, {others} are not")?;
            }
            FaultKind::Silent => write!(f, "{name} gives no reading for {:.0} % of the time", 100.0 * size)?,
            other => write!(f, "{name} has a fault: {other}")?,
        }
        f.write_str(": left out")
    }
}

/// Displays a difference with few digits.
struct ShortNumber(f64);

impl fmt::Display for ShortNumber {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            value if value >= 100.0 => write!(f, "{value:.0}"),
            value if value >= 0.01 => write!(f, "{value:.2}"),
            value => write!(f, "{value:.2e}"),
        }
    }
}

/// Sensors that contradict each other, without a way to identify the wrong one.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Contradiction {
    /// The sensor that differs most from the others in use.
    pub name: String,
    /// The difference.
    pub fault: ElementFault,
    /// Largest distance of a sensor in use from the fused reading, in the channel's unit: it widens the declared offset.
    pub widened_by: f64,
}

/// Result of fusing the redundant sensors of a channel.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FusedChannel {
    /// The channel.
    pub channel: Channel,
    /// Number of its sensors.
    pub sensors: usize,
    /// The excluded sensors.
    pub left_out: Vec<FaultyElement>,
    /// Contradiction between the remaining ones.
    pub contradiction: Option<Contradiction>,
    /// Uncertainty of the fused reading.
    pub declared: DeclaredUncertainty,
    /// Diameter of a single probe, m, with the same lag as the sensors in use together.
    pub probe_diameter_m: f64,
}

impl FusedChannel {
    /// Whether the sensor of this number, from 1, is in use.
    pub fn uses(&self, number: usize) -> bool {
        !self.left_out.iter().any(|faulty| faulty.element.number == number)
    }
}

impl fmt::Display for FusedChannel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let unit = self.channel.unit();
        let DeclaredUncertainty { noise_sigma, offset_sigma, gain_sigma_ratio } = self.declared;
        let in_use = self.sensors - self.left_out.len().min(self.sensors);
        write!(
            f,
            "{}: {in_use} of {} sensors, together with noise {} {unit} and offset {} {unit}",
            self.channel,
            self.sensors,
            ShortNumber(noise_sigma),
            ShortNumber(offset_sigma)
        )?;
        if gain_sigma_ratio > 0.0 {
            write!(f, ", gain {:.2} %", 100.0 * gain_sigma_ratio)?;
        }
        for faulty in &self.left_out {
            write!(f, "; {faulty}")?;
        }
        if let Some(Contradiction { name, fault, widened_by }) = &self.contradiction {
            let ElementFault { kind, size, sigmas, .. } = fault;
            let what = match kind {
                FaultKind::Offset => {
                    format!(
                        "reads {size:+.2} {unit} off the others ({:.1} sigma)",
                        sigmas.unwrap_or(f64::NAN)
                    )
                }
                FaultKind::Lag => format!("follows changes {size:+.1} s after the others"),
                _ => "does not follow the others".to_owned(),
            };
            write!(
                f,
                "; {name} {what}, and the wrong one cannot be identified: all are used, and the offset covers them (+/- {} {unit})",
                ShortNumber(*widened_by)
            )?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fault_says_who_how_far_and_against_whom() {
        let faulty = |fault| {
            let element = Element { channel: Channel::T2, number: 3 };
            FaultyElement { element, name: "T2/3".to_owned(), others: 3, fault }.to_string()
        };
        let off = faulty(ElementFault { sigmas: Some(6.1), ..ElementFault::new(FaultKind::Offset, -1.52) });
        assert_eq!(off, "T2/3 reads 1.52 K below the other 3 (6.1 sigma): left out");
        let slow = faulty(ElementFault::new(FaultKind::Lag, 7.26));
        assert_eq!(slow, "T2/3 follows changes 7.3 s later than the other 3: left out");
    }
}

//! Redundant sensors of one channel below `sensors:`: identical ones by their `count`, or a list.

use crate::checking::Check;
use crate::elements::rig::calibration::Calibration;
use mapper_core::{Channel, DeclaredElement, DeclaredUncertainty, Element, MAX_ELEMENTS, RedundantSensors};
use mapper_yaml::{FindingKind, Step, steps};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A declared sensor; all uncertainties are one standard deviation, in the channel's unit (K, Pa, kg/s, rpm).
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct SensorDeclaration {
    /// Noise, offset after calibration, gain; those of the combined reading if there are several sensors.
    pub declared: DeclaredUncertainty,
    /// Whether a gain is declared, which may be 0.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub gain_is_declared: bool,
    /// Inner diameter of the pipe at a static tap, m; `None` if the total value is measured.
    pub static_tap_pipe_diameter_m: Option<f64>,
    /// Diameter of the probe's tip, m; 0 is a probe without inertia. For several sensors, that of the single probe with the same
    /// lag as the combined reading.
    pub probe_diameter_m: f64,
    /// Share by which a thermocouple on a housing reads towards the cell, one standard deviation above 0; `None` if no mounting is declared.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub contact_sigma_ratio: Option<f64>,
    /// Each of the redundant sensors; `None` if there is only one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub redundant: Option<RedundantSensors>,
    /// The calibration of each sensor as listed; one for identical sensors. Empty if none is declared.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub calibrations: Vec<Option<Calibration>>,
}

impl SensorDeclaration {
    /// Each sensor with its calibration: its index in a list, its name, and the calibration if it has one.
    pub fn calibrated(&self, channel: Channel) -> Vec<(Option<usize>, String, Option<&Calibration>)> {
        let listed = match &self.redundant {
            Some(redundant) if self.calibrations.len() > 1 => redundant.elements.as_slice(),
            _ => &[],
        };
        let calibration = |index: usize| self.calibrations.get(index).and_then(Option::as_ref);
        if listed.is_empty() {
            return vec![(None, channel.to_string(), calibration(0))];
        }
        let each = listed.iter().enumerate();
        each.map(|(index, element)| (Some(index), element.name.clone(), calibration(index))).collect()
    }
}

/// The sensors of a channel: one, several identical ones (`count`), or a list.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(untagged)]
pub(crate) enum Sensors<S> {
    /// One sensor, or `count` sensors like it.
    Alike(S),
    /// Each sensor by itself.
    Each(#[schemars(length(min = 1, max = 16))] Vec<S>),
}

/// One entry of `sensors:`.
pub(crate) trait Sensor {
    /// The properties of the sensor itself.
    fn declaration(&self) -> SensorDeclaration;

    fn shared_settings(&self) -> SharedSettings<'_>;
}

/// Settings of an entry about the redundant sensors of its channel.
pub(crate) struct SharedSettings<'a> {
    /// Number of identical sensors.
    pub count: usize,
    /// Display name.
    pub name: Option<&'a str>,
    /// Offset shared by all, in the channel's unit.
    pub common_offset: f64,
}

impl<S: Sensor> Sensors<S> {
    /// The declared properties of the channel.
    pub(crate) fn declaration(&self, channel: Channel) -> SensorDeclaration {
        let members: Vec<&S> = match self {
            Sensors::Alike(sensor) => vec![sensor; sensor.shared_settings().count],
            Sensors::Each(sensors) => sensors.iter().collect(),
        };
        let common_offset_sigma =
            members.iter().map(|sensor| sensor.shared_settings().common_offset).fold(0.0, f64::max);
        let element = |(index, sensor): (usize, &&S)| {
            let SensorDeclaration { declared, probe_diameter_m, .. } = sensor.declaration();
            let usual = || Element { channel, number: index + 1 }.to_string();
            let name = sensor.shared_settings().name.map_or_else(usual, str::to_owned);
            DeclaredElement { name, declared, probe_diameter_m }
        };
        let redundant = RedundantSensors {
            elements: members.iter().enumerate().map(element).collect(),
            common_offset_sigma,
        };
        let first = match self {
            Sensors::Alike(sensor) => sensor.declaration(),
            // The check ensures that the list is not empty.
            Sensors::Each(sensors) => match sensors.first() {
                Some(sensor) => sensor.declaration(),
                None => return SensorDeclaration::default(),
            },
        };
        let calibrations: Vec<Option<Calibration>> = match self {
            Sensors::Alike(sensor) => sensor.declaration().calibrations,
            Sensors::Each(sensors) => sensors.iter().flat_map(|one| one.declaration().calibrations).collect(),
        };
        let has_none = calibrations.iter().all(Option::is_none);
        let calibrations = if has_none { Vec::new() } else { calibrations };
        let declared = redundant.fused(|_| true);
        if members.len() < 2 {
            let offset_sigma = first.declared.offset_sigma.hypot(common_offset_sigma);
            return SensorDeclaration {
                declared: DeclaredUncertainty { offset_sigma, ..first.declared },
                calibrations,
                ..first
            };
        }
        let probe_diameter_m = redundant.probe_diameter_m(|_| true);
        SensorDeclaration { declared, probe_diameter_m, redundant: Some(redundant), calibrations, ..first }
    }
}

/// The sensors of a channel, which may have none.
pub(crate) trait DeclaredSensors {
    /// Their declared properties.
    fn declared(&self, channel: Channel) -> Option<SensorDeclaration>;
}

impl<S: Sensor> DeclaredSensors for Sensors<S> {
    fn declared(&self, channel: Channel) -> Option<SensorDeclaration> {
        Some(self.declaration(channel))
    }
}

impl<S: Sensor> DeclaredSensors for Option<Sensors<S>> {
    fn declared(&self, channel: Channel) -> Option<SensorDeclaration> {
        self.as_ref().map(|sensors| sensors.declaration(channel))
    }
}

/// The paths of a channel's sensors in the file.
pub(crate) fn sensor_places(check: &Check<'_>, symbol: &str) -> Vec<Vec<Step>> {
    let channel = steps!["sensors", symbol];
    match check.count(&channel) {
        0 => vec![channel.to_vec()],
        count => (0..count.min(MAX_ELEMENTS)).map(|index| [&channel[..], &steps![index]].concat()).collect(),
    }
}

/// Checks for contradictions between the sensors of one channel.
pub(crate) fn check_redundant_sensors(check: &mut Check<'_>, symbol: &str) {
    let places = sensor_places(check, symbol);
    let is_list = check.count(&steps!["sensors", symbol]) > 0;
    let at = |place: &[Step], key: &str| [place, &steps![key]].concat();
    let (misplaced, remedy) = if is_list {
        ("count", "a list names each sensor by itself: leave `count` out, or write one mapping with it")
    } else {
        ("name", "a name is only needed to distinguish the sensors of a list: write a list, or leave it out")
    };
    for place in &places {
        let path = at(place, misplaced);
        if check.get(&path).is_some() {
            let message = format!("`{misplaced}` has no effect here");
            check.note(FindingKind::Conflict, &path, message, remedy);
        }
    }
    // The common offset comes from one position in the flow and one calibration bath, so all sensors have the same one.
    for key in ["common_offset", "tap", "pipe_diameter"] {
        let text_of = |check: &Check<'_>, place: &[Step]| check.text(&at(place, key)).map(str::to_owned);
        let first = places.iter().find_map(|place| text_of(check, place));
        let other = places
            .iter()
            .find(|place| text_of(check, place).is_some_and(|text| Some(&text) != first.as_ref()));
        if let (Some(first), Some(other)) = (first, other) {
            let message = format!(
                "`{key}` is {first} for another sensor of {symbol}, and must be equal for all of them"
            );
            check.note(
                FindingKind::Conflict,
                &at(other, key),
                message,
                "write the same value for each of them",
            );
        }
    }
    let mut names: Vec<String> = Vec::new();
    for place in &places {
        let path = at(place, "name");
        let Some(name) = check.text(&path).map(str::to_owned) else { continue };
        if names.contains(&name) {
            let message = format!("another sensor of {symbol} is called `{name}` too");
            check.note(FindingKind::Conflict, &path, message, "give each sensor of a channel its own name");
        }
        names.push(name);
    }
}

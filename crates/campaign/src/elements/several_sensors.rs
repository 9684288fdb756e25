//! Several sensors of one channel below `sensors:`: alike by their `count`, or a list.

use super::sensors::SensorDeclaration;
use crate::checking::Check;
use mapper_core::{Channel, DeclaredElement, DeclaredUncertainty, Element, MAX_ELEMENTS, RedundantSensors};
use mapper_yaml::{FindingKind, Node, Step, steps};
use schemars::JsonSchema;
use serde::Deserialize;

/// The sensors of a channel: one, several alike (`count`), or a list.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(untagged)]
pub(crate) enum Sensors<S> {
    /// One sensor, or as many like it as `count` says.
    Alike(S),
    /// Each sensor by itself.
    Each(#[schemars(length(min = 1, max = 16))] Vec<S>),
}

/// One entry of `sensors:`.
pub(crate) trait Sensor {
    /// What is declared of it by itself.
    fn declaration(&self) -> SensorDeclaration;

    /// What it says of the other sensors of its channel.
    fn several(&self) -> Several<'_>;
}

/// What an entry says of several sensors.
pub(crate) struct Several<'a> {
    /// How many there are like it.
    pub count: usize,
    /// What it is called.
    pub name: Option<&'a str>,
    /// Offset shared by all, in the channel's unit.
    pub common_offset: f64,
}

impl<S: Sensor> Sensors<S> {
    /// What is declared of the channel.
    pub(crate) fn declaration(&self, channel: Channel) -> SensorDeclaration {
        let members: Vec<&S> = match self {
            Sensors::Alike(sensor) => vec![sensor; sensor.several().count],
            Sensors::Each(sensors) => sensors.iter().collect(),
        };
        let common_offset_sigma =
            members.iter().map(|sensor| sensor.several().common_offset).fold(0.0, f64::max);
        let element = |(index, sensor): (usize, &&S)| {
            let SensorDeclaration { declared, probe_diameter_m, .. } = sensor.declaration();
            let usual = || Element { channel, number: index + 1 }.to_string();
            let name = sensor.several().name.map_or_else(usual, str::to_owned);
            DeclaredElement { name, declared, probe_diameter_m }
        };
        let redundant = RedundantSensors {
            elements: members.iter().enumerate().map(element).collect(),
            common_offset_sigma,
        };
        let first = match self {
            Sensors::Alike(sensor) => sensor.declaration(),
            // The list is checked to have one at least.
            Sensors::Each(sensors) => match sensors.first() {
                Some(sensor) => sensor.declaration(),
                None => return SensorDeclaration::default(),
            },
        };
        let declared = redundant.fused(|_| true);
        if members.len() < 2 {
            let offset_sigma = first.declared.offset_sigma.hypot(common_offset_sigma);
            return SensorDeclaration {
                declared: DeclaredUncertainty { offset_sigma, ..first.declared },
                ..first
            };
        }
        let probe_diameter_m = redundant.probe_diameter_m(|_| true);
        SensorDeclaration { declared, probe_diameter_m, redundant: Some(redundant), ..first }
    }
}

/// The places of the sensors of a channel in the file.
pub(crate) fn each_place(check: &Check<'_>, symbol: &str) -> Vec<Vec<Step>> {
    let channel = steps!["sensors", symbol];
    match check.count(&channel) {
        0 => vec![channel.to_vec()],
        count => (0..count.min(MAX_ELEMENTS)).map(|index| [&channel[..], &steps![index]].concat()).collect(),
    }
}

/// What the sensors of one channel may not say of each other.
pub(crate) fn check_several(check: &mut Check<'_>, symbol: &str) {
    let places = each_place(check, symbol);
    let is_list = check.count(&steps!["sensors", symbol]) > 0;
    let at = |place: &[Step], key: &str| [place, &steps![key]].concat();
    let (misplaced, remedy) = if is_list {
        ("count", "a list names each sensor by itself: leave `count` out, or write one mapping with it")
    } else {
        ("name", "a name tells the sensors of a list apart: write a list, or leave it out")
    };
    for place in &places {
        let path = at(place, misplaced);
        if check.get(&path).is_some() {
            let message = format!("`{misplaced}` says nothing here");
            check.note(FindingKind::Conflict, &path, message, remedy);
        }
    }
    // One place in the flow and one calibration bath have one value each.
    for key in ["common_offset", "tap", "pipe_diameter"] {
        let said = |check: &Check<'_>, place: &[Step]| {
            check.get(&at(place, key)).and_then(Node::text).map(str::to_owned)
        };
        let first = places.iter().find_map(|place| said(check, place));
        let other =
            places.iter().find(|place| said(check, place).is_some_and(|text| Some(&text) != first.as_ref()));
        if let (Some(first), Some(other)) = (first, other) {
            let message =
                format!("`{key}` is {first} for another sensor of {symbol}, and holds for all of them");
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::elements::sensors::ProbeSensor;

    fn declared(text: &str) -> SensorDeclaration {
        crate::testing::any::<Sensors<ProbeSensor>>(text).unwrap().declaration(Channel::T2)
    }

    #[test]
    fn a_count_and_a_list_of_equal_sensors_are_the_same_and_one_is_none_of_several() {
        let one = "{noise: 0.1 K, offset: 0.24 K, probe_diameter: 1 mm}";
        let alike = declared("{noise: 0.1 K, offset: 0.24 K, probe_diameter: 1 mm, count: 4}");
        assert_eq!(alike, declared(&format!("[{one}, {one}, {one}, {one}]")));
        // A fourth of the variance each.
        assert!((alike.declared.noise_sigma - 0.05).abs() < 1e-12);
        assert!((alike.declared.offset_sigma - 0.12).abs() < 1e-12);
        assert!((alike.probe_diameter_m - 1e-3).abs() < 1e-12);
        let names: Vec<String> = alike.redundant.unwrap().elements.into_iter().map(|e| e.name).collect();
        assert_eq!(names, ["T2/1", "T2/2", "T2/3", "T2/4"]);
        let single = declared(one);
        assert_eq!((single.redundant.clone(), single.declared.offset_sigma), (None, 0.24));
        assert_eq!(single, declared(&format!("[{one}]")));
    }

    #[test]
    fn a_common_offset_does_not_average_out() {
        let four = declared("{noise: 0.1 K, offset: 0.24 K, common_offset: 0.16 K, count: 4}");
        // 0.12 and 0.16 in quadrature; for a single sensor 0.24 and 0.07.
        assert!((four.declared.offset_sigma - 0.2).abs() < 1e-12);
        let one = declared("{noise: 0.1 K, offset: 0.24 K, common_offset: 0.07 K}");
        assert!((one.declared.offset_sigma - 0.25).abs() < 1e-12);
        let named = declared("[{noise: 0.1 K, name: TC_21}, {noise: 0.1 K, common_offset: 0.16 K}]");
        let redundant = named.redundant.unwrap();
        assert_eq!(redundant.elements[0].name, "TC_21");
        assert!((redundant.common_offset_sigma - 0.16).abs() < 1e-12);
    }
}

//! Puts measured motions of actuators into the text of a campaign: values change in place, and everything else, comments included, stays.

use mapper_yaml::{Source, Step, Tree, steps};
use std::path::Path;

/// A value to declare: its keys below `rig.actuators`, and its text.
pub type ActuatorValue<'a> = (&'a str, &'a str, String);

/// The values as lines of a campaign without any.
pub fn actuator_lines(values: &[ActuatorValue<'_>]) -> String {
    let mut lines = "rig:\n  actuators:\n".to_owned();
    for actuator in actuators(values) {
        lines += &format!("    {actuator}: {}\n", mapping(values, actuator));
    }
    lines
}

/// The text with these values. `None` if its form does not allow them to be put in place; the caller checks the result.
pub fn with_actuators(text: &str, origin: &Path, values: &[ActuatorValue<'_>]) -> Option<String> {
    let mut text = text.to_owned();
    let root = steps!["rig", "actuators"];
    let tree = tree(&text, origin)?;
    match tree.get(&root) {
        None if tree.get(&steps!["rig"]).is_some() => return None,
        None => {
            let limits = tree.keys(&[]).find(|key| *key == "limits").map(str::to_owned)?;
            let at = key_place(&tree, &[], &limits)?;
            text.insert_str(at, &format!("{}\n", actuator_lines(values)));
            return Some(text);
        }
        Some(value) if value.is_string() => {
            // A kind of stand stays the source of what was not measured.
            let place = tree.place(&root);
            let settings = actuators(values).map(|name| format!("{name}: {}", mapping(values, name)));
            let settings = settings.collect::<Vec<_>>().join(", ");
            let kind = text.get(place.clone())?.to_owned();
            text.replace_range(place, &format!("{{like: {kind}, {settings}}}"));
            return Some(text);
        }
        Some(_) => {}
    }
    for (actuator, key, value) in values {
        let tree = self::tree(&text, origin)?;
        let parent = steps!["rig", "actuators", *actuator];
        if tree.get(&steps!["rig", "actuators", *actuator, *key]).is_some() {
            text.replace_range(tree.place(&steps!["rig", "actuators", *actuator, *key]), value);
        } else if tree.get(&parent).is_some() {
            insert(&mut text, &tree, &parent, &format!("{key}: {value}"))?;
        } else {
            insert(&mut text, &tree, &root, &format!("{actuator}: {{{key}: {value}}}"))?;
        }
    }
    Some(text)
}

fn tree(text: &str, origin: &Path) -> Option<Tree> {
    let source = Source::new(&crate::load::DOCUMENT, origin, text);
    Some(mapper_yaml::read(source).ok()?.0)
}

/// The actuators in order, each once.
fn actuators<'a>(values: &'a [ActuatorValue<'a>]) -> impl Iterator<Item = &'a str> {
    let is_first = |index: &usize| *index == 0 || values[index - 1].0 != values[*index].0;
    (0..values.len()).filter(is_first).map(|index| values[index].0)
}

fn mapping(values: &[ActuatorValue<'_>], actuator: &str) -> String {
    let own = values.iter().filter(|(of, ..)| *of == actuator);
    let pairs: Vec<String> = own.map(|(_, key, value)| format!("{key}: {value}")).collect();
    format!("{{{}}}", pairs.join(", "))
}

/// Where the key of a child begins in the text.
fn key_place(tree: &Tree, parent: &[Step], key: &str) -> Option<usize> {
    let value = tree.place(&[parent, &[Step::from(key)]].concat());
    let text = tree.source().text();
    // The place of a mapping is its key, that of a scalar its value.
    match text.get(value.clone())? == key {
        true => Some(value.start),
        false => text.get(..value.start)?.rfind(&format!("{key}:")),
    }
}

/// Inserts an entry before the first of a mapping, in its own style.
fn insert(text: &mut String, tree: &Tree, parent: &[Step], entry: &str) -> Option<()> {
    let first = tree.keys(parent).next()?.to_owned();
    let at = key_place(tree, parent, &first)?;
    let line = text.get(..at)?.rsplit('\n').next()?;
    let is_block = line.chars().all(char::is_whitespace);
    let separator = if is_block { format!("\n{line}") } else { ", ".to_owned() };
    text.insert_str(at, &format!("{entry}{separator}"));
    Some(())
}

#[cfg(test)]
mod tests {
    use super::*;

    const VALUES: [(&str, &str, &str); 3] = [
        ("turbine_inlet_pressure", "lag", "2.9 s"),
        ("turbine_inlet_pressure", "rate", "20 kPa/s"),
        ("valve", "play", "2 %"),
    ];

    /// Whatever the form, the values are there, and every other line and comment stays.
    #[test]
    fn values_arrive_in_every_form_and_comments_stay() {
        for before in [
            "",
            "rig: {actuators: screw_compressor}    # ours\n",
            "rig:\n  actuators: {turbine_inlet_pressure: {lag: 1 s}}    # ours\n",
            "rig:\n  actuators:\n    # ours\n    turbine_inlet_pressure:\n      lag: 1 s    # a guess\n      dead_time: 0.5 s\n",
            "rig:\n  actuators:\n    like: blow_down    # ours\n    valve: {lag: 1 s, play: 1 %}\n",
        ] {
            let text = format!("name: a\n{before}limits:    # of the cell\n  speed: 180 krpm\n");
            let values = VALUES.map(|(actuator, key, value)| (actuator, key, value.to_owned()));
            let after = with_actuators(&text, Path::new("a.yaml"), &values).unwrap();
            let tree = tree(&after, Path::new("a.yaml")).unwrap();
            for (actuator, key, value) in VALUES {
                let found = tree.text(&steps!["rig", "actuators", actuator, key]);
                assert_eq!(found, Some(value), "{after}");
            }
            assert_eq!(tree.text(&steps!["limits", "speed"]), Some("180 krpm"), "{after}");
            let comments = |text: &str| text.matches('#').count();
            assert_eq!(comments(&after), comments(&text), "{after}");
        }
    }
}

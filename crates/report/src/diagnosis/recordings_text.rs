//! Several recordings of one rig compared: causes that persist, appear and disappear.

use crate::formatting::number::four_figures;
use mapper_core::with_unit;
use mapper_diagnose::gap::{Over, Persistence, Value};

/// The page: each recording's headline, then each cause over all of them.
pub fn recordings_text(headlines: &[(String, String)], over: &[Over]) -> String {
    let mut text = String::new();
    for (number, (path, headline)) in headlines.iter().enumerate() {
        text += &format!("{}  {path}\n     {headline}\n", number + 1);
    }
    if over.is_empty() {
        return text + "\nno cause to compare: none is named, or the recordings have other channels\n";
    }
    text += "\ncauses over the recordings\n";
    for cause in over {
        let persistence = match cause.persistence {
            Persistence::Persists => "persists",
            Persistence::Changes => "is in every recording, and changes",
            Persistence::Appeared => "appeared",
            Persistence::Disappeared => "disappeared",
            Persistence::ComesAndGoes => "comes and goes",
        };
        text += &format!("  {} ({}) {persistence}: {}\n", cause.name, cause.effect, cause.size);
        for (number, (value, present)) in cause.each.iter().zip(&cause.present).enumerate() {
            let absent = if *present { "" } else { ", indistinguishable from zero" };
            text += &format!("    {:8} {}{absent}\n", number + 1, interval(value, &cause.unit));
        }
        text += &format!("    together {}\n", interval(&cause.together, &cause.unit));
    }
    text
}

fn interval(value: &Value, unit: &str) -> String {
    format!(
        "{} ({} .. {})",
        with_unit(four_figures(value.value), unit),
        four_figures(value.low),
        four_figures(value.high)
    )
}

//! The reference of a campaign's keys, from its JSON schema.

use mapper_campaign::json_schema;
use mapper_report::{Table, markdown_table, markdown_text};
use serde_json::{Map, Value};

const HEAD: &str = "\
# Campaign

<!-- Generated from the schema by `cargo xtask docs`; do not edit. -->

Every key of a campaign file. Values have units: `52 mm`, `110 krpm`, `0.5 %`. Pressures are absolute. An unknown key is an
error. `mapper schema` prints the schema itself, with which an editor completes and checks while you type. `mapper check FILE`
reports all mistakes at once.
";

/// The page, Markdown.
pub fn campaign_page() -> String {
    let schema = json_schema();
    let mut text = HEAD.to_owned();
    for (key, value) in properties(&schema) {
        let needed = if required(&schema, key) { " Required." } else { "" };
        text.push_str(&format!("\n## `{key}`\n\n{}{needed}\n", markdown_text(description(value))));
        let mut rows = Vec::new();
        below("", value, &mut rows);
        if rows.is_empty() {
            let values = values(value);
            if !values.is_empty() {
                text.push_str(&format!("\n{values}\n"));
            }
        } else {
            let table = Table::new(["key", "value", "meaning"]).all_texts().rows(rows);
            text.push_str(&format!("\n{}", markdown_table(&table)));
        }
    }
    text
}

/// A row for each key below this one; keys that several forms share appear once.
fn below(path: &str, schema: &Value, rows: &mut Vec<[String; 3]>) {
    for form in forms(schema) {
        for (key, value) in properties(form) {
            let path = joined(path, key);
            let name = format!("`{path}`");
            if rows.iter().any(|[known, ..]| *known == name) {
                continue;
            }
            let needed = if required(form, key) { " Required." } else { "" };
            rows.push([name, values(value), format!("{}{needed}", description(value))]);
            below(&path, value, rows);
        }
        if let Some(items) = form.get("items") {
            below(&format!("{path}[]"), items, rows);
        }
        if let Some(items) = form.get("additionalProperties").filter(|items| items.is_object()) {
            below(&joined(path, "NAME"), items, rows);
        }
    }
}

/// A key below another, without the key of the section itself.
fn joined(path: &str, key: &str) -> String {
    if path.is_empty() { key.to_owned() } else { format!("{path}.{key}") }
}

/// The schema, and each of its alternatives.
fn forms(schema: &Value) -> Vec<&Value> {
    let alternatives = ["anyOf", "oneOf", "allOf"].iter().filter_map(|key| schema.get(*key)?.as_array());
    let mut all = vec![schema];
    for form in alternatives.flatten() {
        all.extend(forms(form));
    }
    all
}

fn properties(schema: &Value) -> impl Iterator<Item = (&String, &Value)> {
    schema.get("properties").and_then(Value::as_object).into_iter().flat_map(Map::iter)
}

fn required(schema: &Value, key: &str) -> bool {
    let names = schema.get("required").and_then(Value::as_array);
    names.is_some_and(|names| names.iter().any(|name| name == key))
}

/// The first description of the schema or of its forms.
fn description(schema: &Value) -> &str {
    let texts = forms(schema).into_iter().filter_map(|form| form.get("description")?.as_str());
    texts.into_iter().next().unwrap_or_default()
}

/// Kind of the value with its range, allowed names, and an example.
fn values(schema: &Value) -> String {
    let mut parts: Vec<String> = Vec::new();
    for form in forms(schema) {
        let part = value(form);
        if !part.is_empty() && !parts.contains(&part) {
            parts.push(part);
        }
    }
    let mut text = parts.join("; or ");
    if let Some(example) = forms(schema).into_iter().find_map(|form| form.get("examples")?.get(0)) {
        let shown = example.as_str().map_or_else(|| example.to_string(), str::to_owned);
        text.push_str(&format!("{}e.g. `{shown}`", if text.is_empty() { "" } else { "; " }));
    }
    text
}

fn value(form: &Value) -> String {
    let text = |key: &str| {
        form.get(key).map(|value| value.as_str().map_or_else(|| value.to_string(), str::to_owned))
    };
    let names = |names: &Value| {
        let names = names.as_array().into_iter().flatten();
        names
            .map(|name| format!("`{}`", name.as_str().map_or_else(|| name.to_string(), str::to_owned)))
            .collect::<Vec<_>>()
    };
    if let Some(constant) = text("const") {
        return format!("`{constant}`");
    }
    if let Some(allowed) = form.get("enum") {
        return names(allowed).join(", ");
    }
    let kind = match (text("x-quantity"), text("type")) {
        (Some(kind), _) => kind.replace('_', " "),
        (None, Some(kind)) => match kind.as_str() {
            "number" => "number",
            "integer" => "whole number",
            "boolean" => "`true`, `false`",
            _ => return String::new(),
        }
        .to_owned(),
        (None, None) => return String::new(),
    };
    let bounds = [
        ("x-above", "above"),
        ("x-min", "at least"),
        ("x-max", "at most"),
        ("exclusiveMinimum", "above"),
        ("minimum", "at least"),
        ("maximum", "at most"),
    ];
    let bounds = bounds.iter().filter_map(|(key, word)| Some(format!(", {word} {}", text(key)?)));
    kind + bounds.collect::<String>().as_str()
}

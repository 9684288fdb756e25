//! Common parts of the JSON schemas of shared types.

use schemars::Schema;
use serde_json::{Value, json};

/// Turns the schema of an enum of unit variants into one list of names. `schemars` makes a list of alternatives if each variant has a doc comment;
/// messages could then not list the names together.
pub(crate) fn flatten_to_names(schema: &mut Schema) {
    let Some(Value::Array(variants)) = schema.get("oneOf") else { return };
    let names: Option<Vec<Value>> = variants
        .iter()
        .map(|variant| variant.get("const").or_else(|| variant.get("enum")?.get(0)).cloned())
        .collect();
    if let Some(names) = names {
        schema.remove("oneOf");
        schema.insert("type".to_owned(), json!("string"));
        schema.insert("enum".to_owned(), Value::Array(names));
    }
}

//! Common parts of the JSON schemas of shared types.

use schemars::Schema;
use serde_json::{Value, json};

/// An enum of unit variants as one list of names. With a doc comment on each variant, `schemars` makes a list of
/// alternatives instead, and messages would have to report them one by one.
pub(crate) fn names_alone(schema: &mut Schema) {
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

//! Recognises a file of another kind, which is one mistake instead of one for each key.

use crate::document::path::Step;
use crate::document::tree::Tree;
use crate::mistakes::finding::{Finding, FindingKind};
use serde_json::Value;

/// Kinds of files: the key that only they have, what they are, and the command that reads them.
const KINDS: [(&str, &str, &str); 4] = [
    ("campaign", "a campaign", "use `mapper check FILE` or `mapper run FILE`"),
    ("nightly", "a list of nightly runs", "use `mapper nightly FILE`"),
    ("fleet", "a study of a fleet", "use `mapper fleet make FILE --out DIR`"),
    ("channels", "a channel map", "use it as `mapper identify RECORDING --channels FILE`"),
];

impl Tree {
    /// Finding about a file that is not of its kind: it has the key of another kind instead of its `own`, or none of the `known` keys.
    pub fn find_other_kind(&self, own: &str, known: &[&str]) -> Option<Finding> {
        let has = |key: &str| self.value().get(key).is_some();
        let keys = self.value().as_object().map_or(0, |keys| keys.len());
        // A study has the key `campaign` too, but few others of a campaign.
        if has(own) && 2 * known.iter().filter(|key| has(key)).count() >= keys {
            return None;
        }
        let name = self.source().document.name;
        let is_other = |key: &str| has(key) && !known.contains(&key) && !(key == "campaign" && has(own));
        if let Some((key, kind, remedy)) = KINDS.iter().find(|(key, ..)| is_other(key)) {
            let message = format!("this is {kind}, not a {name}");
            return Some(self.finding(FindingKind::WrongValue, &[Step::from(*key)], message, *remedy));
        }
        let is_foreign = match self.value() {
            Value::Null => false,
            Value::Object(keys) => !keys.is_empty() && !keys.keys().any(|key| known.contains(&key.as_str())),
            _ => true,
        };
        is_foreign.then(|| {
            let remedy = format!(
                "`{}` is one; `mapper map inspect` shows maps, `mapper log inspect` logs",
                self.source().document.example
            );
            self.finding(
                FindingKind::WrongType,
                &[],
                format!("this is not a {name}: no key of one is in it"),
                remedy,
            )
        })
    }
}

//! Sentences of typed warnings, remarks and findings in JSON.
//!
//! A warning is a variant with values; another crate knows its sentence. While [`with_sentences`] runs, each value behind [`JsonMessages`] or
//! [`serialize`] is written with its sentence as `message`; otherwise with its values alone.

use serde::{Serialize, Serializer};
use std::any::Any;
use std::cell::Cell;

/// The sentence of a typed message; `None` for a value of another type.
pub type Sentences = fn(&dyn Any) -> Option<String>;

thread_local! {
    static SENTENCES: Cell<Option<Sentences>> = const { Cell::new(None) };
}

/// Restores the sentences of the surrounding work, after a panic too.
struct Restored(Option<Sentences>);

impl Drop for Restored {
    fn drop(&mut self) {
        SENTENCES.set(self.0);
    }
}

/// Runs `work`; JSON that it makes on this thread has the sentences.
pub fn with_sentences<R>(sentences: Sentences, work: impl FnOnce() -> R) -> R {
    let _restored = Restored(SENTENCES.replace(Some(sentences)));
    work()
}

/// Messages with their sentences.
#[derive(Debug, Clone, Copy)]
pub struct JsonMessages<'a, T>(pub &'a [T]);

#[derive(Serialize)]
struct WithMessage<'a, T> {
    #[serde(flatten)]
    value: &'a T,
    #[serde(skip_serializing_if = "Option::is_none")]
    message: Option<String>,
}

impl<T: Serialize + 'static> Serialize for JsonMessages<'_, T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let Some(sentences) = SENTENCES.get() else { return self.0.serialize(serializer) };
        serializer.collect_seq(self.0.iter().map(|value| WithMessage { value, message: sentences(value) }))
    }
}

/// For `#[serde(serialize_with = ...)]` of a list of messages.
pub fn serialize<T: Serialize + 'static, S: Serializer>(all: &[T], serializer: S) -> Result<S::Ok, S::Error> {
    JsonMessages(all).serialize(serializer)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Warning;
    use serde_json::json;

    #[test]
    fn a_value_keeps_its_fields_and_gains_its_sentence_only_inside() {
        let lost =
            || json!(JsonMessages(&[Warning::LostSamples { lost: 3, samples: 90 }, Warning::Apparent]));
        let sentence =
            |value: &dyn Any| value.downcast_ref::<Warning>().map(|warning| warning.code().to_uppercase());
        let plain = json!([{"code": "lost_samples", "lost": 3, "samples": 90}, {"code": "apparent"}]);
        assert_eq!(lost(), plain);
        let mut told = plain.clone();
        told[0]["message"] = "LOST_SAMPLES".into();
        told[1]["message"] = "APPARENT".into();
        assert_eq!(with_sentences(sentence, lost), told);
        assert_eq!(lost(), plain);
    }
}
